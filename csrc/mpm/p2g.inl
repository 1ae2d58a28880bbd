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
 * Each cell has separate sums, in the order of its points. The grid stage then sums over the cells of a node in a fixed
 * order (grid.c), so that the result depends neither on the number of threads nor on the cells of a tile.
 *
 * A lane is a cell. A few rows of points are worked on at a time: first their contributions are prepared, and then they are
 * added to one row of nodes after the other, because the running sums of a row fit the registers. */
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
    return v_select(large, v_exp(-v_clamp(c, -GR_LARGEST_POWER, GR_LARGEST_POWER)), e);
}

/* Component of a stress of contributions, xx, yy, zz, xy, yz, xz. */
GR_INLINE int at_stress(const int d, const int j)
{
    static const int place[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
    return place[d][j];
}

/* Prepare w, grad w, m, v and C dx of the points in the slots from `at` on, which count where `counted`. */
GR_INLINE void prepare_momentum(const int dim, const int basis, const int affine, const struct gr_engine *e,
                                const struct gr_frame *frame, int64_t at, vm counted, struct contribution *contribution)
{
    const int k = gr_nodes_1d(basis);
    struct gr_shape s;
    gr_shapes(dim, basis, e, frame, at, 0, &s);
    for (int d = 0; d < dim; d++) {
        for (int a = 0; a < k; a++) {
            contribution->w[d][a] = s.w[d][a];
            if (basis != GR_LINEAR) contribution->g[d][a] = s.g[d][a];
        }
        contribution->v[d] = component(e, GR_FIELD_v, d, at);
        for (int j = 0; affine && j < dim; j++)
            contribution->affine[d][j] = v_set(e->config.dx) * component(e, GR_FIELD_affine, d * dim + j, at);
        if (affine) contribution->v[d] = at_edge(dim, &s, contribution->v[d], contribution->affine[d]);
    }
    contribution->m = v_keep(counted, component(e, GR_FIELD_mass, 0, at));
}

/* Prepare -V sigma/dx and the force that takes back the momentum of the shift. */
GR_INLINE void prepare_force(const int dim, const int smoothed, const struct gr_engine *e, int64_t at,
                             struct contribution *contribution)
{
    vd stress[6], largest = v_zero();
    acting_stress(dim, e, at, stress);
    for (int d = 0; d < dim; d++)
        for (int j = 0; j <= d; j++) largest = v_max(v_abs(stress[at_stress(d, j)]), largest);
    const vd c = component(e, GR_FIELD_log_density, 0, at);
    vd V = contribution->m * gr_of_material(e, GR_MATERIAL_FORCE_SCALE, at) * inverse_density(c, v_gt(largest, v_zero()));
    if (smoothed) {
        contribution->weight = v_set(1.0) + component(e, GR_FIELD_weight_correction, 0, at);
        V = V * contribution->weight;
    }
    for (int d = 0; d < dim; d++)
        for (int j = 0; j <= d; j++) contribution->stress[at_stress(d, j)] = V * stress[at_stress(d, j)];
    for (int d = 0; smoothed && e->sums.correct_shift && d < dim; d++)
        contribution->shift_momentum[d] =
            contribution->m * v_set(e->shift_scale) * component(e, GR_FIELD_shift_velocity, d, at);
}

/* For the nodes of a row: m_i += w m, p_i += w m (v + C (x_i - x)). */
GR_INLINE void add_momentum(const int dim, const int basis, const int affine, const struct gr_frame *frame,
                            const struct contribution *p, const struct row row, vd sum[3][7])
{
    const vd m_yz = p->m * weight_yz(dim, basis, p, row, 0);
    vd u_yz[3];
    for (int d = 0; d < dim; d++) {
        u_yz[d] = p->v[d];
        if (affine) u_yz[d] = linear_yz(dim, basis, frame, row, u_yz[d], p->affine[d]);
    }
    for (int a = 0; a < gr_nodes_1d(basis); a++) {
        const vd wm = m_yz * p->w[0][a];
        sum[a][GR_SUM_MASS] = sum[a][GR_SUM_MASS] + wm;
        for (int d = 0; d < dim; d++) {
            vd u = u_yz[d]; /* v + C (x_i - x) */
            if (affine) u = along_axis(basis, frame, 0, a, u, p->affine[d][0]);
            sum[a][GR_SUM_MOMENTUM + d] = v_fma(wm, u, sum[a][GR_SUM_MOMENTUM + d]);
        }
    }
}

/* For the nodes of a row: f_i += -V sigma grad w, in sum[a][first...]. The derivative along x is split off, because w
 * along y and z is common to the row. */
GR_INLINE void add_force(const int dim, const int basis, const int shifts, const struct contribution *p,
                         const struct row row, const int first, vd sum[3][7])
{
    const vd w_yz = weight_yz(dim, basis, p, row, 0);
    for (int d = 0; d < dim; d++) {
        const vd by_x = p->stress[at_stress(d, 0)] * w_yz;
        vd by_yz = p->stress[at_stress(d, 1)] * weight_yz(dim, basis, p, row, 1);
        if (dim == 3) by_yz = v_fma(p->stress[at_stress(d, 2)], weight_yz(dim, basis, p, row, 2), by_yz);
        if (shifts) by_yz = v_fma(p->shift_momentum[d], w_yz, by_yz);
        for (int a = 0; a < gr_nodes_1d(basis); a++) {
            const vd partial = v_fma(by_yz, p->w[0][a], sum[a][first + d]);
            if (basis == GR_LINEAR)
                sum[a][first + d] = a ? v_add(partial, by_x) : v_sub(partial, by_x);
            else
                sum[a][first + d] = v_fma(by_x, p->g[0][a], partial);
        }
    }
}

/* Sums of a pass over the rows: m and p; f, with SHIFT also the term that subtracts the momentum of a shift; the sums of
 * the density, or of the density with several materials. */
enum { MOMENTUM = 1, FORCE = 2, DENSITY = 4, VOLUME = 8, SHIFT = 16 };

/* Add the contributions of n rows of points to the sums `what`, row of nodes by row: sums first... of each node, which has
 * `rows` sums in all. The sums begin at zero if `fresh`. */
GR_INLINE void add_rows(const int dim, const int basis, const int affine, const int what, const struct gr_frame *frame,
                        const struct contribution *contribution, int n, const int rows, const int first, int fresh,
                        int stream, gr_real *out)
{
    const int k = gr_nodes_1d(basis), K = gr_power(k, dim);
    const int width = (what & MOMENTUM ? 1 + dim : 0) + (what & FORCE ? dim : 0) +
                      (what & DENSITY ? GR_DENSITY_SUMS(dim) : 0) + (what & VOLUME ? GR_VOLUME_SUMS : 0);
    for (int bc = 0; bc < K / k; bc++) {
        const struct row row = {bc % k, bc / k};
        vd sum[3][7];
        for (int i = 0; i < k * width; i++) sum[i / width][i % width] = v_zero();
        for (int i = 0; !fresh && i < k * width; i++)
            sum[i / width][i % width] = v_load(out + ((bc * k + i / width) * rows + first + i % width) * GR_LANES);
        GR_ROLLED
        for (int i = 0; i < n; i++) {
            if (what & MOMENTUM) add_momentum(dim, basis, affine, frame, contribution + i, row, sum);
            if (what & FORCE) add_force(dim, basis, what & SHIFT, contribution + i, row, what & MOMENTUM ? 1 + dim : 0, sum);
            if (what & DENSITY) add_density(dim, basis, frame, contribution + i, row, sum);
            if (what & VOLUME) add_volume(dim, basis, frame, contribution + i, row, sum);
        }
        for (int a = 0; !stream && a < k; a++)
            for (int q = 0; q < width; q++) v_store(out + ((bc * k + a) * rows + first + q) * GR_LANES, sum[a][q]);
        for (int a = 0; stream && a < k; a++)
            for (int q = 0; q < width; q++) v_stream(out + ((bc * k + a) * rows + first + q) * GR_LANES, sum[a][q]);
    }
}

/* The points of GR_W cells of a tile that P2G adds to their sums: rows [begin, end), in a lane from its first row on. */
struct summed {
    int begin, end;
    vd first;
};

/* All points of the cells from `first` on, or those that are not in their sums yet. */
GR_INLINE struct summed points_to_sum(struct gr_engine *e, int64_t first, int more)
{
    struct summed rows = {more ? INT32_MAX : 0, 0, v_zero()};
    double done[GR_W];
    for (int l = 0; l < GR_W; l++) {
        struct gr_cell *cell = &e->mesh.cell[first + l];
        done[l] = more ? cell->summed : 0;
        if (more && cell->count > cell->summed && cell->summed < rows.begin) rows.begin = cell->summed;
        if (cell->count > rows.end) rows.end = cell->count;
        cell->summed = cell->count;
    }
    if (rows.begin > rows.end) rows.begin = rows.end;
    rows.first = v_load(done);
    return rows;
}

/* P2G of the cells from `first` on, for all their points or for those that arrived (`more`). */
GR_INLINE void p2g_cells(const int dim, const int basis, const int affine, const int smoothed, struct gr_engine *e,
                         int64_t first, int more)
{
    const int K = gr_power(gr_nodes_1d(basis), dim), rows = GR_SUM_DAMPED(dim);
    const struct summed summed = points_to_sum(e, first, more);
    gr_real *out = gr_sums(e) + gr_sums_of_cell(e, first);
    struct gr_frame frame;
    struct contribution contribution[MOST_PREPARED];
    /* with the density next to sleeping cells, too: these sums are not made again when they are needed */
    const int averages = smoothed && (e->sums.averages || (e->sleep && gr_lanes_asleep(e, first / GR_LANES)));
    int fresh = !more;
    if (more && summed.begin == summed.end) return;
    for (int i = 0; !summed.end && i < e->sums.stride; i += GR_LANES) v_store(out + i, v_zero());
    gr_frame_of(dim, basis, basis != GR_LINEAR && (affine || averages), e, first, &frame);
    const int prepared = gr_prepared(summed.end - summed.begin);
    for (int done = summed.begin; done < summed.end; done += prepared, fresh = 0) {
        const int left = summed.end - done, n = left < prepared ? left : prepared,
                  stream = e->out_of_cache && n == left; /* before that they are read again */
        for (int i = 0; i < n; i++) {
            const int64_t at = gr_slot(&e->mesh.cell[first], done + i);
            const vm counted = v_ge(v_set(done + i), summed.first);
            prepare_momentum(dim, basis, affine, e, &frame, at, counted, &contribution[i]);
            prepare_force(dim, smoothed, e, at, &contribution[i]);
            if (averages) prepare_density(dim, basis, e, &frame, at, &contribution[i]);
        }
        if (K <= 4) { /* all sums of a row fit the registers */
            add_rows(dim, basis, affine, MOMENTUM | FORCE, &frame, contribution, n, rows, 0, fresh, stream, out);
        } else {
            add_rows(dim, basis, affine, MOMENTUM, &frame, contribution, n, rows, 0, fresh, stream, out);
            if (smoothed && e->sums.correct_shift)
                add_rows(dim, basis, 0, FORCE | SHIFT, &frame, contribution, n, rows, GR_SUM_FORCE(dim), fresh, stream, out);
            else
                add_rows(dim, basis, 0, FORCE, &frame, contribution, n, rows, GR_SUM_FORCE(dim), fresh, stream, out);
        }
        if (averages)
            add_rows(dim, basis, 0, DENSITY, &frame, contribution, n, GR_DENSITY_SUMS(dim), 0, fresh, stream,
                     out + e->sums.of_density);
        if (averages && e->config.n_materials > 1)
            add_rows(dim, basis, 0, VOLUME, &frame, contribution, n, GR_VOLUME_SUMS, 0, fresh, stream,
                     out + e->sums.of_volume);
    }
}
