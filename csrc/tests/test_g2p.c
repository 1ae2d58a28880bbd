/* Tests of mpm/g2p.inl: velocities, gradients and densities of points, from given nodal fields. */
#include <string.h>

#include "mpm/engine.h"
#include "tests/check.h"
#include "tests/scene.h"

enum { POINTS = 300, STRIDE = 9 }; /* every STRIDE-th point is disconnected */

static const double C[3][3] = {{0.5, -2, 1}, {1.5, 0.25, -1}, {0.75, 2, -0.5}};

static double linear_field(const double x[3], int dim, int d)
{
    double u = 0.1 * d;
    for (int j = 0; j < dim; j++) u += C[d][j] * x[j];
    return u;
}

/* P2G and grid stage; then replace the nodal velocities by a linear field, with w = share of it; then G2P. */
static void with_linear_field(struct scene *s, int dim, int basis, int affine, double keep, double share)
{
    scene_seed(31);
    scene_default(s, dim, basis, affine, 0);
    s->config.dt = 1e-4;
    s->config.material[0].law = gr_law_index("elastic");
    CHECK(scene_build(s, POINTS, 0.15, 0.85) == GR_OK);
    for (int64_t k = 0; k < POINTS; k++) *scene_at(s, GR_FIELD_log_density, 0, k) = k % STRIDE ? 1e-3 : -0.1;
    CHECK(gr_grid(s->engine, gr_kernels_select("baseline")) == GR_OK);
    for (int64_t n = 0; n < s->engine->mesh.n_nodes; n++) {
        double x[3] = {0};
        for (int d = 0; d < dim; d++) x[d] = scene_node_x(s, n, d);
        for (int d = 0; d < dim; d++) {
            gr_node_field(s->engine, d)[n] = linear_field(x, dim, d);
            gr_node_field(s->engine, dim + d)[n] = share * linear_field(x, dim, d);
        }
    }
    s->engine->keep_velocity = keep;
}

/* The state of the points before G2P, by id. */
struct before {
    double x[POINTS][3], v[POINTS][3], c[POINTS];
};

static void remember(const struct scene *s, struct before *b)
{
    for (int64_t id = 0; id < POINTS; id++) {
        const int64_t k = scene_find(s, id);
        for (int d = 0; d < s->config.dim; d++) {
            b->x[id][d] = *scene_at(s, GR_FIELD_x, d, k);
            b->v[id][d] = *scene_at(s, GR_FIELD_v, d, k);
        }
        b->c[id] = *scene_at(s, GR_FIELD_log_density, 0, k);
    }
}

/* v <- f v + w, x <- x + dt v', c <- c - dt tr L for the log-density c, and L becomes the affine field. In APIC C = B D^-1
 * is L, and the velocity is the one of the grid. */
TEST(linear_fields_are_exact)
{
    static struct before b;
    for (int dim = 2; dim <= 3; dim++)
        for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
            for (int affine = 0; affine < GR_AFFINE_COUNT; affine++) {
                struct scene s;
                const int apic = affine == GR_AFFINE_MOMENT;
                const double keep = apic ? 0 : 0.75, share = apic ? 1 : 0.5;
                with_linear_field(&s, dim, basis, affine, keep, share);
                remember(&s, &b);
                CHECK(gr_g2p(s.engine, gr_kernels_select("baseline")) == GR_OK);
                double trace = 0;
                for (int d = 0; d < dim; d++) trace += C[d][d];
                for (int64_t id = 0; id < POINTS; id++) {
                    const int64_t k = scene_find(&s, id);
                    CHECK_NEAR(*scene_at(&s, GR_FIELD_log_density, 0, k), b.c[id] - 1e-4 * trace, 1e-15);
                    for (int d = 0; d < dim; d++) {
                        const double u = linear_field(b.x[id], dim, d);
                        CHECK_NEAR(*scene_at(&s, GR_FIELD_x, d, k), b.x[id][d] + 1e-4 * u, 1e-14);
                        CHECK_NEAR(*scene_at(&s, GR_FIELD_v, d, k), keep * b.v[id][d] + share * u, 1e-13);
                        for (int j = 0; affine && j < dim; j++)
                            CHECK_NEAR(*scene_at(&s, GR_FIELD_affine, d * dim + j, k), C[d][j], apic ? 1e-11 : 1e-12);
                    }
                }
                CHECK(s.engine->clock.step == 1);
                CHECK_NEAR(s.engine->clock.time, 1e-4, 0);
                scene_free(&s);
            }
}

/* A uniform nodal velocity changes neither density nor stress, and spare slots have no mass. */
TEST(translation_is_free)
{
    struct scene s, before;
    for (int copy = 0; copy < 2; copy++) {
        struct scene *one = copy ? &before : &s;
        scene_seed(37);
        scene_default(one, 2, GR_QUADRATIC, GR_AFFINE_NONE, 0);
        one->config.dt = 1e-3;
        one->config.material[0].law = gr_law_index("elastic");
        CHECK(scene_build(one, POINTS, 0.2, 0.8) == GR_OK);
        CHECK(gr_grid(one->engine, gr_kernels_select("baseline")) == GR_OK);
    }
    for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++)
        for (int d = 0; d < 2; d++) gr_node_field(s.engine, d)[n] = 40;
    CHECK(gr_g2p(s.engine, gr_kernels_select("baseline")) == GR_OK);
    for (int64_t k = 0; k < s.capacity; k++) {
        if (s.id[k] < 0) {
            CHECK(*scene_at(&s, GR_FIELD_mass, 0, k) == 0 && isfinite(*scene_at(&s, GR_FIELD_v, 0, k)));
            continue;
        }
        const int64_t old = scene_find(&before, s.id[k]);
        CHECK_NEAR(*scene_at(&s, GR_FIELD_x, 1, k), *scene_at(&before, GR_FIELD_x, 1, old) + 0.04, 1e-14);
        CHECK_NEAR(*scene_at(&s, GR_FIELD_log_density, 0, k), *scene_at(&before, GR_FIELD_log_density, 0, old), 1e-14);
        for (int c = 0; c < 4; c++)
            CHECK_NEAR(*scene_at(&s, GR_FIELD_stress, c, k), *scene_at(&before, GR_FIELD_stress, c, old), 1e-6);
    }
    scene_free(&s);
    scene_free(&before);
}

TEST(needs_points_and_a_step)
{
    struct scene s;
    scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    CHECK(scene_build(&s, 10, 0.2, 0.8) == GR_OK);
    CHECK(gr_g2p(s.engine, gr_kernels_select("baseline")) == GR_ERR_CONFIG); /* not grouped */
    CHECK(gr_regroup(s.engine, NULL) == GR_OK);
    CHECK(gr_g2p(s.engine, gr_kernels_select("baseline")) == GR_ERR_CONFIG); /* no dt yet */
    scene_free(&s);
}

/* Without a grid stage since the last regrouping the nodes are at rest: nothing moves, and nothing is undefined. */
TEST(before_the_grid_all_is_at_rest)
{
    static struct before b;
    for (int affine = 0; affine < GR_AFFINE_COUNT; affine++)
        for (int stepped = 0; stepped < 2; stepped++) {
            struct scene s;
            const struct gr_kernels *kernels = gr_kernels_select("baseline");
            scene_seed(41);
            scene_default(&s, 2, GR_QUADRATIC, affine, affine == GR_AFFINE_GRADIENT);
            s.config.dt = 1e-4;
            CHECK(scene_build(&s, POINTS, 0.3, 0.7) == GR_OK);
            if (stepped) CHECK(gr_advance(s.engine, kernels, 5, INFINITY, 1) == GR_OK);
            CHECK(gr_regroup(s.engine, NULL) == GR_OK);
            const struct gr_engine *e = s.engine;
            for (int64_t n = 0; n < e->mesh.n_nodes; n++) {
                CHECK(e->nodes.mass[n] == 0);
                for (int q = 0; q < e->nodes.n_fields; q++) CHECK(gr_node_field(e, q)[n] == 0);
            }
            remember(&s, &b);
            CHECK(gr_g2p(s.engine, kernels) == GR_OK);
            for (int64_t id = 0; id < POINTS; id++)
                for (int d = 0; d < 2; d++) CHECK(*scene_at(&s, GR_FIELD_x, d, scene_find(&s, id)) == b.x[id][d]);
            scene_free(&s);
        }
}
