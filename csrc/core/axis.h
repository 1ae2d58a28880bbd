/* One axis of the grid: its cells, its nodes, and the shape functions of each cell along it.
 *
 * All bases are products of one-dimensional functions, and within a cell of the *grouping* each is a
 * known function of the local coordinate xi in [0, 1), so walls, inner walls and periodic ends are a
 * matter of tables built once, not of branches in the loops. A point belongs to the cell with
 * begin <= x < end, to the last bit.
 *
 *   linear     nodes on the grid lines; cells as the grid's; 2 nodes a cell.
 *   quadratic  B-splines of degree 2 with knots on the grid lines, triple at the ends and double on
 *              c0_lines (inner walls, orifice edges), so that a wall's nodes interpolate; 3 nodes a cell.
 *   ugimp      points of fixed half-width lambda (in cells); grouped in cells centred on the nodes, so
 *              that a point touches 3 nodes; at walls and c0_lines the extent of a point is clipped. */
#ifndef GR_CORE_AXIS_H
#define GR_CORE_AXIS_H

#include <stdint.h>

/* X(constant, name) */
#define GR_BASES(X) X(GR_LINEAR, linear) X(GR_UGIMP, ugimp) X(GR_QUADRATIC, quadratic)

enum gr_basis {
#define GR_X(constant, name) constant,
    GR_BASES(GR_X)
#undef GR_X
        GR_BASIS_COUNT
};

#define GR_MAX_NODES_1D 3

/* What a kernel needs to know of one cell along one axis. */
struct gr_axis_cell {
    double coefficient[GR_MAX_NODES_1D][3]; /* shape a: c0 + c1 xi + c2 xi^2 (linear, quadratic) */
    double position[GR_MAX_NODES_1D];       /* of the nodes, in cells from the cell's lower edge */
    double integral[GR_MAX_NODES_1D];       /* of the shapes over the cell, in cells */
    double edge;                            /* coordinate where xi = 0, m */
    double begin, end;                      /* the cell's part of the domain, m; the next cell begins at `end` */
    int32_t node[GR_MAX_NODES_1D];          /* index of the nodes along the axis */
    int32_t clip;                           /* ugimp: 1 where extents end at this cell's node */
};

struct gr_axis {
    int n_cells; /* cells of the grouping */
    int n_nodes;
    int periodic;
    double origin; /* coordinate of the lower end of the domain, m */
    double length; /* of the domain, m */
    double shift;  /* the cell of x is about (x - origin)/dx + shift */
    struct gr_axis_cell *cell;
    double *node_position; /* in cells from the origin */
    double *node_integral; /* of the shape of a node over the domain, in cells */
};

/* Cell of x, or a number outside [0, n_cells) for an x outside the domain (of a periodic axis, too). */
int64_t gr_locate(const struct gr_axis *axis, double inv_dx, double x);

static inline int gr_basis_nodes_1d(int basis) { return basis == GR_LINEAR ? 2 : 3; }

/* Build the tables of one axis.
 * Given: basis, n (grid cells), periodic, c0_lines[n_c0_lines] (interior grid lines, ascending), lambda
 * (ugimp: half-width of a point in cells, 0 < lambda <= 1/2), origin and dx in m.
 * Returned: 0, GR_ERR_MEMORY or GR_ERR_CONFIG. */
int gr_axis_build(struct gr_axis *axis, int basis, int n, int periodic, const int32_t *c0_lines, int n_c0_lines,
                  double lambda, double origin, double dx);
void gr_axis_free(struct gr_axis *axis);

#endif
