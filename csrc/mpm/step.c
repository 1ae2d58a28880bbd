/* The time step: P2G, grid stage, diffusion of the fluidity, G2P. A call makes many steps, by a team of threads.
 *
 * The work of each stage is divided into chunks of cells or nodes. Each result is written by one chunk, and every sum
 * has a fixed order, so that the bits do not depend on the number of threads. */
#include <math.h>
#include <stdlib.h>

#include "mpm/contact.h"
#include "mpm/feet.h"
#include "mpm/fluidity_bodies.h"
#include "mpm/moving.h"
#include "mpm/open_volume.h"
#include "core/memory.h"
#include "core/piecewise.h"
#include "core/team.h"
#include "kernels.h"
#include "mpm/grid.h"
#include "mpm/inflow.h"
#include "mpm/migrate.h"
#include "mpm/sleep.h"
#include "mpm/smoothed_density.h"
#include "mpm/tally.h"
#include "mpm/thin_bodies.h"
#include "mpm/wall_impulse.h"

enum { DT_INTERVAL = GR_SLEEP_INTERVAL }; /* steps between two updates of the largest speed */

/* A call for steps. */
struct run {
    struct gr_engine *e;
    const struct gr_kernels *kernels; /* in the precision of the scheme */
    gr_diffuse *diffuse;
    struct gr_team *team;
    int again, pass;
    int64_t left; /* steps left */
    double until, gravity[3];
    int n_chunks; /* of tiles */
};

/* The largest speed of the points, squared, by chunks of cells. */
struct fastest {
    const struct gr_engine *e;
    int64_t chunks;
    double square[GR_MAX_CHUNKS];
};

static void find_fastest(void *context, int64_t chunk, int t)
{
    struct fastest *fastest = context;
    const struct gr_engine *e = fastest->e;
    int64_t first, last;
    double largest = 0;
    (void)t;
    gr_share(e->mesh.n_cells, chunk, fastest->chunks, &first, &last);
    for (int64_t c = first; c < last; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        for (int32_t k = 0; cell->calm != GR_ASLEEP && k < cell->count; k++) { /* asleep: v = 0 */
            const double square = gr_speed_squared(e, gr_slot(cell, k));
            if (square > largest) largest = square;
        }
    }
    fastest->square[chunk] = largest;
}

double gr_stable_dt(const struct gr_engine *e, struct gr_team *team)
{
    struct fastest fastest = {.e = e, .chunks = gr_chunks(team, e->mesh.n_cells)};
    double square = 0;
    gr_team_run(team, find_fastest, &fastest, fastest.chunks);
    for (int64_t c = 0; c < fastest.chunks; c++) square = fmax(square, fastest.square[c]);
    double speed = fmax(sqrt(square), fmax(gr_bodies_speed(e), gr_inlets_speed(e->inflow)));
    for (int k = 0; k < e->config.n_walls; k++) {
        const double *wall = e->config.walls[k].velocity;
        speed = fmax(speed, sqrt(wall[0] * wall[0] + wall[1] * wall[1] + wall[2] * wall[2]));
    }
    return gr_damped_dt(&e->config, e->config.cfl * e->config.dx / (e->config.wave_speed + speed));
}

/* Reserve memory for the state of the points between substeps. */
static int reserve_substeps(struct gr_engine *e)
{
    const int64_t needed = e->capacity * GR_SUBSTEP_COUNT;
    if (!e->fluidity || e->config.nonlocal.substeps < 2 || needed <= e->substep_capacity) return GR_OK;
    free(e->substeps);
    e->substeps = malloc(sizeof(double) * (size_t)needed);
    e->substep_capacity = e->substeps ? needed : 0;
    return e->substeps ? GR_OK : GR_ERR_MEMORY;
}

static int reserve_chunks(struct gr_engine *e, int64_t n)
{
    if (n <= e->chunk_capacity) return GR_OK;
    e->chunk_capacity = 0;
    GR_RESIZE(e->cut, n + 1);
    GR_RESIZE(e->migrants, n);
    e->chunk_capacity = n;
    return GR_OK;
}

/* Give chunk k space for migrants behind that for as many `points` of other chunks. */
static void lend_space(struct gr_engine *e, int k, int64_t points)
{
    e->migrants[k] = (struct gr_migrants){
        .from = e->migrant + points, .record = e->pending + points * e->n_components, .id = e->pending_id + points};
}

/* Divide the tiles so that each chunk has about the same number of places. Give each chunk space for migrants: all its
 * points may leave their cells at once. */
static void share_tiles(struct run *run)
{
    struct gr_engine *e = run->e;
    const int64_t n_tiles = e->mesh.n_tiles;
    const int chunks = run->n_chunks;
    int64_t all = 0, places = 0;
    int k = 1;
    for (int64_t tile = 0; tile < n_tiles; tile++) all += GR_LANES * e->mesh.cell[tile * GR_LANES].capacity;
    e->cut[0] = 0;
    lend_space(e, 0, 0);
    for (int64_t tile = 0; tile < n_tiles; tile++) {
        const struct gr_cell *cell = &e->mesh.cell[tile * GR_LANES];
        places += GR_LANES * cell->capacity;
        if (cell[GR_LANES - 1].side == 1) continue; /* its back must be in the same chunk */
        for (; k < chunks && places * chunks >= all * k; k++) {
            e->cut[k] = tile + 1;
            lend_space(e, k, places);
        }
    }
    for (; k < chunks; k++) {
        e->cut[k] = n_tiles;
        lend_space(e, k, places);
    }
    e->cut[chunks] = n_tiles;
    e->tiles_grown = 0;
}

/* Prepare what depends on the mesh. */
static int share_out(struct run *run)
{
    struct gr_engine *e = run->e;
    if (e->feet) {
        e->feet->listed = 0; /* the mesh may be another */
        if (gr_feet_list(e) || (e->open && gr_open_volumes(e, 0))) return GR_ERR_MEMORY;
    }
    run->n_chunks = (int)gr_chunks(run->team, GR_MAX_CHUNKS);
    if (reserve_chunks(e, run->n_chunks)) return GR_ERR_MEMORY;
    if (e->sleep && gr_sleep_begin(e)) return GR_ERR_MEMORY;
    if (reserve_substeps(e) || gr_reserve_pending(e, e->capacity + gr_inflow_most(e))) return GR_ERR_MEMORY;
    share_tiles(run);
    return GR_OK;
}

/* The grid stage for groups of GR_LANES nodes. */
static void grid_nodes(struct run *run, int64_t first_group, int64_t last_group)
{
    const int64_t n = run->e->mesh.n_nodes, first = first_group * GR_LANES, end = last_group * GR_LANES;
    const int64_t last = end < n ? end : n;
    if (run->e->n_thin) gr_split_nodes(run->e, first, last);
    gr_grid_nodes(run->e, run->kernels, first, last, run->gravity);
}

static void forces_of_cells(struct run *run, int64_t first, int64_t last)
{
    if (!run->e->sleep || !run->e->sleep->asleep) {
        run->kernels->apply_cell_forces(run->e, first, last);
        return;
    }
    for (int64_t tile = first; tile < last; tile++)
        if (!gr_tile_rests(run->e, tile)) run->kernels->apply_cell_forces(run->e, tile, tile + 1);
}

static void p2g_listed(struct run *run, int64_t first, int64_t last)
{
    for (int64_t k = first; k < last; k++) {
        const int64_t tile = run->e->dirty[k];
        if (run->e->mesh.tile_state[tile] == GR_TILE_GAINED)
            run->kernels->p2g_arrivals(run->e, tile);
        else
            run->kernels->p2g(run->e, tile, tile + 1);
    }
}

/* ---- Chunks of the stages ---- */

/* Define chunk(): call a kernel for the tiles of a chunk. */
#define GR_CHUNK_OF_TILES(chunk, ...)                                    \
    static void chunk(void *context, int64_t c, int t)                   \
    {                                                                    \
        struct run *run = context;                                       \
        const int64_t first = run->e->cut[c], last = run->e->cut[c + 1]; \
        (void)t, __VA_ARGS__;                                            \
    }

GR_CHUNK_OF_TILES(p2g, run->kernels->p2g(run->e, first, last))
GR_CHUNK_OF_TILES(cell_forces, forces_of_cells(run, first, last))
GR_CHUNK_OF_TILES(fillings, run->kernels->fill_cells(run->e, first, last))
GR_CHUNK_OF_TILES(smooth, run->kernels->smooth(run->e, first, last))
GR_CHUNK_OF_TILES(mark, gr_bodies_mark(run->e, first *GR_LANES, last *GR_LANES))
GR_CHUNK_OF_TILES(begin_substeps, run->kernels->begin_substeps(run->e, first, last))
GR_CHUNK_OF_TILES(substep, run->kernels->substep(run->e, first, last))
GR_CHUNK_OF_TILES(sweep, run->kernels->sweep(run->e, first, last, &run->e->migrants[c], 1))

/* Define chunk(): the same for chunks of n nodes or other items. */
#define GR_CHUNK_OF(n, chunk, ...)                              \
    static void chunk(void *context, int64_t c, int t)          \
    {                                                           \
        struct run *run = context;                              \
        int64_t first, last;                                    \
        gr_share(n, c, gr_chunks(run->team, n), &first, &last); \
        (void)t, __VA_ARGS__;                                   \
    }

GR_CHUNK_OF(run->e->n_dirty, p2g_dirty, p2g_listed(run, first, last))
GR_CHUNK_OF(run->e->mesh.n_paired, mean_pairs, run->kernels->mean_pairs(run->e, first, last))
GR_CHUNK_OF(run->e->mesh.n_nodes, masses, gr_grid_masses(run->e, first, last))
GR_CHUNK_OF(gr_groups(run->e), surroundings, gr_grid_surroundings(run->e, run->kernels, first, last))
GR_CHUNK_OF(run->e->mesh.n_nodes, smooth_nodes, gr_grid_smooth(run->e, first, last, run->pass))
GR_CHUNK_OF(gr_groups(run->e), narrow, run->kernels->narrow_nodes(run->e, first, last))
GR_CHUNK_OF(gr_groups(run->e), nodes, grid_nodes(run, first, last))

static void all_tiles(struct run *run, gr_chunk_work *chunk) { gr_team_run(run->team, chunk, run, run->n_chunks); }

static void all_of(struct run *run, gr_chunk_work *chunk, int64_t n)
{
    gr_team_run(run->team, chunk, run, gr_chunks(run->team, n));
}

/* Let material that has been slow fall asleep, and sum over what is left of it. */
static void look_for_calm(struct run *run)
{
    struct gr_engine *e = run->e;
    gr_sleep_look(e, run->team);
    all_of(run, p2g_dirty, e->n_dirty);
}

/* Whether gravity or a wall is another one at the time `next` than in this step. */
static int load_changes(const struct run *run, double next)
{
    const struct gr_engine *e = run->e;
    const struct gr_config *config = &e->config;
    double then[3] = {0};
    int changes = 0;
    gr_piecewise(config->dim, config->n_gravity, config->gravity_times, 1, config->gravity_vectors, config->dim, next, then);
    for (int d = 0; d < config->dim; d++) changes |= run->gravity[d] != then[d];
    for (int k = 0; k < config->n_walls; k++)
        changes |= e->time < config->walls[k].opens_at && config->walls[k].opens_at <= next;
    return changes;
}

/* Share of the deviations within a cell that a diffusion leaves. The longest wave between smooth ends of a cell decays as
 * exp(-(pi A d/dx)^2 t/t0): where A d is far below a cell each point keeps its own fluidity, as with the local law. */
static double deviation_left(const struct gr_engine *e)
{
    const double k = 3.141592653589793 / e->config.dx;
    return exp(-k * k * e->fluidity->diffusivity * e->dt / e->config.nonlocal.substeps);
}

/* Decide whether there is another step, and set its dt and gravity.
 * Returned: whether there is one. */
static int prepare(struct run *run)
{
    struct gr_engine *e = run->e;
    const struct gr_config *config = &e->config;
    if (!(run->left > 0 && e->time < run->until)) return 0;
    run->left--;
    if (e->sleep && e->step % GR_SLEEP_INTERVAL == 0) look_for_calm(run);
    const double dt = config->dt > 0                               ? config->dt
                      : e->step % DT_INTERVAL == 0 || !(e->dt > 0) ? gr_stable_dt(e, run->team)
                                                                   : e->dt;
    /* The sums contain the momentum of the shift as a force for dt; with another dt they are computed again. */
    run->again = e->sums_correct_shift && e->step > 0 && dt != e->shift_dt;
    if (dt != e->dt) {
        e->dt = dt;
        e->time_anchor = e->time;
        e->step_anchor = e->step;
        if (e->sleep) e->sleep->all_nodes = 1;
    }
    const double next = e->time_anchor + (double)(e->step + 1 - e->step_anchor) * e->dt;
    /* Shear rates are recorded in the last step, where they are seen, in the step before an averaging or a damping of
     * flutter, which use them, and in that of a tally. The damping of elastic waves needs them in all. */
    e->record_rates = run->left == 0 || next >= run->until || gr_averages(e, e->step + 1) ||
                      gr_damps_flutter(e, e->step + 1) || (e->step + 1) % GR_TALLY_INTERVAL == 0 ||
                      (config->cell_averaged && config->damping_rate > 0) || config->damping_time > 0 || e->fluidity;
    e->diffuses = e->fluidity && !(e->time < config->nonlocal.begins_at);
    if (e->diffuses) e->deviation_left = deviation_left(e);
    const double rate = config->keep_velocity_rate;
    e->keep_velocity = config->xpic_order || rate < 0 ? 0 : rate > 0 ? exp(-rate * dt) : 1;
    for (int d = 0; d < config->dim; d++)
        e->sponge_factor[d] = config->has_sponge >> d & 1 ? exp(-config->sponge_damping[d] * dt) : 1;
    gr_piecewise(config->dim, config->n_gravity, config->gravity_times, 1, config->gravity_vectors, config->dim, e->time,
                 run->gravity);
    if (e->sleep && e->sleep->asleep && load_changes(run, next)) gr_sleep_wake_all(e);
    if (e->sleep) gr_sleep_find_uses(e, run->team);
    return 1;
}

/* Finish the step: move the points that left their cells, and the bodies. */
static void finish(struct run *run)
{
    struct gr_engine *e = run->e;
    e->error = gr_migrate(e, e->migrants, run->n_chunks, run->team);
    e->sums_valid = e->sums_valid && !e->error;
    if (e->error) return;
    if (e->watch) gr_add_wall_impulses(e);
    for (int b = 0; b < e->config.n_bodies; b++) e->body[b] = e->body_next[b];
    if (e->n_thin) gr_change_sides(e);
    if (e->feet) gr_feet_move_out(e);
    e->step++;
    e->time = e->time_anchor + (double)(e->step - e->step_anchor) * e->dt;
    if (e->inflow) gr_inflow_enter(e);
    if (e->n_thin && gr_follow_bodies(e)) e->disconnected = 1; /* until the mesh is made for the new poses */
    if (e->feet && gr_feet_list(e)) e->error = GR_ERR_MEMORY;
    if (e->open && (e->config.cell_averaged || gr_averages(e, e->step)) && gr_open_volumes(e, 1)) e->error = GR_ERR_MEMORY;
    if (e->error) return;
    if (e->n_pending || e->disconnected || gr_has_emptied(e)) {
        e->error = gr_regroup(e, run->team);
        if (!e->error) e->error = share_out(run);
    } else if (e->tiles_grown) {
        share_tiles(run);
    }
}

/* ---- Stages ---- */

static void stage_grid(struct run *run)
{
    struct gr_engine *e = run->e;
    const int64_t n_nodes = e->mesh.n_nodes;
    e->shift_dt = e->dt;
    e->shift_scale = -1.0 / e->dt;
    e->inv_dt = 1.0 / e->dt;
    e->servo_strain = gr_servo_strain(e);
    if (run->again) all_tiles(run, p2g);
    gr_plan_sums(e, e->step + 1);
    if (e->config.cell_averaged) {
        all_of(run, masses, n_nodes);
        all_tiles(run, cell_forces);
    }
    all_of(run, nodes, gr_groups(e));
    if (e->config.n_bodies) e->error = gr_bodies_touch(e, run->gravity, run->team);
    if (e->error) {
        e->sums_valid = 0;
        return;
    }
    if (gr_averages(e, e->step)) {
        all_of(run, surroundings, gr_groups(e));
        all_tiles(run, fillings);
    }
    for (run->pass = 2; run->pass <= e->config.xpic_order; run->pass++) {
        all_tiles(run, smooth);
        all_of(run, smooth_nodes, n_nodes);
    }
    if (run->kernels->narrow_nodes) all_of(run, narrow, gr_groups(e));
    if (e->watch) gr_sum_wall_impulses(e);
    if (e->watch && e->watch->servo.height > 0) gr_move_servo(e);
}

/* After the diffusion has failed to converge: find a point that is not finite, if there is one. */
static void blame(struct gr_engine *e)
{
    e->error_id = -1;
    e->error_step = e->step;
    for (int64_t s = 0; s < e->used; s++) {
        const double g = gr_number(e, GR_FIELD_g, 0, s); /* it is not stored in all substeps */
        if (e->id[s] < 0 || (isfinite(g) && isfinite(gr_number(e, GR_FIELD_shear_rate, 0, s)))) continue;
        e->error = GR_ERR_NOT_FINITE;
        e->error_id = e->id[s];
        for (int d = 0; d < e->config.dim; d++) e->error_x[d] = gr_x(e, d)[s];
        return;
    }
}

/* Diffuse the fluidity, and make all substeps of the nonlocal law but the last, which is part of the sweep.
 * Returned: 0, or the error of the step. */
static int stage_fluidity(struct run *run)
{
    struct gr_engine *e = run->e;
    const struct gr_nonlocal *nonlocal = &e->config.nonlocal;
    if (!e->diffuses) return GR_OK;
    if (e->fluidity->has_inside) all_tiles(run, mark);
    const struct gr_diffusion_call call = {nonlocal->method, 1.0 / nonlocal->substeps * e->dt, 1};
    for (int made = 0; made < nonlocal->substeps; made++) {
        if (made) all_tiles(run, made == 1 ? begin_substeps : substep);
        if (!made && e->mesh.n_paired) all_of(run, mean_pairs, e->mesh.n_paired);
        e->error = run->diffuse(e->fluidity, &call, run->team);
        if (e->error) {
            e->sums_valid = 0;
            blame(e);
            break;
        }
        e->cg_iterations += e->fluidity->iterations;
        e->clamped_cells += e->fluidity->clamped;
    }
    return e->error;
}

/* Regroup unless the points are grouped, none is pending and the mesh is complete. Without points there are no cells,
 * and only the clock runs on, fast. */
static int ready(struct gr_engine *e, struct gr_team *team)
{
    return e->n_points && e->mesh.n_cells && !e->n_pending && !e->disconnected ? GR_OK : gr_regroup(e, team);
}

/* Tell of a call of a law of the user's own that has failed; all points are there, but those of the call have no stress. */
static void check_laws(struct gr_engine *e)
{
    if (!e->own_calls.failed || (e->error && e->error != GR_ERR_CAPACITY)) return;
    e->own_calls = (struct gr_own_calls){0, 0};
    e->error = GR_ERR_LAW;
    e->error_id = -1;
    e->error_step = e->step - 1;
    e->sums_valid = 0;
}

static void make_steps(void *context, struct gr_team *team)
{
    struct run *run = context;
    struct gr_engine *e = run->e;
    run->team = team;
    e->error = ready(e, team);
    if (!e->error) e->error = share_out(run);
    gr_plan_sums(e, e->step);
    while (!e->error) {
        if (!e->sums_valid) {
            all_tiles(run, p2g);
        }
        e->sums_valid = 1;
        if (gr_tally_is_due(e) && (e->error = gr_tally_make(e, team))) return;
        if (!prepare(run)) return;
        stage_grid(run);
        if (e->error || stage_fluidity(run)) return;
        all_tiles(run, sweep);
        if (e->sleep && (!e->config.smoothed || gr_averages(e, e->step))) e->sleep->all_nodes = 0;
        finish(run);
        check_laws(e);
        if (!e->error && e->sums_valid) all_of(run, p2g_dirty, e->n_dirty);
    }
}

/* The kernels of a scheme, from those in double precision. */
static const struct gr_kernels *in_precision(const struct gr_engine *e, const struct gr_kernels *kernels)
{
    return e->config.single ? kernels->single : kernels;
}

static struct run run_of(struct gr_engine *e, const struct gr_kernels *kernels)
{
    return (struct run){
        .e = e, .kernels = in_precision(e, kernels), .diffuse = kernels->diffuse, .left = 1, .until = INFINITY};
}

int gr_advance(struct gr_engine *e, const struct gr_kernels *kernels, int64_t max_steps, double until, int threads)
{
    struct run run = run_of(e, kernels);
    run.left = max_steps, run.until = until;
    const int asked = e->n_points ? threads : 1;
    e->refused_threads = asked - gr_team_lead(asked, make_steps, &run);
    if (e->error || !e->own_calls.repeated) return e->error;
    e->own_calls.repeated = 0;
    return GR_ERR_REPEATED;
}

/* The stages one by one, in one thread: the same as a step of gr_advance, to the last bit. */
int gr_p2g(struct gr_engine *e, const struct gr_kernels *kernels)
{
    e->error = ready(e, NULL);
    if (e->error) return e->error;
    gr_plan_sums(e, e->step);
    kernels = in_precision(e, kernels);
    kernels->p2g(e, 0, e->mesh.n_tiles);
    if (e->config.cell_averaged) {
        gr_grid_masses(e, 0, e->mesh.n_nodes);
        kernels->apply_cell_forces(e, 0, e->mesh.n_tiles);
    }
    e->sums_valid = 1;
    return GR_OK;
}

int gr_grid(struct gr_engine *e, const struct gr_kernels *kernels)
{
    struct run run = run_of(e, kernels);
    e->error = GR_OK;
    if (!e->sums_valid) gr_p2g(e, kernels);
    if (!e->error) e->error = share_out(&run);
    if (e->error) return e->error;
    prepare(&run);
    stage_grid(&run);
    if (e->error) return e->error;
    if (e->config.xpic_order > 1) e->sums_valid = 0; /* the XPIC passes overwrote the sums */
    return stage_fluidity(&run);
}

int gr_g2p(struct gr_engine *e, const struct gr_kernels *kernels)
{
    struct run run = run_of(e, kernels);
    const int known = !e->config.cell_averaged || e->sums_valid; /* the density of a cell is stored with its sums */
    e->error = e->mesh.n_cells && e->dt > 0 && !e->n_pending && !e->disconnected && known ? share_out(&run) : GR_ERR_CONFIG;
    if (e->error) return e->error;
    e->record_rates = 1;
    run.kernels->sweep(e, 0, e->mesh.n_tiles, &e->migrants[0], 0);
    finish(&run);
    check_laws(e);
    e->sums_valid = 0;
    return e->error;
}
