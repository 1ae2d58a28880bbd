/* Shape functions of a block of points in a cell, and interpolation of nodal fields to the points. */
#pragma once

#include "core/simd.h"
#include "mpm/engine.h"

/* Put before a loop over blocks to prevent unrolling: an unrolled loop would first copy all its input to the stack. */
#define GR_ROLLED _Pragma("GCC unroll 1")

struct gr_shape {
    vd xi[3];   /* local coordinate in the cell */
    vd w[3][3]; /* value, by axis and node */
    vd g[3][3]; /* derivative with respect to the coordinate in cells (ugimp: its mean over the box of the point) */
    vd r[3][3]; /* position of the node relative to the point, in cells */
};

/* Position of a cell, common to its points. */
struct gr_frame {
    const struct gr_axis_cell *axis[3];
    vd edge[3], inv_dx;
    double lambda;
};

GR_INLINE int gr_power(int k, int dim) { return dim == 2 ? k * k : k * k * k; }
GR_INLINE int gr_nodes_1d(const int basis) { return basis == GR_LINEAR ? 2 : 3; }

/* Look up the frame of a cell. Beyond the dimension nothing is set, and nothing is used. */
GR_INLINE void gr_frame_of(const int dim, const struct gr_engine *e, const struct gr_cell *cell, struct gr_frame *frame)
{
    frame->inv_dx = v_set(e->inv_dx);
    frame->lambda = e->config.lambda;
    for (int d = 0; d < dim; d++) {
        frame->axis[d] = &e->axis[d].cell[cell->at[d]];
        frame->edge[d] = v_set(frame->axis[d]->edge);
    }
}

/* Whatever its knots, a quadratic B-spline on a cell is low (1 - xi)^2, 1 - low (1 - xi)^2 - high xi^2, or high xi^2. */
GR_INLINE double gr_low(const struct gr_axis_cell *cell) { return cell->coefficient[0][2]; }
GR_INLINE double gr_high(const struct gr_axis_cell *cell) { return cell->coefficient[2][2]; }

GR_INLINE void gr_shape_1d(const int basis, const struct gr_axis_cell *cell, double lambda, vd xi, vd w[3], vd g[3])
{
    if (basis == GR_LINEAR) {
        w[0] = v_set(1.0) - xi, w[1] = xi;
        g[0] = v_set(-1.0), g[1] = v_set(1.0);
    } else if (basis == GR_QUADRATIC) {
        const vd one = v_set(1.0), rest = one - xi; /* for any knots: low (1 - xi)^2 and high xi^2 */
        const vd low = v_set(gr_low(cell)) * rest, high = v_set(gr_high(cell)) * xi;
        w[0] = low * rest, w[2] = high * xi, w[1] = (one - w[0]) - w[2];
        g[0] = v_set(-2.0) * low, g[2] = high + high, g[1] = -g[2] - g[0];
    } else { /* ugimp: h(r) is the linear shape function of a neighbour, averaged over [r - lambda, r + lambda] */
        const vd r = xi - v_set(0.5), zero = v_zero(), one = v_set(1.0);
        vd h[2], d[2];
        for (int side = 0; side < 2; side++) {
            const vd q = side ? r : -r;
            if (cell->clip) { /* the box of a point ends at the node */
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

/* All shape functions of the block of points at place `at`. */
GR_INLINE void gr_shapes(const int dim, const int basis, const struct gr_engine *e, const struct gr_frame *frame, int64_t at,
                         const int positions, struct gr_shape *s)
{
    for (int d = 0; d < dim; d++) {
        s->xi[d] = (v_load(e->field[GR_FIELD_x] + d * e->capacity + at) - frame->edge[d]) * frame->inv_dx;
        gr_shape_1d(basis, frame->axis[d], frame->lambda, s->xi[d], s->w[d], s->g[d]);
        for (int a = 0; positions && a < gr_nodes_1d(basis); a++) s->r[d][a] = v_set(frame->axis[d]->position[a]) - s->xi[d];
    }
}

/* Convert the nodal values of fields on a cell to modes. If the shape functions are polynomials in xi, the modes are
 * the coefficients of the powers of xi along each axis, and a value is a short Horner scheme. If `nodal`, the modes are
 * the nodal values themselves.
 * Changed: mode[node * stride + q] of n_fields fields, from values to modes, in whole vectors of fields. */
GR_INLINE void gr_modes(const int dim, const int basis, const int nodal, const int n_fields, const int stride,
                        const struct gr_frame *frame, double *mode)
{
    const int k = gr_nodes_1d(basis), K = gr_power(k, dim);
    for (int q = 0; !nodal && q < n_fields; q += GR_W) {
        vd m[GR_MAX_NODES];
        GR_UNROLLED
        for (int i = 0; i < K; i++) m[i] = v_load(mode + i * stride + q);
        GR_UNROLLED
        for (int d = 0; d < dim; d++) {
            const int step = d == 0 ? 1 : d == 1 ? k : k * k;
            GR_UNROLLED
            for (int i = 0; i < K; i++) {
                if (i / step % k) continue; /* not the first node of a line along d */
                const vd n0 = m[i], n1 = m[i + step], n2 = k == 3 ? m[i + 2 * step] : n1;
                if (basis == GR_LINEAR) {
                    m[i + step] = n1 - n0;
                    continue;
                }
                const vd low = v_set(gr_low(frame->axis[d])) * (n0 - n1);
                m[i] = n1 + low;
                m[i + step] = v_set(-2.0) * low;
                m[i + 2 * step] = v_fma(v_set(gr_high(frame->axis[d])), n2 - n1, low);
            }
        }
        GR_UNROLLED
        for (int i = 0; i < K; i++) v_store(mode + i * stride + q, m[i]);
    }
}

/* Value and derivative along axis d, from the modes m. */
GR_INLINE void gr_along(const int basis, const int nodal, const struct gr_shape *s, const vd g[3][3], const int d,
                        const vd m[3], vd *value, vd *slope)
{
    if (nodal) {
        *value = s->w[d][0] * m[0], *slope = g[d][0] * m[0];
        for (int a = 1; a < gr_nodes_1d(basis); a++) {
            *value = v_fma(s->w[d][a], m[a], *value);
            *slope = v_fma(g[d][a], m[a], *slope);
        }
    } else if (basis == GR_LINEAR) {
        *value = v_fma(m[1], s->xi[d], m[0]), *slope = m[1];
    } else {
        *value = v_fma(v_fma(m[2], s->xi[d], m[1]), s->xi[d], m[0]);
        *slope = v_fma(m[2], s->xi[d] + s->xi[d], m[1]);
    }
}

/* Value at the points of the field with the modes mode[0], mode[stride], ..., and its gradient per cell. If `nodal`, g
 * are the weights of the derivatives. The compiler omits what a caller does not use. */
GR_INLINE vd gr_interpolate(const int dim, const int basis, const int nodal, const double *mode, const int stride,
                            const struct gr_shape *s, const vd g[3][3], vd gradient[3])
{
    const int k = gr_nodes_1d(basis);
    vd value[3], slope_x[3], slope_y[3], unused;
    for (int c = 0; c < (dim == 3 ? k : 1); c++) {
        vd line[3], line_x[3];
        for (int b = 0; b < k; b++) {
            vd m[3];
            for (int a = 0; a < k; a++) m[a] = v_set(mode[(a + k * (b + k * c)) * stride]);
            gr_along(basis, nodal, s, g, 0, m, &line[b], &line_x[b]);
        }
        gr_along(basis, nodal, s, g, 1, line, &value[c], &slope_y[c]);
        gr_along(basis, nodal, s, g, 1, line_x, &slope_x[c], &unused);
    }
    if (dim == 2) {
        gradient[0] = slope_x[0], gradient[1] = slope_y[0];
        return value[0];
    }
    vd whole;
    gr_along(basis, nodal, s, g, 2, value, &whole, &gradient[2]);
    gr_along(basis, nodal, s, g, 2, slope_x, &gradient[0], &unused);
    gr_along(basis, nodal, s, g, 2, slope_y, &gradient[1], &unused);
    return whole;
}
