/* Launches of the stages, and the memory of a device (device.h). */
#include "mpm/device.h"

#include <math.h>
#include <string.h>

#include "core/memory.h"

const char *gr_device_lacks(const struct gr_config *config)
{
    for (int k = 0; k < config->n_materials; k++)
        if (config->material[k].function) return "laws of the user";
    return NULL;
}

int gr_device_new(struct gr_device **device, const struct gr_backend *backend, gr_thread *const *threads)
{
    *device = gr_calloc(1, sizeof **device);
    if (!*device) return GR_ERR_MEMORY;
    (*device)->backend = backend;
    (*device)->threads = threads;
    return GR_OK;
}

void gr_device_free(struct gr_device *device)
{
    if (!device) return;
    void *const owned[] = {device->leaving,     device->leaves,      device->place[0], device->place[1], device->place[2],
                           device->of_group,    device->of_groups,   device->arrivals, device->next,     device->fastest,
                           device->products[0], device->products[1], device->exact};
    for (size_t k = 0; k < sizeof owned / sizeof *owned; k++) gr_free(owned[k]);
    gr_free(device);
}

static int reserve_cells(struct gr_device *d, int64_t n)
{
    if (n <= d->n_cells) return GR_OK;
    const int64_t cells = n + n / 2, groups = gr_groups_of(cells), all = gr_groups_of(groups);
    d->n_cells = 0;
    GR_RESIZE(d->leaving, cells);
    GR_RESIZE(d->arrivals, cells);
    GR_RESIZE(d->place[0], cells);
    GR_RESIZE(d->place[1], groups);
    GR_RESIZE(d->place[2], all);
    GR_RESIZE(d->of_group, groups);
    GR_RESIZE(d->of_groups, all);
    GR_RESIZE(d->fastest, groups);
    memset(d->arrivals, 0, (size_t)cells * sizeof *d->arrivals); /* a step leaves them so */
    d->n_cells = cells;
    return GR_OK;
}

int gr_device_reserve(struct gr_engine *e)
{
    struct gr_device *d = e->device;
    if (reserve_cells(d, gr_lanes_of(e)) || gr_device_reserve_fluidity(e)) return GR_ERR_MEMORY;
    if (e->migration.pending_capacity <= d->n_points) return GR_OK;
    d->n_points = 0;
    GR_RESIZE(d->leaves, e->migration.pending_capacity);
    GR_RESIZE(d->next, e->migration.pending_capacity);
    memset(d->leaves, 0, (size_t)e->migration.pending_capacity);
    d->n_points = e->migration.pending_capacity;
    return GR_OK;
}

void gr_device_begin(struct gr_engine *e, struct gr_team *team)
{
    e->device->team = team;
    e->device->makes_steps = 1;
    e->device->backend->begin(e->device);
}

void gr_device_end(struct gr_engine *e)
{
    e->device->team = NULL;
    e->device->makes_steps = 0;
}

int gr_device_wait(struct gr_engine *e)
{
    struct gr_device *d = e->device;
    if (!d) return GR_OK;
    d->backend->wait(d);
    if (!*d->failure) return GR_OK;
    e->failure.code = GR_ERR_DEVICE;
    e->failure.id = -1;
    e->failure.step = e->clock.step;
    return GR_ERR_DEVICE;
}

/* ---- Passes ---- */

/* A pass by a team. */
struct shared_pass {
    gr_pass *pass;
    const struct gr_launch *launch;
};

static void do_chunk(void *context, int64_t chunk, int t)
{
    const struct shared_pass *shared = context;
    const struct gr_launch *launch = shared->launch;
    int64_t first, last;
    (void)t;
    gr_share(launch->items, chunk, launch->chunks, &first, &last);
    shared->pass(launch->e, launch->work, first, last, chunk);
}

void gr_make_pass(struct gr_team *team, enum gr_device_stage stage, gr_pass *pass, const struct gr_launch *launch)
{
    struct shared_pass shared = {pass, launch};
    if (launch->e->device)
        gr_device_run(launch, stage, launch->chunks);
    else
        gr_team_run(team, do_chunk, &shared, launch->chunks);
}

/* ---- Sums over cells ---- */

int gr_device_tally(struct gr_engine *e)
{
    const struct gr_launch launch = {.e = e};
    gr_device_run(&launch, GR_STAGE_tally, gr_lanes_of(e));
    return gr_device_wait(e);
}

double gr_device_fastest(const struct gr_engine *e)
{
    const struct gr_launch launch = {.e = (struct gr_engine *)e}; /* its threads only read it */
    const int64_t groups = gr_groups_of(gr_lanes_of(e));
    double square = 0;
    gr_device_run(&launch, GR_STAGE_fastest, groups);
    if (gr_device_wait(launch.e)) return 0;
    for (int64_t g = 0; g < groups; g++) square = fmax(square, e->device->fastest[g]);
    return square;
}

int64_t gr_device_occupied(const struct gr_engine *e)
{
    const struct gr_launch launch = {.e = (struct gr_engine *)e};
    const int64_t groups = gr_groups_of(gr_lanes_of(e));
    int64_t occupied = 0;
    gr_device_run(&launch, GR_STAGE_occupied, groups);
    if (gr_device_wait(launch.e)) return e->mesh.n_cells;
    for (int64_t g = 0; g < groups; g++) occupied += e->device->of_group[g];
    return occupied;
}
