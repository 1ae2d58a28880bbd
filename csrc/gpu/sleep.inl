/* The threads for material that sleeps (mpm/sleep.h). */
#include "mpm/sleep.h"

static void thread_check(const struct gr_launch *launch, int64_t i)
{
    add_count(&launch->e->device->counts.cells, gr_count_checks(launch->e, i));
}

static void thread_calm(const struct gr_launch *launch, int64_t i) { launch->e->sleep->restless[i] = 0; }

static void thread_restless(const struct gr_launch *launch, int64_t i) { gr_note_restless(launch->e, i); }

/* Let a cell fall asleep. Its sums do not change after they are made once more. */
static void thread_fall(const struct gr_launch *launch, int64_t i)
{
    if (!gr_fall_asleep(launch->e, i)) return;
    add_count(&launch->e->device->counts.cells, 1);
    if (launch->e->mesh.cell[i].count) thread_p2g(launch, i);
}

static void thread_unuse(const struct gr_launch *launch, int64_t i) { launch->e->sleep->use[i] = GR_NODE_UNUSED; }

static void thread_use(const struct gr_launch *launch, int64_t i)
{
    if (!is_asleep(launch->e, i)) gr_use_nodes(launch->e, i);
}

static void thread_use_near(const struct gr_launch *launch, int64_t i)
{
    gr_use_nodes(launch->e, launch->e->bodies.near.cell[i]);
}

static void thread_watch(const struct gr_launch *launch, int64_t i) { gr_watch_nodes(launch->e, i); }

static void thread_rest(const struct gr_launch *launch, int64_t i)
{
    gr_find_resting(launch->e, i);
    add_count(&launch->e->sleep->asleep, __builtin_popcount(gr_lanes_asleep(launch->e, i)));
}

static void thread_wake(const struct gr_launch *launch, int64_t i)
{
    if (is_asleep(launch->e, i)) launch->e->mesh.cell[i].calm = 0;
}
