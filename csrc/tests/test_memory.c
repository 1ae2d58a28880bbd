/* Allocations that fail at the n-th call: an error is returned, nothing leaks, and the engine works afterwards. */
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

/* Advance with a fault, then simply again: the same points as without it. */
static void advance_fails(void)
{
    long n = 0;
    int error, hit;
    struct scene good;
    const struct gr_kernels *kernels = gr_kernels_select("baseline");
    config(&good, GR_LINEAR);
    CHECK(scene_build(&good, 300, 0.3, 0.5) == GR_OK);
    CHECK(gr_advance(good.engine, kernels, 200, INFINITY, 1) == GR_OK);
    do {
        struct scene s;
        config(&s, GR_LINEAR);
        CHECK(scene_build(&s, 300, 0.3, 0.5) == GR_OK);
        faults_at(++n);
        error = gr_advance(s.engine, kernels, 200, INFINITY, 1);
        hit = faults_hit();
        faults_at(0);
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        CHECK(s.engine->n_points == 300);
        if (!s.engine->leaver_room) { /* nothing had begun; a failure within a step may spoil it, but loses no point */
            CHECK(gr_advance(s.engine, kernels, 200, INFINITY, 1) == GR_OK);
            CHECK(!scene_differs(&good, &s));
        } else {
            CHECK(gr_advance(s.engine, kernels, 10, INFINITY, 1) == GR_OK);
            for (int64_t id = 0; id < 300; id++) CHECK(scene_find(&s, id) >= 0);
        }
        scene_free(&s);
    } while (hit && n < MOST);
    CHECK(n > 6 && n < MOST);
    scene_free(&good);
}

int main(void)
{
    RUN(axis_build_fails);
    RUN(engine_new_fails);
    RUN(first_regroup_fails);
    RUN(later_regroup_fails);
    RUN(advance_fails);
    return check_report("memory");
}
