/* Tests of mpm/step.c: equal bits for any number of threads, the clock, and runs that fail. */
#include "engine/stable_dt.h"

#include "tests/check.h"
#include "tests/scene.h"

/* Advance to a time, with larger buffers when they are required. */
static int go(struct scene *s, int64_t steps, double until, int threads)
{
    int error;
    const int64_t target = s->engine->clock.step + steps;
    do {
        error = gr_advance(s->engine, gr_kernels_select(""), target - s->engine->clock.step, until, threads);
        if (error == GR_ERR_CAPACITY && scene_grow(s)) return GR_ERR_MEMORY;
        if (error == GR_ERR_CAPACITY && gr_regroup(s->engine, NULL)) return GR_ERR_MEMORY;
    } while (error == GR_ERR_CAPACITY);
    return error;
}

/* A heap that falls onto a no-slip floor, with an open right side through which points leave; with `rings` about an axis at
 * the left side. */
static void falling_about(struct scene *s, int dim, int basis, int affine, int smoothed, int rings)
{
    scene_seed(61);
    scene_default(s, dim, basis, affine, smoothed);
    s->gravity_vectors[dim - 1] = -9.8;
    s->config.open_high[0] = 1;
    s->walls[1] = (struct gr_wall){.fixed = (1 << dim) - 1, .opens_at = INFINITY};
    s->walls[2] = (struct gr_wall){.fixed = 1, .opens_at = INFINITY};
    s->config.n_walls = 3;
    s->config.axisymmetric = rings;
    if (rings) s->config.lower[0] = 0;
    scene_codes(s);
    if (rings) scene_face(s, 0, 0, 2);
    scene_face(s, dim - 1, 0, 1);
    CHECK(scene_build(s, 500, 0.02, 0.95) == GR_OK);
}

static void falling(struct scene *s, int dim, int basis, int affine, int smoothed)
{
    falling_about(s, dim, basis, affine, smoothed, 0);
}

TEST(threads_give_the_same_bits)
{
    for (int dim = 2; dim <= 3; dim++)
        for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
            for (int variant = 0; variant < 3; variant++) {
                const int affine = variant == 0 ? GR_AFFINE_NONE : variant == 1 ? GR_AFFINE_MOMENT : GR_AFFINE_GRADIENT;
                struct scene s[4];
                for (int k = 0; k < 4; k++) {
                    falling(&s[k], dim, basis, affine, variant == 2 && basis == GR_QUADRATIC);
                    CHECK(go(&s[k], 150, INFINITY, k + 1) == GR_OK);
                    CHECK(s[k].engine->clock.step == 150 && s[k].engine->clock.time == s[0].engine->clock.time);
                    CHECK(s[k].engine->dropped == s[0].engine->dropped &&
                          s[k].engine->dropped_mass == s[0].engine->dropped_mass);
                    if (k) CHECK(!scene_differs(&s[0], &s[k]));
                }
                if (basis == GR_LINEAR && dim == 2) CHECK(s[0].engine->dropped > 0);
                for (int k = 0; k < 4; k++) scene_free(&s[k]);
            }
}

TEST(threads_give_the_same_bits_of_rings)
{
    static const int bases[] = {GR_LINEAR, GR_QUADRATIC};
    for (int b = 0; b < 2; b++)
        for (int smoothed = 0; smoothed <= b; smoothed++) {
            struct scene s[2];
            for (int k = 0; k < 2; k++) {
                falling_about(&s[k], 2, bases[b], GR_AFFINE_GRADIENT, smoothed, 1);
                CHECK(go(&s[k], 150, INFINITY, 3 * k + 1) == GR_OK && s[k].engine->mesh.node_radius);
            }
            CHECK(!scene_differs(&s[0], &s[1]));
            for (int k = 0; k < 2; k++) scene_free(&s[k]);
        }
}

/* Calls of any length, with sums computed again in between, do not change the result. */
TEST(calls_give_the_same_bits)
{
    struct scene a, b;
    falling(&a, 2, GR_QUADRATIC, GR_AFFINE_GRADIENT, 1);
    falling(&b, 2, GR_QUADRATIC, GR_AFFINE_GRADIENT, 1);
    CHECK(go(&a, 100, INFINITY, 2) == GR_OK);
    for (int k = 1; b.engine->clock.step < 100; k++) {
        CHECK(go(&b, k, INFINITY, 1 + k % 3) == GR_OK);
        if (b.engine->clock.step + k + 1 > 100) CHECK(go(&b, 100 - b.engine->clock.step, INFINITY, 1) == GR_OK);
        b.engine->sums.valid = 0;
    }
    CHECK(b.engine->clock.step == 100 && a.engine->clock.time == b.engine->clock.time);
    CHECK(!scene_differs(&a, &b));
    scene_free(&a);
    scene_free(&b);
}

TEST(stops_at_the_first_step_past)
{
    struct scene s;
    falling(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    CHECK(go(&s, 1000000, 0.01, 1) == GR_OK);
    CHECK(s.engine->clock.time >= 0.01 && s.engine->clock.time - s.engine->clock.dt < 0.01);
    const int64_t steps = s.engine->clock.step;
    CHECK(go(&s, 1000, 0.01, 1) == GR_OK); /* this time is already reached */
    CHECK(go(&s, 0, INFINITY, 1) == GR_OK);
    CHECK(s.engine->clock.step == steps);
    scene_free(&s);
}

/* With a fixed step the time is a product, not an accumulated sum. */
TEST(time_does_not_drift)
{
    struct scene s;
    scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    s.config.dt = 1e-5;
    CHECK(scene_build(&s, 4, 0.45, 0.55) == GR_OK);
    for (int64_t k = 0; k < s.capacity; k++)
        for (int d = 0; d < 2; d++) *scene_at(&s, GR_FIELD_v, d, k) = 0;
    for (int64_t k = 0; k < s.capacity; k++)
        for (int c = 0; c < 4; c++) *scene_at(&s, GR_FIELD_stress, c, k) = 0;
    CHECK(go(&s, 3000, INFINITY, 1) == GR_OK);
    CHECK_NEAR(s.engine->clock.time, 3000 * 1e-5, 0);
    scene_free(&s);
}

TEST(stable_dt_follows_the_fastest)
{
    struct scene s;
    falling(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    CHECK(gr_regroup(s.engine, NULL) == GR_OK);
    double fastest = 0;
    for (int64_t k = 0; k < s.capacity; k++)
        if (s.id[k] >= 0) fastest = fmax(fastest, hypot(*scene_at(&s, GR_FIELD_v, 0, k), *scene_at(&s, GR_FIELD_v, 1, k)));
    CHECK_NEAR(gr_stable_dt(s.engine, NULL), 0.4 * 0.1 / (s.config.wave_speed + fastest), 1e-18);
    scene_free(&s);
}

/* The mass is exact, and the momentum of free flight grows by gravity alone. */
TEST(conserves)
{
    struct scene s;
    scene_seed(67);
    scene_default(&s, 2, GR_QUADRATIC, GR_AFFINE_MOMENT, 0);
    s.config.periodic[0] = s.config.periodic[1] = 1;
    s.config.dt = 1e-4;
    s.gravity_vectors[0] = 3;
    CHECK(scene_build(&s, 500, 0, 1) == GR_OK);
    double p[2][2] = {{0}}, mass[2] = {0};
    for (int when = 0; when < 2; when++) {
        for (int64_t id = 0; id < 500; id++) {
            const int64_t k = scene_find(&s, id);
            const double m = *scene_at(&s, GR_FIELD_mass, 0, k);
            mass[when] += m;
            for (int d = 0; d < 2; d++) p[when][d] += m * *scene_at(&s, GR_FIELD_v, d, k);
        }
        if (!when) CHECK(go(&s, 500, INFINITY, 2) == GR_OK);
    }
    CHECK(mass[0] == mass[1]);
    CHECK_NEAR(p[1][0] - p[0][0], mass[0] * 3 * s.engine->clock.time, 1e-11 * mass[0]);
    CHECK_NEAR(p[1][1], p[0][1], 1e-11 * mass[0]);
    scene_free(&s);
}

/* A NaN in any field stops the run within ten steps and names a point; a further call does so again. */
TEST(nan_stops_the_run)
{
    const int fields[] = {GR_FIELD_x, GR_FIELD_v, GR_FIELD_stress, GR_FIELD_mass, GR_FIELD_log_density};
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int k = 0; k < 5; k++) {
            struct scene s;
            scene_seed(71);
            scene_default(&s, 2, basis, GR_AFFINE_NONE, 0);
            s.config.material[0].law = gr_law_index("elastic");
            CHECK(scene_build(&s, 300, 0.1, 0.9) == GR_OK);
            CHECK(go(&s, 5, INFINITY, 1) == GR_OK);
            *scene_at(&s, fields[k], 0, scene_find(&s, 120)) = NAN;
            s.engine->sums.valid = 0;
            for (int again = 0; again < 30; again++) {
                const int error = go(&s, 10, INFINITY, 1 + again % 2);
                CHECK(error == GR_ERR_NOT_FINITE || error == GR_ERR_RUNAWAY);
                CHECK(s.engine->failure.id >= 0 && s.engine->failure.id < 300);
                CHECK(s.engine->clock.step <= 15);
                CHECK(s.engine->points.n == 300);
            }
            scene_free(&s);
        }
}

TEST(runaway_stops_the_run)
{
    struct scene s;
    scene_seed(73);
    scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    s.config.dt = 1e-4;
    CHECK(scene_build(&s, 300, 0.3, 0.7) == GR_OK);
    CHECK(go(&s, 2, INFINITY, 1) == GR_OK);
    for (int64_t k = 0; k < s.capacity; k++)
        if (s.id[k] >= 0) *scene_at(&s, GR_FIELD_v, 0, k) = 1e5;
    s.engine->sums.valid = 0;
    CHECK(go(&s, 10, INFINITY, 1) == GR_ERR_RUNAWAY);
    CHECK(s.engine->clock.step == 2 && s.engine->failure.step == 2);
    scene_free(&s);
}

/* Without points only the clock runs, with the time step of a medium at rest. */
TEST(empty_run)
{
    struct scene s;
    const struct gr_kernels *kernels = gr_kernels_select("");
    scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    CHECK(scene_build(&s, 0, 0.1, 0.9) == GR_OK);
    const double dt = s.config.cfl * s.config.dx / s.config.wave_speed;
    CHECK(gr_advance(s.engine, kernels, 5, INFINITY, 3) == GR_OK);
    CHECK(s.engine->clock.step == 5 && s.engine->clock.dt == dt);
    CHECK(gr_advance(s.engine, kernels, 1000000, 100 * dt, 3) == GR_OK);
    CHECK(s.engine->clock.time >= 100 * dt && s.engine->clock.time < 101 * dt);
    CHECK(gr_p2g(s.engine, kernels) == GR_OK);
    CHECK(gr_grid(s.engine, kernels) == GR_OK);
    scene_free(&s);
}

/* When all points have left, the cells vanish too, and the clock is not affected. */
TEST(emptied_run)
{
    struct scene whole, cut;
    for (int part = 0; part < 2; part++) {
        struct scene *s = part ? &cut : &whole;
        scene_seed(67);
        scene_default(s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
        s->config.open_high[0] = 1;
        s->gravity_vectors[0] = 50;
        CHECK(scene_build(s, 40, 0.7, 0.95) == GR_OK);
        for (int64_t k = 0; part && k < 400; k++) CHECK(go(s, 5, INFINITY, 1 + (int)(k % 2)) == GR_OK);
        if (!part) CHECK(go(s, 2000, INFINITY, 1) == GR_OK);
    }
    CHECK(whole.engine->points.n == 0 && whole.engine->dropped == 40);
    CHECK(whole.engine->mesh.n_cells == 0 && cut.engine->mesh.n_cells == 0);
    CHECK(whole.engine->clock.step == 2000 && cut.engine->clock.step == 2000 &&
          whole.engine->clock.time == cut.engine->clock.time);
    scene_free(&whole);
    scene_free(&cut);
}

/* Advancing again without the larger buffers that are required must neither break anything nor lose a point. */
TEST(capacity_may_be_refused)
{
    struct scene s;
    scene_seed(79);
    scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    s.config.dt = 1e-3;
    CHECK(scene_build(&s, 300, 0.02, 0.98) == GR_OK);
    for (int64_t k = 0; k < 300; k++) { /* disconnected points that fly together into a few cells */
        *scene_at(&s, GR_FIELD_log_density, 0, k) = -5;
        for (int c = 0; c < 4; c++) *scene_at(&s, GR_FIELD_stress, c, k) = 0;
        for (int d = 0; d < 2; d++)
            *scene_at(&s, GR_FIELD_v, d, k) = -14 * (*scene_at(&s, GR_FIELD_x, d, k) - (d ? 2.3 : -0.7));
    }
    CHECK(gr_regroup(s.engine, NULL) == GR_OK);
    const int64_t stride = s.capacity, used = s.engine->points.used;
    for (int f = 0; f < GR_FIELD_COUNT; f++) /* move the components together: no slot beyond those in use */
        for (int c = 1; s.field[f] && c < gr_field_components(f, 2); c++)
            for (int64_t k = 0; k < used; k++) s.field[f][c * used + k] = s.field[f][c * stride + k];
    s.capacity = used;
    scene_bind(&s);
    int refused = 0;
    for (int k = 0; k < 60; k++) {
        const int error = gr_advance(s.engine, gr_kernels_select(""), 1, INFINITY, 1);
        CHECK(error == GR_OK || error == GR_ERR_CAPACITY);
        CHECK(s.engine->points.n == 300);
        refused += error == GR_ERR_CAPACITY;
    }
    CHECK(refused > 1);
    if (refused) CHECK(scene_grow(&s) == 0);
    CHECK(gr_regroup(s.engine, NULL) == GR_OK);
    for (int64_t id = 0; id < 300; id++) CHECK(scene_find(&s, id) >= 0);
    scene_free(&s);
}
