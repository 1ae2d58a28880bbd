/* Tests of mpm/p2g.inl: properties of the nodal sums that hold for any points. */
#include "mpm/cell_sums.h"
#include "core/memory.h"
#include "tests/check.h"
#include "tests/scene.h"

enum { POINTS = 400 };

/* Run a check for every variant, in a periodic and in a closed box. */
static void each_variant(void (*check)(struct scene *s, int clipped))
{
    for (int dim = 2; dim <= 3; dim++)
        for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
            for (int affine = 0; affine < GR_AFFINE_COUNT; affine++)
                for (int smoothed = 0; smoothed <= (basis == GR_QUADRATIC && affine == GR_AFFINE_GRADIENT); smoothed++) {
                    struct scene s;
                    scene_seed(17);
                    scene_default(&s, dim, basis, affine, smoothed);
                    CHECK(scene_build(&s, POINTS, 0.001, 0.999) == GR_OK);
                    CHECK(gr_p2g(s.engine, gr_kernels_select("baseline")) == GR_OK);
                    check(&s, basis == GR_UGIMP);
                    scene_free(&s);
                }
}

static double point_total(const struct scene *s, int field, int c, int moment)
{
    double sum = 0;
    for (int64_t k = 0; k < s->capacity; k++)
        if (s->id[k] >= 0)
            sum += *scene_at(s, GR_FIELD_mass, 0, k) * (field < 0 ? 1 : *scene_at(s, field, c, k)) *
                   (moment < 0 ? 1 : *scene_at(s, GR_FIELD_x, moment, k));
    return sum;
}

/* The mass is complete, and so is the centre of mass if the basis reproduces linear functions. */
static void check_mass(struct scene *s, int clipped)
{
    const double mass = point_total(s, -1, 0, -1);
    CHECK_NEAR(scene_total(s, 0, -1), mass, 1e-12 * mass);
    for (int d = 0; !clipped && d < s->config.dim; d++)
        CHECK_NEAR(scene_total(s, 0, d), point_total(s, -1, 0, d), 1e-11 * mass);
}

TEST(mass_is_kept) { each_variant(check_mass); }

/* The momentum is complete; the affine part has none, because sum w (x_i - x) = 0. */
static void check_momentum(struct scene *s, int clipped)
{
    const int dim = s->config.dim;
    const double scale = point_total(s, -1, 0, -1);
    for (int d = 0; d < dim; d++)
        if (!clipped || !s->config.affine)
            CHECK_NEAR(scene_total(s, 1 + d, -1), point_total(s, GR_FIELD_v, d, -1), 1e-12 * scale);
}

TEST(momentum_is_kept) { each_variant(check_momentum); }

/* The internal forces sum to zero, and their moment is -sum V sigma. */
static void check_force(struct scene *s, int clipped)
{
    const int dim = s->config.dim, place[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
    double scale = 0;
    if (s->config.smoothed) /* without the momentum of the shift */
        for (int64_t k = 0; k < s->capacity; k++)
            for (int d = 0; d < dim; d++) CHECK(*scene_at(s, GR_FIELD_shift_velocity, d, k) == 0);
    for (int64_t n = 0; n < s->engine->mesh.n_nodes; n++) scale += fabs(scene_sum(s, n, 1 + dim));
    CHECK(scale > 0);
    for (int d = 0; d < dim; d++) {
        CHECK_NEAR(scene_total(s, 1 + dim + d, -1), 0, 1e-12 * scale);
        for (int j = 0; !clipped && j < dim; j++) {
            double expected = 0;
            for (int64_t k = 0; k < s->capacity; k++)
                if (s->id[k] >= 0)
                    expected -= *scene_at(s, GR_FIELD_mass, 0, k) / s->config.material[0].rho_c *
                                exp(-*scene_at(s, GR_FIELD_log_density, 0, k)) *
                                *scene_at(s, GR_FIELD_stress, place[d][j], k);
            CHECK_NEAR(scene_total(s, 1 + dim + d, j), expected, 1e-12 * scale);
        }
    }
}

TEST(forces_balance) { each_variant(check_force); }

/* A velocity linear in x, with C its gradient, gives p_i = m_i u(x_i) at every node. */
TEST(affine_field_is_exact)
{
    for (int dim = 2; dim <= 3; dim++)
        for (int basis = 0; basis < GR_BASIS_COUNT; basis += 2) {
            struct scene s;
            scene_seed(23);
            scene_default(&s, dim, basis, GR_AFFINE_GRADIENT, 0);
            CHECK(scene_build(&s, POINTS, 0.001, 0.999) == GR_OK);
            const double C[3][3] = {{1, -2, 0.5}, {3, 0.25, -1}, {0.75, 2, -0.5}};
            for (int64_t k = 0; k < POINTS; k++)
                for (int d = 0; d < dim; d++) {
                    double u = d;
                    for (int j = 0; j < dim; j++) {
                        u += C[d][j] * *scene_at(&s, GR_FIELD_x, j, k);
                        *scene_at(&s, GR_FIELD_affine, d * dim + j, k) = C[d][j];
                    }
                    *scene_at(&s, GR_FIELD_v, d, k) = u;
                }
            CHECK(gr_p2g(s.engine, gr_kernels_select("baseline")) == GR_OK);
            for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++)
                for (int d = 0; d < dim; d++) {
                    double u = d;
                    for (int j = 0; j < dim; j++) u += C[d][j] * scene_node_x(&s, n, j);
                    CHECK_NEAR(scene_sum(&s, n, 1 + d), scene_sum(&s, n, 0) * u, 1e-12 * (1 + scene_sum(&s, n, 0)));
                }
            scene_free(&s);
        }
}

/* A linear log-density with its gradient is reproduced exactly at the nodes, whatever the quadrature weights of the
 * points; disconnected points take no part. */
TEST(log_density_extrapolates)
{
    struct scene s;
    const int first = GR_SUM_DENSITY(2);
    double near = 0, all = 0, counted = 0, weighted = 0;
    scene_seed(29);
    scene_default(&s, 2, GR_QUADRATIC, GR_AFFINE_GRADIENT, 1);
    CHECK(scene_build(&s, POINTS, 0.001, 0.999) == GR_OK);
    for (int64_t k = 0; k < POINTS; k++) {
        *scene_at(&s, GR_FIELD_log_density, 0, k) =
            k % 5 ? 1e-3 + 2e-3 * (*scene_at(&s, GR_FIELD_x, 0, k) + 1) - 1e-3 * (*scene_at(&s, GR_FIELD_x, 1, k) - 2)
                  : -0.3;
        *scene_at(&s, GR_FIELD_density_gradient, 0, k) = 2e-3;
        *scene_at(&s, GR_FIELD_density_gradient, 1, k) = -1e-3;
        const double u = scene_random(-0.5, 0.5);
        *scene_at(&s, GR_FIELD_weight_correction, 0, k) = u;
        counted += k % 5 ? (1 + u) * *scene_at(&s, GR_FIELD_mass, 0, k) : 0;
    }
    CHECK(gr_p2g(s.engine, gr_kernels_select("baseline")) == GR_OK);
    for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++) {
        const double m = scene_sum(&s, n, first + GR_SUM_WEIGHTED),
                     c = 1e-3 + 2e-3 * (scene_node_x(&s, n, 0) + 1) - 1e-3 * (scene_node_x(&s, n, 1) - 2);
        CHECK_NEAR(scene_sum(&s, n, first + GR_SUM_LOG_DENSITY), m * c, 1e-14 * (1 + m));
        near += scene_sum(&s, n, first + GR_SUM_CONNECTED), weighted += m, all += scene_sum(&s, n, 0);
    }
    CHECK_NEAR(weighted, counted, 1e-12 * all);
    CHECK(near > 0.7 * all && near < 0.9 * all);
    scene_free(&s);
}

/* Sums that are stored past the caches are the same. */
TEST(streamed_sums_are_the_same)
{
    const char *const names[] = {"baseline", "avx2", "avx512"};
    for (int kernel = 0; kernel < 3; kernel++) {
        const struct gr_kernels *kernels = gr_kernels_select(names[kernel]);
        if (!kernels) continue;
        for (int dim = 2; dim <= 3; dim++) {
            struct scene s;
            scene_seed(23);
            scene_default(&s, dim, GR_QUADRATIC, GR_AFFINE_GRADIENT, 1);
            CHECK(scene_build(&s, POINTS, 0.001, 0.999) == GR_OK);
            struct gr_engine *e = s.engine;
            e->sums.averages = e->sums.correct_shift = 1;
            CHECK(gr_p2g(e, kernels) == GR_OK);
            CHECK((uintptr_t)e->sums.data % 64 == 0);
            const size_t size = gr_bytes_of_sums(e, e->mesh.tile_block[e->mesh.n_tiles] - GR_FIRST_BLOCK);
            void *stored = gr_malloc(size);
            memcpy(stored, gr_sums_of_tile(e, 0), size);
            memset(gr_sums_of_tile(e, 0), 255, size);
            e->out_of_cache = 1;
            CHECK(gr_p2g(e, kernels) == GR_OK);
            CHECK(!memcmp(stored, gr_sums_of_tile(e, 0), size));
            gr_free(stored);
            scene_free(&s);
        }
    }
}
