/* Tests of sph/: the neighbour list, the limits of the time step, walls, and allocations that fail. */
#include "sph/sph.h"

#include <math.h>
#include <string.h>

#include "core/simd.h"
#include "kernels.h"
#include "mpm/engine.h"
#include "sph/gas.h"
#include "sph/inflow.h"
#include "tests/check.h"
#include "tests/faults.h"

enum { SIDE = 8, PARTICLES = SIDE * SIDE, WALL_FIRST = PARTICLES + 2 * GR_LANES, WALLS = 3 * SIDE };
enum { CAPACITY = WALL_FIRST + WALLS + 2 * GR_LANES, MOST = 100 };

static const double spacing = 0.01;

/* A square of particles over a floor of three rows, periodic along x. */
struct bed {
    struct gr_sph_config config;
    double times[1], vectors[2], numbers[32 * CAPACITY], *row[GR_SPH_MAX_ROWS];
    int64_t id[CAPACITY];
};

static void begin(struct bed *bed, double shake)
{
    memset(bed, 0, sizeof *bed);
    const double length = SIDE * spacing;
    bed->vectors[1] = -9.81;
    bed->config = (struct gr_sph_config){.dim = 2,
                                         .periodic = {1, 0, 0},
                                         .upper = {length, 2 * length, 0},
                                         .parameter = {[GR_SPH_P_h] = 1.2 * spacing,
                                                       [GR_SPH_P_skin] = 0.3 * spacing,
                                                       [GR_SPH_P_rho0] = 1550,
                                                       [GR_SPH_P_rho0_wall] = 1500,
                                                       [GR_SPH_P_kappa] = 1e5,
                                                       [GR_SPH_P_mu_l] = 0.27,
                                                       [GR_SPH_P_mu_h] = 0.58,
                                                       [GR_SPH_P_D_star] = 20,
                                                       [GR_SPH_P_shear_modulus] = 1.5e4,
                                                       [GR_SPH_P_dilation] = 0.5,
                                                       [GR_SPH_P_regularisation] = 1,
                                                       [GR_SPH_P_z_max] = 1.5,
                                                       [GR_SPH_P_gradient] = 0.991,
                                                       [GR_SPH_P_cfl] = 1},
                                         .n_gravity = 1,
                                         .gravity_times = bed->times,
                                         .gravity_vectors = bed->vectors};
    for (int r = 0; r < 32; r++) bed->row[r] = bed->numbers + r * CAPACITY;
    unsigned state = 7;
    for (int k = 0; k < CAPACITY; k++) {
        const int wall = k >= WALL_FIRST, n = wall ? k - WALL_FIRST : k;
        bed->id[k] = -1;
        if (n >= (wall ? WALLS : PARTICLES)) continue;
        bed->id[k] = wall ? PARTICLES + n : n;
        for (int d = 0; d < 2; d++) {
            state = state * 1664525u + 1013904223u;
            const double noise = wall ? 0.0 : shake * spacing * ((double)(state >> 8) / (1 << 24) - 0.5);
            const int site = d ? n / SIDE : n % SIDE;
            bed->row[d][k] = (d && wall ? -(site + 0.5) : site + 0.5) * spacing + noise;
        }
        bed->row[6][k] = 1550 * spacing * spacing; /* mass, after x, v and anchor */
        bed->row[12][k] = wall;                    /* y component of the normal, after the elastic stress */
        bed->row[13][k] = wall ? (n / SIDE + 0.5) * spacing : 0;
    }
}

static struct gr_sph *built(struct bed *bed)
{
    struct gr_sph *s = NULL;
    CHECK(gr_sph_new(&s, &bed->config, gr_kernels_select("")->lanes) == GR_OK);
    CHECK(gr_sph_bind(s, bed->row, bed->id, CAPACITY, PARTICLES, WALL_FIRST, WALLS, 1) == GR_OK);
    return s;
}

static struct gr_sph *started(struct bed *bed, double shake)
{
    begin(bed, shake);
    return built(bed);
}

/* Every pair within reach is once in the list of each point, and no row is twice there as the same image. */
TEST(list_holds_every_pair_once)
{
    static struct bed bed;
    struct gr_sph *s = started(&bed, 0.9);
    for (int64_t a = 0; a < PARTICLES; a++)
        for (int64_t b = 0; b < CAPACITY; b++)
            for (int image = 0; image < GR_SPH_SHIFTS; image++) {
                if (bed.id[b] < 0 || image / 9 != 1 || image / 3 % 3 != 1) continue;
                int listed = 0;
                for (int64_t k = s->begin[a]; k < s->end[a]; k++)
                    listed += s->block[k].shift == image && b >= s->block[k].row && b < s->block[k].row + s->lanes;
                double r2 = 0;
                for (int d = 0; d < 2; d++) {
                    const double r = bed.row[d][b] + s->shift[image][d] - bed.row[d][a];
                    r2 += r * r;
                }
                CHECK(listed <= 1);
                if (r2 <= s->reach * s->reach) CHECK(listed == 1);
            }
    gr_sph_free(s);
}

TEST(time_step_is_the_smaller_limit)
{
    static struct bed bed;
    struct gr_sph *s = started(&bed, 0.0);
    const double h = 1.2 * spacing;
    s->speed2 = 100, s->acceleration2 = 0;
    CHECK_NEAR(gr_sph_stable_dt(s), 0.25 * h / 10, 1e-15);
    s->acceleration2 = 1e12;
    CHECK_NEAR(gr_sph_stable_dt(s), 0.25 * sqrt(h / 1e6), 1e-15);
    gr_sph_free(s);
}

TEST(wrong_configurations_are_refused)
{
    static struct bed bed;
    struct gr_sph *s;
    begin(&bed, 0.0);
    bed.config.upper[0] = 2 * spacing; /* a period shorter than the list reaches */
    CHECK(gr_sph_new(&s, &bed.config, 8) == GR_ERR_CONFIG && !s);
    begin(&bed, 0.0);
    bed.config.upper[1] = 1e9; /* too many cells */
    CHECK(gr_sph_new(&s, &bed.config, 8) == GR_ERR_CONFIG && !s);
    s = started(&bed, 0.0);
    CHECK(gr_sph_bind(s, bed.row, bed.id, CAPACITY, WALL_FIRST, WALL_FIRST, WALLS, 1) == GR_ERR_CONFIG);
    CHECK(gr_sph_bind(s, bed.row, bed.id, CAPACITY, PARTICLES, WALL_FIRST, CAPACITY, 1) == GR_ERR_CONFIG);
    gr_sph_free(s);
}

TEST(allocations_fail)
{
    static struct bed bed;
    long n = 0;
    int error;
    do {
        struct gr_sph *s = NULL;
        begin(&bed, 0.3);
        faults_at(++n);
        error = gr_sph_new(&s, &bed.config, gr_kernels_select("")->lanes);
        if (!error) error = gr_sph_bind(s, bed.row, bed.id, CAPACITY, PARTICLES, WALL_FIRST, WALLS, 1);
        const int hit = faults_end();
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        gr_sph_free(s);
    } while (error && n < MOST);
    CHECK(n > 8 && n < MOST);
}

/* Steps with one thread and with three threads give the same bits, and allocate nothing. */
TEST(steps_do_not_allocate)
{
    static struct bed bed[2];
    const struct gr_kernels *kernels = gr_kernels_select("");
    for (int k = 0; k < 2; k++) {
        struct gr_sph *s = started(&bed[k], 0.5);
        CHECK(gr_sph_advance(s, kernels->sph, 200, 1e9, 1 + 2 * k) == GR_OK);
        const int64_t rebuilds = s->rebuilds;
        faults_at(MOST);
        CHECK(gr_sph_advance(s, kernels->sph, 200, 1e9, 1) == GR_OK);
        if (k == 0) CHECK(faults_calls() == 0);
        faults_at(0);
        CHECK(s->step == 400 && s->rebuilds > rebuilds && s->n_particles == PARTICLES);
        gr_sph_free(s);
    }
    CHECK(!memcmp(bed[0].numbers, bed[1].numbers, sizeof bed[0].numbers));
}

/* A floor that is at rest, sinks from one time on and is removed at another, with steps of any length. */
TEST(walls_move_and_are_removed)
{
    static struct bed bed;
    const struct gr_kernels *kernels = gr_kernels_select("");
    const double from = 0.0123, until = 0.05, speed = -0.1;
    begin(&bed, 0.0);
    bed.config.n_walls = 1;
    bed.config.wall[0] = (struct gr_sph_wall){.lower = {-INFINITY, -3 * spacing},
                                              .upper = {INFINITY, 0},
                                              .v = {0, speed},
                                              .from = from,
                                              .until = until,
                                              .axis = 1};
    struct gr_sph *s = built(&bed);
    double *const *x = gr_sph_rows(s, GR_SPH_FIELD_x), *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    double highest = -1;
    CHECK(gr_sph_advance(s, kernels->sph, 1000, 0.97 * from, 3) == GR_OK);
    for (int a = WALL_FIRST; a < WALL_FIRST + WALLS; a++) highest = fmax(highest, x[1][a]);
    CHECK_NEAR(highest, -0.5 * spacing, 1e-15);
    CHECK(gr_sph_advance(s, kernels->sph, 1000, 0.03, 3) == GR_OK);
    highest = -1;
    for (int a = WALL_FIRST; a < WALL_FIRST + WALLS; a++) highest = fmax(highest, x[1][a]);
    CHECK_NEAR(highest, -0.5 * spacing + speed * (s->time - from), 1e-14);
    CHECK(v[1][WALL_FIRST] == speed && s->n_walls == WALLS);
    CHECK(gr_sph_advance(s, kernels->sph, 1000, 1.01 * until, 3) == GR_OK);
    CHECK(s->n_walls == 0 && s->n_particles == PARTICLES);
    gr_sph_free(s);
}

/* A particle that enters a wall through a face is put back on it; one that was inside stays. */
TEST(walls_stop_particles)
{
    static struct bed bed;
    struct gr_sph *s = started(&bed, 0.0);
    double *const *x = gr_sph_rows(s, GR_SPH_FIELD_x), *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    s->config.n_walls = 1;
    s->config.wall[0] = (struct gr_sph_wall){
        .lower = {-INFINITY, -3 * spacing}, .upper = {INFINITY, 0}, .from = INFINITY, .until = INFINITY, .axis = 1};
    s->dt = 1e-3;
    x[1][0] = -0.2 * spacing, v[1][0] = -3.0, v[0][0] = 0.5; /* came from above */
    x[1][1] = -0.2 * spacing, v[1][1] = 0.0;                 /* was inside */
    CHECK(gr_sph_stop(s, 0, PARTICLES) == 1);
    CHECK(x[1][0] == 0.0 && v[1][0] == 0.0 && v[0][0] == 0.0); /* 0.27 of 3 m/s exceeds 0.5 m/s */
    CHECK(x[1][1] == -0.2 * spacing);
    x[1][0] = -0.05 * spacing, v[1][0] = -1.0, v[0][0] = 0.5;
    CHECK(gr_sph_stop(s, 0, PARTICLES) == 1);
    CHECK_NEAR(v[0][0], 0.5 - 0.27, 1e-15);
    s->config.wall[0].until = 0.0;
    x[1][0] = -0.2 * spacing, v[1][0] = -3.0;
    CHECK(gr_sph_stop(s, 0, PARTICLES) == 0);
    gr_sph_free(s);
}

enum { SITES = 4, WIDE = 32 };

/* An inlet above the bed, whose box is empty at the start: particles enter at 0.15 m and fall with 0.5 m/s. */
static int with_inlet(struct gr_sph *s, double *record)
{
    const int n = gr_sph_row_count(s);
    memset(record, 0, sizeof *record * (size_t)(SITES * WIDE));
    for (int i = 0; i < SITES; i++) {
        record[i * n] = (2.5 + i) * spacing, record[i * n + 1] = 0.15;
        record[i * n + 3] = -0.5, record[i * n + 6] = 1550 * spacing * spacing;
    }
    const struct gr_inlet inlet = {
        .n_sites = SITES, .axis = 1, .velocity = {0, -0.5}, .spacing = spacing, .end = INFINITY, .record = record};
    const struct gr_sph_box box = {.lower = {2 * spacing, 0.12}, .upper = {6 * spacing, 0.15}};
    return gr_sph_add_inlet(s, &inlet, &box);
}

static struct gr_sph *fed(struct bed *bed, double *record)
{
    struct gr_sph *s = NULL;
    begin(bed, 0.0);
    CHECK(gr_sph_new(&s, &bed->config, gr_kernels_select("")->lanes) == GR_OK);
    CHECK(with_inlet(s, record) == GR_OK);
    CHECK(gr_sph_bind(s, bed->row, bed->id, CAPACITY, PARTICLES, WALL_FIRST, WALLS, 1) == GR_OK);
    s->inflow->inlets->next_id = PARTICLES + WALLS;
    return s;
}

/* Particles enter as they are due and move with the inlet as long as they are in its box. When the rows are full a run
 * stops before the next step; with larger ones it goes on to the bits of one that had them from the start, with any
 * threads. */
TEST(particles_enter_until_the_rows_are_full)
{
    static struct bed bed[2];
    static double record[SITES * WIDE];
    const struct gr_kernels *kernels = gr_kernels_select("");
    struct gr_sph *s = fed(&bed[0], record), *other = fed(&bed[1], record);
    CHECK(gr_sph_advance(s, kernels->sph, 10000, 1e9, 1) == GR_ERR_CAPACITY);
    CHECK(gr_sph_advance(s, kernels->sph, 10000, 1e9, 1) == GR_ERR_CAPACITY && s->error == GR_OK);
    CHECK(gr_sph_advance(other, kernels->sph, s->step, 1e9, 3) == GR_OK && other->step == s->step);
    CHECK(s->n_particles > PARTICLES + SITES && s->n_particles <= WALL_FIRST - GR_LANES);
    CHECK(s->n_particles - PARTICLES == (int64_t)(s->time * 0.5 / spacing * SITES));
    CHECK(s->inflow->n_held > SITES && s->inflow->inlets->next_id == s->n_particles + WALLS);
    for (int64_t i = 0; i < s->inflow->n_held; i++) CHECK(bed[0].row[3][s->inflow->held[i]] == -0.5);
    CHECK(!memcmp(bed[0].numbers, bed[1].numbers, sizeof bed[0].numbers));
    CHECK(!memcmp(s->inflow->box, other->inflow->box, sizeof *s->inflow->box));
    gr_sph_free(s), gr_sph_free(other);
}

TEST(inlets_fail_or_are_refused)
{
    static struct bed bed;
    static double record[SITES * WIDE];
    long n = 0;
    int error;
    do {
        struct gr_sph *s = NULL;
        begin(&bed, 0.0);
        CHECK(gr_sph_new(&s, &bed.config, gr_kernels_select("")->lanes) == GR_OK);
        faults_at(++n);
        error = with_inlet(s, record);
        if (!error) error = gr_sph_bind(s, bed.row, bed.id, CAPACITY, PARTICLES, WALL_FIRST, WALLS, 1);
        const int hit = faults_end();
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        if (!error) CHECK(with_inlet(s, record) == GR_ERR_CONFIG); /* bound */
        gr_sph_free(s);
    } while (error && n < MOST);
    CHECK(n > 6 && n < MOST);
    struct gr_sph *s = NULL;
    CHECK(gr_sph_new(&s, &bed.config, gr_kernels_select("")->lanes) == GR_OK);
    struct gr_inlet inlet = {.n_sites = 1, .axis = 1, .velocity = {0, -1}, .spacing = 1, .end = 1, .record = record};
    struct gr_sph_box box = {.upper = {1, 1}};
    inlet.yields = 1; /* nothing waits */
    CHECK(gr_sph_add_inlet(s, &inlet, &box) == GR_ERR_CONFIG);
    inlet.yields = 0, box.is_gas = 1; /* no gas */
    CHECK(gr_sph_add_inlet(s, &inlet, &box) == GR_ERR_CONFIG);
    box.is_gas = 0, box.lower[0] = 1;
    CHECK(gr_sph_add_inlet(s, &inlet, &box) == GR_ERR_CONFIG);
    box.lower[0] = 0, record[6] = 0;
    CHECK(gr_sph_add_inlet(s, &inlet, &box) == GR_ERR_CONFIG);
    gr_sph_free(s);
}
