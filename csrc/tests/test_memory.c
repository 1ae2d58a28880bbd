/* Allocations that fail at the n-th call: an error is returned, nothing leaks, and the engine works afterwards. */
#include <string.h>

#include "mpm/engine.h"
#include "tests/check.h"
#include "tests/faults.h"
#include "tests/scene.h"

enum { MOST = 200 };

static void config(struct scene *s, int basis)
{
    scene_seed(83);
    scene_default(s, 2, basis, GR_AFFINE_NONE, 0);
}

static void axis_build_fails(void)
{
    const int32_t creases[] = {2, 3};
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++) {
        long n = 0;
        int error;
        do {
            struct gr_axis axis;
            faults_at(++n);
            error = gr_axis_build(&axis, basis, 6, 0, creases, 2, 0.25, 0, 1);
            const int hit = faults_hit();
            faults_at(0);
            CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
            if (error) CHECK(!axis.cell && !axis.node_position && !axis.node_integral);
            gr_axis_free(&axis);
        } while (error && n < MOST);
        CHECK(n > 3 && n < MOST);
    }
}

static void engine_new_fails(void)
{
    long n = 0;
    int error;
    do {
        struct scene s;
        struct gr_engine *e = NULL;
        uint8_t flags[36] = {[8] = GR_CELL_SOLID};
        config(&s, GR_QUADRATIC);
        scene_codes(&s);
        s.config.walls = s.walls, s.config.node_codes = s.codes, s.config.cell_flags = flags;
        s.config.gravity_times = s.gravity_times, s.config.gravity_vectors = s.gravity_vectors;
        faults_at(++n);
        error = gr_engine_new(&e, &s.config);
        const int hit = faults_hit();
        faults_at(0);
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK) && !e == !!error);
        gr_engine_free(e);
        scene_free(&s);
    } while (error && n < MOST);
    CHECK(n > 10 && n < MOST);
}

/* Regroup with a fault, then without: the points are those of an engine that never failed. */
static void regroup_fails(int moved)
{
    long n = 0;
    int error;
    struct scene good;
    const struct gr_kernels *kernels = gr_kernels_select("baseline");
    config(&good, GR_QUADRATIC);
    CHECK(scene_build(&good, 300, 0.3, 0.5) == GR_OK);
    if (moved) CHECK(gr_advance(good.engine, kernels, 20, INFINITY, 1) == GR_OK);
    CHECK(gr_regroup(good.engine) == GR_OK);
    CHECK(gr_advance(good.engine, kernels, 30, INFINITY, 1) == GR_OK);
    do {
        struct scene s;
        config(&s, GR_QUADRATIC);
        CHECK(scene_build(&s, 300, 0.3, 0.5) == GR_OK);
        if (moved) CHECK(gr_advance(s.engine, kernels, 20, INFINITY, 1) == GR_OK);
        faults_at(++n);
        error = gr_regroup(s.engine);
        const int hit = faults_hit();
        faults_at(0);
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        CHECK(s.engine->n_points == 300);
        CHECK(gr_regroup(s.engine) == GR_OK);
        CHECK(gr_advance(s.engine, kernels, 30, INFINITY, 1) == GR_OK);
        CHECK(!scene_differs(&good, &s));
        scene_free(&s);
    } while (error && n < MOST);
    CHECK(n > 6 && n < MOST);
    scene_free(&good);
}

static void first_regroup_fails(void) { regroup_fails(0); }
static void later_regroup_fails(void) { regroup_fails(1); }

/* Send all points off, into cells that are not active yet. */
static void throw_all(struct scene *s)
{
    for (int64_t k = 0; k < s->capacity; k++)
        if (s->id[k] >= 0) *scene_at(s, GR_FIELD_v, 0, k) = 5;
}

/* Advance with a fault, then simply again: the same points as without it, wherever it struck. */
static void advance_fails(void)
{
    enum { STEPS = 200 };
    long n = 0;
    int error, hit, within = 0;
    struct scene good;
    const struct gr_kernels *kernels = gr_kernels_select("baseline");
    config(&good, GR_LINEAR);
    CHECK(scene_build(&good, 300, 0.3, 0.5) == GR_OK);
    throw_all(&good);
    CHECK(gr_advance(good.engine, kernels, STEPS, INFINITY, 1) == GR_OK);
    do {
        struct scene s;
        config(&s, GR_LINEAR);
        CHECK(scene_build(&s, 300, 0.3, 0.5) == GR_OK);
        throw_all(&s);
        faults_at(++n);
        error = gr_advance(s.engine, kernels, STEPS, INFINITY, 1);
        hit = faults_hit();
        faults_at(0);
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        CHECK(s.engine->n_points == 300);
        within += hit && s.engine->step > 0;
        CHECK(gr_advance(s.engine, kernels, STEPS - s.engine->step, INFINITY, 1) == GR_OK);
        CHECK(s.engine->step == STEPS && s.engine->time == good.engine->time);
        CHECK(!scene_differs(&good, &s));
        scene_free(&s);
    } while (hit && n < MOST);
    CHECK(n > 6 && n < MOST);
    CHECK(within > 0); /* a regrouping on the way */
    scene_free(&good);
}

/* Points per cell, to see that some have moved on. */
static void count_cells(const struct scene *s, int32_t *count)
{
    for (int64_t c = 0; c < s->engine->mesh.n_cells; c++) count[c] = s->engine->mesh.cell[c].count;
}

/* A step allocates nothing, though points change cells; only a regrouping does. */
static void no_step_allocates(void)
{
    enum { CELLS = 7 * 7 }; /* of ugimp, 6 x 6 of the others */
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
                CHECK(gr_regroup(s.engine) == GR_OK);
                CHECK(faults_calls() > 0); /* they are counted */
                scene_free(&s);
            }
}

int main(void)
{
    RUN(axis_build_fails);
    RUN(engine_new_fails);
    RUN(first_regroup_fails);
    RUN(later_regroup_fails);
    RUN(advance_fails);
    RUN(no_step_allocates);
    return check_report("memory");
}
