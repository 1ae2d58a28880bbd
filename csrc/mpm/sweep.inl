/* Sweep over a run of cells: G2P, the law, and P2G of the next step in one pass, so that the points of a cell are read
 * and written once per step. */

/* P2G of one cell with the density of the scheme, and its mean fluidity. That of a double cell follows when it is known
 * whether its sides are separated (mean_pairs). */
GR_INLINE void p2g_points(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                          struct gr_engine *e, int64_t index)
{
    if (cell_averaged)
        p2g_averaged_cell(dim, affine, e, index);
    else
        p2g_cell(dim, basis, affine, smoothed, e, index);
    if (e->fluidity && !GR_IS_DOUBLE(&e->mesh.cell[index])) mean_of_cell(e, &e->mesh.cell[index]);
}

/* Sweep the cells [first, last). Points that left their cell are packed into `out`. P2G follows if `fused`. */
GR_INLINE void sweep_cells(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                           struct gr_engine *e, int64_t first, int64_t last, struct gr_migrants *out, int fused,
                           gr_law_update *law)
{
    enum { QUEUE = 64 };
    struct batch batch;
    const int averages = gr_averages(e, e->step);
    int64_t queued = 0, packed = 0, queue[QUEUE];
    batch.n = 0;
    gr_clear_migrants(out);
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
