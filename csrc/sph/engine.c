/* The SPH engine: memory, clock and time steps. */
#include "sph/sph.h"

#include <math.h>
#include <string.h>

#include "core/memory.h"
#include "core/piecewise.h"
#include "core/simd.h"
#include "sph/gas.h"
#include "sph/inflow.h"

#define GR_X(name, kind, need, unit, doc) {#name, unit, doc, kind, need},
const struct gr_field_info gr_sph_field_table[GR_SPH_FIELD_COUNT] = {GR_SPH_FIELDS(GR_X)};
#undef GR_X

#define GR_X(name, zero, unit, doc) {#name, unit, doc},
const struct gr_parameter_info gr_sph_parameter_table[GR_SPH_PARAMETER_COUNT] = {GR_SPH_PARAMETERS(GR_X)};
#undef GR_X

#define GR_X(name, zero, unit, doc) | (unsigned)zero << GR_SPH_P_##name
const unsigned gr_sph_may_be_zero = 0 GR_SPH_PARAMETERS(GR_X);
#undef GR_X

enum { MAX_CELLS = 1 << 26, STEP_LIMIT_DIVISOR = 4 };

/* Divide the domain into cells, of which GR_SPH_CELLS_IN_REACH span the reach of the neighbour list. */
static int divide(struct gr_sph *s)
{
    const struct gr_sph_config *c = &s->config;
    double cells = 1;
    s->reach = 2.0 * c->parameter[GR_SPH_P_h] + c->parameter[GR_SPH_P_skin];
    s->n_cells = 1;
    for (int d = 0; d < c->dim; d++) {
        const double length = c->upper[d] - c->lower[d], n = floor(length * GR_SPH_CELLS_IN_REACH / s->reach);
        if (!(length > 0) || (c->periodic[d] && length < s->reach)) return GR_ERR_CONFIG;
        cells *= n < 1 ? 1 : n;
        if (!(cells <= MAX_CELLS)) return GR_ERR_CONFIG;
        s->shape[d] = n < 1 ? 1 : (int)n;
        if (c->periodic[d] && s->shape[d] < GR_SPH_CELLS_IN_REACH) return GR_ERR_CONFIG; /* possible by rounding */
        s->per_cell[d] = s->shape[d] / length;
        s->n_cells *= s->shape[d];
        for (int k = 0, unit = d == 0 ? 1 : d == 1 ? 3 : 9; k < GR_SPH_SHIFTS; k++)
            s->shift[k][d] = (k / unit % 3 - 1) * length;
    }
    return GR_OK;
}

/* Square of the speed of sound at rho0, m^2/s^2: of compression waves, including the elastic shear modulus. */
static double slow_sound2(const double *p)
{
    return (1.5 * p[GR_SPH_P_kappa] + 4.0 / 3.0 * p[GR_SPH_P_shear_modulus]) / p[GR_SPH_P_rho0];
}

int gr_sph_new(struct gr_sph **out, const struct gr_sph_config *config, int lanes)
{
    struct gr_sph *s = *out = gr_calloc(1, sizeof *s);
    int error = GR_OK;
    if (!s) return GR_ERR_MEMORY;
    s->config = *config, s->lanes = lanes;
    error |= gr_own((const void **)&s->config.gravity_times, sizeof(double) * (size_t)config->n_gravity);
    error |= gr_own((const void **)&s->config.gravity_vectors, sizeof(double) * (size_t)(config->n_gravity * config->dim));
    if (!error) error = divide(s);
    for (int k = 0; k < 3 && !error; k++) {
        s->start[k] = gr_malloc(sizeof(int32_t) * (size_t)(s->n_cells + 2));
        if (!s->start[k]) error = GR_ERR_MEMORY;
    }
    if (!error) {
        s->speed2 = slow_sound2(s->config.parameter);
        s->dt = gr_sph_stable_dt(s);
        return GR_OK;
    }
    gr_sph_free(s);
    *out = NULL;
    return error;
}

static void free_places(struct gr_sph *s)
{
    void *owned[] = {s->lump, s->sorted, s->sorted_id, s->cell, s->order, s->block};
    for (size_t k = 0; k < sizeof owned / sizeof *owned; k++) gr_free(owned[k]);
    s->lump = s->sorted = NULL, s->sorted_id = NULL, s->cell = s->order = NULL, s->block = NULL;
    s->stride = 0;
    gr_sph_free_gas_places(s);
}

void gr_sph_free(struct gr_sph *s)
{
    if (!s) return;
    free_places(s);
    gr_sph_free_gas(s);
    gr_sph_free_inflow(s);
    void *owned[] = {(void *)s->config.gravity_times, (void *)s->config.gravity_vectors, s->start[0], s->start[1],
                     s->start[2]};
    for (size_t k = 0; k < sizeof owned / sizeof *owned; k++) gr_free(owned[k]);
    gr_free(s);
}

/* Allocate the memory of the engine per row: nine numbers, three indices, and two for sorting. */
static int make_places(struct gr_sph *s, int64_t capacity)
{
    const size_t n = (size_t)capacity;
    free_places(s);
    double *numbers = s->lump = gr_calloc(9 * n, sizeof *numbers);
    s->sorted = gr_malloc(n * sizeof *s->sorted), s->sorted_id = gr_malloc(4 * n * sizeof *s->sorted_id);
    s->cell = gr_malloc(n * sizeof *s->cell), s->order = gr_malloc(n * sizeof *s->order);
    if (!numbers || !s->sorted || !s->sorted_id || !s->cell || !s->order || gr_sph_make_gas_places(s, capacity) ||
        gr_sph_make_inflow_places(s, capacity)) {
        free_places(s);
        return GR_ERR_MEMORY;
    }
    s->volume = numbers + n, s->rho_plain = numbers + 2 * n;
    for (int k = 0; k < 6; k++) s->pull[k] = numbers + (size_t)(3 + k) * n;
    s->begin = s->sorted_id + n, s->middle = s->begin + n, s->end = s->middle + n;
    return GR_OK;
}

enum kind { PARTICLES, WALLS, GAS, KINDS };

/* The rows of each kind in a chunk: [first, last). */
struct share {
    int64_t first[KINDS], last[KINDS];
};

static struct share share_of(const struct gr_sph *s, int64_t chunk, int64_t chunks)
{
    const int64_t n[KINDS] = {s->n_particles, s->n_walls, s->n_gas}, begin[KINDS] = {0, s->wall_first, s->gas_first};
    struct share share;
    for (int k = 0; k < KINDS; k++) {
        gr_share(n[k], chunk, chunks, &share.first[k], &share.last[k]);
        share.first[k] += begin[k], share.last[k] += begin[k];
    }
    return share;
}

/* List the blocks of a share.
 * Returned: the largest number of them that a row needs. */
static int64_t list_blocks(struct gr_sph *s, struct share share)
{
    int64_t most = 0;
    for (int k = 0; k < KINDS; k++) {
        const int64_t n = gr_sph_list_blocks(s, share.first[k], share.last[k]);
        if (n > most) most = n;
    }
    return most;
}

/* Sort the points and make the neighbour list. One thread. */
static int make_list(struct gr_sph *s, int fresh)
{
    gr_sph_sort(s, fresh);
    for (;;) {
        const int64_t most = list_blocks(s, share_of(s, 0, 1));
        if (most <= s->stride) return GR_OK;
        const int error = gr_sph_widen(s, most);
        if (error) return error;
    }
}

void gr_sph_place_gas(struct gr_sph *s, int64_t gas_first, int64_t n_gas) { s->gas_first = gas_first, s->n_gas = n_gas; }

int gr_sph_bind(struct gr_sph *s, double *const *row, int64_t *id, int64_t capacity, int64_t n_particles, int64_t wall_first,
                int64_t n_walls, int fresh)
{
    const int n_rows = gr_sph_row_count(s);
    if (!s->gas) gr_sph_place_gas(s, capacity, 0);
    if (n_particles < 0 || n_walls < 0 || s->n_gas < 0 || n_particles + GR_LANES > wall_first || capacity > INT32_MAX ||
        wall_first + n_walls + GR_LANES > s->gas_first || s->gas_first + s->n_gas + (s->gas ? GR_LANES : 0) > capacity)
        return GR_ERR_CONFIG;
    s->id = NULL; /* until all has succeeded */
    const int error = make_places(s, capacity);
    if (error) return error;
    memset(s->row, 0, sizeof s->row);
    for (int r = 0; r < n_rows; r++) s->row[r] = row[r];
    s->capacity = capacity, s->n_particles = n_particles, s->wall_first = wall_first, s->n_walls = n_walls;
    s->id = id;
    return s->error = make_list(s, fresh);
}

/* Largest stable time step: the smaller of h/(4 c), with a gas also h/(4 (c + |v|)) of the gas, and sqrt(h/|a|)/4 (eq.
 * 5.28). Here c is the speed of sound or of the fastest particle, so that no particle moves more than h/4 in a step. The
 * third limit, of the viscosity, cannot be exceeded: the regularisation bounds the viscosity accordingly. */
double gr_sph_stable_dt(const struct gr_sph *s)
{
    const double *p = s->config.parameter, h = p[GR_SPH_P_h];
    double limit = h / sqrt(s->speed2);
    if (s->gas) limit = fmin(limit, h / (s->gas->parameter[GR_SPH_GAS_P_sound_speed] + sqrt(s->gas_speed2)));
    if (s->acceleration2 * limit * limit * limit * limit > h * h) limit = sqrt(h / sqrt(s->acceleration2));
    return p[GR_SPH_P_cfl] * limit / STEP_LIMIT_DIVISOR;
}

/* A call for steps. */
struct run {
    struct gr_sph *s;
    gr_sph_kernel *kernel;
    struct gr_team *team;
    double until, kick_dt;
    int64_t steps_left;
    int rebuilds, wall_goes, is_full;
    const struct stage *stage;
};

/* Of the bad points the first one is recorded, whatever the order of chunks. */
static void note_bad(struct gr_sph_extremes *extremes, int64_t i)
{
    if (extremes->bad < 0 || i < extremes->bad) extremes->bad = i;
}

/* First half of a step: v^{n+1/2} = v^n + a^n dt/2, x^{n+1} = x^n + v^{n+1/2} dt (eqs. 5.25, 5.27). A particle that
 * moves by h in it has run away. */
static void drift(struct gr_sph *s, int64_t first, int64_t last, struct gr_sph_extremes *extremes)
{
    double *const *x = gr_sph_rows(s, GR_SPH_FIELD_x), *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    double *const *a = gr_sph_rows(s, GR_SPH_FIELD_a);
    const double farthest = s->config.parameter[GR_SPH_P_h] / s->dt;
    for (int64_t i = first; i < last; i++) {
        double speed2 = 0;
        for (int d = 0; d < s->config.dim; d++) {
            v[d][i] += 0.5 * s->dt * a[d][i];
            x[d][i] += s->dt * v[d][i];
            speed2 += v[d][i] * v[d][i];
        }
        if (!(speed2 < farthest * farthest)) note_bad(extremes, i);
    }
    extremes->stopped += gr_sph_stop(s, first, last);
}

/* Measure the displacements of points since the neighbour list was made. */
static void measure(const struct gr_sph *s, int64_t first, int64_t last, struct gr_sph_extremes *extremes)
{
    double *const *x = gr_sph_rows(s, GR_SPH_FIELD_x), *const *anchor = gr_sph_rows(s, GR_SPH_FIELD_anchor);
    for (int64_t i = first; i < last; i++) {
        double moved2 = 0;
        for (int d = 0; d < s->config.dim; d++) {
            const double way = x[d][i] - anchor[d][i];
            moved2 += way * way;
            if (way < extremes->low[d]) extremes->low[d] = way;
            if (way > extremes->high[d]) extremes->high[d] = way;
        }
        if (moved2 > extremes->moved2) extremes->moved2 = moved2;
        if (!isfinite(moved2)) note_bad(extremes, i);
    }
}

/* Second half of a step: v^{n+1} = v^{n+1/2} + a^{n+1} dt/2 (eq. 5.26). */
static void kick(struct gr_sph *s, double dt, int64_t first, int64_t last, struct gr_sph_extremes *extremes)
{
    double *const *v = gr_sph_rows(s, GR_SPH_FIELD_v), *const *a = gr_sph_rows(s, GR_SPH_FIELD_a);
    for (int64_t i = first; i < last; i++) {
        double speed2 = 0;
        for (int d = 0; d < s->config.dim; d++) {
            v[d][i] += 0.5 * dt * a[d][i];
            speed2 += v[d][i] * v[d][i];
        }
        if (speed2 > extremes->speed2) extremes->speed2 = speed2;
    }
}

/* Combine the results of the threads. Maxima and counts do not depend on the order of threads. */
static struct gr_sph_extremes combined(const struct run *run)
{
    const struct gr_sph *s = run->s;
    struct gr_sph_extremes all = s->extremes[0];
    for (int t = 1; t < gr_team_threads(run->team); t++) {
        const struct gr_sph_extremes *f = &s->extremes[t];
        all.speed2 = fmax(all.speed2, f->speed2), all.acceleration2 = fmax(all.acceleration2, f->acceleration2);
        all.gas_speed2 = fmax(all.gas_speed2, f->gas_speed2);
        all.moved2 = fmax(all.moved2, f->moved2), all.stopped += f->stopped;
        all.blocks = all.blocks > f->blocks ? all.blocks : f->blocks;
        for (int d = 0; d < s->config.dim; d++)
            all.low[d] = fmin(all.low[d], f->low[d]), all.high[d] = fmax(all.high[d], f->high[d]);
        if (f->bad >= 0) note_bad(&all, f->bad);
    }
    return all;
}

static void find_gravity(struct gr_sph *s)
{
    const struct gr_sph_config *c = &s->config;
    gr_piecewise(c->dim, c->n_gravity, c->gravity_times, 1, c->gravity_vectors, c->dim, s->time, s->gravity);
}

/* Decide whether there is another step, and its length.
 * Returned: whether there is one. */
static int begin_step(struct run *run)
{
    struct gr_sph *s = run->s;
    if (!(run->steps_left-- > 0 && s->time < run->until)) return 0;
    const double dt = s->config.parameter[GR_SPH_P_dt] > 0 ? s->config.parameter[GR_SPH_P_dt] : gr_sph_stable_dt(s);
    run->is_full = s->inflow && !gr_sph_has_capacity(s, dt);
    if (run->is_full) return 0;
    s->dt = dt, s->time += dt, s->step++;
    if (s->inflow) gr_sph_push(s, dt);
    run->wall_goes = gr_sph_begin_walls(s);
    find_gravity(s);
    return 1;
}

/* True if two points may have become neighbours without being in the list. That takes a displacement of half the skin,
 * and displacements that differ by a skin. */
static int is_old(const struct gr_sph *s, const struct gr_sph_extremes *all)
{
    const double skin = s->config.parameter[GR_SPH_P_skin];
    double spread2 = 0;
    for (int d = 0; d < s->config.dim; d++) spread2 += (all->high[d] - all->low[d]) * (all->high[d] - all->low[d]);
    return 4.0 * all->moved2 >= skin * skin && spread2 >= skin * skin;
}

/* After the points have moved: let others enter, find out whether a new list is needed, and whether a point ran away or is
 * not finite. */
static void look(struct run *run)
{
    struct gr_sph *s = run->s;
    const struct gr_sph_extremes all = combined(run);
    if (all.bad >= 0) {
        s->error = GR_ERR_RUNAWAY, s->error_id = s->id[all.bad];
        for (int d = 0; d < s->config.dim; d++) {
            s->error_x[d] = gr_sph_rows(s, GR_SPH_FIELD_x)[d][all.bad];
            if (!isfinite(s->error_x[d])) s->error = GR_ERR_NOT_FINITE;
        }
    }
    s->stopped += all.stopped;
    const int have_entered = !s->error && s->inflow && gr_sph_enter(s);
    run->rebuilds = !s->error && (have_entered || run->wall_goes || is_old(s, &all));
    if (!run->rebuilds) return;
    gr_sph_sort(s, 1);
    s->rebuilds++;
}

static void over_chunks(struct run *run, gr_chunk_work *work)
{
    gr_team_run(run->team, work, run, gr_chunks(run->team, GR_MAX_CHUNKS));
}

static struct share share_of_chunk(const struct run *run, int64_t c)
{
    return share_of(run->s, c, gr_chunks(run->team, GR_MAX_CHUNKS));
}

static void list_chunk(void *context, int64_t c, int t)
{
    const struct run *run = context;
    struct gr_sph_extremes *extremes = &run->s->extremes[t];
    const int64_t blocks = list_blocks(run->s, share_of_chunk(run, c));
    if (blocks > extremes->blocks) extremes->blocks = blocks;
}

/* Make a new neighbour list. */
static void rebuild(struct run *run)
{
    struct gr_sph *s = run->s;
    for (;;) {
        over_chunks(run, list_chunk);
        const int64_t most = combined(run).blocks;
        if (most <= s->stride) return;
        s->error = gr_sph_widen(s, most); /* the lists are gone */
        if (s->error) return;
    }
}

/* Stages of a step. Those in a row up to one that waits for the results of all before are made together. */
static const struct stage {
    enum gr_sph_stage stage;
    enum kind kind;
    int waits;
} plan[] = {{GR_SPH_DENSITIES, PARTICLES, 1}, {GR_SPH_DENSITIES, WALLS, 0},        {GR_SPH_FILTER, PARTICLES, 1},
            {GR_SPH_FILTER, WALLS, 0},        {GR_SPH_STRESSES, PARTICLES, 1},     {GR_SPH_STRESSES, WALLS, 0},
            {GR_SPH_GAS_VOLUMES, GAS, 0},     {GR_SPH_FORCES, PARTICLES, 1},       {GR_SPH_GAS_FORCES, GAS, 0},
            {GR_SPH_GAS_LOADS, PARTICLES, 0}, {GR_SPH_GAS_SHARES, PARTICLES, 1},   {GR_SPH_GAS_EXCHANGE, GAS, 0},
            {GR_SPH_GAS_DRAG, GAS, 1},        {GR_SPH_GAS_REACTIONS, PARTICLES, 1}};
static const struct stage *const plan_end = plan + sizeof plan / sizeof *plan;

static void stage_chunk(void *context, int64_t c, int t)
{
    const struct run *run = context;
    const struct share share = share_of_chunk(run, c);
    const struct stage *k = run->stage;
    do {
        if (k->stage < GR_SPH_GAS_VOLUMES || run->s->gas)
            run->kernel(run->s, k->stage, share.first[k->kind], share.last[k->kind], &run->s->extremes[t]);
    } while (++k < plan_end && !k->waits);
}

static void kick_chunk(void *context, int64_t c, int t)
{
    const struct run *run = context;
    const struct share share = share_of_chunk(run, c);
    kick(run->s, run->kick_dt, share.first[PARTICLES], share.last[PARTICLES], &run->s->extremes[t]);
    if (run->s->gas) gr_sph_kick_gas(run->s, run->kick_dt, share.first[GAS], share.last[GAS], &run->s->extremes[t]);
}

static void forget(struct run *run)
{
    for (int t = 0; t < gr_team_threads(run->team); t++) run->s->extremes[t] = (struct gr_sph_extremes){.bad = -1};
}

/* Compute densities, stresses and accelerations at the present positions and velocities, and make the second half of a
 * step of length dt. Keep the maxima for the time step limits of the next one. */
static void evaluate(struct run *run, double dt)
{
    struct gr_sph *s = run->s;
    forget(run);
    for (run->stage = plan; run->stage < plan_end; run->stage++)
        if (run->stage->waits && (run->stage->stage < GR_SPH_GAS_VOLUMES || s->gas)) over_chunks(run, stage_chunk);
    if (s->inflow) gr_sph_hold(s, dt);
    run->kick_dt = dt;
    over_chunks(run, kick_chunk);
    const struct gr_sph_extremes all = combined(run);
    s->speed2 = fmax(all.speed2, slow_sound2(s->config.parameter));
    s->acceleration2 = all.acceleration2, s->gas_speed2 = all.gas_speed2;
    s->started = 1;
}

static void drift_chunk(void *context, int64_t c, int t)
{
    const struct run *run = context;
    struct gr_sph *s = run->s;
    const struct share share = share_of_chunk(run, c);
    drift(s, share.first[PARTICLES], share.last[PARTICLES], &s->extremes[t]);
    gr_sph_move_walls(s, share.first[WALLS], share.last[WALLS]);
    if (s->gas) gr_sph_drift_gas(s, share.first[GAS], share.last[GAS]);
    for (int k = 0; k < KINDS; k++) measure(s, share.first[k], share.last[k], &s->extremes[t]);
}

static void make_steps(void *context, struct gr_team *team)
{
    struct run *run = context;
    struct gr_sph *s = run->s;
    run->team = team;
    if (!s->started) evaluate(run, 0.0); /* accelerations and speeds of the initial state */
    while (begin_step(run)) {
        forget(run);
        over_chunks(run, drift_chunk);
        look(run);
        if (!s->error && run->rebuilds) rebuild(run);
        if (s->error) return;
        evaluate(run, s->dt);
    }
}

/* Compute the stresses of the last step for output; the steps themselves use sigma/rho^2. */
static void show_stresses(struct gr_sph *s)
{
    double *const *stress = gr_sph_rows(s, GR_SPH_FIELD_stress);
    const double *rho = gr_sph_rows(s, GR_SPH_FIELD_rho)[0];
    const struct share all = share_of(s, 0, 1);
    for (int kind = PARTICLES; kind <= WALLS; kind++)
        for (int k = 0; k < gr_sph_components(s, GR_SPH_FIELD_stress); k++)
            for (int64_t a = all.first[kind]; a < all.last[kind]; a++) stress[k][a] = rho[a] * rho[a] * s->pull[k][a];
}

int gr_sph_advance(struct gr_sph *s, gr_sph_kernel *kernel, int64_t max_steps, double until, int threads)
{
    struct run run = {.s = s, .kernel = kernel, .until = until, .steps_left = max_steps};
    const int64_t step = s->step, started = s->started;
    if (s->error) return s->error;
    if (!started) find_gravity(s);
    s->refused_threads = threads - gr_team_lead(threads, make_steps, &run);
    if (!s->error && (s->step > step || !started)) show_stresses(s);
    return !s->error && run.is_full ? GR_ERR_CAPACITY : s->error;
}
