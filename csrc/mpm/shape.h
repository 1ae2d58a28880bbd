/* Shape functions of a block of points in a cell, and sums over the nodes of the cell. */
#ifndef GR_MPM_SHAPE_H
#define GR_MPM_SHAPE_H

#include "core/simd.h"
#include "mpm/engine.h"

#define GR_INLINE static inline __attribute__((always_inline))

struct gr_shape {
    vd w[3][3]; /* axis, node: value */
    vd g[3][3]; /* derivative by the coordinate in cells (ugimp: its mean over the extent of the point) */
    vd r[3][3]; /* position of the node from the point, cells */
};

GR_INLINE int gr_power(int k, int dim) { return dim == 2 ? k * k : k * k * k; }
GR_INLINE int gr_nodes_1d(const int basis) { return basis == GR_LINEAR ? 2 : 3; }

/* Local coordinate in [0, 1) of a cell; the same operations as gr_locate, so that both agree to the last bit. */
GR_INLINE vd gr_local(const struct gr_axis *axis, double inv_dx, const double *x, int32_t at)
{
    return ((v_load(x) - v_set(axis->origin)) * v_set(inv_dx) + v_set(axis->shift)) - v_set((double)at);
}

GR_INLINE void gr_shape_1d(const int basis, const struct gr_axis_cell *cell, double lambda, vd xi, vd w[3], vd g[3])
{
    if (basis == GR_LINEAR) {
        w[0] = v_set(1.0) - xi, w[1] = xi;
        g[0] = v_set(-1.0), g[1] = v_set(1.0);
    } else if (basis == GR_QUADRATIC) {
        for (int a = 0; a < 3; a++) {
            const double *c = cell->coefficient[a];
            w[a] = v_fma(v_fma(v_set(c[2]), xi, v_set(c[1])), xi, v_set(c[0]));
            g[a] = v_fma(v_set(2.0 * c[2]), xi, v_set(c[1]));
        }
    } else { /* ugimp: h(r) is the hat of a neighbour, averaged over [r - lambda, r + lambda] */
        const vd r = xi - v_set(0.5), zero = v_zero(), one = v_set(1.0);
        vd h[2], d[2];
        for (int side = 0; side < 2; side++) {
            const vd q = side ? r : -r;
            if (cell->clip) { /* the extent ends at the node */
                const vm inside = v_ge(q, zero);
                h[side] = v_keep(inside, v_max(q, v_set(0.5) * (q + v_set(lambda))));
                d[side] = v_keep(inside, one);
            } else {
                const vd t = v_clamp(q + v_set(lambda), 0.0, 2.0 * lambda);
                h[side] = v_fma(t * t, v_set(0.25 / lambda), v_max(q - v_set(lambda), zero));
                d[side] = t * v_set(0.5 / lambda);
            }
        }
        w[0] = h[0], w[2] = h[1], w[1] = (one - h[0]) - h[1];
        g[0] = -d[0], g[2] = d[1], g[1] = d[0] - d[1];
    }
}

/* All shapes of the block whose first place is `at`. */
GR_INLINE void gr_shapes(const int dim, const int basis, const struct gr_engine *e, const struct gr_cell *cell, int64_t at,
                         int positions, struct gr_shape *s)
{
    const double inv_dx = e->inv_dx;
    for (int d = 0; d < dim; d++) {
        const struct gr_axis_cell *ac = &e->axis[d].cell[cell->at[d]];
        const vd xi = gr_local(&e->axis[d], inv_dx, e->field[GR_FIELD_x] + d * e->capacity + at, cell->at[d]);
        gr_shape_1d(basis, ac, e->config.lambda, xi, s->w[d], s->g[d]);
        if (positions)
            for (int a = 0; a < gr_nodes_1d(basis); a++) s->r[d][a] = v_set(ac->position[a]) - xi;
    }
}

/* Value of the nodal field N at the points, and its derivatives with the derivative weights g. */
GR_INLINE vd gr_interpolate(const int dim, const int basis, const double *N, const struct gr_shape *s, vd g[3][3],
                            const int derivatives, vd slope[3])
{
    const int k = gr_nodes_1d(basis);
    vd value = v_zero();
    for (int d = 0; d < dim; d++) slope[d] = v_zero();
    for (int c = 0; c < (dim == 3 ? k : 1); c++) {
        vd plane = v_zero(), plane_x = v_zero(), plane_y = v_zero();
        for (int b = 0; b < k; b++) {
            const double *row = N + k * (b + k * c);
            vd line = s->w[0][0] * v_set(row[0]), line_x = g[0][0] * v_set(row[0]);
            for (int a = 1; a < k; a++) {
                line = v_fma(s->w[0][a], v_set(row[a]), line);
                if (derivatives) line_x = v_fma(g[0][a], v_set(row[a]), line_x);
            }
            plane = b ? v_fma(s->w[1][b], line, plane) : v_mul(s->w[1][b], line);
            if (derivatives) {
                plane_x = b ? v_fma(s->w[1][b], line_x, plane_x) : v_mul(s->w[1][b], line_x);
                plane_y = b ? v_fma(g[1][b], line, plane_y) : v_mul(g[1][b], line);
            }
        }
        if (dim == 2) {
            value = plane, slope[0] = plane_x, slope[1] = plane_y;
        } else {
            value = v_fma(s->w[2][c], plane, value);
            slope[0] = v_fma(s->w[2][c], plane_x, slope[0]);
            slope[1] = v_fma(s->w[2][c], plane_y, slope[1]);
            slope[2] = v_fma(g[2][c], plane, slope[2]);
        }
    }
    return value;
}

#endif
