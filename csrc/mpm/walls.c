/* Walls on grid lines: boundary conditions of the nodes (walls.h). */
#include "mpm/walls.h"

#include <math.h>

int gr_face_is_closed(const struct gr_engine *e, const int32_t from[3], int d, int high)
{
    const int dim = e->config.dim, k = gr_basis_nodes_1d(e->config.basis);
    const double end = high ? e->axis[d].length / e->config.dx : 0;
    int64_t stride[3] = {1, e->axis[0].n_nodes, (int64_t)e->axis[0].n_nodes * e->axis[1].n_nodes};
    for (int n = 0; n < (dim == 2 ? k * k : k * k * k); n++) {
        const int local[3] = {n % k, n / k % k, n / (k * k)};
        int64_t id = 0;
        int on_face = 0;
        for (int j = 0; j < dim; j++) {
            const int32_t node = e->axis[j].cell[from[j]].node[local[j]];
            id += stride[j] * node;
            if (j == d) on_face = fabs(e->axis[j].node_position[node] - end) < 1e-9;
        }
        if (on_face && !(gr_wall_now(e, (uint8_t)gr_table_get(&e->node_codes, id))->fixed >> d & 1)) return 0;
    }
    return 1;
}
