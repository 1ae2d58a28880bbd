/* P2G: sums over the points of each cell for each of its nodes (Dunatunga & Kamrin 2015, eq. 3.4).
 *
 *   m_i = sum w m
 *   p_i = sum w m (v + C (x_i - x))
 *   f_i = -sum V sigma grad w,   V = q m/rho
 *
 * w is the shape function of node i at the point, C the affine velocity field of the point and q = 1 + u its quadrature
 * weight. Particle shifting adds -w m shift_velocity/dt to the force, which takes back the momentum that the shift gave, and
 * in an axisymmetric plane the stress of the rings adds -V sigma_tt w/r along r.
 * Where the density is averaged, further sums follow (smoothed_density.inl).
 *
 * A lane is a cell, whose sums are in the order of its points. A few rows of points are worked on at a time: first their
 * contributions are prepared, and then they are added to one row of nodes after the other, because the running sums of a row
 * fit the registers. When all points are in them, what the lanes of a run have for a node is added, and stored (engine.h). The
 * grid stage then sums over the runs about a node in a fixed order, so that the result depends neither on the number of
 * threads nor on where tiles begin. */
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

/* Prepare w, grad w, m, v and C dx of the points in the slots from `at` on. */
GR_INLINE void prepare_momentum(const int dim, const int basis, const int affine, const struct gr_engine *e,
                                const struct gr_frame *frame, int64_t at, struct contribution *contribution)
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
    contribution->m = component(e, GR_FIELD_mass, 0, at);
}

/* Prepare -V sigma/dx, and the force of the shift and of rings. */
GR_INLINE void prepare_force(const int dim, const int smoothed, const struct gr_engine *e, int64_t at,
                             struct contribution *contribution)
{
    vd stress[6], largest = v_zero();
    acting_stress(dim, e, at, stress);
    for (int d = 0; d < dim; d++)
        for (int j = 0; j <= d; j++) largest = v_max(v_abs(stress[at_stress(d, j)]), largest);
    const vd c = component(e, GR_FIELD_log_density, 0, at);
    vd V = contribution->m * gr_of_material(e, GR_MATERIAL_FORCE_SCALE, at) * inverse_density(c, v_gt(largest, v_zero()));
    if (__builtin_expect(e->dilates, 0)) V = V * component(e, GR_FIELD_bulking, 0, at);
    if (smoothed) {
        contribution->weight = v_set(1.0) + component(e, GR_FIELD_weight_correction, 0, at);
        V = V * contribution->weight;
    }
    for (int d = 0; d < dim; d++)
        for (int j = 0; j <= d; j++) contribution->stress[at_stress(d, j)] = V * stress[at_stress(d, j)];
    const int shifts = smoothed && e->sums.correct_shift;
    for (int d = 0; shifts && d < dim; d++)
        contribution->body_force[d] = contribution->m * v_set(e->shift_scale) * component(e, GR_FIELD_shift_velocity, d, at);
    if (dim == 2 && __builtin_expect(e->config.axisymmetric, 0)) {
        for (int d = 0; !shifts && d < dim; d++) contribution->body_force[d] = v_zero();
        contribution->hoop = gr_inverse_radius(e, at);
        contribution->body_force[0] = v_fma(V * stress[2], contribution->hoop, contribution->body_force[0]);
    }
}

/* For the nodes of a row: m_i += w m, p_i += w m (v + C (x_i - x)). */
GR_INLINE void add_momentum(const int dim, const int basis, const int affine, const struct gr_frame *frame,
                            const struct contribution *p, const struct row row, vd sum[3][MOST_SUMS])
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

/* For the nodes of a row: f_i += -V sigma grad w, in sum[a][first...], and with `body_forces` those times w. The derivative
 * along x is split off, because w along y and z is common to the row. */
GR_INLINE void add_force(const int dim, const int basis, const int body_forces, const struct contribution *p,
                         const struct row row, const int first, vd sum[3][MOST_SUMS])
{
    const vd w_yz = weight_yz(dim, basis, p, row, 0);
    for (int d = 0; d < dim; d++) {
        const vd by_x = p->stress[at_stress(d, 0)] * w_yz;
        vd by_yz = p->stress[at_stress(d, 1)] * weight_yz(dim, basis, p, row, 1);
        if (dim == 3) by_yz = v_fma(p->stress[at_stress(d, 2)], weight_yz(dim, basis, p, row, 2), by_yz);
        if (body_forces) by_yz = v_fma(p->body_force[d], w_yz, by_yz);
        for (int a = 0; a < gr_nodes_1d(basis); a++) {
            const vd partial = v_fma(by_yz, p->w[0][a], sum[a][first + d]);
            if (basis == GR_LINEAR)
                sum[a][first + d] = a ? v_add(partial, by_x) : v_sub(partial, by_x);
            else
                sum[a][first + d] = v_fma(by_x, p->g[0][a], partial);
        }
    }
}

/* Sums of a pass over the rows: m and p; f, with BODY_FORCE also the terms with w; the sums of the density, with HOOP of
 * rings; and those of the density with several materials. With MASSES the masses of each lane are stored, too. */
enum { MOMENTUM = 1, FORCE = 2, DENSITY = 4, VOLUME = 8, BODY_FORCE = 16, MASSES = 32, HOOP = 64 };

/* Sums of a pass over GR_W cells after another of a tile. */
struct pass {
    const struct gr_rows *rows;
    gr_real *lanes, *ends;     /* the block of the tile, and where in it are the ends of its runs */
    gr_real *masses;           /* where the masses of the lanes go, if they do */
    unsigned joins;            /* gr_mesh.tile_joins */
    int n, of_run, stream;     /* lanes that are cells; numbers of a run; whether sums are stored past the caches */
    vm follows[GR_VECTORS][2]; /* lanes that are in a run with the one before, and with that two before */
    vd partial[GR_MAX_NODES * MOST_SUMS]; /* between parts of the rows of points, in each lane */
    /* what the lanes have for their second and their last node: in the block where each is a run by itself, else in `buffer` */
    gr_real *next[2], buffer[2][GR_SIZE(9 * MOST_SUMS * GR_LANES, 1)];
};

/* Store a vector of sums. */
GR_INLINE void put(gr_real *at, int stream, vd sum)
{
    if (stream)
        v_stream(at, sum);
    else
        v_store(at, sum);
}

/* What the lanes of a vector have that are `by` before those of `a`, vector number `part` of a row that begins before `at`. */
GR_INLINE vd v_of_lane_before(const int by, vd a, const gr_real *at, int part)
{
#if GR_W == 1
    (void)a;
    return part < by ? v_zero() : v_load(at - by);
#else
    const vd before = part ? v_load(at - GR_W) : v_zero();
    return by == 1 ? v_after_1(a, before) : v_after_2(a, before);
#endif
}

/* Add the sums of the lanes for the first, second and last node of a row, and store them; `at` is the number of the sum in
 * all rows. */
GR_INLINE void store_lanes(const int k, struct pass *pass, int part, int at, vd first, vd second, vd last)
{
    const int place = at * GR_LANES + part * GR_W;
    gr_real *const next[2] = {pass->next[0] + place, pass->next[1] + place};
    vd sum = first;
    if (pass->joins) {
        sum = sum + v_keep(pass->follows[part][0], v_of_lane_before(1, second, next[0], part));
        if (k == 3) sum = sum + v_keep(pass->follows[part][1], v_of_lane_before(2, last, next[1], part));
    }
    put(pass->lanes + pass->rows->main + place, pass->stream, sum);
    put(next[0], pass->stream && !pass->joins, second);
    if (k == 3) put(next[1], pass->stream && !pass->joins, last);
}

/* Store the tail of a run that ends with lane l, for the sums [begin, end) of each row. */
GR_INLINE void store_tail(const int k, const int n_rows, const struct pass *pass, int run, int l, int begin, int end)
{
    const int width = pass->rows->width;
    const unsigned two = pass->joins >> l & 1;
    gr_real buffer[(9 * MOST_SUMS + 2) * GR_TAIL(3)];
    gr_real *const out = pass->ends + run * pass->of_run + pass->rows->tail, *const tail = pass->stream ? buffer : out;
    for (int row = 0; row < n_rows; row++)
        for (int at = row * width + begin; at < row * width + end; at++) {
            const gr_real *const second = pass->next[0] + at * GR_LANES + l, *const last = pass->next[1] + at * GR_LANES + l;
            if (k == 3)
                v_store_four(tail + at * GR_TAIL(3), *second, *last, two ? last[-1] : 0, 0);
            else
                tail[at] = *second;
        }
    if (!pass->stream) return;
    const int n = n_rows * width * GR_TAIL(k);
    for (int i = n; i % GR_LANES; i++) buffer[i] = 0;
    for (int i = 0; i < n; i += GR_LANES) v_copy_eight(out + i, buffer + i);
}

/* The same for all runs of a tile. */
static __attribute__((noinline)) void store_tails(int k, int n_rows, const struct pass *pass, int begin, int end)
{
    int run = 0;
    for (int l = 0; l < pass->n; l++)
        if (l == pass->n - 1 || !(pass->joins >> (l + 1) & 1)) store_tail(k, n_rows, pass, run++, l, begin, end);
}

/* Store what the lanes have for the nodes beyond their runs: the sums [begin, end) of each row. */
GR_INLINE void store_ends(const int k, const int n_rows, const struct pass *pass, int begin, int end)
{
    if (GR_SIZE(0, 1)) return; /* each lane is a run by itself */
    if (pass->joins == GR_ONE_RUN)
        store_tail(k, n_rows, pass, 0, GR_LANES - 1, begin, end);
    else if (pass->joins)
        store_tails(k, n_rows, pass, begin, end);
}

/* Where a pass is in the rows of points of GR_W cells: n of them are added, the first if it `begins`, the last if it
 * `ends`. */
struct stretch {
    int part, n, begins, ends;
};

/* Add the contributions of rows of points to the sums `what`, row of nodes by row: sums first... of each node. */
GR_INLINE void add_rows(const int dim, const int basis, const int affine, const int what, const struct gr_frame *frame,
                        const struct contribution *contribution, struct stretch stretch, const int first, struct pass *pass)
{
    const int k = gr_nodes_1d(basis), K = gr_power(k, dim);
    const int width = (what & MOMENTUM ? 1 + dim : 0) + (what & FORCE ? dim : 0) +
                      (what & DENSITY ? GR_DENSITY_SUMS(dim) : 0) + (what & VOLUME ? GR_VOLUME_SUMS : 0);
    for (int bc = 0; bc < K / k; bc++) {
        const struct row row = {bc % k, bc / k};
        vd sum[3][MOST_SUMS], *const partial = pass->partial + (bc * MOST_SUMS + first) * k;
        GR_UNROLLED
        for (int i = 0; i < k * width; i++) sum[i / width][i % width] = stretch.begins ? v_zero() : partial[i];
        GR_ROLLED
        for (int i = 0; i < stretch.n; i++) {
            if (what & MOMENTUM) add_momentum(dim, basis, affine, frame, contribution + i, row, sum);
            if (what & FORCE)
                add_force(dim, basis, what & BODY_FORCE, contribution + i, row, what & MOMENTUM ? 1 + dim : 0, sum);
            if (what & DENSITY) add_density(dim, basis, what & HOOP, frame, contribution + i, row, sum);
            if (what & VOLUME) add_volume(dim, basis, frame, contribution + i, row, sum);
        }
        if (!stretch.ends) {
            GR_UNROLLED
            for (int i = 0; i < k * width; i++) partial[i] = sum[i / width][i % width];
            continue;
        }
        for (int a = 0; what & MASSES && a < k; a++)
            v_store(pass->masses + (bc * k + a) * GR_LANES + stretch.part * GR_W, sum[a][GR_SUM_MASS]);
        GR_UNROLLED
        for (int q = 0; q < width; q++)
            store_lanes(k, pass, stretch.part, bc * pass->rows->width + first + q, sum[0][q], sum[1][q], sum[k - 1][q]);
    }
}

/* Largest number of points of n cells from `first` on. */
GR_INLINE int most_points(const struct gr_engine *e, int64_t first, int n)
{
    int most = 0;
    for (int l = 0; l < n; l++) most = e->mesh.cell[first + l].count > most ? e->mesh.cell[first + l].count : most;
    return most;
}

/* True if all parts of a tile are worked on, and no cell of it has points. */
GR_INLINE int is_empty_tile(const struct gr_engine *e, int64_t tile, const struct gr_parts parts)
{
    return parts.last - parts.first == GR_VECTORS && !most_points(e, tile * GR_LANES, GR_LANES);
}

/* Begin a pass over the cells of a tile. The members that are not set are set before they are read. */
GR_INLINE void begin_pass(const struct gr_engine *e, enum gr_group_of_sums group, int64_t tile, int stream,
                          struct pass *pass)
{
    const int64_t left = e->mesh.n_cells - tile * GR_LANES;
    const unsigned joins = e->mesh.tile_joins[tile];
    pass->rows = &e->sums.rows[group];
    pass->lanes = gr_sums_of_tile(e, tile);
    pass->ends = pass->lanes + e->sums.of_lanes;
    pass->joins = joins;
    pass->n = left < GR_LANES ? (int)left : GR_LANES;
    pass->of_run = e->sums.of_run;
    pass->stream = stream;
    pass->next[0] = joins ? pass->buffer[0] : pass->ends + pass->rows->apart;
    pass->next[1] = joins ? pass->buffer[1] : pass->next[0] + e->n_rows * pass->rows->width * GR_LANES;
    for (int part = 0; part < GR_VECTORS; part++) {
        pass->follows[part][0] = m_of_bits((joins >> (part * GR_W)) & GR_ALL_LANES);
        pass->follows[part][1] = m_of_bits(((joins & joins << 1) >> (part * GR_W)) & GR_ALL_LANES);
    }
}

/* The next rows of points to be worked on together. */
GR_INLINE struct stretch next_stretch(int part, int done, int most)
{
    const int prepared = gr_prepared(most), left = most - done, n = left < prepared ? left : prepared;
    return (struct stretch){.part = part, .n = n, .begins = !done, .ends = n == left};
}

GR_INLINE void clear_sums(const struct gr_engine *e, int64_t tile)
{
    for (gr_real *out = gr_sums_of_tile(e, tile); out < gr_sums_of_tile(e, tile + 1); out += GR_W) v_store(out, v_zero());
}

/* The passes over the points of a tile. */
struct p2g_passes {
    struct pass motion, density, volume;
};

/* P2G of GR_W cells of a tile. */
GR_INLINE void p2g_cells(const int dim, const int basis, const int affine, const int smoothed, struct gr_engine *e,
                         int64_t tile, int part, int averages, struct p2g_passes *passes)
{
    const int K = gr_power(gr_nodes_1d(basis), dim), rings = dim == 2 && e->config.axisymmetric,
              body_forces = rings || (smoothed && e->sums.correct_shift);
    const int64_t first = tile * GR_LANES + part * GR_W;
    const int most = most_points(e, first, GR_W);
    struct gr_frame frame;
    struct contribution contribution[MOST_PREPARED];
    struct stretch stretch = {0};
    vd filled = v_zero();
    gr_frame_of(dim, basis, basis != GR_LINEAR && (affine || averages), e, first, &frame);
    for (int done = 0; !stretch.ends; done += stretch.n) {
        stretch = next_stretch(part, done, most);
        for (int i = 0; i < stretch.n; i++) {
            const int64_t at = gr_slot(&e->mesh.cell[first], done + i);
            prepare_momentum(dim, basis, affine, e, &frame, at, &contribution[i]);
            prepare_force(dim, smoothed, e, at, &contribution[i]);
            if (averages) prepare_density(dim, basis, e, &frame, at, &contribution[i]);
            if (averages) filled = filled + contribution[i].filled;
        }
        if (K <= 4) { /* all sums of a row fit the registers */
            if (rings)
                add_rows(dim, basis, affine, MOMENTUM | FORCE | BODY_FORCE, &frame, contribution, stretch, 0,
                         &passes->motion);
            else
                add_rows(dim, basis, affine, MOMENTUM | FORCE, &frame, contribution, stretch, 0, &passes->motion);
        } else {
            add_rows(dim, basis, affine, MOMENTUM, &frame, contribution, stretch, 0, &passes->motion);
            if (body_forces)
                add_rows(dim, basis, 0, FORCE | BODY_FORCE, &frame, contribution, stretch, GR_SUM_FORCE(dim),
                         &passes->motion);
            else
                add_rows(dim, basis, 0, FORCE, &frame, contribution, stretch, GR_SUM_FORCE(dim), &passes->motion);
        }
        if (averages && rings)
            add_rows(dim, basis, 0, DENSITY | HOOP, &frame, contribution, stretch, 0, &passes->density);
        else if (averages)
            add_rows(dim, basis, 0, DENSITY, &frame, contribution, stretch, 0, &passes->density);
        if (averages && e->own_volumes) add_rows(dim, basis, 0, VOLUME, &frame, contribution, stretch, 0, &passes->volume);
    }
    if (averages) v_store(gr_cell_sums(e, first, GR_CELL_FILLED), filled);
}

/* P2G of the points of a tile, or of parts of one whose lanes are runs by themselves. */
GR_INLINE void p2g_points(const int dim, const int basis, const int affine, const int smoothed, struct gr_engine *e,
                          int64_t tile, const struct gr_parts parts)
{
    const int k = gr_nodes_1d(basis), n_rows = gr_power(k, dim) / k, stream = e->out_of_cache;
    /* with the density next to sleeping cells, too: these sums are not made again when they are needed */
    const int averages = smoothed && (e->sums.averages || (e->sleep && gr_lanes_asleep(e, tile)));
    struct p2g_passes passes;
    if (is_empty_tile(e, tile, parts)) {
        clear_sums(e, tile);
        return;
    }
    begin_pass(e, GR_SUMS_OF_MOTION, tile, stream, &passes.motion);
    begin_pass(e, GR_SUMS_OF_DENSITY, tile, stream, &passes.density); /* always, or compilers warn of what is not set */
    begin_pass(e, GR_SUMS_OF_VOLUME, tile, stream, &passes.volume);
    GR_EACH_PART (part, parts) p2g_cells(dim, basis, affine, smoothed, e, tile, part, averages, &passes);
    store_ends(k, n_rows, &passes.motion, 0, GR_SUM_DAMPED(dim));
    if (averages) store_ends(k, n_rows, &passes.density, 0, GR_DENSITY_SUMS(dim));
    if (averages && e->own_volumes) store_ends(k, n_rows, &passes.volume, 0, GR_VOLUME_SUMS);
}
