/* The step: p2g, grid, gather; many of them in one call, by a team of threads.
 *
 * The work of a stage is cut at cells and nodes; each result is written by one thread and every sum has
 * an order of its own, so the bits do not depend on the number of threads. */
#include <math.h>
#include <stdlib.h>

#ifdef _OPENMP
#include <omp.h>
#endif

#include "mpm/contact.h"
#include "core/barrier.h"
#include "core/gravity.h"
#include "kernels.h"
#include "mpm/grid.h"
#include "mpm/migrate.h"
#include "mpm/smoothed_density.h"

enum { DT_INTERVAL = 16 }; /* steps between two looks at the fastest point */

struct team {
    struct gr_engine *e;
    const struct gr_kernels *kernels;
    struct gr_barrier barrier;
    int go, again;
    int64_t left; /* steps */
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

/* Paths of the points through many substeps. */
static int reserve_path(struct gr_engine *e)
{
    const int64_t room = e->capacity * GR_SUBSTEP_COUNT;
    if (!e->fluidity || e->config.nonlocal.substeps < 2 || room <= e->substep_capacity) return GR_OK;
    free(e->substeps);
    e->substeps = malloc(sizeof(double) * (size_t)room);
    e->substep_capacity = e->substeps ? room : 0;
    return e->substeps ? GR_OK : GR_ERR_MEMORY;
}

/* Cut the cells so that each thread has about the same number of points, and give each room for migrants: all its
 * points may leave their cells at once. */
static int share_out(struct team *team)
{
    struct gr_engine *e = team->e;
    int64_t points = 0, first[GR_MAX_THREADS + 1] = {0};
    int t = 1;
    team->cut[0] = 0;
    for (int64_t c = 0; c < e->mesh.n_cells; c++) {
        points += e->mesh.cell[c].capacity;
        if (e->mesh.cell[c].side == 1) continue; /* its back goes with it */
        while (t < team->barrier.threads && points * team->barrier.threads >= e->mesh.cell[e->mesh.n_cells - 1].offset * t) {
            first[t] = points;
            team->cut[t++] = c + 1;
        }
    }
    for (; t <= team->barrier.threads; t++) team->cut[t] = e->mesh.n_cells, first[t] = points;
    if (reserve_path(e) || gr_reserve_pending(e, points + team->barrier.threads)) return GR_ERR_MEMORY;
    for (t = 0; t < team->barrier.threads; t++) {
        const int64_t begin = first[t] + t; /* a record more than points for each */
        team->migrants[t] =
            (struct gr_migrants){e->migrant + begin, e->pending + begin * e->n_components, e->pending_id + begin, 0};
    }
    return GR_OK;
}

/* Decide whether there is another step, and its dt and gravity. One thread. */
static void prepare(struct team *team)
{
    struct gr_engine *e = team->e;
    const struct gr_config *config = &e->config;
    team->go = !e->error && team->left > 0 && e->time < team->until;
    if (!team->go) return;
    team->left--;
    const double dt = config->dt > 0 ? config->dt : e->step % DT_INTERVAL == 0 || !(e->dt > 0) ? gr_stable_dt(e) : e->dt;
    /* What the shift has lent is in the sums as a force for dt: with another dt they are made again. */
    team->again = e->sums_correct_shift && e->step > 0 && dt != e->shift_dt;
    if (dt != e->dt) {
        e->dt = dt;
        e->time_anchor = e->time;
        e->step_anchor = e->step;
    }
    const double next = e->time_anchor + (double)(e->step + 1 - e->step_anchor) * e->dt;
    /* The rates of the last step are seen, and those before an averaging are used by it. */
    e->record_rates = team->left == 0 || next >= team->until || gr_averages(e, e->step + 1) || e->fluidity;
    e->diffuses = e->fluidity && !(e->time < config->nonlocal.begins_at);
    const double rate = config->keep_velocity_rate;
    e->keep_velocity = config->xpic_order || rate < 0 ? 0 : rate > 0 ? exp(-rate * dt) : 1;
    for (int d = 0; d < config->dim; d++)
        e->sponge_factor[d] = config->has_sponge >> d & 1 ? exp(-config->sponge_damping[d] * dt) : 1;
    gr_gravity(config->dim, config->n_gravity, config->gravity_times, config->gravity_vectors, e->time, team->gravity);
}

/* Points that left their cells move; the step is complete. One thread. */
static void finish(struct team *team)
{
    struct gr_engine *e = team->e;
    e->error = gr_migrate(e, team->migrants, team->barrier.threads);
    e->sums_valid = e->sums_valid && !e->error;
    if (e->error) return;
    gr_bodies_move(e);
    if (e->n_thin) gr_change_sides(e);
    e->step++;
    e->time = e->time_anchor + (double)(e->step - e->step_anchor) * e->dt;
    if (e->n_thin && gr_follow_bodies(e)) e->disconnected = 1; /* until the mesh is that of the new split */
    if (!e->n_pending && !e->disconnected) return;
    e->error = gr_regroup(e);
    if (!e->error) e->error = share_out(team);
}

static void note_dt(struct gr_engine *e)
{
    e->shift_dt = e->dt;
    e->shift_scale = -1.0 / e->dt;
    e->inv_dt = 1.0 / e->dt;
}

static void stage_grid(struct team *team, int t)
{
    struct gr_engine *e = team->e;
    int64_t first, last;
    if (t == 0) note_dt(e); /* not before: others may still have been scattering with the last one */
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

/* The fluidity has not converged: which of the points is not finite, if one is. */
static void blame(struct gr_engine *e)
{
    const double *g = e->field[GR_FIELD_g], *rate = e->field[GR_FIELD_shear_rate]; /* g is not kept in all substeps */
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

/* The double cells, when the law has been made for all points and they are marked. */
static void mean_pairs(struct team *team, int t)
{
    int64_t first, last;
    gr_wait(&team->barrier);
    gr_share(team->e->mesh.n_paired, t, team->barrier.threads, &first, &last);
    team->kernels->mean_pairs(team->e, first, last);
}

/* Diffusion of the fluidity, and all substeps of the nonlocal law but the last, which goes with the gather.
 * Returned: 0, or the error of the step, the same to all threads. */
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

static void run(struct team *team, int t)
{
    struct gr_engine *e = team->e;
    for (;;) {
        int64_t first, last;
        if (!e->sums_valid && !e->error) { /* without memory there may be no lattice to write to */
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
        team->kernels->p2g_list(e, e->dirty, first, last);
    }
}

/* Points grouped, none waiting and the mesh whole: else that first. Without points it leaves no cells, so that
 * the clock alone goes on, and fast. */
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
#ifdef _OPENMP
    if (threads > GR_MAX_THREADS) threads = GR_MAX_THREADS;
    if (!e->mesh.n_cells) threads = 1;
#pragma omp parallel num_threads(threads)
    {
#pragma omp single
        {
            team.barrier.threads = omp_get_num_threads();
            e->error = share_out(&team);
        }
        if (!e->error) run(&team, omp_get_thread_num());
    }
#else
    (void)threads;
    e->error = share_out(&team);
    if (!e->error) run(&team, 0);
#endif
    return e->error;
}

/* The stages one by one, by one thread: what advance does in a step, to the last bit. */

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
    if (e->config.xpic_order > 1) e->sums_valid = 0; /* the passes work in their place */
    return stage_fluidity(&team, 0);
}

int gr_g2p(struct gr_engine *e, const struct gr_kernels *kernels)
{
    struct team team = {.e = e, .kernels = kernels, .barrier = {.threads = 1}};
    const int known = !e->config.cell_averaged || e->sums_valid; /* the density of a cell is in its sums */
    e->error = e->mesh.n_cells && e->dt > 0 && !e->n_pending && !e->disconnected && known ? share_out(&team) : GR_ERR_CONFIG;
    if (e->error) return e->error;
    e->record_rates = 1;
    kernels->sweep(e, 0, e->mesh.n_cells, &team.migrants[0], 0);
    finish(&team);
    e->sums_valid = 0;
    return e->error;
}
