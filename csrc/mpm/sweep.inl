/* Sweep over a run of tiles: G2P, the law, and P2G of the next step in one pass, so that the points of a tile are read
 * and written once per step. */

/* P2G of a tile with the density of the scheme, for all points or for those that arrived (`more`), and the mean fluidity of
 * its cells. That of a double cell follows when it is known whether its sides are separated (mean_pairs). */
GR_INLINE void p2g_tile(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                        struct gr_engine *e, int64_t tile, int more)
{
    for (int part = 0; part < GR_VECTORS; part++) {
        const int64_t first = tile * GR_LANES + part * GR_W;
        if (cell_averaged)
            p2g_averaged_cells(dim, affine, e, first, more);
        else
            p2g_cells(dim, basis, affine, smoothed, e, first, more);
        if (e->fluidity) means_of_cells(e, first);
    }
}

static inline int64_t points_of_tile(const struct gr_engine *e, int64_t tile)
{
    int64_t points = 0;
    for (int l = 0; l < GR_LANES; l++) points += e->mesh.cell[tile * GR_LANES + l].count;
    return points;
}

/* Sweep the tiles [first, last). Points that left their cell are packed into `out`. P2G follows if `fused`. */
GR_INLINE void sweep_tiles(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                           struct gr_engine *e, int64_t first, int64_t last, struct gr_migrants *out, int fused,
                           gr_law_update *law)
{
    enum { QUEUE = 8 };
    struct batch batch;
    const int averages = smoothed && gr_averages(e, e->step);
    int64_t queued = 0, packed = 0, queue[QUEUE];
    batch.n = 0;
    gr_clear_migrants(out);
    for (int64_t tile = first; tile < last; tile++) {
        e->mesh.tile_state[tile] = GR_TILE_SUMMED;
        if (points_of_tile(e, tile)) {
            struct gr_migrant *migrant = out->from + out->count;
            out->count +=
                averages ? g2p_tile(dim, basis, affine, smoothed, cell_averaged, smoothed, e, tile, &batch, law, migrant)
                         : g2p_tile(dim, basis, affine, smoothed, cell_averaged, 0, e, tile, &batch, law, migrant);
            queue[queued++] = tile;
        }
        if (queued < QUEUE && tile + 1 < last && batch.n < BATCH) continue;
        if (batch.n) run_law(e, law, &batch, 0);
        if (out->count > packed) gr_pack_migrants(e, out, packed);
        packed = out->count;
        for (int64_t k = 0; fused && k < queued; k++)
            p2g_tile(dim, basis, affine > 0, smoothed, cell_averaged, e, queue[k], 0);
        queued = 0;
    }
}
