/* Gather (G2P), law and scatter of a run of cells in one sweep: a cell's points are read and written once a step.
 *
 * Given: node_data, see GR_NODE_FIELDS. Per point
 *   v <- f v + sum S w,   x <- x + dt sum S v^{n+1},   L = sum v^{n+1} (x) grad S   (eq. 3.8; w: see grid.c),
 *   c <- c - dt tr L      (eq. 3.9 in the logarithm of the density),
 * then the stress update of the law, and the sums of the next step. Points that leave their cell are taken out
 * of it before; the sums of a cell that they come to are made anew (migrate.c). */
#include "mpm/shape.h"

#define NO_DENSITY 1e3 /* |ln(rho/rho_c)| beyond which a density is none: looked at as a point that leaves */

enum { ALONE = 2 }; /* points in a cell up to which they are alone */

#define MODE_STRIDE(fields) (((fields) + GR_W - 1) / GR_W * GR_W) /* whole vectors */

enum { BATCH = 256 / GR_W }; /* blocks a law sees at once: they stay in the first-level cache */

struct batch {
    int64_t n;
    int64_t slot[BATCH];
    double g_star[BATCH];
    double scale[MODE_STRIDE(GR_NODE_FIELDS(3, 1))]; /* of the nodal fields: velocity to displacement in cells a step */
    _Alignas(64) double gradient[BATCH * 9 * GR_W];
};

/* The law: all of the step, or the first or last of its substeps. */
static void run_law(const struct gr_engine *e, gr_law_update *update, struct batch *batch, int begins)
{
    const int many = e->diffuses && e->config.nonlocal.substeps > 1;
    const double fraction = many ? 1.0 / e->config.nonlocal.substeps : 1;
    struct gr_law_call call = {.n_blocks = batch->n,
                               .slot = batch->slot,
                               .gradient = batch->gradient,
                               .dt = fraction * e->dt,
                               .fraction = fraction,
                               .substeps = many ? e->substeps : 0,
                               .begins = begins,
                               .pressure_from_density = e->config.pressure_from_density,
                               .parameter = e->config.parameter,
                               .log_density = e->field[GR_FIELD_log_density],
                               .g_star = e->diffuses ? batch->g_star : 0,
                               .shear_rate = e->record_rates ? e->field[GR_FIELD_shear_rate] : 0,
                               .g = e->field[GR_FIELD_g],
                               .gain = e->field[GR_FIELD_g_gain],
                               .plastic_strain = e->field[GR_FIELD_plastic_strain]};
    for (int c = 0; c < (e->config.dim == 2 ? 4 : 6); c++) call.stress[c] = e->field[GR_FIELD_stress] + c * e->capacity;
    update(&call);
    batch->n = 0;
}

/* Lanes outside the cell: points are listed, spare places go back to the middle of the cell. */
static __attribute__((noinline)) int64_t list_migrants(struct gr_engine *e, int64_t index, int block, unsigned inside,
                                                       struct gr_migrant *migrant)
{
    struct gr_cell *cell = &e->mesh.cell[index];
    int64_t found = 0;
    for (int lane = 0; lane < GR_W; lane++) {
        const int place = block * GR_W + lane;
        if (inside >> lane & 1u) continue;
        if (place < cell->count) {
            migrant[found].cell = index;
            migrant[found++].slot = cell->offset + place;
        } else {
            gr_clear_place(e, cell, cell->offset + place);
        }
    }
    return found;
}

/* Towards a wall the shift dies out over the cell at the wall, as the flow does: else it would carry points,
 * which the wall only stops by the velocity of its nodes, through a wall inside the grid. */
GR_INLINE void hold_at_walls(const int dim, const struct gr_cell *cell, const vd xi[3], vd delta[3])
{
    for (int d = 0; d < dim; d++) {
        const int walls = cell->flags / GR_CELL_WALL >> 2 * d & 3;
        if (walls & 1) delta[d] = v_max(delta[d], delta[d] * xi[d]);
        if (walls & 2) delta[d] = v_min(delta[d], delta[d] * (v_set(1.0) - xi[d]));
    }
}

/* Weights of the points in the force, that a uniform pressure makes none inside the material:
 *   u += -weight_correction sum_i E_i . grad S_i - weight_correction_decay u - sum_i S_i x_i,   E_i = sum (1 + u) m/(rho_c dx^dim) grad S_i,
 * in lengths of cells; a descent on the sum of E^2, which forgets where a point has been, and takes away x_i, what
 * the mean weight about a node is in excess of exp(cbar_i)/phi_i. Given the modes of x and E. */
GR_INLINE void weigh(const int dim, const int basis, struct gr_engine *e, const struct gr_shape *s, const double *mode,
                     const int stride, int64_t at)
{
    const struct gr_density_numbers *q = &e->config.density;
    double *place = e->field[GR_FIELD_weight_correction] + at;
    vd u = v_load(place), divergence = v_zero(), slope[3];
    for (int d = 0; d < dim; d++) {
        (void)gr_interpolate(dim, basis, 0, mode + 1 + d, stride, s, (const vd(*)[3])s->g, slope);
        divergence = divergence + slope[d];
    }
    const vd excess =
        gr_interpolate(dim, basis, 0, mode, stride, s, (const vd(*)[3])s->g, slope) * v_set(q->weight_correction > 0);
    u = v_fnma(v_set(q->weight_correction), divergence, v_fnma(v_set(q->weight_correction_decay), u, u) - excess);
    v_store(place, v_clamp(u, -q->weight_correction_limit, q->weight_correction_limit));
}

/* Averaging of the density, its pull to the geometric density, and the shift out of crowded places.
 *   c += eta (cbar - c) + pull (gap),   eta: averaged_part, pull: relax_to_nodal_density,
 *   delta = -beta gdot dt dx^2 sum max(0, phi_i - 1) grad S_i,   |delta| <= min(limit dx, gdot dt dx/2).
 * dt and gdot dt are those of all the steps that the averaging stands for; gdot is the plastic rate of points that bear
 * stress, that of the flow for those that do not. Given L dt and dt tr L of this step, and the modes of the gap, cbar,
 * max(0, phi - 1), x and E; returned: the new log-density, delta in m, L delta in m/s. */
GR_INLINE vd relax_density(const int dim, const int basis, struct gr_engine *e, const struct gr_cell *cell,
                           const struct gr_shape *s, const double *mode, const int stride, const vd *L, vd trace, int64_t at,
                           vd delta[3], vd shift_velocity[3])
{
    const struct gr_density_numbers *q = &e->config.density;
    const double dx = e->config.dx, inv_dx = e->inv_dx;
    const vd(*g)[3] = (const vd(*)[3])s->g;
    vd slope[3], gradient[3];
    const double interval = e->config.averaging_interval;
    const vd old = v_load(e->field[GR_FIELD_log_density] + at), flow = v_load(e->field[GR_FIELD_shear_rate] + at);
    const vm bears = v_ge(
        old,
        v_set(q->separation_strain < NO_DENSITY ? 0.0 : -q->separation_strain)); /* what has no reach bears tension, too */
    const vm joins = v_ge(old, v_set(-q->separation_strain));
    const vd strain = v_set(interval) * v_select(bears, v_set(e->dt) * flow, kinematic_rate(dim, L));
    const vd gap = gr_interpolate(dim, basis, 0, mode, stride, s, g, slope);
    const vd near = gr_interpolate(dim, basis, 0, mode + 1, stride, s, g, gradient);
    (void)gr_interpolate(dim, basis, 0, mode + 2, stride, s, g, slope);
    vd c = v_fma(v_keep(joins, averaged_part(e, interval * e->dt, strain, old)), near - old, old - trace);
    for (int d = 0; d < dim; d++)
        v_store(e->field[GR_FIELD_density_gradient] + d * e->capacity + at, v_keep(joins, gradient[d] * v_set(inv_dx)));
    c = c + v_keep(v_ge(c, v_zero()), relax_to_nodal_density(q, interval * e->dt, strain, gap));
    vd length = v_zero();
    for (int d = 0; d < dim; d++) {
        delta[d] = v_set(-q->shifting * dx) * strain * slope[d];
        length = v_fma(delta[d], delta[d], length);
    }
    const vd most =
        cell->flags & GR_CELL_NO_SHIFTING ? v_zero() : v_min(v_set(q->shifting_limit * dx), v_set(0.5 * dx) * strain);
    const vm far = v_gt(length, most * most);
    if (m_bits(far)) {
        const vd scale = v_select(far, most / v_sqrt(v_max(length, v_set(1e-300))), v_set(1.0));
        for (int d = 0; d < dim; d++) delta[d] = delta[d] * scale;
    }
    if (cell->flags >= GR_CELL_WALL) hold_at_walls(dim, cell, s->xi, delta);
    weigh(dim, basis, e, s, mode + 3, stride, at);
    for (int d = 0; d < dim; d++) {
        shift_velocity[d] = v_zero();
        for (int j = 0; j < dim; j++) shift_velocity[d] = v_fma(L[d * dim + j], delta[j], shift_velocity[d]);
        shift_velocity[d] = shift_velocity[d] * v_set(e->inv_dt);
        v_store(e->field[GR_FIELD_shift_velocity] + d * e->capacity + at, shift_velocity[d]);
    }
    return c;
}

/* Derivative weights w r/D of APIC's C = B D^-1; where D vanishes (a wall), those of the gradient. */
GR_INLINE void moment_weights(const int dim, const int basis, const struct gr_shape *s, vd moment[3][3])
{
    const int k = gr_nodes_1d(basis);
    for (int d = 0; d < dim; d++) {
        vd D = v_zero();
        for (int a = 0; a < k; a++) D = v_fma(s->w[d][a] * s->r[d][a], s->r[d][a], D);
        for (int a = 0; a < k; a++) moment[d][a] = v_select(v_gt(D, v_set(0.02)), s->w[d][a] * s->r[d][a] / D, s->g[d][a]);
    }
}

/* The affine field that the points carry on, from the gradient L dt of the displacement or from its moment.
 * A point that has come disconnected and is alone before a wall carries none: it would keep a gradient that grows as
 * the wall comes near, and strike it with that. Where the density is averaged, no disconnected point does. */
GR_INLINE void store_affine(const int dim, const int basis, const int affine, struct gr_engine *e, int64_t at,
                            const struct gr_shape *s, const double *mode, const int stride, vm joined, const vd *L)
{
    vd moment[3][3], C[9];
    for (int c = 0; c < dim * dim; c++) C[c] = L[c];
    if (affine == GR_AFFINE_MOMENT) {
        moment_weights(dim, basis, s, moment);
        for (int d = 0; d < dim; d++)
            (void)gr_interpolate(dim, basis, 1, mode + d, stride, s, (const vd(*)[3])moment, C + d * dim);
    }
    for (int c = 0; c < dim * dim; c++)
        v_store(e->field[GR_FIELD_affine] + c * e->capacity + at, v_keep(joined, C[c] * v_set(e->inv_dt)));
}

/* Modes of the nodal fields of a cell: displacement in cells a step, w, and what an averaging of the density takes. */
GR_INLINE void cell_modes(const int dim, const int basis, const int nodal, const int averages, const int stride,
                          const struct gr_engine *e, int64_t index, const struct gr_frame *frame, const double *scale,
                          double *mode)
{
    const int K = gr_power(gr_nodes_1d(basis), dim), fields = GR_NODE_FIELDS(dim, averages);
    for (int i = 0; i < K; i++) {
        const double *node = e->node_data + (int64_t)e->mesh.cell_node[index * K + i] * e->node_stride;
        for (int q = 0; q < fields; q += GR_W) v_store(mode + i * stride + q, v_load(node + q) * v_load(scale + q));
    }
    gr_modes(dim, basis, nodal, fields, stride, frame, mode);
}

/* What the points of a cell have in common. */
struct view {
    struct gr_frame frame;
    vd begin[3], end[3];  /* the cell ends here */
    int has_sponge;       /* bit d: points that rise along axis d may be slowed */
    vd disconnected;      /* log-density below which a point carries no affine field */
    vd L[9], shift[3], c; /* of all the points, where they share their density: L dt, m, 1 */
    double mode[MODE_STRIDE(GR_NODE_FIELDS(3, 1)) * GR_MAX_NODES];
};

GR_INLINE void look_at_cell(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                            int averages, const struct gr_engine *e, int64_t index, const double *scale, struct view *view)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int fields = MODE_STRIDE(GR_NODE_FIELDS(dim, smoothed)), nodal = basis == GR_UGIMP || affine == GR_AFFINE_MOMENT;
    const int carried = !smoothed && !cell_averaged && !(cell->flags >= GR_CELL_WALL && cell->count <= ALONE);
    view->frame = gr_frame_of(dim, e, cell);
    view->disconnected = v_set(carried ? -NO_DENSITY : -e->config.density.separation_strain);
    view->has_sponge = e->config.has_sponge;
    for (int d = 0; d < dim; d++) {
        view->begin[d] = v_set(view->frame.axis[d]->begin);
        view->end[d] = v_set(view->frame.axis[d]->end);
        if (e->config.above[d] >= view->frame.axis[d]->end) view->has_sponge &= ~(1 << d);
    }
    if (smoothed && averages)
        cell_modes(dim, basis, nodal, 1, fields, e, index, &view->frame, scale, view->mode);
    else
        cell_modes(dim, basis, nodal, 0, fields, e, index, &view->frame, scale, view->mode);
    if (cell_averaged) view->c = flow_of_cell(dim, e, index, view->L, view->shift);
}

/* Move the block of points at place `at`; L dt is for the law. Returned: a bit for each lane still in the cell. */
GR_INLINE unsigned move_block(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                              int averages, struct gr_engine *e, const struct gr_cell *cell, const struct view *view,
                              int64_t at, double *gradient)
{
    const int fields = MODE_STRIDE(GR_NODE_FIELDS(dim, smoothed)), nodal = basis == GR_UGIMP || affine == GR_AFFINE_MOMENT;
    const int all_new = affine == GR_AFFINE_MOMENT; /* APIC: nothing of the old velocity survives and w = v */
    const int64_t stride = e->capacity;
    const double *const mode = view->mode;
    const vd dx = v_set(e->config.dx), keep = v_set(e->keep_velocity), speed = v_set(e->config.dx * e->inv_dt);
    double *const x = e->field[GR_FIELD_x] + at, *const v = e->field[GR_FIELD_v] + at,
                  *const log_density = e->field[GR_FIELD_log_density] + at;
    struct gr_shape s;
    vd L[9], move[3], v_new[3], slope[3], delta[3], shift_velocity[3], trace = v_zero();
    const double *place[3];
    for (int d = 0; d < dim; d++) place[d] = x + d * stride;
    gr_shapes(dim, basis, &view->frame, place, affine == GR_AFFINE_MOMENT, &s);
    for (int d = 0; d < dim; d++) {
        move[d] = gr_interpolate(dim, basis, nodal, mode + d, fields, &s, (const vd(*)[3])s.g, L + d * dim);
        for (int j = 0; j < dim; j++) {
            if (cell_averaged) L[d * dim + j] = view->L[d * dim + j];
            v_store(gradient + (d * dim + j) * GR_W, L[d * dim + j]);
        }
        trace = d ? v_add(trace, L[d * dim + d]) : L[0];
        const vd w = all_new ? v_mul(speed, move[d])
                             : gr_interpolate(dim, basis, nodal, mode + dim + d, fields, &s, (const vd(*)[3])s.g, slope);
        v_new[d] = all_new ? w : v_fma(keep, v_load(v + d * stride), w);
    }
    vd c = cell_averaged ? view->c : v_sub(v_load(log_density), trace);
    if (smoothed && averages) {
        c = relax_density(dim, basis, e, cell, &s, mode + 2 * dim, fields, L, trace, at, delta, shift_velocity);
        for (int d = 0; d < dim; d++) v_new[d] = v_new[d] + shift_velocity[d];
    }
    if (cell_averaged) {
        for (int d = 0; d < dim; d++) delta[d] = view->shift[d];
        if (cell->flags >= GR_CELL_WALL) hold_at_walls(dim, cell, s.xi, delta);
    }
    for (int d = 0; __builtin_expect(view->has_sponge != 0, 0) && d < dim; d++) {
        if (!(view->has_sponge >> d & 1)) continue;
        const vm slowed = m_and(v_ge(v_load(place[d]), v_set(e->config.above[d])), v_gt(v_new[d], v_zero()));
        v_new[d] = v_select(slowed, v_set(e->sponge_factor[d]) * v_new[d], v_new[d]);
    }
    v_store(log_density, c);
    if (affine) store_affine(dim, basis, affine, e, at, &s, mode, fields, v_ge(c, view->disconnected), L);
    vm stays = v_ge(v_set(NO_DENSITY), v_abs(c)); /* NaN is outside, too */
    for (int d = 0; d < dim; d++) {
        vd y = v_fma(dx, move[d], v_load(place[d]));
        if (cell_averaged || (smoothed && averages)) y = y + delta[d];
        v_store(v + d * stride, v_new[d]);
        v_store(x + d * stride, y);
        stays = m_and(stays, m_and(v_ge(y, view->begin[d]), v_gt(view->end[d], y)));
    }
    return m_bits(stays);
}

/* What the diffusion has left of the fluidity of a cell, see mean_fluidity. */
GR_INLINE double fluidity_of_cell(const struct gr_engine *e, int64_t place)
{
    double g = e->fluidity->g[place];
    if (gr_is_balanced(e)) g -= e->fluidity->gain[place];
    return g < e->config.nonlocal.floor ? e->config.nonlocal.floor : g; /* NaN stays */
}

GR_INLINE int64_t g2p_cell(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                           int averages, struct gr_engine *e, int64_t index, struct batch *batch, gr_law_update *law,
                           struct gr_migrant *migrant)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int blocks = GR_BLOCKS(cell->count);
    struct view view;
    int64_t found = 0, filled = batch->n;
    const double g_star = e->diffuses ? fluidity_of_cell(e, gr_place_of_cell(e, cell)) : 0;
    look_at_cell(dim, basis, affine, smoothed, cell_averaged, averages, e, index, batch->scale, &view);
    for (int n = 0; n < blocks; n++) {
        const int64_t at = cell->offset + n * GR_W;
        if (__builtin_expect(filled == BATCH, 0)) {
            batch->n = filled;
            run_law(e, law, batch, 0);
            filled = 0;
        }
        double *gradient = batch->gradient + filled * dim * dim * GR_W;
        const unsigned inside =
            move_block(dim, basis, affine, smoothed, cell_averaged, averages, e, cell, &view, at, gradient);
        batch->g_star[filled] = g_star;
        batch->slot[filled++] = at;
        if (__builtin_expect(inside != GR_ALL_LANES, 0)) found += list_migrants(e, index, n, inside, migrant + found);
    }
    batch->n = filled;
    return found;
}

/* Sweep the cells [first, last). Points that left their cell are packed into `out`. */
GR_INLINE void sweep_cells(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                           struct gr_engine *e, int64_t first, int64_t last, struct gr_migrants *out, int fused,
                           gr_law_update *law)
{
    enum { QUEUE = 64 };
    struct batch batch;
    const int averages = gr_averages(e, e->step);
    int64_t queued = 0, packed = 0, queue[QUEUE];
    batch.n = 0;
    out->count = 0;
    for (int q = 0; q < MODE_STRIDE(GR_NODE_FIELDS(3, 1)); q++) batch.scale[q] = q < dim ? e->dt * e->inv_dx : 1.0;
    for (int64_t index = first; index < last; index++) {
        struct gr_cell *cell = &e->mesh.cell[index];
        cell->dirty = 0;
        if (cell->count) {
            out->count += g2p_cell(dim, basis, affine, smoothed, cell_averaged, averages, e, index, &batch, law,
                                   out->from + out->count);
            queue[queued++] = index;
        }
        if (queued < QUEUE && index + 1 < last && batch.n + GR_BLOCKS(e->mesh.cell[index + 1].count) <= BATCH) continue;
        if (batch.n) run_law(e, law, &batch, 0);
        if (out->count > packed) gr_pack_migrants(e, out, packed);
        packed = out->count;
        for (int64_t k = 0; fused && k < queued; k++)
            p2g_points(dim, basis, affine > 0, smoothed, cell_averaged, e, queue[k]);
        queued = 0;
    }
}

/* L dt of the points of a cell, where they are now, from which their paths begin once the batch is full. */
GR_INLINE void strain_cell(const int dim, const int basis, const int cell_averaged, const struct gr_engine *e, int64_t index,
                           struct batch *batch, gr_law_update *law)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int stride = MODE_STRIDE(GR_NODE_FIELDS(dim, 0)), blocks = GR_BLOCKS(cell->count);
    const double g_star = fluidity_of_cell(e, gr_place_of_cell(e, cell));
    struct view view;
    look_at_cell(dim, basis, GR_AFFINE_NONE, 0, cell_averaged, 0, e, index, batch->scale, &view);
    for (int n = 0; n < blocks; n++) {
        struct gr_shape s;
        const double *place[3];
        const int64_t at = cell->offset + n * GR_W;
        vd L[9];
        if (batch->n == BATCH) run_law(e, law, batch, 1);
        double *gradient = batch->gradient + batch->n * dim * dim * GR_W;
        for (int d = 0; d < dim; d++) place[d] = e->field[GR_FIELD_x] + d * e->capacity + at;
        gr_shapes(dim, basis, &view.frame, place, 0, &s);
        for (int d = 0; d < dim; d++)
            (void)gr_interpolate(dim, basis, 0, view.mode + d, stride, &s, (const vd(*)[3])s.g, L + d * dim);
        for (int c = 0; c < dim * dim; c++) v_store(gradient + c * GR_W, cell_averaged ? view.L[c] : L[c]);
        batch->g_star[batch->n] = g_star;
        batch->slot[batch->n++] = at;
    }
}

/* Whether a fluidity is that of this cell, or of a double one of which it is the front, and there are points. */
static inline int leads(const struct gr_engine *e, const struct gr_cell *cell)
{
    int64_t points = 0;
    GR_EACH_OF_FLUIDITY(e, cell, side) points += side->count;
    return points > 0;
}

/* The shares of the points of a cell in its fluidity, by the pressures of their paths, and what the first part of the step
 * makes of it. */
GR_INLINE void weigh_substeps(struct gr_engine *e, const struct gr_cell *cell)
{
    const int64_t place = gr_place_of_cell(e, cell);
    vd mass = v_zero(), flow = mass;
    for (int pass = 0; pass < 2; pass++) {
        const double sum = v_sum(mass);
        const vd inverse = v_set(sum > 0 ? 1 / sum : 0);
        GR_EACH_OF_FLUIDITY(e, cell, side)
        for (int n = 0; n < GR_BLOCKS(side->count); n++) {
            const int64_t at = side->offset + n * GR_W;
            const vm dense = v_gt(v_load(gr_substep_at(e->substeps, at, GR_SUBSTEP_p)), v_zero());
            const vd m = v_keep(dense, component(e, GR_FIELD_mass, 0, at));
            if (!pass) {
                mass = mass + m;
                flow = v_fma(m, v_keep(dense, component(e, GR_FIELD_g, 0, at)), flow);
            } else {
                v_store(gr_substep_at(e->substeps, at, GR_SUBSTEP_weight), inverse * m);
            }
        }
        e->fluidity->dense[place] = sum > 0;
        if (pass) store_fluidity(e, place, v_sum(inverse * flow), fluidity_of_cell(e, place));
    }
}

/* The paths of the points through the substeps of a step, before they move, and the first of them. */
GR_INLINE void begin_substeps_of_cells(const int dim, const int basis, const int cell_averaged, struct gr_engine *e,
                                       int64_t first, int64_t last, gr_law_update *law)
{
    struct batch batch;
    batch.n = 0;
    for (int q = 0; q < MODE_STRIDE(GR_NODE_FIELDS(3, 1)); q++) batch.scale[q] = q < dim ? e->dt * e->inv_dx : 1.0;
    for (int64_t index = first; index < last; index++) {
        if (e->mesh.cell[index].count) strain_cell(dim, basis, cell_averaged, e, index, &batch, law);
        if (index + 1 < last && batch.n + GR_BLOCKS(e->mesh.cell[index + 1].count) <= BATCH) continue;
        if (batch.n) run_law(e, law, &batch, 1);
    }
    for (int64_t index = first; index < last; index++)
        if (leads(e, &e->mesh.cell[index])) weigh_substeps(e, &e->mesh.cell[index]);
}

/* A substep along the paths, and the fluidity of the cells anew. */
GR_INLINE void substep_cells(const int linear, struct gr_engine *e, int64_t first, int64_t last, const double *fluidity)
{
    enum { TOGETHER = GR_SUMS > 4 ? GR_SUMS : 4 };
    const vd fraction = v_set(1.0 / e->config.nonlocal.substeps);
    const struct gr_fluidity_numbers numbers = gr_fluidity_numbers_of(fluidity, e->dt / e->config.nonlocal.substeps);
    double *const rate = e->field[GR_FIELD_shear_rate], sum[TOGETHER], g_star[TOGETHER];
    int64_t place[TOGETHER];
    vd acc[TOGETHER];
    int found = 0;
    for (int k = 0; k < TOGETHER; k++) acc[k] = v_zero();
    for (int64_t index = first; index < last; index++) {
        const struct gr_cell *cell = &e->mesh.cell[index];
        if (leads(e, cell)) {
            place[found] = gr_place_of_cell(e, cell);
            g_star[found] = fluidity_of_cell(e, place[found]);
            const vd start = gr_fluidity_start(&numbers, v_set(g_star[found]));
            vd flow = v_zero();
            GR_EACH_OF_FLUIDITY(e, cell, side)
            for (int n = 0; n < GR_BLOCKS(side->count); n++) {
                const int64_t at = side->offset + n * GR_W;
                const vd g = gr_substep(linear, 0, &numbers, fraction, e->substeps, at, start, v_zero(), rate + at);
                flow = v_fma(v_load(gr_substep_at(e->substeps, at, GR_SUBSTEP_weight)), g, flow);
            }
            acc[found++] = flow;
        }
        if (found < TOGETHER && index + 1 < last) continue;
        for (int k = 0; k < TOGETHER; k += GR_SUMS) v_sums(sum + k, acc + k);
        for (int k = 0; k < found; k++) store_fluidity(e, place[k], sum[k], g_star[k]);
        found = 0;
    }
}
