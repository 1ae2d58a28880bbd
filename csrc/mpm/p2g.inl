/* P2G: sums over the points of each cell for each of its nodes (Dunatunga & Kamrin 2015, eq. 3.4).
 *
 *   m_i = sum w m
 *   p_i = sum w m (v + C (x_i - x))
 *   f_i = -sum V sigma grad w,   V = q m/rho
 *
 * w is the shape function of node i at the point, C the affine velocity field of the point and q = 1 + u its quadrature
 * weight. Particle shifting adds -m shift_velocity/dt to the force, which takes back the momentum that the shift gave.
 * Where the density is averaged, further sums follow (smoothed_density.inl).
 *
 * Each cell writes a block of sums of its own. The grid stage then sums over the cells of a node in a fixed order
 * (grid.c), so that the result does not depend on the number of threads.
 *
 * A cell is processed a few blocks of points at a time. First the contributions of these blocks are prepared. Then they
 * are added to one row of nodes after the other, because the running sums of a row fit the registers. */
#include "mpm/contribution.h"

/* exp(-c), for V = m exp(-c)/rho_c. It matters only in the lanes that `carry` stress; in others the result is finite
 * and unused. Points with stress have |c| of order p/K, for which a short series is exact to round-off. Each lane
 * chooses by its own value, so that no lane depends on its neighbours. */
GR_INLINE vd inverse_density(vd c, vm carry)
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

/* Prepare w, grad w, x_i - x, m, v and C dx of the block at place `at`. */
GR_INLINE void prepare_momentum(const int dim, const int basis, const int affine, const struct gr_engine *e,
                                const struct gr_frame *frame, int64_t at, struct contribution *contribution)
{
    const int k = gr_nodes_1d(basis);
    struct gr_shape s;
    gr_shapes(dim, basis, e, frame, at, affine, &s);
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

/* Prepare -V sigma/dx and the force that takes back the momentum of the shift. */
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
    vd V = contribution->m * v_set(e->force_scale) * inverse_density(c, v_gt(largest, v_zero()));
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

/* For the nodes of a row: m_i += w m, p_i += w m (v + C (x_i - x)). */
GR_INLINE void add_momentum(const int dim, const int basis, const int affine, const struct contribution *p,
                            const struct row row, vd sum[3][7])
{
    const vd m_yz = p->m * weight_yz(dim, basis, p, row, 0);
    vd u_yz[3];
    for (int d = 0; d < dim; d++) {
        u_yz[d] = p->v[d];
        if (affine) u_yz[d] = linear_yz(dim, p, row, u_yz[d], p->affine[d]);
    }
    for (int a = 0; a < gr_nodes_1d(basis); a++) {
        const vd wm = m_yz * p->w[0][a];
        sum[a][GR_SUM_MASS] = sum[a][GR_SUM_MASS] + wm;
        for (int d = 0; d < dim; d++) {
            vd u = u_yz[d]; /* v + C (x_i - x) */
            if (affine) u = v_fma(p->affine[d][0], p->r[0][a], u);
            sum[a][GR_SUM_MOMENTUM + d] = v_fma(wm, u, sum[a][GR_SUM_MOMENTUM + d]);
        }
    }
}

/* For the nodes of a row: f_i += -V sigma grad w, in sum[a][first...]. The derivative along x is split off, because w
 * along y and z is common to the row. */
GR_INLINE void add_force(const int dim, const int basis, const int smoothed, const struct contribution *p,
                         const struct row row, const int first, vd sum[3][7])
{
    const vd w_yz = weight_yz(dim, basis, p, row, 0);
    for (int d = 0; d < dim; d++) {
        const vd by_x = p->stress[d][0] * w_yz;
        vd by_yz = p->stress[d][1] * weight_yz(dim, basis, p, row, 1);
        if (dim == 3) by_yz = v_fma(p->stress[d][2], weight_yz(dim, basis, p, row, 2), by_yz);
        if (smoothed) by_yz = v_fma(p->shift_momentum[d], w_yz, by_yz);
        for (int a = 0; a < gr_nodes_1d(basis); a++) {
            const vd partial = v_fma(by_yz, p->w[0][a], sum[a][first + d]);
            if (basis == GR_LINEAR)
                sum[a][first + d] = a ? v_add(partial, by_x) : v_sub(partial, by_x);
            else
                sum[a][first + d] = v_fma(by_x, p->g[0][a], partial);
        }
    }
}

/* Sums of a pass over the rows: m and p, f, or those of the density. */
enum { MOMENTUM = 1, FORCE = 2, DENSITY = 4 };

/* Contributions of n blocks, row by row: acc[node * rows + first...] = the sums `what` of each node, which has `rows`
 * sums in all. */
GR_INLINE void add_rows(const int dim, const int basis, const int affine, const int smoothed, const int what,
                        const struct contribution *contribution, int n, const int rows, const int first, vd *acc)
{
    const int k = gr_nodes_1d(basis), K = gr_power(k, dim);
    const int width =
        (what & MOMENTUM ? 1 + dim : 0) + (what & FORCE ? dim : 0) + (what & DENSITY ? GR_DENSITY_SUMS(dim) : 0);
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

/* Sum the lanes of n vectors, and add the results to `out` or store them there. Whole groups of GR_SUMS are written;
 * out has the capacity for them. */
GR_INLINE void store_sums(double *out, vd *acc, const int n, int add)
{
    for (int i = n; i % GR_SUMS; i++) acc[i] = v_zero();
    for (int i = 0; i < n; i += GR_SUMS) {
        double sum[GR_SUMS];
        v_sums(sum, acc + i);
        for (int j = 0; j < GR_SUMS; j++) out[i + j] = add ? out[i + j] + sum[j] : sum[j];
    }
}

/* P2G of one cell. */
GR_INLINE void p2g_cell(const int dim, const int basis, const int affine, const int smoothed, struct gr_engine *e,
                        int64_t index)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int K = gr_power(gr_nodes_1d(basis), dim), rows = GR_SUM_DAMPED(dim), blocks = GR_BLOCKS(cell->count);
    struct gr_frame frame;
    gr_frame_of(dim, e, cell, &frame);
    double *out = e->sums + index * e->sum_stride;
    struct contribution contribution[CHUNK];
    vd acc[GR_SUM_DAMPED(3) * GR_MAX_NODES + 2 + GR_SUMS];
    const int averages = smoothed && e->sums_average;
    for (int i = 0; !blocks && i < e->sum_stride; i++) out[i] = 0; /* all: empty cells are not visited in each step */
    for (int done = 0; done < blocks; done += CHUNK) {
        const int n = blocks - done < CHUNK ? blocks - done : CHUNK;
        vd damped = v_zero(), mass = v_zero();
        for (int i = 0; i < n; i++) {
            const int64_t at = cell->offset + (done + i) * GR_W;
            prepare_momentum(dim, basis, affine, e, &frame, at, &contribution[i]);
            prepare_force(dim, smoothed, e, at, &contribution[i]);
            if (averages) prepare_density(dim, e, at, &contribution[i]);
            if (!smoothed || !(e->config.damping_rate > 0)) continue;
            mass = mass + contribution[i].m;
            damped = v_fma(contribution[i].m, component(e, GR_FIELD_damping, 0, at), damped);
        }
        if (K <= 4) { /* all sums of a row fit the registers */
            add_rows(dim, basis, affine, smoothed, MOMENTUM | FORCE, contribution, n, rows, 0, acc);
        } else {
            add_rows(dim, basis, affine, smoothed, MOMENTUM, contribution, n, rows, 0, acc);
            add_rows(dim, basis, affine, smoothed, FORCE, contribution, n, rows, GR_SUM_FORCE(dim), acc);
        }
        if (smoothed) acc[K * rows] = damped, acc[K * rows + 1] = mass;
        store_sums(out, acc, K * rows + 2 * smoothed, done);
        if (!averages) continue;
        add_rows(dim, basis, affine, smoothed, DENSITY, contribution, n, GR_DENSITY_SUMS(dim), 0, acc);
        store_sums(out + e->density_sums, acc, K * GR_DENSITY_SUMS(dim), done);
    }
    if (smoothed && blocks) out[K * rows] = out[K * rows] > 0 ? out[K * rows] / out[K * rows + 1] : 0;
}
