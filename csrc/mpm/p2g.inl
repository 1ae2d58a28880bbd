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
#include "mpm/shape.h"

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

GR_INLINE void prepare_density(const int dim, const struct gr_engine *e, int64_t at, struct contribution *contribution)
{
    contribution->c = component(e, GR_FIELD_log_density, 0, at);
    contribution->joined = v_keep(v_ge(contribution->c, v_set(-e->config.density.separation_strain)), contribution->m);
    for (int j = 0; j < dim; j++)
        contribution->slope[j] = v_set(e->config.dx) * component(e, GR_FIELD_density_gradient, j, at);
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
        sum[a][0] = sum[a][0] + w;
        for (int d = 0; d < dim; d++) {
            vd value = level[d];
            if (affine) value = v_fma(p->affine[d][0], p->r[0][a], value);
            sum[a][1 + d] = v_fma(w, value, sum[a][1 + d]);
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

/* sum[a][...] += mass, the same by weights, log-density and residual_force of the row. */
GR_INLINE void add_density(const int dim, const int basis, const struct contribution *p, const struct row row, vd sum[3][7])
{
    const vd m = p->joined * beside(dim, basis, p, row, 0), level = level_of(dim, p, row, p->c, p->slope);
    vd across[3];
    across[0] = m * p->weight;
    for (int d = 1; d < dim; d++) across[d] = p->joined * p->weight * beside(dim, basis, p, row, d);
    for (int a = 0; a < gr_nodes_1d(basis); a++) {
        sum[a][0] = v_fma(m, p->w[0][a], sum[a][0]);
        const vd weighted = across[0] * p->w[0][a];
        sum[a][1] = sum[a][1] + weighted;
        sum[a][2] = v_fma(weighted, v_fma(p->slope[0], p->r[0][a], level), sum[a][2]);
        sum[a][3] = v_fma(across[0], p->g[0][a], sum[a][3]);
        for (int d = 1; d < dim; d++) sum[a][3 + d] = v_fma(across[d], p->w[0][a], sum[a][3 + d]);
    }
}

/* What is summed in a pass over the rows: m and p, f, or what the averaging needs. */
enum { MOMENTUM = 1, FORCE = 2, DENSITY = 4 };

/* What n blocks give, row by row: acc[node * rows + first...] = the sums `what` of each node, of its `rows` in all. */
GR_INLINE void add_rows(const int dim, const int basis, const int affine, const int smoothed, const int what,
                        const struct contribution *contribution, int n, const int rows, const int first, vd *acc)
{
    const int k = gr_nodes_1d(basis), K = gr_power(k, dim);
    const int width = (what & MOMENTUM ? 1 + dim : 0) + (what & FORCE ? dim : 0) + (what & DENSITY ? 3 + dim : 0);
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
        for (int q = 1 + 2 * dim; q < rows; q++) acc[i * rows + q] = v_zero();
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
            add_rows(dim, basis, affine, smoothed, FORCE, contribution, n, rows, 1 + dim, acc);
        }
        if (averages) add_rows(dim, basis, affine, smoothed, DENSITY, contribution, n, rows, 1 + 2 * dim, acc);
        store_sums(out, acc, K * rows, done);
    }
}

/* The fluidity of a cell, of which the diffusion begins: the mean over its points that bear pressure, by mass.
 *
 * A step of diffusion after which the law makes a step of its own has another steady state than the two together:
 * backward Euler takes g - k L g' with g' = g/(1 + k L), too little: a layer at 1.9 times its stopping height would flow
 * 1.9 % too fast with dt = .17 t0 and 9 % with .83 t0 (docs/equations.md).
 * The implicit step is therefore balanced (Speth, Green, MacNamara & Strang 2013, SIAM J. Numer. Anal. 51): it knows
 * what the law has added in the substep before, r, and makes (1 + k L) g' = g + r; the law begins from g' - r, which
 * is g - k L g, with nothing left to err, where all is steady. r within -g and g/2: no g' is negative, and a growing
 * mode of the law does not overshoot. */
GR_INLINE void store_gain(struct gr_engine *e, int64_t place, double g, double gain)
{
    if (gr_is_balanced(e)) {
        const double more = gain < -g ? -g : gain, most = 0.5 * g;
        gain = more > most ? most : more;
        e->fluidity->gain[place] = gain;
        g += gain;
    }
    e->fluidity->g[place] = g;
}

/* After a part of the step that began from g_star. */
GR_INLINE void store_fluidity(struct gr_engine *e, int64_t place, double g, double g_star)
{
    store_gain(e, place, g, e->fluidity->dense[place] ? g - g_star : 0);
}

GR_INLINE void mean_of_cell(struct gr_engine *e, const struct gr_cell *cell)
{
    enum { SUMS = GR_SUMS > 3 ? GR_SUMS : 4 };
    const int64_t place = gr_place_of_cell(e, cell);
    const int balanced = gr_is_balanced(e);
    double sum[SUMS];
    vd acc[SUMS];
    for (int i = 0; i < SUMS; i++) acc[i] = v_zero();
    GR_EACH_OF_FLUIDITY(e, cell, side)
    for (int n = 0; n < GR_BLOCKS(side->count); n++) {
        const int64_t at = side->offset + n * GR_W;
        vd tension = component(e, GR_FIELD_stress, 0, at);
        for (int c = 1; c < 3; c++) tension = tension + component(e, GR_FIELD_stress, c, at);
        const vd m = v_keep(v_gt(v_zero(), tension), component(e, GR_FIELD_mass, 0, at));
        acc[0] = acc[0] + m;
        acc[1] = v_fma(m, component(e, GR_FIELD_g, 0, at), acc[1]);
        if (balanced) acc[2] = v_fma(m, component(e, GR_FIELD_g_gain, 0, at), acc[2]);
    }
    for (int i = 0; i < 3; i += GR_SUMS) v_sums(sum + i, acc + i);
    const double inverse = sum[0] > 0 ? 1 / sum[0] : 0;
    e->fluidity->dense[place] = sum[0] > 0;
    store_gain(e, place, inverse * sum[1], inverse * sum[2]);
}

GR_INLINE void mean_fluidity(struct gr_engine *e, int64_t index)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    if (!GR_IS_DOUBLE(cell)) mean_of_cell(e, cell); /* else when it is known whether its sides are apart */
}

/* One more pass of XPIC: the momentum of the nodal velocity field seen by the points. */
GR_INLINE void smooth_cell(const int dim, const int basis, struct gr_engine *e, int64_t index)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int K = gr_power(gr_nodes_1d(basis), dim), blocks = GR_BLOCKS(cell->count), nodal = basis == GR_UGIMP;
    const int rows = GR_NODE_SUMS(dim, 0);
    const struct gr_frame frame = gr_frame_of(dim, e, cell);
    double mode[GR_LANES * GR_MAX_NODES], *out = e->sums + index * e->sum_stride;
    vd acc[GR_NODE_SUMS(3, 1) * GR_MAX_NODES + GR_SUMS], unused[3];
    for (int i = 0; i < K; i++)
        for (int d = 0; d < dim; d++)
            mode[i * GR_LANES + d] = e->node_v[(int64_t)e->mesh.cell_node[index * K + i] * dim + d];
    gr_modes(dim, basis, nodal, dim, GR_LANES, &frame, mode);
    for (int i = 0; i < K * rows; i++) acc[i] = v_zero(); /* no forces */
    for (int n = 0; n < blocks; n++) {
        struct gr_shape s;
        struct contribution contribution;
        const double *x[3];
        const int64_t at = cell->offset + n * GR_W;
        for (int d = 0; d < dim; d++) x[d] = e->field[GR_FIELD_x] + d * e->capacity + at;
        gr_shapes(dim, basis, &frame, x, 0, &s);
        prepare_momentum(dim, basis, 0, e, &frame, at, &contribution);
        for (int d = 0; d < dim; d++)
            contribution.v[d] = gr_interpolate(dim, basis, nodal, mode + d, GR_LANES, &s, (const vd(*)[3])s.g, unused);
        add_rows(dim, basis, 0, 0, MOMENTUM, &contribution, 1, rows, 0, acc);
        store_sums(out, acc, K * rows, n);
    }
}
