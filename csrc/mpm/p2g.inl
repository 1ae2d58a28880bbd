/* Scatter (P2G): sums over the points of each cell for each of its nodes.
 *
 * Sums of a node (Dunatunga & Kamrin 2015, eq. 3.4):
 *   m_i = sum w m;   p_i = sum w m (v + C (x_i - x));   f_i = -sum V sigma grad w;
 * and, where the density is averaged, the mass and the linearly extrapolated log-density of the points
 * that are not far apart: sum w m, sum w q m, sum w q m (c + grad c (x_i - x)), and their residual_force, the force that
 * a uniform pressure would make: sum q m grad w. V is m/rho with the weight q = 1 + u of the point.
 * Each cell writes a block of its own, the sums of one node side by side, and the nodes gather from the blocks
 * in a fixed order (grid.c), so the sums do not depend on the number of threads.
 *
 * A cell is taken a few blocks of lanes at a time: first all that a block contributes is prepared, then
 * the nodes are served row by row, because the running sums of one row fit the registers. */
#include "mpm/contribution.h"

/* exp(-c), for V = m exp(-c)/rho_c, in the lanes that `carry` stress: elsewhere V counts for nothing, and what
 * is returned is finite. Points that carry stress have |c| of order p/K, and then a short series errs less than
 * round-off; each lane takes its own, so that none depends on its neighbours. */
GR_INLINE vd expansion(vd c, vm carry)
{
    const vm large = m_and(carry, v_gt(v_abs(c), v_set(0.0078125)));
    vd e = v_set(-1.0 / 120.0);
    e = v_fma(e, c, v_set(1.0 / 24.0));
    e = v_fma(e, c, v_set(-1.0 / 6.0));
    e = v_fma(e, c, v_set(0.5));
    e = v_fma(e, c, v_set(-1.0));
    e = v_fma(e, c, v_set(1.0));
    if (__builtin_expect(!m_bits(large), 1)) return e;
    return v_select(large, v_exp(-v_clamp(c, -600.0, 600.0)), e);
}

/* Shapes, mass and velocity of the block at place `at`. */
GR_INLINE void prepare_momentum(const int dim, const int basis, const int affine, const struct gr_engine *e,
                                const struct gr_frame *frame, int64_t at, struct contribution *contribution)
{
    const int k = gr_nodes_1d(basis);
    const double *x[3];
    struct gr_shape s;
    for (int d = 0; d < dim; d++) x[d] = e->field[GR_FIELD_x] + d * e->capacity + at;
    gr_shapes(dim, basis, frame, x, affine, &s);
    for (int d = 0; d < dim; d++) {
        for (int a = 0; a < k; a++) {
            contribution->w[d][a] = s.w[d][a];
            if (basis != GR_LINEAR) contribution->g[d][a] = s.g[d][a];
            if (affine) contribution->r[d][a] = s.r[d][a];
        }
        contribution->v[d] = component(e, GR_FIELD_v, d, at);
        for (int j = 0; affine && j < dim; j++)
            contribution->affine[d][j] = v_set(e->config.dx) * component(e, GR_FIELD_affine, d * dim + j, at);
    }
    contribution->m = component(e, GR_FIELD_mass, 0, at);
}

/* Internal force, and the momentum that the shift has shift_momentum to the points. */
GR_INLINE void prepare_force(const int dim, const int smoothed, const struct gr_engine *e, int64_t at,
                             struct contribution *contribution)
{
    static const int place[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
    vd largest = v_zero();
    for (int d = 0; d < dim; d++)
        for (int j = 0; j <= d; j++) {
            contribution->stress[d][j] = component(e, GR_FIELD_stress, place[d][j], at);
            largest = v_max(v_abs(contribution->stress[d][j]), largest);
        }
    const vd c = component(e, GR_FIELD_log_density, 0, at);
    vd V = contribution->m * v_set(e->force_scale) * expansion(c, v_gt(largest, v_zero()));
    if (smoothed) {
        contribution->weight = v_set(1.0) + component(e, GR_FIELD_weight_correction, 0, at);
        V = V * contribution->weight;
    }
    for (int d = 0; d < dim; d++)
        for (int j = 0; j <= d; j++)
            contribution->stress[d][j] = contribution->stress[j][d] = V * contribution->stress[d][j];
    for (int d = 0; smoothed && d < dim; d++) {
        contribution->shift_momentum[d] = v_zero();
        if (e->sums_correct_shift)
            contribution->shift_momentum[d] =
                contribution->m * v_set(e->shift_scale) * component(e, GR_FIELD_shift_velocity, d, at);
    }
}

/* sum[a][...] += m, p of the row. */
GR_INLINE void add_momentum(const int dim, const int basis, const int affine, const struct contribution *p,
                            const struct row row, vd sum[3][7])
{
    const vd m = p->m * beside(dim, basis, p, row, 0);
    vd level[3];
    for (int d = 0; d < dim; d++) {
        level[d] = p->v[d];
        if (affine) level[d] = level_of(dim, p, row, level[d], p->affine[d]);
    }
    for (int a = 0; a < gr_nodes_1d(basis); a++) {
        const vd w = m * p->w[0][a];
        sum[a][GR_SUM_MASS] = sum[a][GR_SUM_MASS] + w;
        for (int d = 0; d < dim; d++) {
            vd value = level[d];
            if (affine) value = v_fma(p->affine[d][0], p->r[0][a], value);
            sum[a][GR_SUM_MOMENTUM + d] = v_fma(w, value, sum[a][GR_SUM_MOMENTUM + d]);
        }
    }
}

/* sum[a][first...] += f of the row. */
GR_INLINE void add_force(const int dim, const int basis, const int smoothed, const struct contribution *p,
                         const struct row row, const int first, vd sum[3][7])
{
    const vd w = beside(dim, basis, p, row, 0);
    for (int d = 0; d < dim; d++) {
        const vd along = p->stress[d][0] * w;
        vd across = p->stress[d][1] * beside(dim, basis, p, row, 1);
        if (dim == 3) across = v_fma(p->stress[d][2], beside(dim, basis, p, row, 2), across);
        if (smoothed) across = v_fma(p->shift_momentum[d], w, across);
        for (int a = 0; a < gr_nodes_1d(basis); a++) {
            const vd with = v_fma(across, p->w[0][a], sum[a][first + d]);
            if (basis == GR_LINEAR)
                sum[a][first + d] = a ? v_add(with, along) : v_sub(with, along);
            else
                sum[a][first + d] = v_fma(along, p->g[0][a], with);
        }
    }
}

/* What is summed in a pass over the rows: m and p, f, or what the averaging needs. */
enum { MOMENTUM = 1, FORCE = 2, DENSITY = 4 };

/* What n blocks give, row by row: acc[node * rows + first...] = the sums `what` of each node, of its `rows` in all. */
GR_INLINE void add_rows(const int dim, const int basis, const int affine, const int smoothed, const int what,
                        const struct contribution *contribution, int n, const int rows, const int first, vd *acc)
{
    const int k = gr_nodes_1d(basis), K = gr_power(k, dim);
    const int width =
        (what & MOMENTUM ? 1 + dim : 0) + (what & FORCE ? dim : 0) + (what & DENSITY ? GR_SUM_RESIDUAL + dim : 0);
    for (int bc = 0; bc < K / k; bc++) {
        const struct row row = {bc % k, bc / k};
        vd sum[3][7];
        for (int i = 0; i < k * width; i++) sum[i / width][i % width] = v_zero();
        GR_ROLLED
        for (int i = 0; i < n; i++) {
            if (what & MOMENTUM) add_momentum(dim, basis, affine, contribution + i, row, sum);
            if (what & FORCE) add_force(dim, basis, smoothed, contribution + i, row, what & MOMENTUM ? 1 + dim : 0, sum);
            if (what & DENSITY) add_density(dim, basis, contribution + i, row, sum);
        }
        for (int a = 0; a < k; a++)
            for (int q = 0; q < width; q++) acc[(bc * k + a) * rows + first + q] = sum[a][q];
    }
}

/* Lane sums of n vectors, added to `out` or written there. Whole groups: there is room for them. */
GR_INLINE void store_sums(double *out, vd *acc, const int n, int add)
{
    for (int i = n; i % GR_SUMS; i++) acc[i] = v_zero();
    for (int i = 0; i < n; i += GR_SUMS) {
        double sum[GR_SUMS];
        v_sums(sum, acc + i);
        for (int j = 0; j < GR_SUMS; j++) out[i + j] = add ? out[i + j] + sum[j] : sum[j];
    }
}

/* The sums of one cell. */
GR_INLINE void p2g_cell(const int dim, const int basis, const int affine, const int smoothed, struct gr_engine *e,
                        int64_t index)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int K = gr_power(gr_nodes_1d(basis), dim), rows = GR_NODE_SUMS(dim, smoothed), blocks = GR_BLOCKS(cell->count);
    const struct gr_frame frame = gr_frame_of(dim, e, cell);
    double *out = e->sums + index * e->sum_stride;
    struct contribution contribution[CHUNK];
    vd acc[GR_NODE_SUMS(3, 1) * GR_MAX_NODES + GR_SUMS];
    const int averages = smoothed && e->sums_average;
    for (int i = 0; smoothed && !averages && i < K; i++)
        for (int q = GR_SUM_DENSITY(dim); q < rows; q++) acc[i * rows + q] = v_zero();
    for (int i = 0; !blocks && i < e->sum_stride; i++) out[i] = 0;
    for (int done = 0; done < blocks; done += CHUNK) {
        const int n = blocks - done < CHUNK ? blocks - done : CHUNK;
        for (int i = 0; i < n; i++) {
            const int64_t at = cell->offset + (done + i) * GR_W;
            prepare_momentum(dim, basis, affine, e, &frame, at, &contribution[i]);
            prepare_force(dim, smoothed, e, at, &contribution[i]);
            if (averages) prepare_density(dim, e, at, &contribution[i]);
        }
        if (K <= 4) { /* all sums of a row fit the registers */
            add_rows(dim, basis, affine, smoothed, MOMENTUM | FORCE, contribution, n, rows, 0, acc);
        } else {
            add_rows(dim, basis, affine, smoothed, MOMENTUM, contribution, n, rows, 0, acc);
            add_rows(dim, basis, affine, smoothed, FORCE, contribution, n, rows, GR_SUM_FORCE(dim), acc);
        }
        if (averages) add_rows(dim, basis, affine, smoothed, DENSITY, contribution, n, rows, GR_SUM_DENSITY(dim), acc);
        store_sums(out, acc, K * rows, done);
    }
}
