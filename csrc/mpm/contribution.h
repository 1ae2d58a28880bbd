/* Contributions of a block of points to the nodes of its cell, row of nodes by row. */
#ifndef GR_MPM_CONTRIBUTION_H
#define GR_MPM_CONTRIBUTION_H

#include "mpm/shape.h"

enum { CHUNK = 32 / GR_W }; /* blocks prepared at once */

/* What a block of points gives to the nodes. Only what a variant needs is set. */
struct contribution {
    vd w[3][3], g[3][3], r[3][3];       /* shapes, see gr_shape */
    vd m, v[3], affine[3][3];           /* kg, m/s, m/s: C dx */
    vd stress[3][3], shift_momentum[3]; /* -V sigma/dx, m/s^2 kg: what the shift takes back */
    vd joined, c, slope[3]; /* mass and log-density of the points that join the averaging; its gradient per cell */
    vd weight;              /* 1 + u */
};

GR_INLINE vd component(const struct gr_engine *e, int field, int c, int64_t at)
{
    return v_load(e->field[field] + c * e->capacity + at);
}

/* A row of nodes: they differ in their place along the first axis, and have b and c along the others. */
struct row {
    int b, c;
};

GR_INLINE vd slope_of(const int basis, const struct contribution *p, int d, int a)
{
    if (basis == GR_LINEAR) return v_set(a ? 1.0 : -1.0);
    return p->g[d][a];
}

/* Product of the shapes along the other axes; `d` of them (0: none) differentiated. */
GR_INLINE vd beside(const int dim, const int basis, const struct contribution *p, const struct row row, const int d)
{
    vd y = p->w[1][row.b], z;
    if (d == 1) y = slope_of(basis, p, 1, row.b);
    if (dim == 2) return y;
    z = p->w[2][row.c];
    if (d == 2) z = slope_of(basis, p, 2, row.c);
    return y * z;
}

/* level + slope . r, but for the first axis: a linear field about the points, at the row. */
GR_INLINE vd level_of(const int dim, const struct contribution *p, const struct row row, vd value, const vd slope[3])
{
    value = v_fma(slope[1], p->r[1][row.b], value);
    return dim == 3 ? v_fma(slope[2], p->r[2][row.c], value) : value;
}

#endif
