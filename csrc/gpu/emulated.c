/* The emulated device: threads of the processor, and memory of its own. All but the machine itself can be tested with it. */
#include "core/memory.h"
#include "gpu/blocks.h"
#include "mpm/device.h"

static const struct gr_pool pool = {malloc, free};

static void *take(size_t bytes) { return gr_take_block(&pool, bytes); }
static void give(void *block) { gr_give_block(&pool, block); }

/* Threads of a launch that a team shares out. */
struct shared {
    const struct gr_launch *launch;
    gr_thread *thread;
    int64_t n;
};

static void run_threads(void *context, int64_t chunk, int t)
{
    const struct shared *work = context;
    int64_t first, last;
    (void)t;
    gr_share(work->n, chunk, gr_chunks(work->launch->e->device->team, work->n), &first, &last);
    for (int64_t i = first; i < last; i++) work->thread(work->launch, i);
}

static void begin(struct gr_device *d) { (void)d; }

static void run(const struct gr_launch *launch, enum gr_device_stage stage, int64_t n)
{
    const struct gr_device *d = launch->e->device;
    struct shared work = {launch, d->threads[stage], n};
    gr_team_run(d->team, run_threads, &work, gr_chunks(d->team, n));
}

static void wait(struct gr_device *d) { (void)d; }

const struct gr_backend gr_emulated = {.name = "emulated", .memory = {take, give}, .begin = begin, .run = run, .wait = wait};
