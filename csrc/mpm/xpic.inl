/* One pass of XPIC for one cell: the nodal velocity field is interpolated to the points, and P2G sums its momentum for
 * gr_grid_smooth. */
#include "mpm/contribution.h"

GR_INLINE void smooth_cell(const int dim, const int basis, struct gr_engine *e, int64_t index)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int K = gr_power(gr_nodes_1d(basis), dim), blocks = GR_BLOCKS(cell->count), nodal = basis == GR_UGIMP;
    const int rows = GR_SUM_DAMPED(dim);
    struct gr_frame frame;
    gr_frame_of(dim, e, cell, &frame);
    double mode[GR_LANES * GR_MAX_NODES], *out = e->sums + index * e->sum_stride;
    vd acc[GR_SUM_DAMPED(3) * GR_MAX_NODES + GR_SUMS], unused[3];
    for (int i = 0; i < K; i++)
        for (int d = 0; d < dim; d++)
            mode[i * GR_LANES + d] = e->node_v[(int64_t)e->mesh.cell_node[index * K + i] * dim + d];
    gr_modes(dim, basis, nodal, dim, GR_LANES, &frame, mode);
    for (int i = 0; i < K * rows; i++) acc[i] = v_zero(); /* no forces */
    for (int n = 0; n < blocks; n++) {
        struct gr_shape s;
        struct contribution contribution;
        const int64_t at = cell->offset + n * GR_W;
        gr_shapes(dim, basis, e, &frame, at, 0, &s);
        prepare_momentum(dim, basis, 0, e, &frame, at, &contribution);
        for (int d = 0; d < dim; d++)
            contribution.v[d] = gr_interpolate(dim, basis, nodal, mode + d, GR_LANES, &s, (const vd(*)[3])s.g, unused);
        add_rows(dim, basis, 0, 0, MOMENTUM, &contribution, 1, rows, 0, acc);
        store_sums(out, acc, K * rows, n);
    }
}
