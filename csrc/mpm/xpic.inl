/* One pass of XPIC: the nodal velocity field is interpolated to the points, and P2G sums its momentum for gr_grid_smooth. */
#include "mpm/contribution.h"

/* The same for GR_W cells of a tile. */
GR_INLINE void smooth_cells(const int dim, const int basis, struct gr_engine *e, int64_t tile, int part, struct pass *pass)
{
    const int K = gr_power(gr_nodes_1d(basis), dim), nodal = basis == GR_UGIMP;
    const int64_t first = tile * GR_LANES + part * GR_W;
    const int most = most_points(e, first, GR_W);
    struct gr_frame frame;
    struct contribution contribution[MOST_PREPARED];
    struct stretch stretch = {0};
    vd mode[3][GR_MAX_NODES], unused[3];
    gr_frame_of(dim, basis, 0, e, first, &frame);
    for (int d = 0; d < dim; d++) {
        for (int i = 0; i < K; i++) {
            double v[GR_W];
            for (int l = 0; l < GR_W; l++) v[l] = e->nodes.v[(int64_t)gr_cell_node(e, first + l, i) * dim + d];
            mode[d][i] = v_load(v);
        }
        gr_modes(dim, basis, nodal, &frame, mode[d]);
    }
    for (int done = 0; !stretch.ends; done += stretch.n) {
        stretch = next_stretch(part, done, most);
        for (int i = 0; i < stretch.n; i++) {
            struct gr_shape s;
            const int64_t at = gr_slot(&e->mesh.cell[first], done + i);
            gr_shapes(dim, basis, e, &frame, at, 0, &s);
            prepare_momentum(dim, basis, 0, e, &frame, at, &contribution[i]);
            for (int d = 0; d < dim; d++)
                contribution[i].v[d] = gr_interpolate(dim, basis, nodal, mode[d], &s, (const vd(*)[3])s.g, unused);
        }
        add_rows(dim, basis, 0, MOMENTUM, &frame, contribution, stretch, 0, pass);
    }
}

GR_INLINE void smooth_tile(const int dim, const int basis, struct gr_engine *e, int64_t tile, const struct gr_parts parts)
{
    const int k = gr_nodes_1d(basis), n_rows = gr_power(k, dim) / k;
    struct pass pass;
    begin_pass(e, GR_SUMS_OF_MOTION, tile, 0, &pass);
    GR_EACH_PART (part, parts) smooth_cells(dim, basis, e, tile, part, &pass);
    store_ends(k, n_rows, &pass, 0, GR_SUM_FORCE(dim)); /* the forces are not summed */
}
