/* Tables of one axis of the grid: its cells, its nodes and the coefficients of the shape functions (axis.h). */
#include "core/axis.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

#include "core/error.h"

static int is_c0_line(const int32_t *c0_lines, int n_c0_lines, int line)
{
    for (int k = 0; k < n_c0_lines; k++)
        if (c0_lines[k] == line) return 1;
    return 0;
}

static void set_integrals(struct gr_axis_cell *cell, int nodes)
{
    for (int a = 0; a < nodes; a++)
        cell->integral[a] = cell->coefficient[a][0] + cell->coefficient[a][1] / 2 + cell->coefficient[a][2] / 3;
}

static void build_linear(struct gr_axis *axis, int n)
{
    axis->n_cells = n;
    axis->n_nodes = axis->periodic ? n : n + 1;
    for (int i = 0; i < axis->n_nodes; i++) axis->node_position[i] = i;
    for (int c = 0; c < n; c++) {
        struct gr_axis_cell *cell = &axis->cell[c];
        cell->coefficient[0][0] = 1, cell->coefficient[0][1] = -1;
        cell->coefficient[1][1] = 1;
        cell->position[1] = 1;
        cell->node[0] = c;
        cell->node[1] = axis->periodic && c == n - 1 ? 0 : c + 1;
        set_integrals(cell, 2);
    }
}

/* Cell j is centred on its middle node, which lies at xi = 1/2. The half-cells at the two ends of a walled axis therefore
 * cover [1/2, 1) and [0, 1/2) only. Their nodes beyond the ends have no weight. */
static void build_ugimp(struct gr_axis *axis, int n, const int32_t *c0_lines, int n_c0_lines)
{
    const int cells = axis->periodic ? n : n + 1;
    axis->n_cells = cells;
    axis->n_nodes = axis->periodic ? n : n + 3;
    axis->shift = 0.5;
    for (int i = 0; i < axis->n_nodes; i++) axis->node_position[i] = axis->periodic ? (i + n - 1) % n : i - 1;
    for (int j = 0; j < cells; j++) {
        struct gr_axis_cell *cell = &axis->cell[j];
        const int first = !axis->periodic && j == 0, last = !axis->periodic && j == cells - 1;
        for (int a = 0; a < 3; a++) {
            cell->node[a] = (j + a) % axis->n_nodes;
            cell->position[a] = a - 0.5;
        }
        cell->clip = first || last || is_c0_line(c0_lines, n_c0_lines, j);
        cell->integral[1] = first || last ? 0.5 : 1; /* lumped: a node at an end has half a cell */
    }
}

/* Coefficients of the three B-splines on the knot span [t2, t3], by the Cox-de Boor recursion. The knots are t[0] to
 * t[5]; xi = t - t2, and the span has the length t3 - t2 = 1. */
static void bspline_span(const double t[6], double c[3][3])
{
    const double a = t[2] - t[1], b = t[4] - t[2], right = t[4] - t[2], left = t[3] - t[1];
    /* B0 = (1-xi)^2/left */
    c[0][0] = 1 / left, c[0][1] = -2 / left, c[0][2] = 1 / left;
    /* B2 = xi^2/right; B1 = (xi + a)(1 - xi)/left + (b - xi) xi/right */
    c[2][2] = 1 / right;
    c[1][0] = a / left, c[1][1] = (1 - a) / left + b / right, c[1][2] = -1 / left - 1 / right;
}

static int build_quadratic(struct gr_axis *axis, int n, const int32_t *c0_lines, int n_c0_lines)
{
    if (axis->periodic) {
        static const double uniform[6] = {-2, -1, 0, 1, 2, 3};
        axis->n_cells = axis->n_nodes = n;
        for (int i = 0; i < n; i++) axis->node_position[i] = (i + n - 1) % n + 0.5;
        for (int c = 0; c < n; c++) {
            struct gr_axis_cell *cell = &axis->cell[c];
            bspline_span(uniform, cell->coefficient);
            for (int a = 0; a < 3; a++) {
                cell->node[a] = (c + a) % n;
                cell->position[a] = a - 0.5;
            }
            set_integrals(cell, 3);
        }
        return GR_OK;
    }
    const int n_knots = n + 5 + n_c0_lines;
    double *knot = gr_malloc(sizeof(double) * (size_t)n_knots);
    if (!knot) return GR_ERR_MEMORY;
    int k = 0;
    knot[k++] = 0, knot[k++] = 0;
    for (int line = 0; line <= n; line++) {
        knot[k++] = line;
        if (is_c0_line(c0_lines, n_c0_lines, line)) knot[k++] = line;
    }
    knot[k++] = n, knot[k++] = n;
    axis->n_cells = n;
    axis->n_nodes = n + 2 + n_c0_lines;
    for (int i = 0; i < axis->n_nodes; i++) axis->node_position[i] = 0.5 * (knot[i + 1] + knot[i + 2]);
    for (int c = 0, s = 2; c < n; c++, s++) { /* s: index of the last knot at grid line c */
        while (knot[s + 1] <= c) s++;
        struct gr_axis_cell *cell = &axis->cell[c];
        bspline_span(knot + s - 2, cell->coefficient);
        for (int a = 0; a < 3; a++) {
            cell->node[a] = s - 2 + a;
            cell->position[a] = axis->node_position[s - 2 + a] - c;
        }
        set_integrals(cell, 3);
    }
    gr_free(knot);
    return GR_OK;
}

/* Number the nodes by their positions. */
static void number_nodes(struct gr_axis *axis, int basis)
{
    const int beyond = basis == GR_UGIMP && !axis->periodic, rotated = basis != GR_LINEAR && axis->periodic;
    axis->n_numbers = axis->n_nodes - 2 * beyond;
    for (int i = 0; i < axis->n_nodes; i++) {
        const int number = rotated ? (i + axis->n_nodes - 1) % axis->n_nodes : i - beyond;
        axis->node_number[i] = number < 0 ? 0 : number < axis->n_numbers ? number : axis->n_numbers - 1;
    }
}

/* Set the coordinates of the cells. Cells of ugimp would reach half a cell beyond the ends of a walled domain and are
 * cut off there. */
static void place_cells(struct gr_axis *axis, double dx)
{
    for (int c = 0; c < axis->n_cells; c++) {
        axis->cell[c].edge = axis->cell[c].begin = axis->origin + (c - axis->shift) * dx;
        axis->cell[c].end = axis->origin + (c + 1 - axis->shift) * dx;
    }
    if (axis->periodic) return;
    axis->cell[0].begin = axis->origin;
    axis->cell[axis->n_cells - 1].end = axis->origin + axis->length;
}

int gr_axis_build(struct gr_axis *axis, int basis, int n, int periodic, const int32_t *c0_lines, int n_c0_lines,
                  double lambda, double origin, double dx)
{
    int error = GR_ERR_CONFIG;
    memset(axis, 0, sizeof *axis);
    if (n < 1 || (periodic && basis == GR_QUADRATIC && n_c0_lines) || n_c0_lines < 0 || n_c0_lines >= n) goto out;
    if (basis == GR_UGIMP && !(lambda > 0 && lambda <= 0.5)) goto out;
    for (int k = 0; k < n_c0_lines; k++)
        if (c0_lines[k] <= 0 || c0_lines[k] >= n || (k && c0_lines[k] <= c0_lines[k - 1])) goto out;
    axis->periodic = periodic;
    axis->origin = origin;
    axis->length = n * dx;
    error = GR_ERR_MEMORY;
    axis->cell = gr_calloc((size_t)n + 1, sizeof *axis->cell);
    axis->node_position = gr_calloc((size_t)(n + 3 + n_c0_lines), sizeof(double));
    axis->node_integral = gr_calloc((size_t)(n + 3 + n_c0_lines), sizeof(double));
    axis->node_radius = gr_calloc((size_t)(n + 3 + n_c0_lines), sizeof(double));
    axis->node_number = gr_calloc((size_t)(n + 3 + n_c0_lines), sizeof(int32_t));
    if (!axis->cell || !axis->node_number || !axis->node_position || !axis->node_integral || !axis->node_radius) goto out;
    error = GR_OK;
    if (basis == GR_LINEAR)
        build_linear(axis, n);
    else if (basis == GR_UGIMP)
        build_ugimp(axis, n, c0_lines, n_c0_lines);
    else
        error = build_quadratic(axis, n, c0_lines, n_c0_lines);
    if (!error) place_cells(axis, dx);
    if (!error) number_nodes(axis, basis);
    for (int c = 0; !error && c < axis->n_cells; c++)
        for (int a = 0; a < gr_basis_nodes_1d(basis); a++)
            axis->node_integral[axis->cell[c].node[a]] += axis->cell[c].integral[a];
    for (int c = 0; !error && c < axis->n_cells; c++) axis->cell[c].radius = 1;
    for (int i = 0; !error && i < axis->n_nodes; i++) axis->node_radius[i] = 1;
out:
    if (error) gr_axis_free(axis);
    return error;
}

void gr_axis_make_radial(struct gr_axis *axis, int basis, double dx)
{
    for (int i = 0; i < axis->n_nodes; i++) axis->node_radius[i] = 0;
    for (int c = 0; c < axis->n_cells; c++) {
        struct gr_axis_cell *cell = &axis->cell[c];
        const double low = axis->origin / dx + (c - axis->shift);
        cell->radius = low + 0.5;
        for (int a = 0; a < gr_basis_nodes_1d(basis); a++) {
            const double *q = cell->coefficient[a];
            cell->integral[a] = low * (q[0] + q[1] / 2 + q[2] / 3) + (q[0] / 2 + q[1] / 3 + q[2] / 4);
            axis->node_radius[cell->node[a]] += cell->integral[a];
        }
    }
    for (int i = 0; i < axis->n_nodes; i++) {
        const double radius = axis->node_radius[i] / axis->node_integral[i];
        axis->node_integral[i] = axis->node_radius[i];
        axis->node_radius[i] = radius;
    }
}

struct gr_node_cells *gr_axis_cells_of_nodes(const struct gr_axis *axis, int basis)
{
    struct gr_node_cells *of = gr_calloc((size_t)axis->n_nodes, sizeof *of);
    for (int a = gr_basis_nodes_1d(basis); of && a-- > 0;)
        for (int32_t c = 0; c < axis->n_cells; c++) {
            struct gr_node_cells *cells = &of[axis->cell[c].node[a]];
            cells->cell[cells->count] = c;
            cells->local[cells->count] = a;
            cells->integral[cells->count++] = axis->cell[c].integral[a];
        }
    return of;
}

void gr_axis_free(struct gr_axis *axis)
{
    gr_free(axis->cell);
    gr_free(axis->node_number);
    gr_free(axis->node_position);
    gr_free(axis->node_integral);
    gr_free(axis->node_radius);
    memset(axis, 0, sizeof *axis);
}
