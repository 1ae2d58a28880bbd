/* Contributions of points to the sums of the nodes of their cells, a lane for each cell. A row of nodes along the first
 * axis is served at a time. */
#pragma once

#include "mpm/of_material.h"
#include "mpm/shape.h"

/* Rows of points that are prepared together: a share of `rows` in as few parts as have no more than these. Between two
 * parts the sums of all nodes are stored and loaded again, which in 3D takes as long as four rows; a dozen rows overflow the
 * first-level cache a little, and take less time than two parts (measured). */
enum { MOST_PREPARED = GR_SIZE(12, 4) }; /* the latter is a guess */
GR_INLINE int gr_prepared(int rows)
{
    const int parts = (rows + MOST_PREPARED - 1) / MOST_PREPARED;
    return parts > 1 ? (rows + parts - 1) / parts : MOST_PREPARED;
}

/* Contributions of the points in a row of a tile, or a part of it. Only the members that a variant needs are set. */
struct contribution {
    vd w[3][3], g[3][3];           /* shape functions, see gr_shape */
    vd m, v[3], affine[3][3];      /* mass, kg; affine velocity field at the edge of the cell, m/s; C dx, m/s */
    vd stress[6], body_force[3];   /* -V sigma/dx, N; force by the shape functions themselves, N */
    vd hoop;                       /* in an axisymmetric plane: dx/r */
    vd weight;                     /* quadrature weight q = 1 + u */
    vd filled, joined;             /* volume as a mass (engine.h), kg; the same of connected points, else 0 */
    vd c, slope[3];                /* log-density at the edge of the cell, and its gradient per cell */
    vd pressed, pressure_slope[3]; /* pressure over K of the first material there, and its gradient per cell */
};

/* Component c of a field for the points in the slots from `at` on. */
GR_INLINE vd component(const struct gr_engine *e, int field, int c, int64_t at)
{
    return v_load(gr_numbers(e, field, c, at));
}

enum { MOST_SUMS = 7 }; /* of a node that are added up together */

/* A row of nodes along the first axis; b and c are their indices along the other two. */
struct row {
    int b, c;
};

/* Derivative of shape function a along axis d. */
GR_INLINE vd slope_1d(const int basis, const struct contribution *p, int d, int a)
{
    if (basis == GR_LINEAR) return v_set(a ? 1.0 : -1.0);
    return p->g[d][a];
}

/* Product of the shape functions along y and z at a row of nodes. The one along axis d is differentiated; none if d is
 * 0. */
GR_INLINE vd weight_yz(const int dim, const int basis, const struct contribution *p, const struct row row, const int d)
{
    vd y = p->w[1][row.b], z;
    if (d == 1) y = slope_1d(basis, p, 1, row.b);
    if (dim == 2) return y;
    z = p->w[2][row.c];
    if (d == 2) z = slope_1d(basis, p, 2, row.c);
    return y * z;
}

/* A linear field of the points is given at the edge of their cells, the origin of local coordinates. So its values at the
 * nodes take the positions of the nodes alone, which all points of a cell have in common. */
GR_INLINE vd at_edge(const int dim, const struct gr_shape *s, vd value, const vd slope[3])
{
    for (int d = 0; d < dim; d++) value = v_fnma(slope[d], s->xi[d], value);
    return value;
}

/* Add what such a field changes from the edge to node a along axis d. */
GR_INLINE vd along_axis(const int basis, const struct gr_frame *frame, int d, int a, vd value, vd slope)
{
    if (basis == GR_LINEAR) return a ? v_add(value, slope) : value; /* the nodes are at the ends of the cell */
    return v_fma(slope, frame->position[d][a], value);
}

/* The field at a row of nodes, without the term along x. */
GR_INLINE vd linear_yz(const int dim, const int basis, const struct gr_frame *frame, const struct row row, vd value,
                       const vd slope[3])
{
    value = along_axis(basis, frame, 1, row.b, value, slope[1]);
    return dim == 3 ? along_axis(basis, frame, 2, row.c, value, slope[2]) : value;
}
