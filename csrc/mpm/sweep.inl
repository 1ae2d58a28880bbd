/* Sweep over a run of tiles: G2P, the law, and P2G of the next step in one pass, so that the points of a tile are read
 * and written once per step. */

/* P2G of a tile with the density of the scheme, and the mean fluidity of its cells. The mean of a double cell follows when it
 * is known whether its sides are separated (mean_pairs). */
GR_INLINE void p2g_tile(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                        struct gr_engine *e, int64_t tile, const struct gr_parts parts)
{
    if (cell_averaged)
        p2g_averaged(dim, affine, e, tile, parts);
    else
        p2g_points(dim, basis, affine, smoothed, e, tile, parts);
    if (!e->nonlocal.fluidity) return;
    GR_EACH_PART (part, parts) means_of_cells(e, tile * GR_LANES + part * GR_W);
}

/* Number of points of a tile that are not asleep. */
static inline int64_t awake_points(const struct gr_engine *e, int64_t tile, unsigned asleep)
{
    int64_t points = 0;
    for (int l = 0; l < GR_LANES; l++)
        if (!(asleep >> l & 1u)) points += e->mesh.cell[tile * GR_LANES + l].count;
    return points;
}

/* Wake the cells from `first` on of which a node moves too fast. */
GR_INLINE void wake_cells(const int dim, const int basis, struct gr_engine *e, int64_t first)
{
    const int K = gr_power(gr_nodes_1d(basis), dim);
    const vd most = v_set(e->config.scheme.sleep_speed * e->config.scheme.sleep_speed);
    vd v[3 * GR_MAX_NODES], fastest = v_zero();
    load_nodes(K, e, first, GR_NODE_VELOCITY, GR_NODE_VELOCITY + dim, 1.0, v);
    for (int i = 0; i < K; i++) {
        vd square = v_zero();
        for (int d = 0; d < dim; d++) square = v_fma(v[d * K + i], v[d * K + i], square);
        fastest = v_max(square, fastest);
    }
    const unsigned pushed = m_bits(v_gt(fastest, most));
    for (int l = 0; pushed && l < GR_W; l++)
        if (pushed >> l & 1u) gr_wake(e, &e->mesh.cell[first + l]);
}

/* The lanes of a tile that are asleep, after those have woken of which a node moves too fast. */
GR_INLINE unsigned wake_lanes(const int dim, const int basis, struct gr_engine *e, int64_t tile)
{
    if (!gr_lanes_asleep(e, tile)) return 0;
    for (int part = 0; part < GR_VECTORS; part++) wake_cells(dim, basis, e, tile * GR_LANES + part * GR_W);
    return gr_lanes_asleep(e, tile);
}

/* Copy the points of a tile to a buffer, or restore the lanes `asleep` from it. */
static void keep_points(struct gr_engine *e, int64_t tile, unsigned asleep, double *buffer, int back)
{
    const struct gr_cell *cell = &e->mesh.cell[tile * GR_LANES];
    for (int k = 0; k < e->points.n_components; k++)
        for (int32_t row = 0; row < cell->capacity; row++, buffer += GR_LANES) {
            const int64_t place = gr_slot(cell, row);
            for (int l = 0; l < GR_LANES; l++) {
                if (!back)
                    buffer[l] = gr_component(e, k, place + l);
                else if (asleep >> l & 1u)
                    gr_set_component(e, k, place + l, buffer[l]);
            }
        }
}

/* Remove the points of cells that are asleep from a list of those that left.
 * Returned: the length of the list. */
static int64_t drop_asleep(const struct gr_engine *e, struct gr_migrant *migrant, int64_t n)
{
    int64_t n_awake = 0;
    for (int64_t k = 0; k < n; k++)
        if (e->mesh.cell[migrant[k].cell].calm != GR_ASLEEP) migrant[n_awake++] = migrant[k];
    return n_awake;
}

enum { MOVED = 8 };

/* Sort the points that left a tile by cell and slot. They are listed row by row: in that order it would matter to the cells
 * that they enter which cells are a tile, so that the bits would depend on when the points were grouped. */
static void sort_by_cell(struct gr_migrant *migrant, int64_t n)
{
    for (int64_t k = 1; k < n; k++) {
        const struct gr_migrant next = migrant[k];
        int64_t at = k;
        for (; at && migrant[at - 1].cell > next.cell; at--) migrant[at] = migrant[at - 1];
        migrant[at] = next;
    }
}

/* Tiles of which the points have moved, until the law is called for all of them and their sums follow. */
struct moved {
    int64_t n, packed, tile[MOVED];
    struct batch batch;
};

/* Add the plastic shear strain of the step to that of the points of a tile. */
GR_INLINE void add_shear_strain(struct gr_engine *e, int64_t tile, const struct gr_parts parts)
{
    const struct gr_cell *cell = &e->mesh.cell[tile * GR_LANES];
    const vd dt = v_set(e->clock.dt);
    for (int32_t row = 0; row < cell->capacity; row++)
        GR_EACH_PART (part, parts) {
            const int64_t at = gr_slot(cell, row) + part * GR_W;
            gr_real *const strain = gr_numbers(e, GR_FIELD_shear_strain, 0, at);
            v_store(strain, v_load(strain) + dt * component(e, GR_FIELD_shear_rate, 0, at));
        }
}

/* Call the law for the tiles that have moved, pack the points that left them and sum over the others. */
GR_INLINE void end_tiles(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                         struct gr_engine *e, struct moved *moved, struct gr_migrants *out, int fused)
{
    if (moved->batch.n) run_law(e, &moved->batch, 0);
    for (int64_t k = 0; e->points.field[GR_FIELD_shear_strain] && k < moved->n; k++)
        add_shear_strain(e, moved->tile[k], GR_ALL_PARTS);
    if (out->count > moved->packed) gr_pack_migrants(e, out, moved->packed);
    moved->packed = out->count;
    for (int64_t k = 0; fused && k < moved->n; k++)
        p2g_tile(dim, basis, affine > 0, smoothed, cell_averaged, e, moved->tile[k], GR_ALL_PARTS);
    moved->n = 0;
}

/* Sweep the tiles [first, last). Points that left their cell are packed into `out`. P2G follows if `fused`. A tile of which
 * all cells are asleep is left alone; one with some is computed, and these get their points back. */
GR_INLINE void sweep_tiles(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                           struct gr_engine *e, int64_t first, int64_t last, struct gr_migrants *out, int fused)
{
    struct moved moved;
    const int averages = smoothed && gr_averages(e, e->clock.step);
    moved.n = moved.packed = moved.batch.n = 0;
    gr_clear_migrants(out);
    for (int64_t tile = first; tile < last; tile++) {
        e->mesh.tile_changed[tile] = 0;
        if (gr_tile_rests(e, tile)) continue;
        const unsigned asleep = e->sleep && e->sleep->asleep ? wake_lanes(dim, basis, e, tile) : 0;
        if (!awake_points(e, tile, asleep)) continue;
        if (asleep) { /* alone, so that the rest of the records is free for a copy of its points */
            end_tiles(dim, basis, affine, smoothed, cell_averaged, e, &moved, out, fused);
            keep_points(e, tile, asleep, out->record + out->count * e->points.n_components, 0);
        }
        struct gr_migrant *migrant = out->from + out->count;
        int64_t left = averages ? g2p_tile(dim, basis, affine, smoothed, cell_averaged, smoothed, e, tile, GR_ALL_PARTS,
                                           &moved.batch, migrant)
                                : g2p_tile(dim, basis, affine, smoothed, cell_averaged, 0, e, tile, GR_ALL_PARTS,
                                           &moved.batch, migrant);
        if (asleep) {
            if (moved.batch.n) run_law(e, &moved.batch, 0);
            keep_points(e, tile, asleep, out->record + out->count * e->points.n_components, 1);
            left = drop_asleep(e, migrant, left);
        }
        sort_by_cell(migrant, left);
        out->count += left;
        moved.tile[moved.n++] = tile;
        if (asleep || moved.n == MOVED || moved.batch.n == BATCH)
            end_tiles(dim, basis, affine, smoothed, cell_averaged, e, &moved, out, fused);
    }
    end_tiles(dim, basis, affine, smoothed, cell_averaged, e, &moved, out, fused);
}
