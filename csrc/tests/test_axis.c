/* Tests of core/axis.c: the shape functions of one axis, against their sum rules and the Cox-de Boor recursion. */
#include "core/axis.h"
#include "core/memory.h"

#include <stdint.h>

#include "core/error.h"
#include "mpm/shape.h"
#include "tests/check.h"

enum { N = 9 };
static const int32_t c0_lines[] = {3, 4, 7};

static double value(const struct gr_axis_cell *cell, int a, double xi)
{
    return cell->coefficient[a][0] + xi * (cell->coefficient[a][1] + xi * cell->coefficient[a][2]);
}

static double slope(const struct gr_axis_cell *cell, int a, double xi)
{
    return cell->coefficient[a][1] + 2 * xi * cell->coefficient[a][2];
}

/* Degree-`degree` B-spline i on the knots t. */
static double b_spline(const double *t, int i, int degree, double x)
{
    if (degree == 0) return x >= t[i] && x < t[i + 1];
    const double left = t[i + degree] - t[i], right = t[i + degree + 1] - t[i + 1];
    return (left > 0 ? (x - t[i]) / left * b_spline(t, i, degree - 1, x) : 0) +
           (right > 0 ? (t[i + degree + 1] - x) / right * b_spline(t, i + 1, degree - 1, x) : 0);
}

/* Sum rules over the nodes of a cell: 1, the derivative of 1, x and its derivative. */
static void check_sums(const struct gr_axis *axis, int nodes, int cells)
{
    for (int c = 0; c < cells; c++)
        for (double xi = 0; xi <= 1; xi += 1.0 / 64) {
            double one = 0, d_one = 0, x = 0, d_x = 0;
            for (int a = 0; a < nodes; a++) {
                const struct gr_axis_cell *cell = &axis->cell[c];
                CHECK(value(cell, a, xi) >= 0);
                one += value(cell, a, xi), d_one += slope(cell, a, xi);
                x += value(cell, a, xi) * cell->position[a], d_x += slope(cell, a, xi) * cell->position[a];
            }
            CHECK_NEAR(one, 1, 1e-15);
            CHECK_NEAR(d_one, 0, 1e-14);
            CHECK_NEAR(x, xi, 1e-14);
            CHECK_NEAR(d_x, 1, 1e-14);
        }
}

TEST(linear_functions_are_reproduced)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int periodic = 0; periodic < 2; periodic++)
            for (int n = 1; n <= N && basis != GR_UGIMP; n++) {
                struct gr_axis axis;
                const int nodes = gr_basis_nodes_1d(basis);
                CHECK(gr_axis_build(&axis, basis, n, periodic, NULL, 0, 0, -2, 0.5) == GR_OK);
                CHECK(axis.n_cells == n && axis.n_nodes == (periodic ? n : n + nodes - 1));
                CHECK_NEAR(axis.length, 0.5 * n, 0);
                check_sums(&axis, nodes, n);
                if (basis == GR_LINEAR) CHECK(axis.cell[n - 1].node[1] == (periodic ? 0 : n));
                gr_axis_free(&axis);
            }
}

/* Compare with the recursion on the whole knot vector, including c0_lines and open ends. */
TEST(quadratic_is_the_spline)
{
    const double knot[] = {0, 0, 0, 1, 2, 3, 3, 4, 4, 5, 6, 7, 7, 8, 9, 9, 9};
    struct gr_axis axis;
    CHECK(gr_axis_build(&axis, GR_QUADRATIC, N, 0, c0_lines, 3, 0, 0, 1) == GR_OK);
    CHECK(axis.n_nodes == N + 2 + 3);
    check_sums(&axis, 3, N);
    for (int c = 0; c < N; c++)
        for (double xi = 0; xi < 1; xi += 1.0 / 16)
            for (int i = 0; i < axis.n_nodes; i++) {
                double sum = 0;
                for (int a = 0; a < 3; a++)
                    if (axis.cell[c].node[a] == i) sum += value(&axis.cell[c], a, xi);
                CHECK_NEAR(sum, b_spline(knot, i, 2, c + xi), 1e-14);
            }
    gr_axis_free(&axis);
}

/* At an open end and on a C0 line one node has the whole weight: the boundary condition of a wall holds exactly there. */
TEST(walls_interpolate)
{
    struct gr_axis axis;
    CHECK(gr_axis_build(&axis, GR_QUADRATIC, N, 0, c0_lines, 3, 0, 0, 1) == GR_OK);
    const int at[] = {0, 3, 4, 7};
    for (int k = 0; k < 4; k++) {
        CHECK_NEAR(value(&axis.cell[at[k]], 0, 0), 1, 1e-15);
        CHECK_NEAR(axis.node_position[axis.cell[at[k]].node[0]], at[k], 0);
    }
    CHECK_NEAR(value(&axis.cell[N - 1], 2, 1), 1, 1e-15);
    CHECK_NEAR(axis.node_position[axis.n_nodes - 1], N, 0);
    for (int k = 1; k < 4; k++) /* the same node, seen from the cell below */
        CHECK(axis.cell[at[k] - 1].node[2] == axis.cell[at[k]].node[0]);
    gr_axis_free(&axis);
}

TEST(integrals_fill_the_domain)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int periodic = 0; periodic < 2; periodic++) {
            struct gr_axis axis;
            const int n_c0_lines = basis == GR_QUADRATIC && periodic ? 0 : 3;
            CHECK(gr_axis_build(&axis, basis, N, periodic, c0_lines, n_c0_lines, 0.25, 0, 1) == GR_OK);
            double sum = 0, least = 1;
            for (int i = 0; i < axis.n_nodes; i++) {
                sum += axis.node_integral[i];
                const int beyond = axis.node_position[i] < 0 || axis.node_position[i] > N; /* ugimp */
                if (!beyond) least = fmin(least, axis.node_integral[i]);
            }
            CHECK_NEAR(sum, N, 1e-13);
            CHECK(least > 0.3);
            gr_axis_free(&axis);
        }
}

/* Volume of the wall nodes of the quadratic basis: 1/3, 2/3, then 1 cell. */
TEST(integrals_at_a_wall)
{
    struct gr_axis axis;
    CHECK(gr_axis_build(&axis, GR_QUADRATIC, N, 0, NULL, 0, 0, 0, 1) == GR_OK);
    const double expected[] = {1.0 / 3, 2.0 / 3, 1, 1};
    for (int i = 0; i < 4; i++) {
        CHECK_NEAR(axis.node_integral[i], expected[i], 1e-15);
        CHECK_NEAR(axis.node_integral[axis.n_nodes - 1 - i], expected[i], 1e-15);
    }
    gr_axis_free(&axis);
}

/* Integral of N r over the domain, in cells, by three Gauss points a cell. */
static double by_gauss(const struct gr_axis *axis, int basis, int i, double first)
{
    const double at[] = {0.5 - sqrt(0.15), 0.5, 0.5 + sqrt(0.15)}, weight[] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    double sum = 0;
    for (int c = 0; c < axis->n_cells; c++)
        for (int a = 0; a < gr_basis_nodes_1d(basis); a++)
            for (int k = 0; k < 3 && axis->cell[c].node[a] == i; k++)
                sum += weight[k] * value(&axis->cell[c], a, at[k]) * (first + c + at[k]);
    return sum;
}

/* Integrals over the radius: of each node, of all together, and at the axis. */
TEST(radial_integrals)
{
    static const int bases[] = {GR_LINEAR, GR_QUADRATIC};
    static const double at_axis[][3] = {{1.0 / 6, 1, 2}, {1.0 / 12, 1.0 / 2, 3.0 / 2}};
    const double dx = 0.25;
    for (int b = 0; b < 2; b++)
        for (int first = 0; first < 6; first += 3) {
            struct gr_axis axis, plane;
            CHECK(gr_axis_build(&plane, bases[b], N, 0, c0_lines, 3, 0, first * dx, dx) == GR_OK);
            CHECK(gr_axis_build(&axis, bases[b], N, 0, c0_lines, 3, 0, first * dx, dx) == GR_OK);
            gr_axis_make_radial(&axis, bases[b], dx);
            double sum = 0;
            for (int i = 0; i < axis.n_nodes; i++) {
                CHECK_NEAR(axis.node_integral[i], by_gauss(&axis, bases[b], i, first), 1e-13);
                CHECK_NEAR(axis.node_radius[i] * plane.node_integral[i], axis.node_integral[i], 1e-13);
                sum += axis.node_integral[i];
            }
            CHECK_NEAR(sum, (pow(first + N, 2) - pow(first, 2)) / 2, 1e-12);
            for (int i = 0; !first && i < 3; i++) CHECK_NEAR(axis.node_integral[i], at_axis[b][i], 1e-14);
            for (int c = 0; c < N; c++) CHECK_NEAR(axis.cell[c].radius, first + c + 0.5, 1e-14);
            gr_axis_free(&axis);
            gr_axis_free(&plane);
        }
}

/* The linear shape function of a neighbour at distance q in [0, 1], averaged over [q - l, q + l], or over its positive
 * part if clipped, by quadrature. */
static double averaged(double q, double l, int clip)
{
    double sum = 0, length = 0;
    const int n = 4000;
    for (int k = 0; k < n; k++) {
        const double y = q - l + 2 * l * (k + 0.5) / n;
        if (clip && y < 0) continue;
        sum += fmax(0, y), length += 1;
    }
    return sum / length;
}

TEST(ugimp_averages_hats)
{
    struct gr_axis axis;
    const double lambda = 0.25;
    CHECK(gr_axis_build(&axis, GR_UGIMP, N, 0, c0_lines, 3, lambda, 0, 1) == GR_OK);
    CHECK(axis.n_cells == N + 1 && axis.n_nodes == N + 3);
    for (int c = 0; c <= N; c++) {
        const struct gr_axis_cell *cell = &axis.cell[c];
        const int is_c0_line = c == 3 || c == 4 || c == 7;
        CHECK(cell->clip == (c == 0 || c == N || is_c0_line));
        CHECK_NEAR(cell->begin - cell->edge, c == 0 ? 0.5 : 0, 0);
        CHECK_NEAR(cell->end - cell->edge, c == N ? 0.5 : 1, 0);
        for (double xi = cell->begin - cell->edge + 1.0 / 128; xi < cell->end - cell->edge; xi += 1.0 / 64) {
            vd w[3], g[3];
            const struct gr_knots knots = gr_knots_of(cell);
            gr_shape_1d(GR_UGIMP, &knots, lambda, v_set(xi), w, g);
            const double r = xi - 0.5;
            const double right = cell->clip && r < 0 ? 0 : averaged(r, lambda, cell->clip);
            const double left = cell->clip && r > 0 ? 0 : averaged(-r, lambda, cell->clip);
            CHECK_NEAR(w[2][0], right, 1e-4);
            CHECK_NEAR(w[0][0], left, 1e-4);
            CHECK_NEAR(w[0][0] + w[1][0] + w[2][0], 1, 1e-15);
            CHECK_NEAR(g[0][0] + g[1][0] + g[2][0], 0, 1e-15);
            if (cell->clip) continue; /* there x is reproduced as its mean over the box only */
            CHECK_NEAR(w[2][0] - w[0][0], r, 1e-15);
            CHECK_NEAR(g[2][0] - g[0][0], 1, 1e-15);
        }
    }
    gr_axis_free(&axis);
}

/* The weights and derivatives that the kernels compute agree with the tables, lane by lane. */
TEST(blocks_agree)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++) {
        if (basis == GR_UGIMP) continue;
        struct gr_axis axis;
        CHECK(gr_axis_build(&axis, basis, N, 0, c0_lines, 3, 0.25, 0, 1) == GR_OK);
        for (int c = 0; c < N; c++)
            for (double xi = 0; xi < 1; xi += 1.0 / 32) {
                vd w[3], g[3];
                const struct gr_knots knots = gr_knots_of(&axis.cell[c]);
                gr_shape_1d(basis, &knots, 0.25, v_set(xi), w, g);
                for (int a = 0; a < gr_basis_nodes_1d(basis); a++) {
                    CHECK_NEAR(w[a][0], value(&axis.cell[c], a, xi), 1e-15);
                    CHECK_NEAR(g[a][GR_W - 1], slope(&axis.cell[c], a, xi), 1e-15);
                }
            }
        gr_axis_free(&axis);
    }
}

TEST(periodic_wraps)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int n = 1; n < 5; n++) {
            struct gr_axis axis;
            CHECK(gr_axis_build(&axis, basis, n, 1, NULL, 0, 0.25, 0, 1) == GR_OK);
            for (int c = 0; c < axis.n_cells; c++)
                for (int a = 0; a < gr_basis_nodes_1d(basis); a++) {
                    CHECK(axis.cell[c].node[a] >= 0 && axis.cell[c].node[a] < n);
                    const double gap = c - axis.shift + axis.cell[c].position[a] - axis.node_position[axis.cell[c].node[a]];
                    CHECK_NEAR(gap / n, round(gap / n), 1e-15); /* a multiple of the period */
                }
            gr_axis_free(&axis);
        }
}

/* Every x of the domain lies in exactly one cell. The cells leave no gap, and there is none beyond the ends. */
TEST(locates)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int periodic = 0; periodic < 2; periodic++)
            for (int far = 0; far < 2; far++) {
                struct gr_axis axis;
                const double origin = far ? 1e6 + 0.1 : -0.3, dx = 0.1;
                CHECK(gr_axis_build(&axis, basis, N, periodic, NULL, 0, 0.25, origin, dx) == GR_OK);
                for (int c = 0; c < axis.n_cells; c++) {
                    const double begin = axis.cell[c].begin, end = axis.cell[c].end;
                    CHECK(c == axis.n_cells - 1 || end == axis.cell[c + 1].begin);
                    CHECK(gr_locate(&axis, 1 / dx, begin) == c);
                    CHECK(gr_locate(&axis, 1 / dx, nextafter(end, begin)) == c);
                    CHECK(gr_locate(&axis, 1 / dx, 0.5 * (begin + end)) == c);
                }
                const double low = axis.cell[0].begin, high = axis.cell[axis.n_cells - 1].end;
                CHECK(gr_locate(&axis, 1 / dx, nextafter(low, -INFINITY)) < 0);
                CHECK(gr_locate(&axis, 1 / dx, high) >= axis.n_cells);
                CHECK(gr_locate(&axis, 1 / dx, -1e300) < 0 && gr_locate(&axis, 1 / dx, NAN) < 0);
                CHECK(gr_locate(&axis, 1 / dx, high + 50 * dx) > axis.n_cells + 10);
                gr_axis_free(&axis);
            }
}

TEST(refuses)
{
    struct gr_axis axis;
    const int32_t twice[] = {3, 3}, falling[] = {4, 3}, end[] = {N}, zero[] = {0}, one[] = {1};
    CHECK(gr_axis_build(&axis, GR_LINEAR, 0, 0, NULL, 0, 0, 0, 1) == GR_ERR_CONFIG);
    CHECK(gr_axis_build(&axis, GR_LINEAR, -3, 0, NULL, 0, 0, 0, 1) == GR_ERR_CONFIG);
    CHECK(gr_axis_build(&axis, GR_LINEAR, N, 0, NULL, -1, 0, 0, 1) == GR_ERR_CONFIG);
    CHECK(gr_axis_build(&axis, GR_QUADRATIC, N, 0, twice, 2, 0, 0, 1) == GR_ERR_CONFIG);
    CHECK(gr_axis_build(&axis, GR_QUADRATIC, N, 0, falling, 2, 0, 0, 1) == GR_ERR_CONFIG);
    CHECK(gr_axis_build(&axis, GR_QUADRATIC, N, 0, end, 1, 0, 0, 1) == GR_ERR_CONFIG);
    CHECK(gr_axis_build(&axis, GR_QUADRATIC, N, 0, zero, 1, 0, 0, 1) == GR_ERR_CONFIG);
    CHECK(gr_axis_build(&axis, GR_QUADRATIC, N, 1, one, 1, 0, 0, 1) == GR_ERR_CONFIG);
    CHECK(gr_axis_build(&axis, GR_UGIMP, N, 0, NULL, 0, 0, 0, 1) == GR_ERR_CONFIG);
    CHECK(gr_axis_build(&axis, GR_UGIMP, N, 0, NULL, 0, 0.6, 0, 1) == GR_ERR_CONFIG);
    CHECK(gr_axis_build(&axis, GR_UGIMP, N, 0, NULL, 0, NAN, 0, 1) == GR_ERR_CONFIG);
    CHECK(!axis.cell && !axis.node_position && !axis.node_integral);
    gr_axis_free(&axis);
}

/* The cells of each node are those that list it, from the lowest on, and their integrals add up to the integral of the
 * node. */
TEST(cells_of_nodes)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int periodic = 0; periodic < 2; periodic++) {
            struct gr_axis axis = {0};
            CHECK(gr_axis_build(&axis, basis, N, periodic, c0_lines, periodic ? 0 : 3, 0.25, 1, 0.1) == GR_OK);
            struct gr_node_cells *of = gr_axis_cells_of_nodes(&axis, basis);
            CHECK(of);
            for (int n = 0; of && n < axis.n_nodes; n++) {
                double sum = 0;
                for (int k = 0; k < of[n].count; k++) {
                    const struct gr_axis_cell *cell = &axis.cell[of[n].cell[k]];
                    CHECK(cell->node[of[n].local[k]] == n && cell->integral[of[n].local[k]] == of[n].integral[k]);
                    if (k) CHECK(of[n].local[k] < of[n].local[k - 1] && (periodic || of[n].cell[k] > of[n].cell[k - 1]));
                    sum += of[n].integral[k];
                }
                CHECK_NEAR(sum, axis.node_integral[n], 1e-15);
            }
            gr_free(of);
            gr_axis_free(&axis);
        }
}
