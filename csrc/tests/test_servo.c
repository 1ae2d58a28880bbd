/* Tests of mpm/servo.c: refused input, the direction and the limit of the motion, equal bits for any number of threads. */
#include "mpm/servo.h"
#include "core/memory.h"

#include "mpm/wall_impulse.h"
#include "tests/check.h"
#include "tests/scene.h"

enum { DIM = 2, POINTS = 330, UP = DIM - 1 };

/* A full box, periodic along x, below a no-slip wall that is watched. */
static void box(struct scene *s, int basis, int smoothed, int cell_averaged)
{
    const struct gr_wall_share share[2] = {{{-1, -1, -1}, 0, INFINITY}, {{0, 0, -1}, 0, INFINITY}};
    scene_seed(83);
    scene_default(s, DIM, basis, GR_AFFINE_GRADIENT, smoothed);
    s->config.cell_averaged = cell_averaged, s->config.pressure_from_density = 1;
    s->config.periodic[0] = 1;
    s->walls[1] = (struct gr_wall){.fixed = 3, .opens_at = INFINITY, .velocity = {0.5, 0, 0}};
    s->config.n_walls = 2;
    scene_codes(s);
    scene_face(s, UP, 1, 1);
    CHECK(scene_build(s, POINTS, 0.01, 0.99) == GR_OK);
    const int64_t n = scene_grid_nodes(s);
    int32_t *code = gr_malloc(sizeof *code * (size_t)n);
    for (int64_t k = 0; k < n; k++) code[k] = s->codes[k];
    CHECK(gr_watch_walls(s->engine, 1, share, 2, code) == GR_OK);
    gr_free(code);
}

static struct gr_servo servo(double pressure)
{
    return (struct gr_servo){
        .axis = UP, .side = 1, .pressure = pressure, .area = 0.6, .height = 0.6, .rate = 3e-5, .limit = 0.05};
}

static double number(const struct scene *s, int k) { return s->engine->watch->total[k]; }

static void go(struct scene *s, int64_t steps, int threads)
{
    while (s->engine->clock.step < steps) {
        const int64_t left = steps - s->engine->clock.step;
        const int error = gr_advance(s->engine, gr_kernels_select(""), left, INFINITY, threads);
        CHECK(error == GR_OK || error == GR_ERR_CAPACITY);
        if (error == GR_ERR_CAPACITY && scene_grow(s)) return;
        if (error == GR_ERR_CAPACITY && gr_regroup(s->engine, NULL)) return;
        if (error && error != GR_ERR_CAPACITY) return;
    }
}

#define REFUSED(change)                                           \
    do {                                                          \
        struct gr_servo wrong = servo(1e4);                       \
        change;                                                   \
        CHECK(gr_watch_servo(s.engine, &wrong) == GR_ERR_CONFIG); \
    } while (0)

TEST(refuses_what_it_cannot_keep)
{
    struct scene s;
    box(&s, GR_QUADRATIC, 1, 0);
    REFUSED(wrong.wall = 1);
    REFUSED(wrong.wall = -1);
    REFUSED(wrong.axis = 0); /* periodic */
    REFUSED(wrong.axis = 2);
    REFUSED(wrong.side = 0);
    REFUSED(wrong.pressure = 0);
    REFUSED(wrong.pressure = NAN);
    REFUSED(wrong.area = -1);
    REFUSED(wrong.height = 0);
    REFUSED(wrong.rate = 0);
    REFUSED(wrong.limit = NAN);
    const struct gr_servo good = servo(1e4);
    CHECK(gr_watch_servo(s.engine, &good) == GR_OK);
    REFUSED((void)0); /* a second one */
    scene_free(&s);
    box(&s, GR_LINEAR, 0, 0); /* no density is averaged */
    REFUSED((void)0);
    scene_free(&s);
}

/* The wall moves inwards to the limit of its strain for a pressure beyond reach, and does positive work. */
TEST(moves_inwards_up_to_the_limit)
{
    for (int cell_averaged = 0; cell_averaged < 2; cell_averaged++) {
        struct scene s;
        const struct gr_servo far = servo(1e6);
        box(&s, cell_averaged ? GR_LINEAR : GR_QUADRATIC, !cell_averaged, cell_averaged);
        CHECK(gr_watch_servo(s.engine, &far) == GR_OK);
        CHECK(gr_servo_strain(s.engine) == 0);
        go(&s, 400, 1);
        CHECK_NEAR(gr_servo_strain(s.engine), -far.limit, 1e-15);
        CHECK(number(&s, GR_WALL_WORK) > 0);
        scene_free(&s);
    }
}

TEST(threads_give_the_same_bits)
{
    for (int cell_averaged = 0; cell_averaged < 2; cell_averaged++) {
        struct scene s[3];
        const struct gr_servo some = servo(1e4);
        for (int k = 0; k < 3; k++) {
            box(&s[k], cell_averaged ? GR_LINEAR : GR_QUADRATIC, !cell_averaged, cell_averaged);
            CHECK(gr_watch_servo(s[k].engine, &some) == GR_OK);
            go(&s[k], 100, k + 1);
            CHECK(number(&s[k], GR_WALL_DISPLACEMENT) != 0);
            for (int i = 0; k && i < GR_WALL_NUMBERS; i++) CHECK(number(&s[k], i) == number(&s[0], i));
            if (k) CHECK(!scene_differs(&s[0], &s[k]));
        }
        for (int k = 0; k < 3; k++) scene_free(&s[k]);
    }
}
