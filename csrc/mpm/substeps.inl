/* Substeps of the nonlocal law: between one diffusion of the fluidity and the next, for the points of all cells. */
#include "law/substep.h"
#include "mpm/migrate.h"

/* L dt of the points of a tile, or of parts of it, at their present positions. Whenever the batch is full, the first substep
 * of its points is made. */
GR_INLINE void strain_tile(const int dim, const int basis, const int cell_averaged, struct gr_engine *e, int64_t tile,
                           const struct gr_parts parts, struct batch *batch)
{
    const int K = gr_power(gr_nodes_1d(basis), dim);
    GR_EACH_PART (part, parts) {
        const int64_t first = tile * GR_LANES + part * GR_W;
        struct view view;
        look_at_cells(dim, basis, GR_AFFINE_NONE, 0, cell_averaged, 0, e, first, &view);
        for (int row = 0; row < view.points; row++) {
            struct gr_shape s;
            const int64_t at = gr_slot(&e->mesh.cell[first], row);
            vd L[9], move[3];
            if (batch->n == BATCH) run_law(e, batch, 1);
            gr_real *gradient = batch->gradient + batch->n * dim * dim * GR_W;
            gr_shapes(dim, basis, e, &view.frame, at, 0, &s);
            for (int d = 0; d < dim; d++)
                move[d] = gr_interpolate(dim, basis, 0, view.mode + d * K, &s, (const vd(*)[3])s.g, L + d * dim);
            if (dim == 2 && e->config.axisymmetric)
                v_store(batch->hoop + batch->n * GR_W, cell_averaged ? view.L[4] : v_mul(move[0], gr_inverse_radius(e, at)));
            for (int c = 0; c < dim * dim; c++) v_store(gradient + c * GR_W, cell_averaged ? view.L[c] : L[c]);
            v_store(batch->g_star + batch->n * GR_W, start_of_points(e, &view.fluidity, has_pressure(e, at), at));
            batch->slot[batch->n++] = at;
        }
    }
}

/* Masses with pressure of the cells from `first` on, and sums of m g and m gain in them. */
GR_INLINE void weigh_cells(struct gr_engine *e, int64_t first)
{
    vd m_sum = v_zero(), mg_sum = v_zero(), gain_sum = v_zero();
    int points = 0;
    for (int l = 0; l < GR_W; l++) points = points > e->mesh.cell[first + l].count ? points : e->mesh.cell[first + l].count;
    for (int n = 0; n < points; n++) {
        const int64_t at = gr_slot(&e->mesh.cell[first], n);
        const vm dense = v_gt(v_load(gr_substep_at(e->nonlocal.substeps, at, GR_SUBSTEP_p)), v_zero());
        const vd m = v_keep(dense, component(e, GR_FIELD_mass, 0, at));
        v_store(gr_substep_at(e->nonlocal.substeps, at, GR_SUBSTEP_weight), m);
        m_sum = m_sum + m;
        mg_sum = v_fma(m, v_keep(dense, component(e, GR_FIELD_g, 0, at)), mg_sum);
        if (gr_is_balanced(e)) gain_sum = v_fma(m, v_keep(dense, component(e, GR_FIELD_g_gain, 0, at)), gain_sum);
    }
    v_store(e->nonlocal.substep_mass + first, m_sum);
    v_store(e->nonlocal.substep_flow + first, mg_sum);
    v_store(e->nonlocal.substep_gain + first, gain_sum);
}

/* A substep of the cells that share one fluidity: the sums over its sides, and the start of the next substep. */
GR_INLINE void store_substep(struct gr_engine *e, int64_t index)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    double m = 0, g = 0, gain = 0;
    if (!represents_fluidity(e, cell)) return;
    GR_EACH_OF_FLUIDITY(e, cell, side)
    {
        const int64_t k = side - e->mesh.cell;
        m += e->nonlocal.substep_mass[k], g += e->nonlocal.substep_flow[k], gain += e->nonlocal.substep_gain[k];
    }
    store_mean(e, gr_place_of_cell(e, cell), m, g, gain);
}

/* The same for the cells of a tile, or of parts of it; that of double cells follows when both sides are known (store_pairs). */
GR_INLINE void store_substeps(struct gr_engine *e, int64_t tile, const struct gr_parts parts)
{
    for (int64_t c = tile * GR_LANES + parts.first * GR_W; c < tile * GR_LANES + parts.last * GR_W; c++)
        if (c < e->mesh.n_cells && !GR_IS_DOUBLE(&e->mesh.cell[c])) store_substep(e, c);
}

/* The fluidity after a substep of the points of a tile, or of parts of it, in which the law was called for them. */
GR_INLINE void end_first_substep(struct gr_engine *e, int64_t tile, const struct gr_parts parts)
{
    GR_EACH_PART (part, parts) weigh_cells(e, tile * GR_LANES + part * GR_W);
    store_substeps(e, tile, parts);
}

/* The first of many substeps, before the points move: for tiles [first, last), the state of their points and the
 * fluidity. */
GR_INLINE void begin_substeps_of_tiles(const int dim, const int basis, const int cell_averaged, struct gr_engine *e,
                                       int64_t first, int64_t last, const struct gr_parts parts)
{
    struct batch batch;
    batch.n = 0;
    for (int64_t tile = first; tile < last; tile++) strain_tile(dim, basis, cell_averaged, e, tile, parts, &batch);
    if (batch.n) run_law(e, &batch, 1);
    for (int64_t tile = first; tile < last; tile++) end_first_substep(e, tile, parts);
}

/* One substep of the points of the cells from `first` on. */
GR_INLINE void substep_cells(const int linear, struct gr_engine *e, int64_t first, const struct gr_fluidity_numbers *numbers)
{
    const vd fraction = v_set(1.0 / e->config.nonlocal.substeps);
    struct fluidity_start starts;
    int points = 0;
    for (int l = 0; l < GR_W; l++) points = points > e->mesh.cell[first + l].count ? points : e->mesh.cell[first + l].count;
    fluidity_starts(e, first, &starts);
    vd flow = v_zero(), gain = v_zero();
    for (int n = 0; n < points; n++) {
        const int64_t at = gr_slot(&e->mesh.cell[first], n);
        const vd weight = v_load(gr_substep_at(e->nonlocal.substeps, at, GR_SUBSTEP_weight));
        const vm dense = v_gt(weight, v_zero());
        const vd start = start_of_points(e, &starts, dense, at);
        const vd g = gr_substep(linear, 0, numbers, fraction, e->nonlocal.substeps, at, gr_fluidity_start(numbers, start),
                                v_zero(), gr_numbers(e, GR_FIELD_shear_rate, 0, at));
        v_store(gr_numbers(e, GR_FIELD_g, 0, at), g);
        flow = v_fma(weight, v_keep(dense, g), flow);
        gain = v_fma(weight, v_keep(dense, g - start), gain);
    }
    v_store(e->nonlocal.substep_flow + first, flow);
    v_store(e->nonlocal.substep_gain + first, gain);
}

/* One substep of the points, and the new fluidity, of the tiles [first, last). */
GR_INLINE void substep_tiles(const int linear, struct gr_engine *e, int64_t first, int64_t last, const double *fluidity,
                             const struct gr_parts parts)
{
    const struct gr_fluidity_numbers numbers = gr_fluidity_numbers_of(fluidity, e->clock.dt / e->config.nonlocal.substeps);
    for (int64_t tile = first; tile < last; tile++) {
        GR_EACH_PART (part, parts) substep_cells(linear, e, tile * GR_LANES + part * GR_W, &numbers);
        store_substeps(e, tile, parts);
    }
}
