/* Tests of failing allocations: at the n-th call an error is returned, nothing leaks, and the engine still works
 * afterwards. */
#include <string.h>

#include "mpm/engine.h"
#include "tests/check.h"
#include "tests/faults.h"
#include "tests/scene.h"

enum { MOST = 300 };

/* Kinds of scenes that allocate differently. */
enum { PLAIN, NONLOCAL, BODIES, NONLOCAL_BODIES, KINDS };

/* A thick box and a thin one with two sides, both moving. */
static void give_bodies(struct gr_config *c)
{
    static const double motion[] = {0, 0.5, 0, 0, 0, 0, 0};
    static const struct gr_part parts[] = {
        {.kind = GR_PART_BOX, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .size = {0.15, 0.15, INFINITY}},
        {.kind = GR_PART_BOX, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .size = {0.01, 0.2, INFINITY}}};
    static struct gr_body bodies[2];
    for (int b = 0; b < 2; b++)
        bodies[b] = (struct gr_body){.first_part = b,
                                     .n_parts = 1,
                                     .contact = GR_CONTACT_SEPARATING,
                                     .bound = 0.3,
                                     .extent = {0.3, 0.3, 0.3},
                                     .position = {b ? -0.55 : -0.8, 2.3, 0},
                                     .orientation = {1, 0, 0, 0},
                                     .n_motion = 1,
                                     .motion = motion};
    c->n_bodies = c->n_parts = 2, c->bodies = bodies, c->parts = parts;
}

static void config(struct scene *s, int basis, int kind)
{
    scene_seed(83);
    scene_default(s, 2, basis, GR_AFFINE_NONE, 0);
    if (kind == NONLOCAL || kind == NONLOCAL_BODIES) scene_nonlocal(s);
    if (kind == BODIES || kind == NONLOCAL_BODIES) give_bodies(&s->config);
}

TEST(axis_build_fails)
{
    const int32_t c0_lines[] = {2, 3};
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++) {
        long n = 0;
        int error;
        do {
            struct gr_axis axis;
            faults_at(++n);
            error = gr_axis_build(&axis, basis, 6, 0, c0_lines, 2, 0.25, 0, 1);
            const int hit = faults_end();
            CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
            if (error) CHECK(!axis.cell && !axis.node_position && !axis.node_integral);
            gr_axis_free(&axis);
        } while (error && n < MOST);
        CHECK(n > 3 && n < MOST);
    }
}

TEST(engine_new_fails)
{
    for (int kind = 0; kind < KINDS; kind++) {
        long n = 0;
        int error;
        do {
            struct scene s;
            struct gr_engine *e = NULL;
            uint8_t flags[36] = {[8] = GR_CELL_SOLID};
            config(&s, GR_QUADRATIC, kind);
            scene_codes(&s);
            s.config.walls = s.walls;
            s.config.node_codes = scene_map(&s, s.codes, 1), s.config.cell_flags = scene_map(&s, flags, 0);
            s.config.gravity_times = s.gravity_times, s.config.gravity_vectors = s.gravity_vectors;
            faults_at(++n);
            error = gr_engine_new(&e, &s.config);
            const int hit = faults_end();
            CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK) && !e == !!error);
            gr_engine_free(e);
            scene_free(&s);
        } while (error && n < MOST);
        CHECK(n > 10 && n < MOST);
    }
}

/* Regroup with a fault, then without: the points are the same as in an engine that never failed. */
TEST(regroup_fails)
{
    for (int moved = 0; moved < 2; moved++)
        for (int kind = 0; kind < KINDS; kind++) {
            long n = 0;
            int error;
            struct scene good;
            const struct gr_kernels *kernels = gr_kernels_select("baseline");
            config(&good, GR_QUADRATIC, kind);
            CHECK(scene_build(&good, 300, 0.3, 0.5) == GR_OK);
            if (moved) CHECK(gr_advance(good.engine, kernels, 20, INFINITY, 1) == GR_OK);
            CHECK(gr_regroup(good.engine, NULL) == GR_OK);
            CHECK(gr_advance(good.engine, kernels, 30, INFINITY, 1) == GR_OK);
            do {
                struct scene s;
                config(&s, GR_QUADRATIC, kind);
                CHECK(scene_build(&s, 300, 0.3, 0.5) == GR_OK);
                if (moved) CHECK(gr_advance(s.engine, kernels, 20, INFINITY, 1) == GR_OK);
                faults_at(++n);
                error = gr_regroup(s.engine, NULL);
                const int hit = faults_end();
                CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
                CHECK(s.engine->points.n == 300);
                CHECK(gr_regroup(s.engine, NULL) == GR_OK);
                CHECK(gr_advance(s.engine, kernels, 30, INFINITY, 1) == GR_OK);
                CHECK(!scene_differs(&good, &s));
                scene_free(&s);
            } while (error && n < MOST);
            CHECK(n > 6 && n < MOST);
            scene_free(&good);
        }
}

/* Throw all points into cells that are not active yet. */
static void throw_all(struct scene *s)
{
    for (int64_t k = 0; k < s->capacity; k++)
        if (s->id[k] >= 0) *scene_at(s, GR_FIELD_v, 0, k) = 5;
}

/* Advance with a fault, then again: the points are the same as without a fault, wherever it occurred. */
TEST(advance_fails)
{
    for (int kind = 0; kind < KINDS; kind++) {
        enum { STEPS = 30 };
        long n = 0;
        int error, hit, within = 0;
        struct scene good;
        const struct gr_kernels *kernels = gr_kernels_select("baseline");
        config(&good, GR_LINEAR, kind);
        CHECK(scene_build(&good, 300, 0.3, 0.5) == GR_OK);
        throw_all(&good);
        CHECK(gr_advance(good.engine, kernels, STEPS, INFINITY, 1) == GR_OK);
        do {
            struct scene s;
            config(&s, GR_LINEAR, kind);
            CHECK(scene_build(&s, 300, 0.3, 0.5) == GR_OK);
            throw_all(&s);
            faults_at(++n);
            error = gr_advance(s.engine, kernels, STEPS, INFINITY, 1);
            hit = faults_end();
            CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
            CHECK(s.engine->points.n == 300);
            within += hit && s.engine->clock.step > 0;
            CHECK(gr_advance(s.engine, kernels, STEPS - s.engine->clock.step, INFINITY, 1) == GR_OK);
            CHECK(s.engine->clock.step == STEPS && s.engine->clock.time == good.engine->clock.time);
            CHECK(!scene_differs(&good, &s));
            scene_free(&s);
        } while (hit && n < MOST);
        CHECK(n > 6 && n < MOST);
        CHECK(within > 0); /* there was a regrouping on the way */
        scene_free(&good);
    }
}

/* Count the points per cell, to check that some have moved. */
static void count_cells(const struct scene *s, int32_t *count)
{
    for (int64_t c = 0; c < s->engine->mesh.n_cells; c++) count[c] = s->engine->mesh.cell[c].count;
}

/* A step allocates nothing, even if points change cells; only a regrouping does. */
TEST(no_step_allocates)
{
    enum { CELLS = 7 * GR_LANES }; /* a tile for each row of cells: 7 for ugimp, 6 for the others */
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int variant = 0; variant < 4; variant++)
            for (int threads = 1; threads <= 3; threads++) {
                struct scene s;
                int32_t before[CELLS] = {0}, after[CELLS] = {0};
                scene_seed(89);
                scene_default(&s, 2, basis, variant < GR_AFFINE_COUNT ? variant : 0,
                              basis == GR_QUADRATIC && variant == GR_AFFINE_GRADIENT);
                s.config.xpic_order = variant == 3 ? 3 : 0;
                s.config.dt = 5e-4;
                CHECK(scene_build(&s, 300, 0.01, 0.99) == GR_OK);
                const struct gr_kernels *kernels = gr_kernels_select("baseline");
                CHECK(gr_advance(s.engine, kernels, 1, INFINITY, threads) == GR_OK);
                CHECK(s.engine->mesh.n_cells <= CELLS);
                count_cells(&s, before);
                faults_at(0);
                CHECK(gr_advance(s.engine, kernels, 40, INFINITY, threads) == GR_OK);
                CHECK(faults_calls() == 0);
                count_cells(&s, after);
                CHECK(memcmp(before, after, sizeof before) != 0);
                CHECK(gr_regroup(s.engine, NULL) == GR_OK);
                CHECK(faults_calls() > 0); /* allocations are counted */
                scene_free(&s);
            }
}
