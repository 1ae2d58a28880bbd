/* The time step: P2G, grid stage, diffusion of the fluidity, G2P. A call makes many steps, by a team of threads.
 *
 * The work of each stage is divided by cells or nodes. Each result is written by one thread, and every sum has a fixed
 * order, so that the bits do not depend on the number of threads. */
#include <math.h>
#include <stdlib.h>

#include "mpm/contact.h"
#include "core/barrier.h"
#include "core/piecewise.h"
#include "kernels.h"
#include "mpm/grid.h"
#include "mpm/migrate.h"
#include "mpm/smoothed_density.h"

enum { DT_INTERVAL = 16 }; /* steps between two updates of the largest speed */

struct team {
    struct gr_engine *e;
    const struct gr_kernels *kernels;
    struct gr_barrier barrier;
    int go, again;
    int64_t left; /* steps left */
    double until, gravity[3];
    int64_t cut[GR_MAX_THREADS + 1];
    struct gr_migrants migrants[GR_MAX_THREADS];
};

double gr_stable_dt(const struct gr_engine *e)
{
    double fastest = 0;
    const double *v = e->field[GR_FIELD_v];
    for (int64_t c = 0; c < e->mesh.n_cells; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        for (int64_t s = cell->offset; s < cell->offset + cell->count; s++) {
            double square = 0;
            for (int d = 0; d < e->config.dim; d++) square += v[d * e->capacity + s] * v[d * e->capacity + s];
            if (square > fastest) fastest = square;
        }
    }
    const double speed = fmax(sqrt(fastest), gr_bodies_speed(e));
    return e->config.cfl * e->config.dx / (e->config.wave_speed + speed);
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

/* Divide the cells so that each thread has about the same number of points. Give each thread capacity for migrants: all
 * its points may leave their cells at once. */
static int share_out(struct team *team)
{
    struct gr_engine *e = team->e;
    int64_t points = 0, first[GR_MAX_THREADS + 1] = {0};
    int t = 1;
    team->cut[0] = 0;
    for (int64_t c = 0; c < e->mesh.n_cells; c++) {
        points += e->mesh.cell[c].capacity;
        if (e->mesh.cell[c].side == 1) continue; /* its back must be in the same part */
        while (t < team->barrier.threads && points * team->barrier.threads >= e->mesh.cell[e->mesh.n_cells - 1].offset * t) {
            first[t] = points;
            team->cut[t++] = c + 1;
        }
    }
    for (; t <= team->barrier.threads; t++) team->cut[t] = e->mesh.n_cells, first[t] = points;
    if (reserve_substeps(e) || gr_reserve_pending(e, points + team->barrier.threads)) return GR_ERR_MEMORY;
    for (t = 0; t < team->barrier.threads; t++) {
        const int64_t begin = first[t] + t; /* one record more than points for each thread */
        team->migrants[t] =
            (struct gr_migrants){e->migrant + begin, e->pending + begin * e->n_components, e->pending_id + begin, 0};
    }
    return GR_OK;
}

/* Decide whether there is another step, and set its dt and gravity. One thread. */
static void prepare(struct team *team)
{
    struct gr_engine *e = team->e;
    const struct gr_config *config = &e->config;
    team->go = !e->error && team->left > 0 && e->time < team->until;
    if (!team->go) return;
    team->left--;
    const double dt = config->dt > 0 ? config->dt : e->step % DT_INTERVAL == 0 || !(e->dt > 0) ? gr_stable_dt(e) : e->dt;
    /* The sums contain the momentum of the shift as a force for dt; with another dt they are computed again. */
    team->again = e->sums_correct_shift && e->step > 0 && dt != e->shift_dt;
    if (dt != e->dt) {
        e->dt = dt;
        e->time_anchor = e->time;
        e->step_anchor = e->step;
    }
    const double next = e->time_anchor + (double)(e->step + 1 - e->step_anchor) * e->dt;
    /* Shear rates are recorded in the last step, where they are seen, and in the step before an averaging, which uses
     * them. */
    e->record_rates = team->left == 0 || next >= team->until || gr_averages(e, e->step + 1) || e->fluidity;
    e->diffuses = e->fluidity && !(e->time < config->nonlocal.begins_at);
    const double rate = config->keep_velocity_rate;
    e->keep_velocity = config->xpic_order || rate < 0 ? 0 : rate > 0 ? exp(-rate * dt) : 1;
    for (int d = 0; d < config->dim; d++)
        e->sponge_factor[d] = config->has_sponge >> d & 1 ? exp(-config->sponge_damping[d] * dt) : 1;
    gr_piecewise(config->dim, config->n_gravity, config->gravity_times, 1, config->gravity_vectors, config->dim, e->time,
                 team->gravity);
}

/* Finish the step: move the points that left their cells, and the bodies. One thread. */
static void finish(struct team *team)
{
    struct gr_engine *e = team->e;
    e->error = gr_migrate(e, team->migrants, team->barrier.threads);
    e->sums_valid = e->sums_valid && !e->error;
    if (e->error) return;
    for (int b = 0; b < e->config.n_bodies; b++) e->body[b] = e->body_next[b];
    if (e->n_thin) gr_change_sides(e);
    e->step++;
    e->time = e->time_anchor + (double)(e->step - e->step_anchor) * e->dt;
    if (e->n_thin && gr_follow_bodies(e)) e->disconnected = 1; /* until the mesh is made for the new poses */
    if (!e->n_pending && !e->disconnected) return;
    e->error = gr_regroup(e);
    if (!e->error) e->error = share_out(team);
}

static void stage_grid(struct team *team, int t)
{
    struct gr_engine *e = team->e;
    int64_t first, last;
    if (t == 0) { /* not before: P2G of other threads may still have used the last dt */
        e->shift_dt = e->dt;
        e->shift_scale = -1.0 / e->dt;
        e->inv_dt = 1.0 / e->dt;
    }
    if (team->again) {
        gr_wait(&team->barrier);
        team->kernels->p2g(e, team->cut[t], team->cut[t + 1]);
        gr_wait(&team->barrier);
    }
    if (t == 0) gr_plan_sums(e, e->step + 1);
    gr_share(e->mesh.n_nodes, t, team->barrier.threads, &first, &last);
    if (e->config.cell_averaged) {
        gr_grid_masses(e, first, last);
        gr_wait(&team->barrier);
        team->kernels->apply_cell_forces(e, team->cut[t], team->cut[t + 1]);
        gr_wait(&team->barrier);
    }
    if (e->n_thin) gr_split_nodes(e, first, last);
    gr_grid_nodes(e, first, last, team->gravity);
    if (e->config.n_bodies) gr_bodies_find(e, first, last);
    gr_wait(&team->barrier);
    if (e->config.n_bodies) {
        if (t == 0) gr_bodies_touch(e, team->gravity);
        gr_wait(&team->barrier);
    }
    if (gr_averages(e, e->step)) {
        gr_grid_surroundings(e, first, last);
        gr_wait(&team->barrier);
    }
    for (int pass = 2; pass <= e->config.xpic_order; pass++) {
        team->kernels->smooth(e, team->cut[t], team->cut[t + 1]);
        gr_wait(&team->barrier);
        gr_grid_smooth(e, first, last, pass);
        gr_wait(&team->barrier);
    }
}

/* After the diffusion has failed to converge: find a point that is not finite, if there is one. */
static void blame(struct gr_engine *e)
{
    const double *g = e->field[GR_FIELD_g], *rate = e->field[GR_FIELD_shear_rate]; /* g is not stored in all substeps */
    e->error_id = -1;
    e->error_step = e->step;
    for (int64_t s = 0; s < e->used; s++) {
        if (e->id[s] < 0 || (isfinite(g[s]) && isfinite(rate[s]))) continue;
        e->error = GR_ERR_NOT_FINITE;
        e->error_id = e->id[s];
        for (int d = 0; d < e->config.dim; d++) e->error_x[d] = e->field[GR_FIELD_x][d * e->capacity + s];
        return;
    }
}

/* Mean fluidity of the double cells, after P2G of all points and the marking of the cells. */
static void mean_pairs(struct team *team, int t)
{
    int64_t first, last;
    gr_wait(&team->barrier);
    gr_share(team->e->mesh.n_paired, t, team->barrier.threads, &first, &last);
    team->kernels->mean_pairs(team->e, first, last);
}

/* Diffuse the fluidity, and make all substeps of the nonlocal law but the last, which is part of the sweep.
 * Returned: 0, or the error of the step; the same to all threads. */
static int stage_fluidity(struct team *team, int t)
{
    struct gr_engine *e = team->e;
    const struct gr_nonlocal *nonlocal = &e->config.nonlocal;
    if (!e->diffuses) return GR_OK;
    if (e->fluidity->has_inside) gr_bodies_mark(e, team->cut[t], team->cut[t + 1]);
    const struct gr_diffusion_call call = {nonlocal->method, 1.0 / nonlocal->substeps * e->dt, 1};
    for (int made = 0; made < nonlocal->substeps; made++) {
        if (made) (made == 1 ? team->kernels->begin_substeps : team->kernels->substep)(e, team->cut[t], team->cut[t + 1]);
        if (!made && e->mesh.n_paired) mean_pairs(team, t);
        const int error = team->kernels->diffuse(e->fluidity, &call, &team->barrier, t);
        if (error) {
            if (t == 0) e->error = error, e->sums_valid = 0, blame(e);
            gr_wait(&team->barrier);
            return error;
        }
        if (t) continue;
        e->cg_iterations += e->fluidity->iterations;
        e->clamped_cells += e->fluidity->clamped;
    }
    return GR_OK;
}

static void run(void *data, int t)
{
    struct team *team = data;
    struct gr_engine *e = team->e;
    if (t == 0) e->error = share_out(team);
    gr_wait(&team->barrier);
    if (e->error) return;
    for (;;) {
        int64_t first, last;
        if (!e->sums_valid && !e->error) { /* after an error there may be no fluidity grid */
            team->kernels->p2g(e, team->cut[t], team->cut[t + 1]);
            gr_wait(&team->barrier);
            if (t == 0) e->sums_valid = 1;
        }
        if (t == 0) prepare(team);
        gr_wait(&team->barrier);
        if (!team->go) return;
        stage_grid(team, t);
        if (stage_fluidity(team, t)) return;
        team->kernels->sweep(e, team->cut[t], team->cut[t + 1], &team->migrants[t], 1);
        gr_wait(&team->barrier);
        if (t == 0) finish(team);
        gr_wait(&team->barrier);
        if (e->error || !e->sums_valid) continue;
        gr_share(e->n_dirty, t, team->barrier.threads, &first, &last);
        for (int64_t k = first; k < last; k++) team->kernels->p2g(e, e->dirty[k], e->dirty[k] + 1);
    }
}

/* Regroup unless the points are grouped, none is pending and the mesh is complete. Without points there are no cells,
 * and only the clock runs on, fast. */
static int ready(struct gr_engine *e)
{
    return e->n_points && e->mesh.n_cells && !e->n_pending && !e->disconnected ? GR_OK : gr_regroup(e);
}

int gr_advance(struct gr_engine *e, const struct gr_kernels *kernels, int64_t max_steps, double until, int threads)
{
    struct team team = {.e = e, .kernels = kernels, .left = max_steps, .until = until, .barrier = {.threads = 1}};
    e->error = ready(e);
    if (e->error) return e->error;
    gr_plan_sums(e, e->step);
    gr_run_team(&team.barrier, e->mesh.n_cells ? threads : 1, run, &team);
    return e->error;
}

/* The stages one by one, in one thread: the same as a step of gr_advance, to the last bit. */
int gr_p2g(struct gr_engine *e, const struct gr_kernels *kernels)
{
    e->error = ready(e);
    if (e->error) return e->error;
    gr_plan_sums(e, e->step);
    kernels->p2g(e, 0, e->mesh.n_cells);
    if (e->config.cell_averaged) {
        gr_grid_masses(e, 0, e->mesh.n_nodes);
        kernels->apply_cell_forces(e, 0, e->mesh.n_cells);
    }
    e->sums_valid = 1;
    return GR_OK;
}

int gr_grid(struct gr_engine *e, const struct gr_kernels *kernels)
{
    struct team team = {.e = e, .kernels = kernels, .left = 1, .until = INFINITY, .barrier = {.threads = 1}};
    e->error = GR_OK;
    if (!e->sums_valid) gr_p2g(e, kernels);
    if (!e->error) e->error = share_out(&team);
    if (e->error) return e->error;
    prepare(&team);
    stage_grid(&team, 0);
    if (e->config.xpic_order > 1) e->sums_valid = 0; /* the XPIC passes overwrote the sums */
    return stage_fluidity(&team, 0);
}

int gr_g2p(struct gr_engine *e, const struct gr_kernels *kernels)
{
    struct team team = {.e = e, .kernels = kernels, .barrier = {.threads = 1}};
    const int known = !e->config.cell_averaged || e->sums_valid; /* the density of a cell is stored with its sums */
    e->error = e->mesh.n_cells && e->dt > 0 && !e->n_pending && !e->disconnected && known ? share_out(&team) : GR_ERR_CONFIG;
    if (e->error) return e->error;
    e->record_rates = 1;
    kernels->sweep(e, 0, e->mesh.n_cells, &team.migrants[0], 0);
    finish(&team);
    e->sums_valid = 0;
    return e->error;
}
