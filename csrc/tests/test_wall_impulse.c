/* Tests of mpm/wall_impulse.c: the walls gain the momentum that the points lose. */
#include "mpm/wall_impulse.h"
#include "core/memory.h"

#include <stdlib.h>
#include <string.h>

#include "kernels.h"
#include "tests/check.h"
#include "tests/faults.h"
#include "tests/scene.h"

enum { FLOOR, CEILING, AFTERWARDS, OWNERS };

static const struct gr_wall_share shares[] = {
    {.owner = {-1, -1, -1}, .opens_at = INFINITY},
    {.owner = {FLOOR, FLOOR, FLOOR}, .opens_at = INFINITY},
    {.owner = {CEILING, CEILING, CEILING}, .opens_at = INFINITY},
    {.owner = {AFTERWARDS, AFTERWARDS, AFTERWARDS}, .opens_at = INFINITY},
};

/* Points between a floor that holds them and a ceiling with friction, the other directions periodic. The floor becomes a
 * row of its own at `changes_at`. */
static void between_walls(struct scene *s, int dim, int basis, int affine, int smoothed, double changes_at)
{
    const int up = dim - 1;
    scene_seed(31);
    scene_default(s, dim, basis, affine, smoothed);
    for (int d = 0; d < up; d++) s->config.periodic[d] = 1;
    s->gravity_vectors[up] = -9.8, s->gravity_vectors[0] = 4;
    s->walls[1] = (struct gr_wall){.fixed = (1 << dim) - 1, .opens_at = changes_at, .after = 3};
    s->walls[2] = (struct gr_wall){.fixed = 1 << up, .opens_at = INFINITY};
    s->walls[2].away[up] = -1, s->walls[2].friction[up] = 0.3;
    s->walls[3] = (struct gr_wall){.fixed = 1 << up, .opens_at = INFINITY};
    s->config.n_walls = 4;
    s->config.dt = 1e-4;
    scene_codes(s);
    scene_face(s, up, 0, 1);
    scene_face(s, up, 1, 2);
    CHECK(scene_build(s, 400, 0.02, 0.98) == GR_OK);
}

/* Watch the walls: the codes of the nodes are the codes of the walls. */
static int watch(struct scene *s, double changes_at)
{
    const int64_t n = scene_grid_nodes(s);
    struct gr_wall_share own[4];
    memcpy(own, shares, sizeof own);
    own[1].opens_at = changes_at, own[1].after = 3;
    int32_t *code = gr_malloc(sizeof *code * (size_t)n);
    for (int64_t k = 0; code && k < n; k++) code[k] = s->codes[k];
    const int error = code ? gr_watch_walls(s->engine, OWNERS, own, 4, code) : GR_ERR_MEMORY;
    gr_free(code);
    return error;
}

static int go(struct scene *s, int64_t steps)
{
    int error;
    const int64_t target = s->engine->clock.step + steps;
    do {
        error = gr_advance(s->engine, gr_kernels_select(""), target - s->engine->clock.step, INFINITY, 2);
        if (error == GR_ERR_CAPACITY && (scene_grow(s) || gr_regroup(s->engine, NULL))) return GR_ERR_MEMORY;
    } while (error == GR_ERR_CAPACITY);
    return error;
}

/* Momentum of the points; returns their mass. */
static double momentum(const struct scene *s, double p[3])
{
    double mass = 0;
    memset(p, 0, 3 * sizeof *p);
    for (int64_t k = 0; k < s->capacity; k++) {
        if (s->id[k] < 0) continue;
        const double m = *scene_at(s, GR_FIELD_mass, 0, k);
        mass += m;
        for (int d = 0; d < s->config.dim; d++) p[d] += m * *scene_at(s, GR_FIELD_v, d, k);
    }
    return mass;
}

/* Without an averaged density, the shift of which lends momentum from one step to the next; uGIMP, whose boxes are
 * clipped at walls, keeps momentum only without a velocity gradient. */
TEST(walls_get_what_the_points_lose)
{
    for (int dim = 2; dim <= 3; dim++)
        for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
            for (int affine = 0; affine < GR_AFFINE_COUNT; affine++) {
                struct scene s;
                double before[3], after[3], moved = 0;
                if (basis == GR_UGIMP && affine) continue;
                between_walls(&s, dim, basis, affine, 0, INFINITY);
                CHECK(watch(&s, INFINITY) == GR_OK);
                const double mass = momentum(&s, before);
                CHECK(go(&s, 100) == GR_OK);
                CHECK_NEAR(momentum(&s, after), mass, 1e-12 * mass);
                const double *total = s.engine->watch->total;
                for (int d = 0; d < dim; d++) {
                    const double lost = before[d] + mass * s.gravity_vectors[d] * s.engine->clock.time - after[d];
                    CHECK_NEAR(total[d] + total[GR_WALL_NUMBERS + d], lost, 1e-11 * mass);
                    moved += fabs(lost);
                }
                CHECK(moved > 1e-3 * mass);
                CHECK(total[dim - 1] < 0); /* the floor is pressed */
                scene_free(&s);
            }
}

/* From the time at which a wall gives way to another one, this one gets the impulse, and the first nothing more. */
TEST(a_wall_that_opens_hands_over)
{
    struct scene s;
    double before[3], after[3], first[GR_WALL_NUMBERS];
    between_walls(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0, 50.5e-4);
    CHECK(watch(&s, 50.5e-4) == GR_OK);
    const double mass = momentum(&s, before), *total = s.engine->watch->total;
    const double *later = total + (int64_t)AFTERWARDS * GR_WALL_NUMBERS,
                 *ceiling = total + (int64_t)CEILING * GR_WALL_NUMBERS;
    CHECK(go(&s, 51) == GR_OK);
    for (int q = 0; q < GR_WALL_NUMBERS; q++) CHECK(later[q] == 0);
    memcpy(first, total, sizeof first);
    CHECK(go(&s, 50) == GR_OK);
    momentum(&s, after);
    CHECK(!memcmp(first, total, sizeof first) && first[1] < 0 && later[1] < 0);
    for (int d = 0; d < 2; d++) {
        const double lost = before[d] + mass * s.gravity_vectors[d] * s.engine->clock.time - after[d];
        CHECK_NEAR(total[d] + ceiling[d] + later[d], lost, 1e-11 * mass);
    }
    CHECK(later[0] == 0); /* it does not rub */
    scene_free(&s);
}

/* The angular impulse is the moment of the impulses of the nodes about the origin. */
TEST(angular_impulse)
{
    for (int dim = 2; dim <= 3; dim++) {
        struct scene s;
        between_walls(&s, dim, GR_QUADRATIC, GR_AFFINE_MOMENT, 0, INFINITY);
        CHECK(watch(&s, INFINITY) == GR_OK);
        CHECK(go(&s, 20) == GR_OK);
        const struct gr_wall_watch *w = s.engine->watch;
        double sum[3] = {0}, size = 0;
        for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++) {
            double x[3] = {0}, J[3] = {0};
            if (s.engine->mesh.node_code[n] != 1) continue;
            for (int d = 0; d < dim; d++) x[d] = scene_node_x(&s, n, d), J[d] = w->node[n * dim + d], size += fabs(J[d]);
            sum[0] += x[1] * J[2] - x[2] * J[1];
            sum[1] += x[2] * J[0] - x[0] * J[2];
            sum[2] += x[0] * J[1] - x[1] * J[0];
        }
        CHECK(size > 0);
        for (int d = 0; d < 3; d++) CHECK_NEAR(w->step[3 + d], sum[d], 1e-13 * size);
        scene_free(&s);
    }
}

/* To watch the walls changes no bit of the points. */
TEST(watching_changes_nothing)
{
    struct scene s[2];
    for (int k = 0; k < 2; k++) {
        between_walls(&s[k], 2, GR_QUADRATIC, GR_AFFINE_GRADIENT, 1, INFINITY);
        if (k) CHECK(watch(&s[k], INFINITY) == GR_OK);
        CHECK(go(&s[k], 50) == GR_OK);
    }
    CHECK(!scene_differs(&s[0], &s[1]));
    for (int k = 0; k < 2; k++) scene_free(&s[k]);
}

TEST(refuses)
{
    struct scene s;
    between_walls(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0, INFINITY);
    struct gr_wall_share own[4];
    int32_t *code = gr_calloc((size_t)scene_grid_nodes(&s), sizeof *code);
    CHECK(code);
#define REFUSED(change)                                                         \
    do {                                                                        \
        memcpy(own, shares, sizeof own);                                        \
        change;                                                                 \
        CHECK(gr_watch_walls(s.engine, OWNERS, own, 4, code) == GR_ERR_CONFIG); \
        CHECK(!s.engine->watch);                                                \
    } while (0)
    REFUSED(own[1].owner[0] = OWNERS);
    REFUSED(own[1].owner[2] = -2);
    REFUSED(own[1].after = 4);
    REFUSED(own[1].after = -1);
    REFUSED(own[1].opens_at = NAN);
    REFUSED((own[1].opens_at = 1, own[1].after = 1)); /* chains that would never end */
    REFUSED((own[1].opens_at = 1, own[1].after = 2, own[2].opens_at = 1, own[2].after = 1));
    REFUSED(code[3] = 4);
    REFUSED(code[3] = -1);
#undef REFUSED
    gr_free(code);
    CHECK(go(&s, 1) == GR_OK);
    CHECK(watch(&s, INFINITY) == GR_ERR_CONFIG); /* the nodes have no memory for impulses any more */
    scene_free(&s);
}

TEST(without_memory)
{
    struct scene s;
    between_walls(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0, INFINITY);
    for (long n = 1;; n++) {
        faults_at(n);
        const int error = watch(&s, INFINITY);
        const int hit = faults_end();
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        if (!hit) break;
        CHECK(!s.engine->watch);
    }
    CHECK(watch(&s, INFINITY) == GR_ERR_CONFIG); /* once */
    scene_free(&s);
}
