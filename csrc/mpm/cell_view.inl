/* What G2P collects: of GR_W cells of a tile, the nodal fields as their points see them; of several tiles, the points for
 * a call of the law. */
#include "mpm/density_correction.h"

enum { BATCH = GR_SIZE(256 / GR_W, 1) }; /* blocks per call: their data stay in the first-level cache */

/* Batch of blocks of points, collected from several tiles, that a law updates in one call. */
struct batch {
    int64_t n;
    int64_t slot[BATCH];
    _Alignas(64) gr_real g_star[BATCH * GR_W];
    _Alignas(64) gr_real gradient[BATCH * 9 * GR_W];
    _Alignas(64) gr_real hoop[BATCH * GR_W]; /* in an axisymmetric plane */
};

/* Call the law of material k for n blocks of a batch from block b on: for the whole step, or for the first (`begins`) or
 * last of its substeps. */
static void call_law(struct gr_engine *e, int k, const struct batch *batch, int64_t b, int64_t n, int begins)
{
    const struct gr_material *material = &e->config.material[k];
    const int many = e->nonlocal.diffuses && e->config.nonlocal.substeps > 1;
    const double fraction = many ? 1.0 / e->config.nonlocal.substeps : 1;
    struct gr_law_call call = {.n_blocks = n,
                               .slot = batch->slot + b,
                               .gradient = batch->gradient + b * e->config.dim * e->config.dim * GR_W,
                               .hoop = e->config.axisymmetric ? batch->hoop + b * GR_W : 0,
                               .dt = fraction * e->clock.dt,
                               .fraction = fraction,
                               .substeps = many ? e->nonlocal.substeps : 0,
                               .begins = begins,
                               .pressure_from_density = e->config.pressure_from_density,
                               .parameter = material->parameter,
                               .log_density = e->points.field[GR_FIELD_log_density],
                               .g_star = e->nonlocal.diffuses ? batch->g_star + b * GR_W : 0,
                               .shear_rate = e->record_rates ? e->points.field[GR_FIELD_shear_rate] : 0,
                               .g = e->points.field[GR_FIELD_g],
                               .gain = e->points.field[GR_FIELD_g_gain],
                               .plastic_strain = e->points.field[GR_FIELD_plastic_strain],
                               .separated = e->points.field[GR_FIELD_separated],
                               .bulking = e->points.field[GR_FIELD_bulking],
                               .function = material->function,
                               .own_parameter = material->own_parameter,
                               .own_calls = &e->failure.own_calls,
                               .history = material->remembers ? e->points.field[GR_FIELD_history] : 0,
                               .capacity = e->points.capacity};
    for (int c = 0; c < (e->config.dim == 2 ? 4 : 6); c++) call.stress[c] = gr_numbers(e, GR_FIELD_stress, c, 0);
    laws[material->law]->update[e->config.dim - 2](&call);
}

/* Fields of a point that laws change. */
static const enum gr_field changed_by_laws[] = {GR_FIELD_stress,  GR_FIELD_shear_rate,     GR_FIELD_g,
                                                GR_FIELD_g_gain,  GR_FIELD_plastic_strain, GR_FIELD_separated,
                                                GR_FIELD_history, GR_FIELD_bulking,        GR_FIELD_log_density};
enum { MOST_CHANGED = 17 };

/* Copy the fields that laws change of a block of points to a buffer, or from it to the lanes whose points are not of
 * material k. */
static void keep_others(const struct gr_engine *e, int64_t at, int k, gr_real *buffer, int back)
{
    for (size_t f = 0; f < sizeof changed_by_laws / sizeof *changed_by_laws; f++)
        for (int c = 0; e->points.field[changed_by_laws[f]] && c < gr_field_components(changed_by_laws[f], e->config.dim);
             c++, buffer += GR_W) {
            gr_real *values = gr_numbers(e, changed_by_laws[f], c, at);
            for (int l = 0; l < GR_W; l++) {
                if (!back)
                    buffer[l] = values[l];
                else if (gr_material_at(e, at + l) != k)
                    values[l] = buffer[l];
            }
        }
}

/* The material of all points of a block; MIXED if there are several. */
enum { MIXED = -1 };
static int material_of_block(const struct gr_engine *e, int64_t at)
{
    int material = MIXED;
    const gr_real *numbers = gr_numbers(e, GR_FIELD_material, 0, at);
    const vd all = v_load(numbers), first = v_set(numbers[0]);
    if (m_bits(m_and(v_ge(all, first), v_ge(first, all))) == GR_ALL_LANES) return gr_material_at(e, at);
    for (int l = 0; l < GR_W; l++) {
        if (e->points.id[at + l] < 0) continue; /* a spare slot */
        const int k = gr_material_at(e, at + l);
        if (material != MIXED && material != k) return MIXED;
        material = k;
    }
    return material;
}

/* Call the laws of several materials: for runs of blocks of one material, and for a mixed block one after the other, where
 * the fields of points of other materials are restored. */
static __attribute__((noinline)) void call_laws(struct gr_engine *e, const struct batch *batch, int begins)
{
    gr_real buffer[MOST_CHANGED * GR_W];
    for (int64_t b = 0, n; b < batch->n; b += n) {
        const int material = material_of_block(e, batch->slot[b]);
        n = 1;
        if (material != MIXED) {
            while (b + n < batch->n && material_of_block(e, batch->slot[b + n]) == material) n++;
            call_law(e, material, batch, b, n, begins);
            continue;
        }
        for (int k = 0; k < e->config.n_materials; k++) {
            keep_others(e, batch->slot[b], k, buffer, 0);
            call_law(e, k, batch, b, 1, begins);
            keep_others(e, batch->slot[b], k, buffer, 1);
        }
    }
}

/* Call the laws for a batch. */
static void run_law(struct gr_engine *e, struct batch *batch, int begins)
{
    if (__builtin_expect(e->config.n_materials == 1, 1))
        call_law(e, 0, batch, 0, batch->n, begins);
    else
        call_laws(e, batch, begins);
    if (e->points.field[GR_FIELD_viscous_stress] && !begins)
        damp_elastic(e, batch->n, batch->slot, batch->gradient, batch->hoop);
    batch->n = 0;
}

enum { ALONE = 2 }; /* a cell with at most this many points is nearly empty */

/* Data common to the points of GR_W cells. */
struct view {
    struct gr_frame frame;
    vx begin[3], end[3]; /* bounds of the cells, m */
    int points;          /* largest number of points of a cell */
    int damps_flutter;   /* gr_damps_flutter */
    int has_sponge;      /* bit d: the sponge layer may damp points that rise along axis d */
    vd disconnected;     /* log-density below which a point of the first material is given no affine field */
    struct fluidity_start fluidity;
    vd L[9], shift[3][2], c; /* with a cell-averaged density: L dt; shift along each axis at the low and high face, m;
                                log-density */
    vd drop[3][2];           /* in an averaging: of the excess at the low and high face along each axis */
    struct gr_wall_cells walls;
    struct damping damping;
    vd mode[GR_NODE_FIELDS(3, 1) * GR_MAX_NODES]; /* field by field */
};

/* The nodal values of fields [begin, end) times `scale` at the nodes of the cells from `first` on, of which some are not in
 * order. */
GR_INLINE void load_each_node(const int K, const struct gr_engine *e, int64_t first, int begin, int end, double scale,
                              vd *value)
{
    const int64_t tile = first / GR_LANES;
    for (int i = 0; i < K; i++) {
        const int32_t *const node = gr_lane_nodes(e, tile, i) + first % GR_LANES;
        const gr_real *field = gr_seen_field(e, begin);
        for (int q = begin; q < end; q++, field += e->nodes.capacity) {
            gr_real each[GR_W];
            if (e->mesh.tile_in_order[tile] >> i & 1) {
                value[(q - begin) * K + i] = v_set(scale) * v_load(field + *node);
                continue;
            }
            for (int l = 0; l < GR_W; l++) each[l] = field[node[l]];
            value[(q - begin) * K + i] = v_set(scale) * v_load(each);
        }
    }
}

/* The same wherever the nodes are. */
GR_INLINE void load_nodes(const int K, const struct gr_engine *e, int64_t first, int begin, int end, double scale, vd *value)
{
    const int k = K % 2 ? 3 : 2, n_rows = K / k;
    const int64_t tile = first / GR_LANES;
    if (__builtin_expect(e->mesh.tile_in_order[tile] != GR_IN_ROW, 0)) {
        load_each_node(K, e, first, begin, end, scale, value);
        return;
    }
    GR_UNROLLED
    for (int row = 0; row < n_rows; row++) {
        const int32_t node = e->mesh.row_node[(tile * n_rows + row) * GR_LANES];
        const gr_real *field = gr_seen_field(e, begin) + node + first % GR_LANES;
        for (int q = begin; q < end; q++, field += e->nodes.capacity)
            for (int a = 0; a < k; a++) value[(q - begin) * K + row * k + a] = v_set(scale) * v_load(field + a);
    }
}

/* Look at the cells from `first` on. Given: the fields of the nodes that the variant needs; `averages`, with the fields of
 * an averaging of the density. */
GR_INLINE void look_at_cells(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                             const int averages, const struct gr_engine *e, int64_t first, struct view *view)
{
    const int nodal = basis == GR_UGIMP || affine == GR_AFFINE_MOMENT, K = gr_power(gr_nodes_1d(basis), dim);
    const int damps = cell_averaged && e->config.largest.damping_rate > 0;
    const int fields = GR_NODE_FIELDS(dim, averages);
    const struct gr_cell *cell = &e->mesh.cell[first];
    double disconnected[GR_W];
    view->points = 0;
    for (int l = 0; l < GR_W; l++) {
        const int carried = !smoothed && !cell_averaged && !(cell[l].flags >= GR_CELL_WALL && cell[l].count <= ALONE);
        disconnected[l] = carried ? -NO_DENSITY : e->material_number[GR_MATERIAL_SEPARATION][0];
        if (cell[l].count > view->points) view->points = cell[l].count;
    }
    if (!view->points) return;
    if (e->nonlocal.diffuses) fluidity_starts(e, first, &view->fluidity);
    gr_frame_of(dim, basis, damps || affine == GR_AFFINE_MOMENT, e, first, &view->frame);
    view->disconnected = v_load(disconnected);
    view->damps_flutter = smoothed && gr_damps_flutter(e, e->clock.step);
    view->has_sponge = e->config.has_sponge;
    if (cell_averaged || averages) gr_wall_cells_of(dim, e, first, &view->walls);
    for (int d = 0; d < dim; d++) {
        view->begin[d] = GR_X_OF_CELLS(e, first, d, begin);
        view->end[d] = GR_X_OF_CELLS(e, first, d, end);
        if (!m_bits(x_gt(view->end[d], x_set(e->config.above[d])))) view->has_sponge &= ~(1 << d);
    }
    view->damping.any = 0;
    if (damps) {
        load_nodes(K, e, first, GR_NODE_DAMPING(dim), GR_NODE_DAMPING(dim) + 1, 1.0, view->damping.share);
        damping_of_cells(K, &view->damping);
    }
    load_nodes(K, e, first, 0, dim, e->clock.dt * e->inv_dx, view->mode); /* displacement in cells per step */
    load_nodes(K, e, first, dim, 2 * dim, 1.0, view->mode + dim * K);
    if (averages) face_drops(dim, 1, e, first, LEFT_POINTS, view->drop);
    if (averages) load_nodes(K, e, first, GR_NODE_DENSITY(dim), fields, 1.0, view->mode + GR_NODE_DENSITY(dim) * K);
    if (cell_averaged) view->c = flow_of_cells(dim, e, first, &view->walls, view->mode, view->L, view->shift);
    for (int q = 0; q < fields; q++) gr_modes(dim, basis, nodal, &view->frame, view->mode + q * K);
}
