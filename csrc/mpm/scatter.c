/* Scatter (P2G): sums over the points of each cell for each of its nodes.
 *
 * Rows of a block, K nodes each (Dunatunga & Kamrin 2015, eq. 3.4):
 *   m_i = sum w m;   p_i = sum w m (v + C (x_i - x));   f_i = -sum V sigma grad w;
 * and, where the density is averaged, the mass and the linearly extrapolated log-density of the points
 * that are not far apart: sum w m, sum w m (c + grad c (x_i - x)).
 * Each cell writes a block of its own and the nodes gather from the blocks in a fixed order (grid.c), so
 * the sums do not depend on the number of threads. */
#include "mpm/shape.h"

/* exp(-c), for V = m exp(-c)/rho_c. Points that carry stress have |c| of order p/K, and then a short
 * series errs less than round-off. */
GR_INLINE vd expansion(vd c)
{
    const vd small = v_set(0.0078125);
    if (m_bits(v_ge(small, v_abs(c))) == GR_ALL_LANES) {
        vd e = v_set(-1.0 / 120.0);
        e = v_fma(e, c, v_set(1.0 / 24.0));
        e = v_fma(e, c, v_set(-1.0 / 6.0));
        e = v_fma(e, c, v_set(0.5));
        e = v_fma(e, c, v_set(-1.0));
        return v_fma(e, c, v_set(1.0));
    }
    return v_exp(-v_max(v_min(c, v_set(600.0)), v_set(-600.0)));
}

GR_INLINE vd component(const struct gr_engine *e, int field, int c, int64_t at)
{
    return v_load(e->field[field] + c * e->capacity + at);
}

/* acc[n] += a w for the K nodes of the cell, a constant over the nodes. */
GR_INLINE void spread(const int dim, const int basis, const struct gr_shape *s, vd a, vd *acc)
{
    const int k = gr_nodes_1d(basis);
    for (int c = 0; c < (dim == 3 ? k : 1); c++)
        for (int b = 0; b < k; b++) {
            const vd ab = dim == 3 ? a * s->w[1][b] * s->w[2][c] : a * s->w[1][b];
            for (int i = 0; i < k; i++) acc[i + k * (b + k * c)] = v_fma(ab, s->w[0][i], acc[i + k * (b + k * c)]);
        }
}

/* acc[n] += w (a + slope . r_n): a linear field about each point. */
GR_INLINE void spread_linear(const int dim, const int basis, const struct gr_shape *s, vd a, const vd slope[3], vd *acc)
{
    const int k = gr_nodes_1d(basis);
    for (int c = 0; c < (dim == 3 ? k : 1); c++)
        for (int b = 0; b < k; b++) {
            const vd w = dim == 3 ? v_mul(s->w[1][b], s->w[2][c]) : s->w[1][b];
            vd at_row = v_fma(slope[1], s->r[1][b], a);
            if (dim == 3) at_row = v_fma(slope[2], s->r[2][c], at_row);
            for (int i = 0; i < k; i++) {
                vd *sum = &acc[i + k * (b + k * c)];
                *sum = v_fma(w * s->w[0][i], v_fma(slope[0], s->r[0][i], at_row), *sum);
            }
        }
}

/* acc[n] += t . grad w_n: one row of the divergence of a stress. */
GR_INLINE void spread_gradient(const int dim, const int basis, const struct gr_shape *s, const vd t[3], vd *acc)
{
    const int k = gr_nodes_1d(basis);
    for (int c = 0; c < (dim == 3 ? k : 1); c++)
        for (int b = 0; b < k; b++) {
            const vd wz = dim == 3 ? s->w[2][c] : v_set(1.0);
            const vd along = dim == 3 ? t[0] * s->w[1][b] * wz : t[0] * s->w[1][b];
            vd across = dim == 3 ? t[1] * s->g[1][b] * wz : t[1] * s->g[1][b];
            if (dim == 3) across = v_fma(t[2] * s->w[1][b], s->g[2][c], across);
            for (int i = 0; i < k; i++) {
                vd *sum = &acc[i + k * (b + k * c)];
                *sum = v_fma(along, s->g[0][i], v_fma(across, s->w[0][i], *sum));
            }
        }
}

GR_INLINE void store_sums(double *out, const vd *acc, const int n)
{
    for (int i = 0; i < n; i += 4) {
        const vd z = v_zero();
        v_sum4(out + i, acc[i], i + 1 < n ? acc[i + 1] : z, i + 2 < n ? acc[i + 2] : z, i + 3 < n ? acc[i + 3] : z);
    }
}

/* The sums of one cell. In several passes, so that the running sums stay in registers. */
GR_INLINE void scatter_cell(const int dim, const int basis, const int affine, const int diffused, struct gr_engine *e,
                            int64_t index)
{
    enum { MAX_ROWS = 4 };
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int K = gr_power(gr_nodes_1d(basis), dim), blocks = GR_BLOCKS(cell->count);
    double *out = e->sums + index * e->sum_stride;
    double row[MAX_ROWS * GR_MAX_NODES + 4];
    if (!blocks) {
        for (int i = 0; i < e->sum_stride; i++) out[i] = 0;
        return;
    }
    struct gr_shape s;
    vd acc[MAX_ROWS * GR_MAX_NODES];
    for (int i = 0; i < (1 + dim) * K; i++) acc[i] = v_zero();
    for (int n = 0; n < blocks; n++) { /* mass and momentum */
        const int64_t at = cell->offset + n * GR_W;
        gr_shapes(dim, basis, e, cell, at, affine, &s);
        const vd m = component(e, GR_FIELD_mass, 0, at);
        spread(dim, basis, &s, m, acc);
        for (int d = 0; d < dim; d++) {
            const vd mv = m * component(e, GR_FIELD_v, d, at);
            if (affine) {
                vd slope[3];
                for (int j = 0; j < dim; j++)
                    slope[j] = m * v_set(e->config.dx) * component(e, GR_FIELD_affine, d * dim + j, at);
                spread_linear(dim, basis, &s, mv, slope, acc + (1 + d) * K);
            } else {
                spread(dim, basis, &s, mv, acc + (1 + d) * K);
            }
        }
    }
    store_sums(row, acc, (1 + dim) * K);
    for (int i = 0; i < (1 + dim) * K; i++) out[i] = row[i];

    const double inv_dx = 1.0 / e->config.dx, inv_rho = 1.0 / e->config.rho_c;
    for (int i = 0; i < dim * K; i++) acc[i] = v_zero();
    for (int n = 0; n < blocks; n++) { /* internal force, and the momentum that the shift has lent */
        const int64_t at = cell->offset + n * GR_W;
        gr_shapes(dim, basis, e, cell, at, 0, &s);
        const vd m = component(e, GR_FIELD_mass, 0, at);
        const vd V = m * v_set(-inv_rho * inv_dx) * expansion(component(e, GR_FIELD_log_density, 0, at));
        vd t[6];
        for (int c = 0; c < (dim == 2 ? 4 : 6); c++) t[c] = V * component(e, GR_FIELD_stress, c, at);
        const int place[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
        for (int d = 0; d < dim; d++) {
            vd line[3];
            for (int j = 0; j < dim; j++) line[j] = t[place[d][j]];
            spread_gradient(dim, basis, &s, line, acc + d * K);
            if (diffused) {
                const vd lent = m * v_set(-1.0 / e->lent_dt) * component(e, GR_FIELD_shift_velocity, d, at);
                spread(dim, basis, &s, lent, acc + d * K);
            }
        }
    }
    store_sums(row, acc, dim * K);
    for (int i = 0; i < dim * K; i++) out[(1 + dim) * K + i] = row[i];

    if (diffused) {
        for (int i = 0; i < 2 * K; i++) acc[i] = v_zero();
        for (int n = 0; n < blocks; n++) {
            const int64_t at = cell->offset + n * GR_W;
            gr_shapes(dim, basis, e, cell, at, 1, &s);
            const vd c = component(e, GR_FIELD_log_density, 0, at);
            const vd m = v_keep(v_ge(c, v_set(-e->config.cure.reach)), component(e, GR_FIELD_mass, 0, at));
            vd slope[3];
            for (int j = 0; j < dim; j++)
                slope[j] = m * v_set(e->config.dx) * component(e, GR_FIELD_density_gradient, j, at);
            spread(dim, basis, &s, m, acc);
            spread_linear(dim, basis, &s, m * c, slope, acc + K);
        }
        store_sums(row, acc, 2 * K);
        for (int i = 0; i < 2 * K; i++) out[(1 + 2 * dim) * K + i] = row[i];
    }
}

/* One more pass of XPIC: the momentum of the nodal velocity field seen by the points. */
GR_INLINE void smooth_cell(const int dim, const int basis, struct gr_engine *e, int64_t index)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int K = gr_power(gr_nodes_1d(basis), dim), blocks = GR_BLOCKS(cell->count);
    double N[3][GR_MAX_NODES], row[3 * GR_MAX_NODES + 4];
    for (int i = 0; i < K; i++)
        for (int d = 0; d < dim; d++) N[d][i] = e->node_v[(int64_t)e->mesh.cell_node[index * K + i] * dim + d];
    vd acc[3 * GR_MAX_NODES], unused[3];
    for (int i = 0; i < dim * K; i++) acc[i] = v_zero();
    for (int n = 0; n < blocks; n++) {
        const int64_t at = cell->offset + n * GR_W;
        struct gr_shape s;
        gr_shapes(dim, basis, e, cell, at, 0, &s);
        const vd m = component(e, GR_FIELD_mass, 0, at);
        for (int d = 0; d < dim; d++)
            spread(dim, basis, &s, m * gr_interpolate(dim, basis, N[d], &s, s.g, 0, unused), acc + d * K);
    }
    store_sums(row, acc, dim * K);
    for (int i = 0; i < dim * K; i++) e->sums[index * e->sum_stride + K + i] = row[i];
}
