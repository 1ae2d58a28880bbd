/* Tests of mpm/node_sums.inl and mpm/tiles.c: the sums of the nodes against sums over all points, and that they do not depend
 * on where tiles begin. */
#include <stdlib.h>
#include <string.h>

#include "kernels.h"
#include "mpm/shape.h"
#include "tests/check.h"
#include "tests/scene.h"

static const char *const names[] = {"baseline", "avx2", "avx512"};

/* Shape function of a node at a point along an axis. A cell that has a node more than once, on a short periodic axis, adds
 * up. */
static double weight_along(const struct gr_engine *e, int d, int32_t node, double x)
{
    const struct gr_axis *axis = &e->axis[d];
    const struct gr_axis_cell *cell = &axis->cell[gr_locate(axis, 1 / e->config.dx, x)];
    const struct gr_knots knots = gr_knots_of(cell);
    vd w[3], g[3];
    double sum = 0;
    gr_shape_1d(e->config.basis, &knots, e->config.lambda, v_set((x - cell->edge) / e->config.dx), w, g);
    for (int a = 0; a < gr_basis_nodes_1d(e->config.basis); a++) sum += cell->node[a] == node ? w[a][0] : 0;
    return sum;
}

/* Compare the masses and momenta of all nodes with sums over all points. */
static void check_sums(const struct scene *s, int64_t points)
{
    const struct gr_engine *e = s->engine;
    for (int64_t n = 0; n < e->mesh.n_nodes; n++) {
        double m = 0, p = 0;
        for (int64_t id = 0; id < points; id++) {
            const int64_t k = scene_find(s, id);
            int64_t rest = e->mesh.node_id[n];
            double w = *scene_at(s, GR_FIELD_mass, 0, k);
            for (int d = 0; d < e->config.dim; d++) {
                w *= weight_along(e, d, (int32_t)(rest % e->axis[d].n_nodes), *scene_at(s, GR_FIELD_x, d, k));
                rest /= e->axis[d].n_nodes;
            }
            m += w, p += w * *scene_at(s, GR_FIELD_v, 0, k);
        }
        CHECK_NEAR(scene_sum(s, n, GR_SUM_MASS), m, 1e-12 * (1 + m));
        CHECK_NEAR(scene_sum(s, n, GR_SUM_MOMENTUM), p, 1e-12 * (1 + fabs(p)));
    }
}

/* A row of n cells along the first axis, walled or periodic, with C0 lines near each other and far apart. */
static void check_row(int dim, int basis, int periodic, int n)
{
    static const int32_t lines[] = {3, 4, 5, 14, 21};
    const int64_t points = 20 + 8 * n;
    struct scene s;
    scene_seed((uint64_t)n);
    scene_default(&s, dim, basis, GR_AFFINE_NONE, 0);
    s.config.shape[0] = n, s.config.periodic[0] = periodic;
    if (basis == GR_QUADRATIC && !periodic) {
        s.config.c0_lines[0] = lines;
        while (s.config.n_c0_lines[0] < 5 && lines[s.config.n_c0_lines[0]] < n) s.config.n_c0_lines[0]++;
    }
    CHECK(scene_build(&s, points, 0.01, n % 2 ? 0.99 : 0.6) == GR_OK);
    CHECK(gr_p2g(s.engine, gr_kernels_select("")) == GR_OK);
    check_sums(&s, points);
    scene_free(&s);
}

TEST(sums_over_all_points)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int periodic = 0; periodic < 2; periodic++) {
            for (int n = 1; n <= 30; n += n < 10 ? 1 : 5) check_row(2, basis, periodic, n);
            for (int n = 1; n <= 9; n += 2) check_row(3, basis, periodic, n);
        }
}

/* The nodes of some material have the same sums, to the last bit, with other material elsewhere in their rows. */
TEST(sums_ignore_distant_material)
{
    enum { N = 200, MORE = 40 };
    for (int kernel = 0; kernel < 3; kernel++)
        for (int dim = 2; dim <= 3; dim++)
            for (int shape = 0; shape < 8; shape++) {
                const struct gr_kernels *kernels = gr_kernels_select(names[kernel]);
                struct scene s[2];
                int64_t compared = 0;
                if (!kernels) continue;
                for (int other = 0; other < 2; other++) {
                    scene_seed(31);
                    scene_default(&s[other], dim, shape % 2 ? GR_QUADRATIC : GR_LINEAR, GR_AFFINE_NONE, 0);
                    s[other].config.shape[0] = 60, s[other].config.periodic[0] = shape / 2 % 2;
                    CHECK(scene_build(&s[other], N + MORE, 0.02, 0.98) == GR_OK);
                    for (int64_t k = 0; k < N + MORE; k++) { /* some in cells 20 to 40, others in 45 to 50, or in 2 to 8 */
                        double *x = scene_at(&s[other], GR_FIELD_x, 0, k);
                        const double share = (*x + 1) / 6;
                        *x = -1 + 0.1 * (k < N ? 20 + 20 * share : shape / 4 ? 45 + 5 * share : 2 + 6 * share);
                    }
                    s[other].engine->points.n = s[other].engine->points.used = N + MORE * other;
                    for (int64_t k = N + MORE * other; k < N + MORE; k++) s[other].id[k] = -1;
                    CHECK(gr_p2g(s[other].engine, kernels) == GR_OK);
                }
                const struct gr_engine *e = s[0].engine;
                for (int64_t n = 0; n < e->mesh.n_nodes; n++) {
                    const int64_t m = (int64_t)gr_table_get(&s[1].engine->mesh.node_of, e->mesh.node_id[n]) - 1;
                    CHECK(m >= 0);
                    for (int q = 0; m >= 0 && q < GR_SUM_DAMPED(dim); q++) {
                        const double here = scene_sum(&s[0], n, q), there = scene_sum(&s[1], m, q);
                        CHECK(!memcmp(&here, &there, sizeof here));
                        compared += here != 0;
                    }
                }
                CHECK(compared > 100);
                for (int other = 0; other < 2; other++) scene_free(&s[other]);
            }
}
