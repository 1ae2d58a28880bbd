/* One axis of the grid: its cells, its nodes and the shape functions of each cell.
 *
 * All bases are tensor products of one-dimensional functions. Within a cell of the *grouping*, the cells by which
 * points are sorted, each function is a polynomial of the local coordinate xi in [0, 1). Walls, inner walls and
 * periodic ends are therefore tables built once, not branches in the loops. A point belongs to the cell with
 * begin <= x < end; the comparison is exact.
 *
 *   linear     linear shape functions with nodes on the grid lines; the cells are those of the grid; 2 nodes per cell.
 *   quadratic  B-splines of degree 2. The knots are the grid lines, triple at the ends and double on c0_lines (inner
 *              walls, orifice edges), where the functions are only C0. A node on a wall then interpolates the field
 *              there. 3 nodes per cell.
 *   ugimp      points are boxes of the fixed half-width lambda (in cells). The cells of the grouping are centred on the
 *              nodes, so that a point touches 3 nodes. At walls and c0_lines the box of a point is clipped.
 *
 * The nodes of a cell follow each other, and those of the next cell are one further, or two across a c0_line of quadratic
 * functions. Across a periodic end the last cells have the first nodes. */
#pragma once

#include <stdint.h>

/* X(constant, name) */
#define GR_BASES(X) X(GR_LINEAR, linear) X(GR_UGIMP, ugimp) X(GR_QUADRATIC, quadratic)

#define GR_X(constant, name) constant,
enum gr_basis { GR_BASES(GR_X) GR_BASIS_COUNT };
#undef GR_X

#define GR_MAX_NODES_1D 3

/* Data of one cell along one axis that the kernels need. */
struct gr_axis_cell {
    double coefficient[GR_MAX_NODES_1D][3]; /* shape function a: c0 + c1 xi + c2 xi^2 (linear, quadratic) */
    double position[GR_MAX_NODES_1D];       /* of the nodes, in cells from the lower edge of the cell */
    double integral[GR_MAX_NODES_1D];       /* of the shape functions over the cell, in cells; see gr_axis_make_radial */
    double radius;                          /* 1; on a radial axis that of its middle, in cells */
    double edge;                            /* coordinate where xi = 0, m */
    double begin, end;                      /* the part of the domain that belongs to the cell, m */
    int32_t node[GR_MAX_NODES_1D];          /* index of the nodes along the axis */
    int32_t clip;                           /* ugimp: 1 where the boxes of points end at the node of this cell */
};

struct gr_axis {
    int n_cells; /* cells of the grouping */
    int n_nodes;
    int periodic;
    double origin; /* coordinate of the lower end of the domain, m */
    double length; /* length of the domain, m */
    double shift;  /* the cell of x is approximately (x - origin)/dx + shift */
    struct gr_axis_cell *cell;
    int n_numbers;         /* nodes without those beyond the ends */
    int32_t *node_number;  /* of a node in the order of positions; beyond an end that of the node at the end */
    double *node_position; /* in cells from the origin */
    double *node_integral; /* of the shape function of a node over the domain, in cells; see gr_axis_make_radial */
    double *node_radius;   /* 1; on a radial axis the mean of the radius over the shape function, in cells */
};

/* The cells that have a node, from the lowest on, also across a periodic end; which of their nodes it is, and the shares of
 * its shape function in them. */
struct gr_node_cells {
    int32_t count, cell[GR_MAX_NODES_1D], local[GR_MAX_NODES_1D];
    double integral[GR_MAX_NODES_1D]; /* over each of the cells, in cells */
};

/* Index of the cell of x; a number outside [0, n_cells) if x lies outside the domain, also on a periodic axis. */
static inline int64_t gr_locate(const struct gr_axis *axis, double inv_dx, double x)
{
    const double guess = (x - axis->origin) * inv_dx + axis->shift; /* exact up to rounding */
    if (!(guess > -1e15 && guess < 1e15)) return -(int64_t)1e15;
    const int64_t last = axis->n_cells - 1;
    int64_t at = (int64_t)guess;
    at -= guess < (double)at; /* rounded down */
    if (x < axis->cell[0].begin) return at < 0 ? at : -1;
    if (x >= axis->cell[last].end) return at > last ? at : last + 1;
    at = at < 0 ? 0 : at > last ? last : at;
    while (x < axis->cell[at].begin) at--;
    while (x >= axis->cell[at].end) at++;
    return at;
}

static inline int gr_basis_nodes_1d(int basis) { return basis == GR_LINEAR ? 2 : 3; }

/* Build the tables of one axis.
 *
 * Given: basis; n, the number of grid cells; periodic; c0_lines[n_c0_lines], interior grid lines in ascending order;
 * lambda, the half-width of a point in cells for ugimp, 0 < lambda <= 1/2; origin and dx in m.
 * Returned: 0, GR_ERR_MEMORY or GR_ERR_CONFIG. */
int gr_axis_build(struct gr_axis *axis, int basis, int n, int periodic, const int32_t *c0_lines, int n_c0_lines,
                  double lambda, double origin, double dx);

/* Turn an axis that was built with cells of dx, m, into that of the radius in an axisymmetric plane, whose volumes are
 * integrals over r dr: the integrals are those of the shape functions times the radius in cells, over 1. */
void gr_axis_make_radial(struct gr_axis *axis, int basis, double dx);

/* List the cells of all nodes of an axis of the given basis.
 * Returned: an array of n_nodes, to be freed by the caller; NULL without memory. */
struct gr_node_cells *gr_axis_cells_of_nodes(const struct gr_axis *axis, int basis);
void gr_axis_free(struct gr_axis *axis);
