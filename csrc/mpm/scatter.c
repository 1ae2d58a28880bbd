/* Scatter (P2G): sums over the points of each cell for each of its nodes.
 *
 * Sums of a node (Dunatunga & Kamrin 2015, eq. 3.4):
 *   m_i = sum w m;   p_i = sum w m (v + C (x_i - x));   f_i = -sum V sigma grad w;
 * and, where the density is averaged, the mass and the linearly extrapolated log-density of the points
 * that are not far apart: sum w m, sum w m (c + grad c (x_i - x)).
 * Where the sums of a node stand is told by gr_sum_place. Each cell writes a block of its own and the nodes gather from the blocks in a fixed order (grid.c), so
 * the sums do not depend on the number of threads. */
#include "mpm/shape.h"

/* exp(-c), for V = m exp(-c)/rho_c. Points that carry stress have |c| of order p/K, and then a short
 * series errs less than round-off; each lane takes its own, so that none depends on its neighbours. */
GR_INLINE vd expansion(vd c)
{
    const vm small = v_ge(v_set(0.0078125), v_abs(c));
    vd e = v_set(-1.0 / 120.0);
    e = v_fma(e, c, v_set(1.0 / 24.0));
    e = v_fma(e, c, v_set(-1.0 / 6.0));
    e = v_fma(e, c, v_set(0.5));
    e = v_fma(e, c, v_set(-1.0));
    e = v_fma(e, c, v_set(1.0));
    if (__builtin_expect(m_bits(small) == GR_ALL_LANES, 1)) return e;
    return v_select(small, e, v_exp(-v_clamp(c, -600.0, 600.0)));
}

GR_INLINE vd component(const struct gr_engine *e, int field, int c, int64_t at)
{
    return v_load(e->field[field] + c * e->capacity + at);
}

/* acc[n stride] += a w for the K nodes of the cell, a constant over the nodes. */
GR_INLINE void spread(const int dim, const int basis, const struct gr_shape *s, vd a, vd *acc, const int stride)
{
    const int k = gr_nodes_1d(basis);
    for (int c = 0; c < (dim == 3 ? k : 1); c++)
        for (int b = 0; b < k; b++) {
            const vd ab = dim == 3 ? a * s->w[1][b] * s->w[2][c] : a * s->w[1][b];
            for (int i = 0; i < k; i++) {
                vd *sum = &acc[(i + k * (b + k * c)) * stride];
                *sum = v_fma(ab, s->w[0][i], *sum);
            }
        }
}

/* acc[n stride] += w (a + slope . r_n): a linear field about each point; wr = w0 r0. */
GR_INLINE void spread_linear(const int dim, const int basis, const struct gr_shape *s, const vd wr[3], vd a,
                             const vd slope[3], vd *acc, const int stride)
{
    const int k = gr_nodes_1d(basis);
    for (int c = 0; c < (dim == 3 ? k : 1); c++)
        for (int b = 0; b < k; b++) {
            const vd w = dim == 3 ? v_mul(s->w[1][b], s->w[2][c]) : s->w[1][b];
            vd level = v_fma(slope[1], s->r[1][b], a);
            if (dim == 3) level = v_fma(slope[2], s->r[2][c], level);
            const vd flat = w * level, tilted = w * slope[0];
            for (int i = 0; i < k; i++) {
                vd *sum = &acc[(i + k * (b + k * c)) * stride];
                *sum = v_fma(flat, s->w[0][i], v_fma(tilted, wr[i], *sum));
            }
        }
}

/* acc[n stride] += t . grad w_n: one row of the divergence of a stress. */
GR_INLINE void spread_gradient(const int dim, const int basis, const struct gr_shape *s, const vd t[3], vd *acc,
                               const int stride)
{
    const int k = gr_nodes_1d(basis);
    for (int c = 0; c < (dim == 3 ? k : 1); c++)
        for (int b = 0; b < k; b++) {
            const vd wz = dim == 3 ? s->w[2][c] : v_set(1.0);
            const vd along = dim == 3 ? t[0] * s->w[1][b] * wz : t[0] * s->w[1][b];
            vd across = dim == 3 ? t[1] * s->g[1][b] * wz : t[1] * s->g[1][b];
            if (dim == 3) across = v_fma(t[2] * s->w[1][b], s->g[2][c], across);
            for (int i = 0; i < k; i++) {
                vd *sum = &acc[(i + k * (b + k * c)) * stride];
                *sum = v_fma(along, s->g[0][i], v_fma(across, s->w[0][i], *sum));
            }
        }
}

/* Lane sums of n vectors. Whole groups are written: what lies behind the last is written over later. */
GR_INLINE void store_sums(double *out, vd *acc, const int n)
{
    for (int i = n; i % GR_SUMS; i++) acc[i] = v_zero();
    for (int i = 0; i < n; i += GR_SUMS) v_sums(out + i, acc + i);
}

GR_INLINE void add_momentum(const int dim, const int basis, const int affine, const struct gr_engine *e, int64_t at,
                            const struct gr_shape *s, vd *acc, const int stride)
{
    const int k = gr_nodes_1d(basis);
    const vd m = component(e, GR_FIELD_mass, 0, at);
    vd wr[3], slope[3];
    for (int i = 0; affine && i < k; i++) wr[i] = s->w[0][i] * s->r[0][i];
    spread(dim, basis, s, m, acc, stride);
    for (int d = 0; d < dim; d++) {
        const vd mv = m * component(e, GR_FIELD_v, d, at);
        for (int j = 0; affine && j < dim; j++)
            slope[j] = m * v_set(e->config.dx) * component(e, GR_FIELD_affine, d * dim + j, at);
        if (affine)
            spread_linear(dim, basis, s, wr, mv, slope, acc + 1 + d, stride);
        else
            spread(dim, basis, s, mv, acc + 1 + d, stride);
    }
}

/* Internal force, and the momentum that the shift has lent to the points. */
GR_INLINE void add_force(const int dim, const int basis, const int diffused, const struct gr_engine *e, int64_t at,
                         const struct gr_shape *s, vd *acc, const int stride)
{
    static const int place[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
    const vd m = component(e, GR_FIELD_mass, 0, at);
    const vd V = m * v_set(e->force_scale) * expansion(component(e, GR_FIELD_log_density, 0, at));
    vd t[6], line[3];
    for (int c = 0; c < (dim == 2 ? 4 : 6); c++) t[c] = V * component(e, GR_FIELD_stress, c, at);
    for (int d = 0; d < dim; d++) {
        for (int j = 0; j < dim; j++) line[j] = t[place[d][j]];
        spread_gradient(dim, basis, s, line, acc + d, stride);
        if (diffused)
            spread(dim, basis, s, m * v_set(e->lent_scale) * component(e, GR_FIELD_shift_velocity, d, at), acc + d, stride);
    }
}

GR_INLINE void add_density(const int dim, const int basis, const struct gr_engine *e, int64_t at, const struct gr_shape *s,
                           vd *acc)
{
    const int k = gr_nodes_1d(basis);
    const vd c = component(e, GR_FIELD_log_density, 0, at);
    const vd m = v_keep(v_ge(c, v_set(-e->config.cure.reach)), component(e, GR_FIELD_mass, 0, at));
    vd slope[3], wr[3];
    for (int i = 0; i < k; i++) wr[i] = s->w[0][i] * s->r[0][i];
    for (int j = 0; j < dim; j++) slope[j] = m * v_set(e->config.dx) * component(e, GR_FIELD_density_gradient, j, at);
    spread(dim, basis, s, m, acc, 2);
    spread_linear(dim, basis, s, wr, m * c, slope, acc + 1, 2);
}

/* The sums of one cell: in one pass where all of them fit the registers, else row group by row group. */
GR_INLINE void scatter_cell(const int dim, const int basis, const int affine, const int diffused, struct gr_engine *e,
                            int64_t index)
{
    enum { MAX_ROWS = 5 };
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int K = gr_power(gr_nodes_1d(basis), dim), blocks = GR_BLOCKS(cell->count), rows = 1 + 2 * dim;
    const int together = GR_TOGETHER(K);
    double *out = e->sums + index * e->sum_stride;
    struct gr_shape s;
    vd acc[MAX_ROWS * GR_MAX_NODES + GR_SUMS];
    if (!blocks) {
        for (int i = 0; i < e->sum_stride; i++) out[i] = 0;
        return;
    }
    for (int i = 0; i < (together ? rows : 1 + dim) * K; i++) acc[i] = v_zero();
    for (int n = 0; n < blocks; n++) {
        const int64_t at = cell->offset + n * GR_W;
        gr_shapes(dim, basis, e, cell, at, affine, &s);
        add_momentum(dim, basis, affine, e, at, &s, acc, together ? rows : 1 + dim);
        if (together) add_force(dim, basis, diffused, e, at, &s, acc + 1 + dim, rows);
    }
    store_sums(out, acc, (together ? rows : 1 + dim) * K);
    if (!together) {
        for (int i = 0; i < dim * K; i++) acc[i] = v_zero();
        for (int n = 0; n < blocks; n++) {
            const int64_t at = cell->offset + n * GR_W;
            gr_shapes(dim, basis, e, cell, at, 0, &s);
            add_force(dim, basis, diffused, e, at, &s, acc, dim);
        }
        store_sums(out + (1 + dim) * K, acc, dim * K);
    }
    if (diffused) {
        for (int i = 0; i < 2 * K; i++) acc[i] = v_zero();
        for (int n = 0; n < blocks; n++) {
            const int64_t at = cell->offset + n * GR_W;
            gr_shapes(dim, basis, e, cell, at, 1, &s);
            add_density(dim, basis, e, at, &s, acc);
        }
        store_sums(out + rows * K, acc, 2 * K);
    }
}

/* One more pass of XPIC: the momentum of the nodal velocity field seen by the points. */
GR_INLINE void smooth_cell(const int dim, const int basis, struct gr_engine *e, int64_t index)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int K = gr_power(gr_nodes_1d(basis), dim), blocks = GR_BLOCKS(cell->count);
    double N[3][GR_MAX_NODES];
    for (int i = 0; i < K; i++)
        for (int d = 0; d < dim; d++) N[d][i] = e->node_v[(int64_t)e->mesh.cell_node[index * K + i] * dim + d];
    vd acc[3 * GR_MAX_NODES + GR_SUMS], unused[3];
    for (int i = 0; i < dim * K; i++) acc[i] = v_zero();
    for (int n = 0; n < blocks; n++) {
        const int64_t at = cell->offset + n * GR_W;
        struct gr_shape s;
        gr_shapes(dim, basis, e, cell, at, 0, &s);
        const vd m = component(e, GR_FIELD_mass, 0, at);
        for (int d = 0; d < dim; d++)
            spread(dim, basis, &s, m * gr_interpolate(dim, basis, N[d], &s, s.g, 0, unused), acc + d, dim);
    }
    store_sums(e->sums + index * e->sum_stride, acc, dim * K);
}
