/* XPIC: the nodal part of the passes of the filter (grid.h). */
#include "mpm/grid.h"
#include "mpm/walls.h"

void gr_grid_smooth(struct gr_engine *e, int64_t first, int64_t last, int pass)
{
    const int dim = e->config.dim, K = e->K, order = e->config.xpic_order;
    double share = pass % 2 ? 1 : -1;
    for (int r = 1; r <= pass; r++) share = share * (order - r + 1) / r;
    for (int64_t n = first; n < last; n++) {
        double sum[3] = {0};
        for (int i = 0; i < K; i++) {
            const double *part = e->sums + e->mesh.node_source[n * K + i];
            for (int d = 0; d < dim; d++) sum[d] += part[GR_SUM_MOMENTUM + d];
        }
        const double m = e->node_mass[n];
        const struct gr_wall *wall = gr_wall_now(e, e->mesh.node_code[n]);
        for (int d = 0; d < dim; d++) {
            const double v = m > e->config.mass_cutoff && !(wall->fixed >> d & 1) ? sum[d] / m : 0;
            e->node_v[n * dim + d] = v;
            if (m > e->config.mass_cutoff) e->node_data[n * e->node_stride + GR_NODE_UPDATE(dim) + d] += share * v;
        }
    }
}
