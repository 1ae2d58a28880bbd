/* One pass of XPIC: the nodal velocity field is interpolated to the points, and P2G sums its momentum for gr_grid_smooth. */
#include "mpm/contribution.h"

/* The same for the cells from `first` on. */
GR_INLINE void smooth_cells(const int dim, const int basis, struct gr_engine *e, int64_t first)
{
    const int K = gr_power(gr_nodes_1d(basis), dim), nodal = basis == GR_UGIMP, rows = GR_SUM_DAMPED(dim);
    gr_real *out = gr_sums(e) + gr_sums_of_cell(e, first);
    struct gr_frame frame;
    vd mode[3][GR_MAX_NODES], unused[3];
    int points = 0;
    gr_frame_of(dim, basis, 0, e, first, &frame);
    for (int l = 0; l < GR_W; l++) points = points > e->mesh.cell[first + l].count ? points : e->mesh.cell[first + l].count;
    for (int d = 0; d < dim; d++) {
        for (int i = 0; i < K; i++) {
            double v[GR_W];
            for (int l = 0; l < GR_W; l++) v[l] = e->nodes.v[(int64_t)gr_cell_node(e, first + l, i) * dim + d];
            mode[d][i] = v_load(v);
        }
        gr_modes(dim, basis, nodal, &frame, mode[d]);
    }
    for (int i = 0; i < K * rows; i++) v_store(out + i * GR_LANES, v_zero()); /* no forces */
    for (int n = 0; n < points; n++) {
        struct gr_shape s;
        struct contribution contribution;
        const int64_t at = gr_slot(&e->mesh.cell[first], n);
        gr_shapes(dim, basis, e, &frame, at, 0, &s);
        prepare_momentum(dim, basis, 0, e, &frame, at, v_ge(v_zero(), v_zero()), &contribution);
        for (int d = 0; d < dim; d++)
            contribution.v[d] = gr_interpolate(dim, basis, nodal, mode[d], &s, (const vd(*)[3])s.g, unused);
        add_rows(dim, basis, 0, MOMENTUM, &frame, &contribution, 1, rows, 0, 0, 0, out);
    }
}
