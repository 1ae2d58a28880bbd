/* Shape functions of points, one of each of GR_W cells, and interpolation of nodal fields to the points. */
#pragma once

#include "core/simd.h"
#include "mpm/numbers.h"

/* Put before a loop over blocks to prevent unrolling: an unrolled loop would first copy all its input to the stack. */
#define GR_ROLLED _Pragma("GCC unroll 1")

struct gr_shape {
    vd xi[3];   /* local coordinate in the cell */
    vd w[3][3]; /* value, by axis and node */
    vd g[3][3]; /* derivative with respect to the coordinate in cells (ugimp: its mean over the box of the point) */
    vd r[3][3]; /* position of the node relative to the point, in cells */
};

/* What shape functions depend on along an axis, in the cells of a vector. */
struct gr_knots {
    vd low, high; /* quadratic: coefficients of (1 - xi)^2 and xi^2 */
    vd clipped;   /* ugimp: 1 where the boxes of points end at the node of the cell, else 0 */
};

/* The functions of one cell. */
GR_INLINE struct gr_knots gr_knots_of(const struct gr_axis_cell *cell)
{
    return (struct gr_knots){v_set(cell->coefficient[0][2]), v_set(cell->coefficient[2][2]), v_set(cell->clip)};
}

/* The cells of a vector, one a lane: cells `first` to first + GR_W - 1 of a tile. */
struct gr_frame {
    vx edge[3];
    vd inv_dx;
    struct gr_knots knots[3];
    vd position[3][3]; /* of the nodes, in cells from the edge; only if asked for */
    double lambda;
};

GR_INLINE int gr_power(int k, int dim) { return dim == 2 ? k * k : k * k * k; }
GR_INLINE int gr_nodes_1d(const int basis) { return basis == GR_LINEAR ? 2 : 3; }

/* Numbers of the GR_W cells from `first` on, along axis d: member(cell) of each. Most tiles are a part of a row of cells:
 * along the other axes they have the same index. Cells follow each other along the first axis, then the second, then the
 * third, so that cells between two of one row are of that row; with two of different layers, rows lie between. */
#define GR_LANES_OF_CELLS(e, first, d, member, vector, set, load)                                             \
    ({                                                                                                        \
        const struct gr_cell *const of_cell = (e)->mesh.cell + (first);                                       \
        const struct gr_axis_cell *const of_axis = (e)->axis[d].cell;                                         \
        vector of_lanes = set(of_axis[of_cell->at[d]].member);                                                \
        if (!(d) || of_cell->at[d] != of_cell[GR_W - 1].at[d] || of_cell->at[2] != of_cell[GR_W - 1].at[2]) { \
            double of_each[GR_W];                                                                             \
            for (int of_l = 0; of_l < GR_W; of_l++) of_each[of_l] = of_axis[of_cell[of_l].at[d]].member;      \
            of_lanes = load(of_each);                                                                         \
        }                                                                                                     \
        of_lanes;                                                                                             \
    })
#define GR_OF_CELLS(e, first, d, member) GR_LANES_OF_CELLS(e, first, d, member, vd, v_set, v_load)
#define GR_X_OF_CELLS(e, first, d, member) GR_LANES_OF_CELLS(e, first, d, member, vx, x_set, x_load)

/* Look up the frame of the cells from `first` on. Beyond the dimension nothing is set, and nothing is used. */
GR_INLINE void gr_frame_of(const int dim, const int basis, const int positions, const struct gr_engine *e, int64_t first,
                           struct gr_frame *frame)
{
    frame->inv_dx = v_set(e->inv_dx);
    frame->lambda = e->config.lambda;
    for (int d = 0; d < dim; d++) {
        frame->edge[d] = GR_X_OF_CELLS(e, first, d, edge);
        if (basis == GR_QUADRATIC) {
            frame->knots[d].low = GR_OF_CELLS(e, first, d, coefficient[0][2]);
            frame->knots[d].high = GR_OF_CELLS(e, first, d, coefficient[2][2]);
        }
        if (basis == GR_UGIMP) frame->knots[d].clipped = GR_OF_CELLS(e, first, d, clip);
        for (int a = 0; positions && a < gr_nodes_1d(basis); a++)
            frame->position[d][a] = GR_OF_CELLS(e, first, d, position[a]);
    }
}

/* Whatever its knots, a quadratic B-spline on a cell is low (1 - xi)^2, 1 - low (1 - xi)^2 - high xi^2, or high xi^2. */
GR_INLINE void gr_shape_1d(const int basis, const struct gr_knots *knots, double lambda, vd xi, vd w[3], vd g[3])
{
    if (basis == GR_LINEAR) {
        w[0] = v_set(1.0) - xi, w[1] = xi;
        g[0] = v_set(-1.0), g[1] = v_set(1.0);
    } else if (basis == GR_QUADRATIC) {
        const vd one = v_set(1.0), rest = one - xi; /* for any knots: low (1 - xi)^2 and high xi^2 */
        const vd low = knots->low * rest, high = knots->high * xi;
        w[0] = low * rest, w[2] = high * xi, w[1] = (one - w[0]) - w[2];
        g[0] = v_set(-2.0) * low, g[2] = high + high, g[1] = -g[2] - g[0];
    } else { /* ugimp: h(r) is the linear shape function of a neighbour, averaged over [r - lambda, r + lambda] */
        const vd r = xi - v_set(0.5), zero = v_zero(), one = v_set(1.0);
        const vm clipped = v_gt(knots->clipped, zero);
        vd h[2], slope[2];
        for (int side = 0; side < 2; side++) {
            const vd q = side ? r : -r, t = v_clamp(q + v_set(lambda), 0.0, 2.0 * lambda);
            h[side] = v_fma(t * t, v_set(0.25 / lambda), v_max(q - v_set(lambda), zero));
            slope[side] = t * v_set(0.5 / lambda);
            if (!m_bits(clipped)) continue;
            const vm inside = side ? v_ge(q, zero) : v_gt(q, zero); /* the box of a point ends at the node */
            h[side] = v_select(clipped, v_keep(inside, v_max(q, v_set(0.5) * (q + v_set(lambda)))), h[side]);
            slope[side] = v_select(clipped, v_keep(inside, one), slope[side]);
        }
        w[0] = h[0], w[2] = h[1], w[1] = (one - h[0]) - h[1];
        g[0] = -slope[0], g[2] = slope[1], g[1] = slope[0] - slope[1];
    }
}

/* dx/r of the points in the slots from `at` on of an axisymmetric plane. The velocity along r vanishes on the axis, so that
 * no point crosses it. */
GR_INLINE vd gr_inverse_radius(const struct gr_engine *e, int64_t at)
{
    return v_set(e->config.dx) / x_minus(x_load(gr_x(e, 0) + at), x_set(0.0));
}

/* All shape functions of the points in the slots from `at` on. */
GR_INLINE void gr_shapes(const int dim, const int basis, const struct gr_engine *e, const struct gr_frame *frame, int64_t at,
                         const int positions, struct gr_shape *s)
{
    for (int d = 0; d < dim; d++) {
        s->xi[d] = x_minus(x_load(gr_x(e, d) + at), frame->edge[d]) * frame->inv_dx;
        gr_shape_1d(basis, &frame->knots[d], frame->lambda, s->xi[d], s->w[d], s->g[d]);
        for (int a = 0; positions && a < gr_nodes_1d(basis); a++) s->r[d][a] = frame->position[d][a] - s->xi[d];
    }
}

/* Convert the nodal values of a field to modes. If the shape functions are polynomials in xi, the modes are the
 * coefficients of the powers of xi along each axis, and a value is a short Horner scheme. If `nodal`, the modes are the
 * nodal values themselves. */
GR_INLINE void gr_modes(const int dim, const int basis, const int nodal, const struct gr_frame *frame, vd *mode)
{
    const int k = gr_nodes_1d(basis), K = gr_power(k, dim);
    vd m[GR_MAX_NODES];
    if (nodal) return;
    GR_UNROLLED
    for (int i = 0; i < K; i++) m[i] = mode[i];
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
            const vd low = frame->knots[d].low * (n0 - n1);
            m[i] = n1 + low;
            m[i + step] = v_set(-2.0) * low;
            m[i + 2 * step] = v_fma(frame->knots[d].high, n2 - n1, low);
        }
    }
    GR_UNROLLED
    for (int i = 0; i < K; i++) mode[i] = m[i];
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

/* Value at the points of the field with these modes, and its gradient per cell. If `nodal`, g are the weights of the
 * derivatives. The compiler omits results that a caller does not use. */
GR_INLINE vd gr_interpolate(const int dim, const int basis, const int nodal, const vd *mode, const struct gr_shape *s,
                            const vd g[3][3], vd gradient[3])
{
    const int k = gr_nodes_1d(basis);
    vd value[3], slope_x[3], slope_y[3], unused;
    for (int c = 0; c < (dim == 3 ? k : 1); c++) {
        vd line[3], line_x[3];
        for (int b = 0; b < k; b++) {
            vd m[3];
            for (int a = 0; a < k; a++) m[a] = mode[a + k * (b + k * c)];
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
