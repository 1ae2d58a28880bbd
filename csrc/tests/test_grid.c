/* Tests of core/piecewise.h and mpm/grid.c: the momentum balance of the nodes, and walls. */
#include "mpm/grid.h"

#include <string.h>

#include "core/piecewise.h"
#include "mpm/migrate.h"
#include "mpm/walls.h"
#include "tests/check.h"
#include "tests/scene.h"

TEST(gravity_is_piecewise_linear)
{
    const double times[] = {1, 2, 4}, vectors[] = {0, 1, 10, 1, 20, -3};
    struct gr_config c = {.dim = 2, .n_gravity = 3, .gravity_times = times, .gravity_vectors = vectors};
    const double expected[][3] = {{-5, 0, 1}, {0, 0, 1},   {1, 0, 1},   {1.25, 2.5, 1},
                                  {2, 10, 1}, {3, 15, -1}, {4, 20, -3}, {1e9, 20, -3}};
    for (size_t k = 0; k < sizeof expected / sizeof *expected; k++) {
        double g[3];
        gr_piecewise(c.dim, c.n_gravity, c.gravity_times, 1, c.gravity_vectors, c.dim, expected[k][0], g);
        CHECK_NEAR(g[0], expected[k][1], 1e-15);
        CHECK_NEAR(g[1], expected[k][2], 1e-15);
    }
}

/* Make a scene and run P2G and the grid stage, with wall row 1 on the floor if `walled`. */
static void prepare(struct scene *s, int dim, struct gr_wall wall, int walled)
{
    scene_seed(21);
    scene_default(s, dim, GR_LINEAR, GR_AFFINE_NONE, 0);
    s->config.dt = 1e-4;
    s->gravity_vectors[dim - 1] = -9.8;
    s->walls[1] = wall;
    s->config.n_walls = 2;
    scene_codes(s);
    if (walled) scene_face(s, dim - 1, 0, 1);
    CHECK(scene_build(s, 400, 0.01, 0.7) == GR_OK);
    CHECK(gr_p2g(s->engine, gr_kernels_select("baseline")) == GR_OK);
    CHECK(gr_grid(s->engine, gr_kernels_select("baseline")) == GR_OK);
}

static double out(const struct scene *s, int64_t n, int q) { return gr_node_field(s->engine, q)[n]; }

static int is_floor(const struct scene *s, int64_t n) { return s->engine->mesh.node_code[n] == 1; }

TEST(free_nodes_follow_newton)
{
    for (int dim = 2; dim <= 3; dim++) {
        struct scene s;
        prepare(&s, dim, (struct gr_wall){.fixed = 1, .opens_at = INFINITY}, 0);
        for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++) {
            const double m = scene_sum(&s, n, 0);
            CHECK_NEAR(s.engine->nodes.mass[n], m, 0);
            for (int d = 0; d < dim; d++) {
                const double v = m > 0 ? scene_sum(&s, n, 1 + d) / m : 0;
                const double a = m > 0 ? scene_sum(&s, n, 1 + dim + d) / m + (d == dim - 1 ? -9.8 : 0) : 0;
                CHECK_NEAR(out(&s, n, d), v + 1e-4 * a, 1e-12 * (1 + fabs(1e-4 * a)));
                CHECK_NEAR(out(&s, n, dim + d), 1e-4 * a, 1e-12 * (1 + fabs(1e-4 * a))); /* FLIP: the increment */
            }
        }
        scene_free(&s);
    }
}

/* No-slip and free-slip walls fix components: these have no velocity and no increment. */
TEST(fixed_components_rest)
{
    for (int fixed = 1; fixed < 4; fixed++) {
        struct scene s, open;
        const struct gr_wall wall = {.fixed = fixed, .opens_at = INFINITY};
        prepare(&s, 2, wall, 1);
        prepare(&open, 2, wall, 0);
        for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++)
            for (int d = 0; d < 4; d++) {
                if (is_floor(&s, n) && (fixed >> d % 2 & 1))
                    CHECK(out(&s, n, d) == 0);
                else
                    CHECK(out(&s, n, d) == out(&open, n, d));
            }
        scene_free(&s);
        scene_free(&open);
    }
}

/* A Coulomb wall holds nodes that move into it, and lets go of others unless it holds both ways. Friction takes mu times the
 * normal impulse, here of the forces alone, from the tangential velocity, which it never reverses. */
TEST(coulomb_friction)
{
    int stuck = 0, slid = 0, left = 0, pulled = 0;
    for (int away = -1; away <= 1; away++)
        for (int dim = 2; dim <= 3; dim++) {
            struct scene s, open;
            const int up = dim - 1;
            const double mu = 0.3;
            struct gr_wall wall = {.fixed = 1 << up, .opens_at = INFINITY};
            wall.away[up] = away, wall.friction[up] = mu;
            prepare(&s, dim, wall, 1);
            prepare(&open, dim, wall, 0);
            for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++) {
                if (!is_floor(&s, n) || !(s.engine->nodes.mass[n] > 0)) continue;
                const double gained = out(&open, n, dim + up), taken = away ? fmax(0, -away * gained) : fabs(gained);
                double before = 0, after = 0, along = 0;
                if (away * out(&open, n, up) > 0) {
                    for (int q = 0; q < 2 * dim; q++) CHECK(out(&s, n, q) == out(&open, n, q));
                    left++;
                    continue;
                }
                for (int d = 0; d < up; d++) {
                    before += pow(out(&open, n, d), 2), after += pow(out(&s, n, d), 2);
                    along += out(&open, n, d) * out(&s, n, d);
                }
                before = sqrt(before), after = sqrt(after);
                CHECK(out(&s, n, up) == 0 && out(&s, n, dim + up) == 0);
                CHECK_NEAR(after, fmax(0, before - mu * taken), 1e-12 * before);
                CHECK(along >= 0);
                stuck += after == 0, slid += after > 0 && taken > 0, pulled += taken == 0;
                for (int d = 0; d < up; d++) /* friction is a force, so it is part of the increment */
                    CHECK_NEAR(out(&s, n, dim + d) - out(&open, n, dim + d), out(&s, n, d) - out(&open, n, d),
                               1e-12 * (1 + before));
            }
            scene_free(&s);
            scene_free(&open);
        }
    CHECK(slid > 0 && left > 0);
    CHECK(stuck + slid + pulled + left > 30);
}

TEST(walls_open_in_turn)
{
    struct scene s;
    scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    s.walls[1] = (struct gr_wall){.fixed = 3, .opens_at = 1, .after = 2};
    s.walls[2] = (struct gr_wall){.fixed = 1, .opens_at = 2, .after = 0};
    s.config.n_walls = 3;
    CHECK(scene_build(&s, 1, 0.4, 0.6) == GR_OK);
    const double times[] = {0, 0.999, 1, 1.5, 2, 9};
    const int fixed[] = {3, 3, 1, 1, 0, 0};
    for (int k = 0; k < 6; k++) {
        s.engine->clock.time = times[k];
        CHECK(gr_wall_now(s.engine, 1)->fixed == fixed[k]);
    }
    scene_free(&s);
}

/* FLIP with decay, given as a rate: w = f dv + (1 - f) v'. */
TEST(velocity_decays_as_a_rate)
{
    struct scene s;
    scene_seed(4);
    scene_default(&s, 2, GR_QUADRATIC, GR_AFFINE_NONE, 0);
    s.config.dt = 1e-3;
    s.config.keep_velocity_rate = 200;
    CHECK(scene_build(&s, 100, 0.1, 0.9) == GR_OK);
    CHECK(gr_grid(s.engine, gr_kernels_select("")) == GR_OK);
    const double f = exp(-0.2);
    CHECK_NEAR(s.engine->keep_velocity, f, 1e-16);
    for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++) {
        for (int d = 0; d < 2; d++) {
            const double m = scene_sum(&s, n, GR_SUM_MASS), p = scene_sum(&s, n, GR_SUM_MOMENTUM + d);
            const double next = out(&s, n, d), v = m > 0 ? p / m : 0;
            CHECK_NEAR(out(&s, n, 2 + d), f * (next - v) + (1 - f) * next, 1e-12 * (1 + fabs(next)));
        }
    }
    scene_free(&s);
}

/* The mass cutoff does not hide a nodal NaN; nodes with little mass are left out. */
TEST(cutoff_spares_nan)
{
    struct scene s;
    scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    s.config.dt = 1e-4;
    s.config.mass_cutoff = 1e9;
    CHECK(scene_build(&s, 100, 0.1, 0.9) == GR_OK);
    CHECK(gr_p2g(s.engine, gr_kernels_select("")) == GR_OK);
    gr_sums_of_tile(s.engine, 0)[0] = NAN;
    CHECK(gr_grid(s.engine, gr_kernels_select("")) == GR_OK);
    int n_nan = 0;
    for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++) {
        n_nan += isnan(out(&s, n, 0));
        if (!isnan(s.engine->nodes.mass[n])) CHECK(out(&s, n, 0) == 0 && out(&s, n, 2) == 0);
    }
    CHECK(n_nan == 1);
    scene_free(&s);
}

/* XPIC(m) = v' - v + the sum of the passes, compared with passes computed by dense matrices. */
TEST(xpic_sums_its_passes)
{
    enum { N = 36, MOST = 64 };
    for (int order = 1; order <= 3; order++) {
        struct scene s;
        scene_seed(8);
        scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
        s.config.dt = 1e-4;
        s.config.xpic_order = order;
        CHECK(scene_build(&s, N, 0.1, 0.9) == GR_OK);
        CHECK(gr_grid(s.engine, gr_kernels_select("")) == GR_OK);
        const int64_t nodes = s.engine->mesh.n_nodes;
        CHECK(nodes <= MOST);
        static double S[N][MOST], v[MOST], next[MOST], w[MOST], mass[MOST];
        memset(S, 0, sizeof S);
        for (int64_t n = 0; n < nodes && n < MOST; n++) {
            double m = 0, p = 0, x[2] = {scene_node_x(&s, n, 0), scene_node_x(&s, n, 1)};
            for (int64_t k = 0; k < N; k++) {
                const int64_t at = scene_find(&s, k);
                double weight = 1;
                for (int d = 0; d < 2; d++)
                    weight *= fmax(0, 1 - fabs(*scene_at(&s, GR_FIELD_x, d, at) - x[d]) / s.config.dx);
                S[k][n] = weight;
                m += weight * *scene_at(&s, GR_FIELD_mass, 0, at);
                p += weight * *scene_at(&s, GR_FIELD_mass, 0, at) * *scene_at(&s, GR_FIELD_v, 0, at);
            }
            mass[n] = m;
            v[n] = m > 0 ? p / m : 0;
            next[n] = out(&s, n, 0);
        }
        const double binomial[][4] = {{0, 1}, {0, 2, -1}, {0, 3, -3, 1}};
        double pass[MOST];
        memcpy(pass, v, sizeof pass);
        for (int64_t n = 0; n < nodes; n++) w[n] = next[n] - v[n] + binomial[order - 1][1] * v[n];
        for (int r = 2; r <= order; r++) {
            double smooth[MOST] = {0};
            for (int64_t k = 0; k < N; k++) {
                double at_point = 0;
                for (int64_t n = 0; n < nodes; n++) at_point += S[k][n] * pass[n];
                for (int64_t n = 0; n < nodes; n++)
                    if (mass[n] > 0)
                        smooth[n] += S[k][n] * *scene_at(&s, GR_FIELD_mass, 0, scene_find(&s, k)) * at_point / mass[n];
            }
            memcpy(pass, smooth, sizeof pass);
            for (int64_t n = 0; n < nodes; n++) w[n] += binomial[order - 1][r] * pass[n];
        }
        for (int64_t n = 0; n < nodes; n++) CHECK_NEAR(out(&s, n, 2), w[n], 1e-10);
        scene_free(&s);
    }
}
