/* The stages of a time step (stages.h). */
#include "engine/stages.h"

#include <math.h>

#include "contact/contact.h"
#include "mpm/device.h"
#include "mpm/fluidity_bodies.h"
#include "mpm/ghosts.h"
#include "mpm/grid.h"
#include "mpm/numbers.h"
#include "mpm/sleep.h"
#include "mpm/smoothed_density.h"
#include "mpm/thin_bodies.h"
#include "mpm/wall_impulse.h"

/* The end of groups of GR_LANES nodes, of which the last may be incomplete. */
static int64_t end_of_groups(const struct gr_engine *e, int64_t last_group)
{
    return last_group * GR_LANES < e->mesh.n_nodes ? last_group * GR_LANES : e->mesh.n_nodes;
}

/* The grid stage for groups of GR_LANES nodes. */
static void grid_nodes(struct gr_run *run, int64_t first_group, int64_t last_group)
{
    const int64_t first = first_group * GR_LANES, last = end_of_groups(run->e, last_group);
    if (run->e->bodies.n_thin) gr_split_nodes(run->e, first, last);
    gr_grid_nodes(run->e, run->kernels, first, last, run->gravity);
}

static void forces_of_cells(struct gr_run *run, int64_t first, int64_t last)
{
    if (!run->e->sleep || !run->e->sleep->asleep) {
        run->kernels->apply_cell_forces(run->e, first, last);
        return;
    }
    for (int64_t tile = first; tile < last; tile++)
        if (!gr_tile_rests(run->e, tile)) run->kernels->apply_cell_forces(run->e, tile, tile + 1);
}

static void p2g_listed(struct gr_run *run, int64_t first, int64_t last)
{
    for (int64_t k = first; k < last; k++) {
        const int64_t tile = run->e->sums.dirty[k];
        run->kernels->p2g(run->e, tile, tile + 1);
    }
}

/* ---- Chunks of the stages, for a team ---- */

/* Define chunk(): call a kernel for the tiles of a chunk. */
#define GR_CHUNK_OF_TILES(chunk, ...)                                                        \
    static void chunk(void *context, int64_t c, int t)                                       \
    {                                                                                        \
        struct gr_run *run = context;                                                        \
        const int64_t first = run->e->migration.cut[c], last = run->e->migration.cut[c + 1]; \
        (void)t, __VA_ARGS__;                                                                \
    }

GR_CHUNK_OF_TILES(p2g, run->kernels->p2g(run->e, first, last))
GR_CHUNK_OF_TILES(cell_forces, forces_of_cells(run, first, last))
GR_CHUNK_OF_TILES(fillings, run->kernels->fill_cells(run->e, first, last))
GR_CHUNK_OF_TILES(smooth, run->kernels->smooth(run->e, first, last))
GR_CHUNK_OF_TILES(mark, gr_bodies_mark(run->e, first *GR_LANES, last *GR_LANES))
GR_CHUNK_OF_TILES(begin_substeps, run->kernels->begin_substeps(run->e, first, last))
GR_CHUNK_OF_TILES(substep, run->kernels->substep(run->e, first, last))
GR_CHUNK_OF_TILES(sweep, run->kernels->sweep(run->e, first, last, &run->e->migration.leaving[c], 1))

/* Define chunk(): the same for chunks of n nodes or other items. */
#define GR_CHUNK_OF(n, chunk, ...)                              \
    static void chunk(void *context, int64_t c, int t)          \
    {                                                           \
        struct gr_run *run = context;                           \
        int64_t first, last;                                    \
        gr_share(n, c, gr_chunks(run->team, n), &first, &last); \
        (void)t, __VA_ARGS__;                                   \
    }

GR_CHUNK_OF(run->e->sums.n_dirty, p2g_dirty, p2g_listed(run, first, last))
GR_CHUNK_OF(run->e->mesh.n_paired, mean_pairs, run->kernels->mean_pairs(run->e, first, last))
GR_CHUNK_OF(run->e->mesh.n_paired, store_pairs, run->kernels->store_pairs(run->e, first, last))

/* Define chunk(): the same for chunks of nodes, in whole groups. */
#define GR_CHUNK_OF_NODES(chunk, ...)                                                           \
    static void chunk(void *context, int64_t c, int t)                                          \
    {                                                                                           \
        struct gr_run *run = context;                                                           \
        int64_t first, last;                                                                    \
        gr_share(gr_groups(run->e), c, gr_chunks(run->team, gr_groups(run->e)), &first, &last); \
        first *= GR_LANES, last = end_of_groups(run->e, last);                                  \
        (void)t, __VA_ARGS__;                                                                   \
    }

GR_CHUNK_OF_NODES(masses, gr_grid_masses(run->e, run->kernels, first, last))
GR_CHUNK_OF_NODES(surroundings, gr_grid_surroundings(run->e, run->kernels, first, last))
GR_CHUNK_OF_NODES(smooth_nodes, gr_grid_smooth(run->e, run->kernels, first, last, run->pass))
GR_CHUNK_OF_NODES(narrow, run->kernels->narrow_nodes(run->e, first, last))
GR_CHUNK_OF_NODES(nodes, grid_nodes(run, first, last))

/* ---- Stages, of a team or a device ---- */

static void tiles_of_team(struct gr_run *run, gr_chunk_work *chunk) { gr_team_run(run->team, chunk, run, run->n_chunks); }

static void all_of(struct gr_run *run, gr_chunk_work *chunk, int64_t n)
{
    gr_team_run(run->team, chunk, run, gr_chunks(run->team, n));
}

static struct gr_launch launch_of(const struct gr_run *run)
{
    struct gr_launch launch = {.e = run->e, .pass = run->pass};
    for (int d = 0; d < 3; d++) launch.gravity[d] = run->gravity[d];
    return launch;
}

static void launch(const struct gr_run *run, enum gr_device_stage stage, int64_t n)
{
    const struct gr_launch launch = launch_of(run);
    gr_device_run(&launch, stage, n);
}

static void all_tiles(struct gr_run *run, gr_chunk_work *chunk, enum gr_device_stage stage)
{
    if (run->e->device)
        launch(run, stage, run->e->mesh.n_tiles * GR_LANES);
    else
        tiles_of_team(run, chunk);
}

static void all_nodes(struct gr_run *run, gr_chunk_work *chunk, enum gr_device_stage stage)
{
    if (run->e->device)
        launch(run, stage, run->e->mesh.n_nodes);
    else
        all_of(run, chunk, gr_groups(run->e));
}

static void all_pairs(struct gr_run *run, gr_chunk_work *chunk, enum gr_device_stage stage)
{
    if (run->e->device)
        launch(run, stage, run->e->mesh.n_paired);
    else
        all_of(run, chunk, run->e->mesh.n_paired);
}

/* Wait for the threads of a device, so that the processor may look at what they have made; an error is in the engine. */
static void finish(struct gr_run *run)
{
    if (run->e->device) (void)gr_device_wait(run->e);
}

/* Run a stage for all tiles, all nodes, or all double cells. */
#define GR_ALL_TILES(run, stage) all_tiles(run, stage, GR_STAGE_##stage)
#define GR_ALL_NODES(run, stage) all_nodes(run, stage, GR_STAGE_##stage)
#define GR_ALL_PAIRS(run, stage) all_pairs(run, stage, GR_STAGE_##stage)

/* Receive the sums of ghost cells, as far as the nodes of this stage need them. */
static void receive(struct gr_run *run, unsigned parts)
{
    if (run->e->ranks && !run->e->failure.code) run->e->failure.code = gr_ghosts_exchange(run->e, parts, run->team);
}

/* Let material and bodies touch: contact is computed by processors, as it has few points of those of a scene. */
static void touch_bodies(struct gr_run *run)
{
    struct gr_engine *e = run->e;
    if (e->device && gr_device_wait(e)) return;
    e->failure.code = gr_bodies_touch(e, run->kernels, run->gravity, run->team);
}

void gr_stage_grid(struct gr_run *run)
{
    struct gr_engine *e = run->e;
    const unsigned density = gr_averages(e, e->clock.step) ? GR_GHOST_DENSITY : 0;
    e->clock.shift_dt = e->clock.dt;
    e->shift_scale = -1.0 / e->clock.dt;
    e->clock.inv_dt = 1.0 / e->clock.dt;
    e->servo_strain = gr_servo_strain(e);
    if (run->again) gr_stage_p2g(run);
    gr_plan_sums(e, e->clock.step + 1);
    receive(run, GR_GHOST_MOMENTUM | (e->config.cell_averaged ? 0 : GR_GHOST_FORCE | density));
    if (e->config.cell_averaged) {
        GR_ALL_NODES(run, masses);
        GR_ALL_TILES(run, cell_forces);
        receive(run, GR_GHOST_FORCE | GR_GHOST_AVERAGES);
    }
    GR_ALL_NODES(run, nodes);
    if (e->config.n_bodies) touch_bodies(run);
    if (e->failure.code) {
        e->sums.valid = 0;
        return;
    }
    if (gr_averages(e, e->clock.step)) {
        GR_ALL_NODES(run, surroundings);
        GR_ALL_TILES(run, fillings);
    }
    for (run->pass = 2; run->pass <= e->config.xpic_order; run->pass++) {
        GR_ALL_TILES(run, smooth);
        receive(run, GR_GHOST_MOMENTUM);
        GR_ALL_NODES(run, smooth_nodes);
    }
    if (run->kernels->narrow_nodes) GR_ALL_NODES(run, narrow);
    finish(run);
    if (e->watch && !e->failure.code) e->failure.code = gr_sum_wall_impulses(e);
    if (e->watch && e->watch->servo.height > 0) gr_move_servo(e);
}

/* After the diffusion has failed to converge: find a point that is not finite, if there is one. */
static void name_the_point(struct gr_engine *e)
{
    e->failure.id = -1;
    e->failure.step = e->clock.step;
    for (int64_t s = 0; s < e->points.used; s++) {
        const double g = gr_number(e, GR_FIELD_g, 0, s); /* it is not stored in all substeps */
        if (e->points.id[s] < 0 || (isfinite(g) && isfinite(gr_number(e, GR_FIELD_shear_rate, 0, s)))) continue;
        e->failure.code = GR_ERR_NOT_FINITE;
        e->failure.id = e->points.id[s];
        for (int d = 0; d < e->config.dim; d++) e->failure.x[d] = gr_x(e, d)[s];
        return;
    }
}

int gr_stage_fluidity(struct gr_run *run)
{
    struct gr_engine *e = run->e;
    const struct gr_nonlocal *nonlocal = &e->config.nonlocal;
    if (!e->nonlocal.diffuses) return GR_OK;
    if (e->nonlocal.fluidity->has_inside) tiles_of_team(run, mark);
    const struct gr_diffusion_call call = {nonlocal->method, 1.0 / nonlocal->substeps * e->clock.dt, 1};
    for (int made = 0; made < nonlocal->substeps; made++) {
        if (made == 1) GR_ALL_TILES(run, begin_substeps);
        if (made > 1) GR_ALL_TILES(run, substep);
        if (made)
            GR_ALL_PAIRS(run, store_pairs);
        else
            GR_ALL_PAIRS(run, mean_pairs);
        e->failure.code = e->device ? gr_device_diffuse(e, run->passes, &call, run->team)
                                    : gr_fluidity_diffuse(e->nonlocal.fluidity, run->passes, &call, run->team, NULL);
        if (e->failure.code) {
            e->sums.valid = 0;
            if (e->failure.code != GR_ERR_DEVICE) name_the_point(e);
            break;
        }
        e->nonlocal.cg_iterations += e->nonlocal.fluidity->iterations;
        e->nonlocal.clamped_cells += e->nonlocal.fluidity->clamped;
    }
    return e->failure.code;
}

void gr_stage_p2g(struct gr_run *run)
{
    GR_ALL_TILES(run, p2g);
    finish(run);
}

void gr_stage_p2g_again(struct gr_run *run)
{
    const int64_t n = run->e->sums.n_dirty;
    if (run->e->device)
        launch(run, GR_STAGE_p2g_dirty, n * GR_LANES);
    else
        all_of(run, p2g_dirty, n);
    finish(run);
}

void gr_stage_g2p(struct gr_run *run)
{
    if (!run->e->device) {
        gr_team_run(run->team, sweep, run, run->n_chunks);
        return;
    }
    const struct gr_launch launch = launch_of(run);
    gr_device_sweep(&launch);
}
