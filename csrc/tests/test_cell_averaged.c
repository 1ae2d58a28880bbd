/* Tests of mpm/cell_averaged.inl: properties of cell averages that hold for any points. */
#include "mpm/engine.h"
#include "tests/check.h"
#include "tests/scene.h"

enum { POINTS = 900 };

static void averaged_scene(struct scene *s, int dim)
{
    scene_seed(61);
    scene_default(s, dim, GR_LINEAR, GR_AFFINE_GRADIENT, 0);
    s->config.cell_averaged = 1;
    s->config.pressure_from_density = 1;
    s->config.dt = 1e-4;
}

/* Log-density of a cell. */
static double density_of(const struct scene *s, int64_t cell)
{
    return s->engine->sums.average[GR_AVERAGE_C * s->engine->mesh.cell_capacity + cell];
}

/* The mass is complete. The forces have no sum and no moment, as the stress is symmetric. */
TEST(forces_balance)
{
    for (int dim = 2; dim <= 3; dim++) {
        struct scene s;
        averaged_scene(&s, dim);
        CHECK(scene_build(&s, POINTS, 0.05, 0.95) == GR_OK);
        CHECK(gr_p2g(s.engine, gr_kernels_select("")) == GR_OK);
        double mass = 0, scale = 0;
        for (int64_t k = 0; k < s.capacity; k++) mass += s.id[k] < 0 ? 0 : *scene_at(&s, GR_FIELD_mass, 0, k);
        for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++) scale += fabs(scene_sum(&s, n, 1 + dim));
        CHECK(scale > 0);
        CHECK_NEAR(scene_total(&s, 0, -1), mass, 1e-12 * mass);
        for (int d = 0; d < dim; d++) {
            CHECK_NEAR(scene_total(&s, 1 + dim + d, -1), 0, 1e-12 * scale);
            for (int j = 0; j < d; j++)
                CHECK_NEAR(scene_total(&s, 1 + dim + d, j) - scene_total(&s, 1 + dim + j, d), 0, 1e-12 * scale);
        }
        scene_free(&s);
    }
}

/* Points of uniform stress, wherever they lie, make no force at a node whose cells are all inside the material. */
TEST(a_uniform_stress_makes_no_force)
{
    for (int dim = 2; dim <= 3; dim++) {
        struct scene s;
        int64_t within = 0;
        averaged_scene(&s, dim);
        CHECK(scene_build(&s, 4 * POINTS, 0.001, 0.999) == GR_OK);
        for (int64_t k = 0; k < 4 * POINTS; k++) {
            *scene_at(&s, GR_FIELD_mass, 0, k) *= 3; /* so that every cell is full */
            for (int q = 0; q < gr_field_components(GR_FIELD_stress, dim); q++)
                *scene_at(&s, GR_FIELD_stress, q, k) = q < 3 ? -100 : 30;
        }
        CHECK(gr_p2g(s.engine, gr_kernels_select("")) == GR_OK);
        for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++) {
            int around = 1;
            for (int d = 0; d < dim; d++) {
                const double x = (scene_node_x(&s, n, d) - s.config.lower[d]) / s.config.dx;
                around &= x > 0.5 && x < s.config.shape[d] - 0.5;
            }
            within += around;
            for (int d = 0; around && d < dim; d++) CHECK_NEAR(scene_sum(&s, n, 1 + dim + d), 0, 1e-12 * 100 * s.config.dx);
        }
        CHECK(within == (dim == 2 ? 25 : 125));
        scene_free(&s);
    }
}

/* A cell has the mean log-density of its points, and after a step all of them have the density of the cell. */
TEST(points_share)
{
    struct scene s;
    averaged_scene(&s, 2);
    CHECK(scene_build(&s, POINTS, 0.05, 0.95) == GR_OK);
    CHECK(gr_grid(s.engine, gr_kernels_select("")) == GR_OK);
    for (int64_t c = 0; c < s.engine->mesh.n_cells; c++) {
        const struct gr_cell *cell = &s.engine->mesh.cell[c];
        double mass = 0, sum = 0;
        for (int32_t k = 0; k < cell->count; k++) {
            const double m = *scene_at(&s, GR_FIELD_mass, 0, gr_slot(cell, k));
            mass += m;
            sum += m * *scene_at(&s, GR_FIELD_log_density, 0, gr_slot(cell, k));
        }
        if (cell->count) CHECK_NEAR(density_of(&s, c), sum / mass, 1e-14);
    }
    const struct gr_cell first = s.engine->mesh.cell[s.engine->mesh.n_cells / 2];
    CHECK(gr_g2p(s.engine, gr_kernels_select("")) == GR_OK);
    const struct gr_cell *now = &s.engine->mesh.cell[s.engine->mesh.n_cells / 2];
    CHECK(first.count > 2 && now->count > 1);
    int64_t like = 0;
    for (int32_t k = 0; k < now->count; k++)
        like +=
            *scene_at(&s, GR_FIELD_log_density, 0, gr_slot(now, k)) == *scene_at(&s, GR_FIELD_log_density, 0, now->offset);
    CHECK(like >= now->count - 1); /* except for one that may have come from another cell */
    scene_free(&s);
}

/* Cells without points do not count as neighbours. G2P without sums is refused. */
TEST(asks_for_sums)
{
    struct scene s;
    averaged_scene(&s, 2);
    CHECK(scene_build(&s, 50, 0.3, 0.7) == GR_OK);
    const struct gr_kernels *kernels = gr_kernels_select("");
    CHECK(gr_p2g(s.engine, kernels) == GR_OK);
    int64_t empty = 0;
    for (int64_t c = 0; c < s.engine->mesh.n_cells; c++)
        if (!s.engine->mesh.cell[c].count) empty += density_of(&s, c) < -1e299;
    CHECK(empty > 0);
    CHECK(gr_regroup(s.engine, NULL) == GR_OK);
    CHECK(gr_g2p(s.engine, kernels) == GR_ERR_CONFIG);
    CHECK(gr_advance(s.engine, kernels, 3, INFINITY, 2) == GR_OK);
    scene_free(&s);
}

/* Variants that are not compiled are refused. */
TEST(refuses_others)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int affine = 0; affine < GR_AFFINE_COUNT; affine++) {
            struct scene s;
            scene_default(&s, 2, basis, affine, 0);
            s.config.cell_averaged = 1;
            const int built = basis == GR_LINEAR && affine == GR_AFFINE_GRADIENT;
            CHECK(scene_build(&s, 10, 0.2, 0.8) == (built ? GR_OK : GR_ERR_CONFIG));
            scene_free(&s);
        }
}
