/* The time step: P2G, grid stage, diffusion of the fluidity, G2P (step.h). */
#include "engine/step.h"

#include <math.h>

#include "contact/body_patches.h"
#include "contact/contact_points.h"
#include "contact/near_bodies.h"
#include "core/piecewise.h"
#include "engine/sharing.h"
#include "engine/stable_dt.h"
#include "engine/stages.h"
#include "mpm/device.h"
#include "mpm/ghosts.h"
#include "mpm/grid.h"
#include "mpm/grouping.h"
#include "mpm/inflow.h"
#include "mpm/migrate.h"
#include "mpm/open_volume.h"
#include "mpm/patches.h"
#include "mpm/ranks.h"
#include "mpm/sleep.h"
#include "mpm/smoothed_density.h"
#include "mpm/tally.h"
#include "mpm/thin_bodies.h"
#include "mpm/wall_impulse.h"

enum { DT_INTERVAL = GR_SLEEP_INTERVAL }; /* steps between two updates of the largest speed */

/* Let material that has been slow fall asleep, and sum over the rest. Returned: 0 or an error of ranks or a device. */
static int look_for_calm(struct gr_run *run)
{
    struct gr_engine *e = run->e;
    int64_t calm = gr_sleep_count(e, run->team);
    int error = e->ranks ? gr_ranks_agree(e, GR_OK, &calm, 1) : e->failure.code; /* of a device */
    if (error || !calm) return error;
    e->sums.n_dirty = 0;
    if (e->ranks) error = gr_ghosts_exchange_calm(e);
    gr_sleep_fall(e, run->team);
    if (e->ranks && !error) error = gr_ghosts_exchange_calm(e);
    gr_stage_p2g_again(run);
    return error;
}

/* Whether gravity or a wall is another one at the time `next` than in this step. */
static int load_changes(const struct gr_run *run, double next)
{
    const struct gr_engine *e = run->e;
    const struct gr_config *config = &e->config;
    double then[3] = {0};
    int changes = 0;
    gr_piecewise(config->dim, config->n_gravity, config->gravity_times, 1, config->gravity_vectors, config->dim, next, then);
    for (int d = 0; d < config->dim; d++) changes |= run->gravity[d] != then[d];
    for (int k = 0; k < config->n_walls; k++)
        changes |= e->clock.time < config->walls[k].opens_at && config->walls[k].opens_at <= next;
    return changes;
}

/* Share of the deviations within a cell that a diffusion leaves. The longest wave between smooth ends of a cell decays as
 * exp(-(pi A d/dx)^2 t/t0): where A d is far below a cell each point has a fluidity of its own, as with the local law. */
static double deviation_left(const struct gr_engine *e)
{
    const double k = M_PI / e->config.dx;
    return exp(-k * k * e->nonlocal.fluidity->diffusivity * e->clock.dt / e->config.nonlocal.substeps);
}

/* Decide whether there is another step, and set its dt and gravity.
 * Returned: whether there is one. */
static int prepare(struct gr_run *run)
{
    struct gr_engine *e = run->e;
    const struct gr_config *config = &e->config;
    if (!(run->left > 0 && e->clock.time < run->until)) return 0;
    run->left--;
    if (e->sleep && e->clock.step % GR_SLEEP_INTERVAL == 0 && (e->failure.code = look_for_calm(run))) return 0;
    const double dt = config->dt > 0                                           ? config->dt
                      : e->clock.step % DT_INTERVAL == 0 || !(e->clock.dt > 0) ? gr_stable_dt(e, run->team)
                                                                               : e->clock.dt;
    /* The sums contain the momentum of the shift as a force for dt; with another dt they are computed again. */
    run->again = e->sums.correct_shift && e->clock.step > 0 && dt != e->clock.shift_dt;
    gr_use_dt(e, dt);
    const double next = e->clock.time_anchor + (double)(e->clock.step + 1 - e->clock.step_anchor) * e->clock.dt;
    /* Shear rates are recorded in the last step, where they are seen, in the step before an averaging or a damping of
     * flutter, which use them, and in the step of a tally. The viscous stress needs them in all. */
    e->record_rates = run->left == 0 || next >= run->until || gr_averages(e, e->clock.step + 1) ||
                      gr_damps_flutter(e, e->clock.step + 1) || (e->clock.step + 1) % GR_TALLY_INTERVAL == 0 ||
                      (config->cell_averaged && config->largest.damping_rate > 0) || gr_has_viscous_stress(config) ||
                      e->nonlocal.fluidity || config->scheme.shear_strain > 0;
    e->nonlocal.diffuses = e->nonlocal.fluidity && !(e->clock.time < config->nonlocal.begins_at);
    if (e->nonlocal.diffuses) e->nonlocal.deviation_left = deviation_left(e);
    const double rate = config->keep_velocity_rate;
    e->keep_velocity = config->xpic_order || rate < 0 ? 0 : rate > 0 ? exp(-rate * dt) : 1;
    for (int d = 0; d < config->dim; d++)
        e->sponge_factor[d] = config->has_sponge >> d & 1 ? exp(-config->sponge_damping[d] * dt) : 1;
    gr_piecewise(config->dim, config->n_gravity, config->gravity_times, 1, config->gravity_vectors, config->dim,
                 e->clock.time, run->gravity);
    if (e->sleep && e->sleep->asleep && load_changes(run, next)) gr_sleep_wake_all(e);
    if (e->sleep) gr_sleep_find_uses(e, run->team);
    return 1;
}

/* Add the impulses on the patches of walls and bodies. */
static int add_patches(struct gr_engine *e)
{
    if (gr_add_wall_patches(e)) return GR_ERR_MEMORY;
    return e->bodies.contacts ? gr_add_body_patches(e) : GR_OK;
}

/* Share out the work of the steps, on all ranks or on none. */
static int share_out(struct gr_run *run)
{
    const int error = gr_share_out(run);
    return run->e->ranks ? gr_ranks_agree(run->e, error, NULL, 0) : error;
}

/* Finish the step: move the points that left their cells, and the bodies. */
static void finish(struct gr_run *run)
{
    struct gr_engine *e = run->e;
    e->failure.code = gr_migrate(e, e->migration.leaving, run->n_chunks, run->team);
    e->sums.valid = e->sums.valid && !e->failure.code;
    if (e->failure.code) return;
    if (e->watch) gr_add_wall_impulses(e);
    if (e->watch && e->watch->patches && add_patches(e)) {
        e->failure.code = GR_ERR_MEMORY;
        return;
    }
    for (int b = 0; b < e->config.n_bodies; b++) e->bodies.now[b] = e->bodies.next[b];
    if (e->bodies.n_thin) gr_change_sides(e);
    if (e->bodies.contacts) e->failure.code = gr_move_out_of_bodies(e);
    e->clock.step++;
    e->clock.time = e->clock.time_anchor + (double)(e->clock.step - e->clock.step_anchor) * e->clock.dt;
    if (e->inflow && !e->failure.code) e->failure.code = gr_inflow_enter(e);
    if (e->bodies.n_thin && gr_follow_bodies(e)) e->disconnected = 1; /* until the mesh is made for the new poses */
    if (e->ranks && gr_ranks_bodies_moved(e)) e->disconnected = 1;
    if (e->bodies.contacts && gr_list_near_bodies(e)) e->failure.code = GR_ERR_MEMORY;
    if (e->bodies.open && (e->config.cell_averaged || gr_averages(e, e->clock.step)) && gr_open_volumes(e, 1))
        e->failure.code = GR_ERR_MEMORY;
    const int law_failed = e->failure.own_calls.failed != 0;
    int64_t next[4] = {e->migration.n_pending || e->disconnected || gr_has_emptied(e), e->passage.any, law_failed,
                       e->sleep && e->sleep->changed};
    if (e->ranks) e->failure.code = gr_ranks_agree(e, e->failure.code, next, 4);
    if (!e->failure.code && next[1]) e->failure.code = gr_tally_settle(e);
    if (!e->failure.code && next[3] && !next[0] && e->ranks) e->failure.code = gr_ghosts_exchange_calm(e);
    if (e->failure.code) return;
    if (next[0]) {
        e->failure.code = gr_regroup(e, run->team);
        if (!e->failure.code) e->failure.code = share_out(run);
    } else if (e->migration.tiles_grown) {
        gr_share_tiles(run);
    }
    if (!e->failure.code && next[2] && !law_failed) e->failure.code = GR_ERR_ELSEWHERE;
}

/* Regroup unless the points are grouped, none is pending and the mesh is complete. Without points there are no cells,
 * and only the clock runs on, fast. */
static int ready(struct gr_engine *e, struct gr_team *team)
{
    const int grouped = e->ranks ? e->ranks->grouped : e->points.n && e->mesh.n_cells;
    int64_t others = !(grouped && !e->migration.n_pending && !e->disconnected);
    const int error = e->ranks ? gr_ranks_agree(e, GR_OK, &others, 1) : GR_OK;
    return error ? error : others ? gr_regroup(e, team) : GR_OK;
}

/* Report a call of a user-defined law that has failed; all points are there, but those of the call have no stress. */
static void check_laws(struct gr_engine *e)
{
    if (!e->failure.own_calls.failed || (e->failure.code && e->failure.code != GR_ERR_CAPACITY)) return;
    e->failure.own_calls = (struct gr_own_calls){0, 0};
    e->failure.code = GR_ERR_LAW;
    e->failure.id = -1;
    e->failure.step = e->clock.step - 1;
    e->sums.valid = 0;
}

static void make_steps(void *context, struct gr_team *team)
{
    struct gr_run *run = context;
    struct gr_engine *e = run->e;
    run->team = team;
    e->failure.code = ready(e, team);
    if (!e->failure.code) e->failure.code = share_out(run);
    if (!e->failure.code && e->ranks && e->sleep) e->failure.code = gr_ghosts_exchange_calm(e);
    gr_plan_sums(e, e->clock.step);
    if (e->device && !e->failure.code) gr_device_begin(e, team);
    while (!e->failure.code) {
        if (!e->sums.valid) gr_stage_p2g(run);
        if (e->failure.code) return;
        e->sums.valid = 1;
        if (gr_tally_is_due(e) && (e->failure.code = gr_tally_make(e, team))) return;
        if (!prepare(run)) return;
        gr_stage_grid(run);
        if (e->failure.code || gr_stage_fluidity(run)) return;
        gr_stage_g2p(run);
        if (e->failure.code) return;
        if (e->sleep && (!e->config.smoothed || gr_averages(e, e->clock.step))) e->sleep->all_nodes = 0;
        finish(run);
        check_laws(e);
        if (!e->failure.code && e->sums.valid) gr_stage_p2g_again(run);
    }
}

static struct gr_run run_of(struct gr_engine *e, const struct gr_kernels *kernels)
{
    return (struct gr_run){.e = e,
                           .kernels = gr_in_precision(kernels, e->config.single),
                           .passes = kernels->passes,
                           .left = 1,
                           .until = INFINITY};
}

int gr_advance(struct gr_engine *e, const struct gr_kernels *kernels, int64_t max_steps, double until, int threads)
{
    struct gr_run run = run_of(e, kernels);
    run.left = max_steps, run.until = until;
    const int wanted = e->points.n ? threads : 1;
    e->refused_threads = wanted - gr_team_lead(wanted, make_steps, &run);
    if (e->device) gr_device_end(e);
    if (e->failure.code || !e->failure.own_calls.repeated) return e->failure.code;
    e->failure.own_calls.repeated = 0;
    return GR_ERR_REPEATED;
}

/* The stages one by one, in one thread: the same as a step of gr_advance, to the last bit. */
int gr_p2g(struct gr_engine *e, const struct gr_kernels *kernels)
{
    e->failure.code = e->ranks || e->device ? GR_ERR_CONFIG : ready(e, NULL); /* they make whole steps alone */
    if (e->failure.code) return e->failure.code;
    gr_plan_sums(e, e->clock.step);
    kernels = gr_in_precision(kernels, e->config.single);
    kernels->p2g(e, 0, e->mesh.n_tiles);
    if (e->config.cell_averaged) {
        gr_grid_masses(e, kernels, 0, e->mesh.n_nodes);
        kernels->apply_cell_forces(e, 0, e->mesh.n_tiles);
    }
    e->sums.valid = 1;
    return GR_OK;
}

int gr_grid(struct gr_engine *e, const struct gr_kernels *kernels)
{
    struct gr_run run = run_of(e, kernels);
    e->failure.code = e->ranks || e->device ? GR_ERR_CONFIG : GR_OK;
    if (!e->failure.code && !e->sums.valid) gr_p2g(e, kernels);
    if (!e->failure.code) e->failure.code = gr_share_out(&run);
    if (e->failure.code) return e->failure.code;
    prepare(&run);
    gr_stage_grid(&run);
    if (e->failure.code) return e->failure.code;
    if (e->config.xpic_order > 1) e->sums.valid = 0; /* the XPIC passes overwrote the sums */
    return gr_stage_fluidity(&run);
}

int gr_g2p(struct gr_engine *e, const struct gr_kernels *kernels)
{
    struct gr_run run = run_of(e, kernels);
    const int known = !e->config.cell_averaged || e->sums.valid; /* the density of a cell is stored with its sums */
    e->failure.code =
        e->mesh.n_cells && e->clock.dt > 0 && !e->migration.n_pending && !e->disconnected && known && !e->ranks && !e->device
            ? gr_share_out(&run)
            : GR_ERR_CONFIG;
    if (e->failure.code) return e->failure.code;
    e->record_rates = 1;
    run.kernels->sweep(e, 0, e->mesh.n_tiles, &e->migration.leaving[0], 0);
    finish(&run);
    check_laws(e);
    e->sums.valid = 0;
    return e->failure.code;
}
