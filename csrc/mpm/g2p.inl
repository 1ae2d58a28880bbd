/* G2P: velocity, position, velocity gradient and density of the points, from the nodal fields (node_data, see
 * GR_NODE_FIELDS).
 *
 *   v <- f v + sum S w,   x <- x + dt sum S v^{n+1},   L = sum v^{n+1} (x) grad S   (eq. 3.8; w: see grid.h),
 *   c <- c - dt tr L      (eq. 3.9 for the logarithm of the density).
 *
 * In an axisymmetric plane L has the component v_r/r of rings, too.
 *
 * The law then updates the stress from L dt (cell_view.inl). Points that leave their cell are listed here; migrate.c
 * moves them, and the sums of the cells that they enter are computed again. */
#include "mpm/device.h"
#include "mpm/contribution.h"
#include "mpm/density_correction.h"
#include "mpm/slots.h"

/* List the points of a row of the cells from `first` on that are not `inside`; without a list, note that they leave. Spare
 * slots that are not go back to the centre of their cell. */
static __attribute__((noinline)) int64_t list_migrants(struct gr_engine *e, int64_t first, int row, unsigned inside,
                                                       struct gr_migrant *migrant)
{
    int64_t n = 0;
    for (int lane = 0; lane < GR_W; lane++) {
        struct gr_cell *cell = &e->mesh.cell[first + lane];
        if (inside >> lane & 1u) continue;
        if (row < cell->count && migrant)
            migrant[n++] = (struct gr_migrant){.cell = first + lane, .slot = gr_slot(cell, row)};
        else if (row < cell->count)
            n += e->device->leaves[gr_slot(cell, row)] = 1;
        else
            gr_clear_slot(e, cell, gr_slot(cell, row));
    }
    return n;
}

/* Weights w r/D of APIC's C = B D^-1 in place of derivatives. Where D vanishes, at a wall, the weights of the gradient. */
GR_INLINE void moment_weights(const int dim, const int basis, const struct gr_shape *s, vd moment[3][3])
{
    const int k = gr_nodes_1d(basis);
    for (int d = 0; d < dim; d++) {
        vd D = v_zero();
        for (int a = 0; a < k; a++) D = v_fma(s->w[d][a] * s->r[d][a], s->r[d][a], D);
        for (int a = 0; a < k; a++) moment[d][a] = v_select(v_gt(D, v_set(0.02)), s->w[d][a] * s->r[d][a] / D, s->g[d][a]);
    }
}

/* Store the affine field of the points, from the gradient L dt of the displacement or from its moment (APIC). A
 * disconnected point that is nearly alone in a cell at a wall gets none: its gradient would grow as it approaches the
 * wall, and it would strike the wall with that velocity. If the density is averaged, no disconnected point gets one. */
GR_INLINE void store_affine(const int dim, const int basis, const int affine, struct gr_engine *e, int64_t at,
                            const struct gr_shape *s, const vd *mode, vm carries, const vd *L)
{
    const int K = gr_power(gr_nodes_1d(basis), dim);
    vd moment[3][3], C[9];
    for (int c = 0; c < dim * dim; c++) C[c] = L[c];
    if (affine == GR_AFFINE_MOMENT) {
        moment_weights(dim, basis, s, moment);
        for (int d = 0; d < dim; d++)
            (void)gr_interpolate(dim, basis, 1, mode + d * K, s, (const vd(*)[3])moment, C + d * dim);
    }
    for (int c = 0; c < dim * dim; c++)
        v_store(gr_numbers(e, GR_FIELD_affine, c, at), v_keep(carries, C[c] * v_set(e->clock.inv_dt)));
}

/* Log-density from which the points in the slots from `at` on are given an affine field. */
GR_INLINE vd affine_from(const struct gr_engine *e, const struct view *view, int64_t at)
{
    if (__builtin_expect(e->config.n_materials == 1, 1)) return view->disconnected;
    return v_select(v_gt(view->disconnected, v_set(-NO_DENSITY)), gr_of_material(e, GR_MATERIAL_SEPARATION, at),
                    view->disconnected);
}

/* Move the points in the slots from `at` on, a row of the viewed cells. L dt is stored in `gradient` for the law, and in an
 * axisymmetric plane that of rings in `hoop`.
 * Returned: a bit for each lane that is still in its cell. */
GR_INLINE unsigned move_row(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                            const int averages, struct gr_engine *e, const struct view *view, int64_t at, gr_real *gradient,
                            gr_real *hoop)
{
    const int nodal = basis == GR_UGIMP || affine == GR_AFFINE_MOMENT, K = gr_power(gr_nodes_1d(basis), dim);
    const int all_new = affine == GR_AFFINE_MOMENT; /* APIC: no share of the old velocity survives, and w = v */
    const int64_t stride = e->points.capacity;
    const vd *const mode = view->mode;
    const vd dx = v_set(e->config.dx), keep = v_set(e->keep_velocity), speed = v_set(e->config.dx * e->clock.inv_dt);
    double *const x = gr_x(e, 0) + at;
    gr_real *const v = gr_numbers(e, GR_FIELD_v, 0, at), *const log_density = gr_numbers(e, GR_FIELD_log_density, 0, at);
    struct gr_shape s;
    vd L[9], move[3], v_new[3], slope[3], delta[3], shift_velocity[3], trace = v_zero();
    gr_shapes(dim, basis, e, &view->frame, at, affine == GR_AFFINE_MOMENT, &s);
    for (int d = 0; d < dim; d++) {
        move[d] = gr_interpolate(dim, basis, nodal, mode + (GR_NODE_VELOCITY + d) * K, &s, (const vd(*)[3])s.g, L + d * dim);
        for (int j = 0; j < dim; j++) {
            if (cell_averaged) L[d * dim + j] = view->L[d * dim + j];
            v_store(gradient + (d * dim + j) * GR_W, L[d * dim + j]);
        }
        trace = d ? v_add(trace, L[d * dim + d]) : L[0];
        const vd w = all_new ? v_mul(speed, move[d])
                             : gr_interpolate(dim, basis, nodal, mode + (GR_NODE_UPDATE(dim) + d) * K, &s,
                                              (const vd(*)[3])s.g, slope);
        v_new[d] = all_new ? w : v_fma(keep, v_load(v + d * stride), w);
    }
    if (dim == 2) L[4] = v_zero();
    if (dim == 2 && __builtin_expect(e->config.axisymmetric, 0)) {
        L[4] = cell_averaged ? view->L[4] : v_mul(move[0], gr_inverse_radius(e, at));
        v_store(hoop, L[4]);
        trace = trace + L[4];
    }
    vd c = cell_averaged ? view->c : v_sub(v_load(log_density), trace);
    if (cell_averaged && view->damping.any) damp(dim, basis, e, &view->frame, &s, &view->damping, at, v_new);
    if (smoothed && view->damps_flutter) damp_flutter(dim, e, at);
    if (averages) {
        c = relax_density(dim, basis, e, &view->walls, view->drop, &s, mode + GR_NODE_DENSITY(dim) * K, L, trace, at, delta,
                          shift_velocity);
        for (int d = 0; d < dim; d++) v_new[d] = v_new[d] + shift_velocity[d];
    }
    for (int d = 0; cell_averaged && d < dim; d++)
        delta[d] = v_fma(s.xi[d], v_sub(view->shift[d][1], view->shift[d][0]), view->shift[d][0]);
    for (int d = 0; __builtin_expect(view->has_sponge != 0, 0) && d < dim; d++) {
        if (!(view->has_sponge >> d & 1)) continue;
        const vm slowed = m_and(x_ge(x_load(x + d * stride), x_set(e->config.above[d])), v_gt(v_new[d], v_zero()));
        v_new[d] = v_select(slowed, v_set(e->sponge_factor[d]) * v_new[d], v_new[d]);
    }
    v_store(log_density, c);
    if (affine) store_affine(dim, basis, affine, e, at, &s, mode, v_ge(c, affine_from(e, view, at)), L);
    xm along[3];
    for (int d = 0; d < dim; d++) {
        vx y = x_fma(dx, move[d], x_load(x + d * stride));
        if (cell_averaged || averages) y = x_add(y, delta[d]);
        v_store(v + d * stride, v_new[d]);
        x_store(x + d * stride, y);
        along[d] = x_within(y, view->begin[d], view->end[d]);
    }
    xm inside = x_and(along[0], along[1]);
    if (dim == 3) inside = x_and(inside, along[2]);
    return x_bits(inside) & m_bits(v_ge(v_set(NO_DENSITY), v_abs(c))); /* a NaN counts as outside */
}

/* Fluidity from which the law starts at the points in the slots from `at` on. After substeps the points with pressure are
 * those with a weight in the mean that is not zero. */
GR_INLINE vd start_of_row(const struct gr_engine *e, const struct fluidity_start *start, int64_t at)
{
    if (e->config.nonlocal.substeps < 2) return start_of_points(e, start, has_pressure(e, at), at);
    const vd weight = v_load(gr_substep_at(e->nonlocal.substeps, at, GR_SUBSTEP_weight));
    return start_of_points(e, start, v_gt(weight, v_zero()), at);
}

/* Fetch the components of the points in the slots from `at` on into the caches, before they are needed: they are more streams
 * than a processor follows by itself. Out of the caches a step takes 5 to 15 % less time in 2D and 2 to 7 % less in 3D
 * (measured). */
GR_INLINE void fetch_row(const struct gr_engine *e, int64_t at)
{
    for (int c = 0; c < e->points.n_doubles; c++) __builtin_prefetch((const double *)e->points.column[c] + at, 1);
    for (int c = e->points.n_doubles; c < e->points.n_components; c++)
        __builtin_prefetch((const float *)e->points.column[c] + at, 1);
}

/* G2P of the cells of a tile, or of parts of it, row by row. Their points are added to the batch of the law.
 * Returned: the number of points that left. */
GR_INLINE int64_t g2p_tile(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                           const int averages, struct gr_engine *e, int64_t tile, const struct gr_parts parts,
                           struct batch *batch, struct gr_migrant *migrant)
{
    struct view views[GR_SIZE(GR_VECTORS, 1)];
    int64_t n = 0, first = tile * GR_LANES;
    int rows = 0;
    GR_EACH_PART (part, parts) {
        struct view *const view = &views[GR_SIZE(part, 0)];
        look_at_cells(dim, basis, affine, smoothed, cell_averaged, averages, e, first + part * GR_W, view);
        if (view->points > rows) rows = view->points;
    }
    const int fetches = e->out_of_cache && !cell_averaged && tile + 1 < e->mesh.n_tiles; /* averages: 2 to 4 % slower */
    const int64_t ahead = fetches ? e->mesh.cell[first + GR_LANES].offset : 0;
    for (int row = 0; row < rows; row++)
        GR_EACH_PART (part, parts) {
            const struct view *const view = &views[GR_SIZE(part, 0)];
            const int64_t at = gr_slot(&e->mesh.cell[first + part * GR_W], row);
            if (!part && fetches) fetch_row(e, ahead + row * GR_LANES);
            if (row >= view->points) continue;
            if (__builtin_expect(batch->n == BATCH, 0)) run_law(e, batch, 0);
            gr_real *gradient = batch->gradient + batch->n * dim * dim * GR_W;
            const unsigned inside = move_row(dim, basis, affine, smoothed, cell_averaged, averages, e, view, at, gradient,
                                             batch->hoop + batch->n * GR_W);
            if (e->nonlocal.diffuses) v_store(batch->g_star + batch->n * GR_W, start_of_row(e, &view->fluidity, at));
            batch->slot[batch->n++] = at;
            if (__builtin_expect(inside != GR_ALL_LANES, 0))
                n += list_migrants(e, first + part * GR_W, row, inside, migrant ? migrant + n : NULL);
        }
    return n;
}
