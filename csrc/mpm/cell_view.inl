/* What G2P collects: of a cell, its nodal fields as its points see them; of several, the points for a call of the law. */
#include "mpm/shape.h"

#define MODE_STRIDE(fields) (((fields) + GR_W - 1) / GR_W * GR_W) /* rounded up to whole vectors */

enum { BATCH = 256 / GR_W }; /* blocks per call: their data stay in the first-level cache */

/* Batch of blocks of points, collected from several cells, that a law updates in one call. */
struct batch {
    int64_t n;
    int64_t slot[BATCH];
    double g_star[BATCH];
    double scale[MODE_STRIDE(GR_NODE_FIELDS(3, 1))]; /* of the nodal fields: converts velocity to displacement in cells
                                                        per step */
    _Alignas(64) double gradient[BATCH * 9 * GR_W];
};

/* Call the law for a batch: for the whole step, or for the first (`begins`) or last of its substeps. */
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

enum { ALONE = 2 }; /* a cell with at most this many points is nearly empty */

/* Data common to the points of a cell. */
struct view {
    struct gr_frame frame;
    vd begin[3], end[3];     /* bounds of the cell, m */
    int has_sponge;          /* bit d: the sponge layer may damp points that rise along axis d */
    vd disconnected;         /* log-density below which a point is given no affine field */
    vd L[9], shift[3][2], c; /* with a cell-averaged density: L dt; shift along each axis at the low and high face, m;
                                log-density */
    struct damping damping;
    double mode[MODE_STRIDE(GR_NODE_FIELDS(3, 1)) * GR_MAX_NODES];
};

/* Modes of the nodal fields of a cell: displacement in cells per step, w, and what an averaging of the density needs. */
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

GR_INLINE void look_at_cell(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                            int averages, const struct gr_engine *e, int64_t index, const double *scale, struct view *view)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int fields = MODE_STRIDE(GR_NODE_FIELDS(dim, smoothed)), nodal = basis == GR_UGIMP || affine == GR_AFFINE_MOMENT;
    const int carried = !smoothed && !cell_averaged && !(cell->flags >= GR_CELL_WALL && cell->count <= ALONE);
    gr_frame_of(dim, e, cell, &view->frame);
    view->disconnected = v_set(carried ? -NO_DENSITY : -e->config.density.separation_strain);
    view->has_sponge = e->config.has_sponge;
    view->damping.of = NO_NODES;
    if ((smoothed || cell_averaged) && e->config.damping_rate > 0) damping_of_cell(dim, basis, e, index, &view->damping);
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
