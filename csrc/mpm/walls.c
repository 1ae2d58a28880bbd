/* Walls on grid lines: boundary conditions of the nodes (walls.h). */
#include "mpm/walls.h"

#include <math.h>

/* Apply a wall to the velocity `next` that a node would have. The impulse on a fixed component does not enter the
 * increment that points receive: v is set to zero together with `next`, so that the wall neither pushes nor drags them.
 * Coulomb friction is a force and does enter it. */
void gr_apply_wall(const struct gr_wall *wall, int dim, double *v, double *next)
{
    double friction = 0;
    if (wall->normal >= 0) {
        const double into = next[wall->normal] * -wall->side; /* normal velocity that the wall removes */
        const double taken = wall->side ? into : fabs(next[wall->normal]);
        double sliding = 0;
        for (int d = 0; d < dim; d++)
            if (d != wall->normal) sliding += next[d] * next[d];
        sliding = sqrt(sliding);
        if (taken > 0 && sliding > 0) friction = fmin(1.0, wall->friction * taken / sliding);
    }
    for (int d = 0; d < dim; d++) {
        if (wall->fixed >> d & 1)
            v[d] = next[d] = 0;
        else if (wall->normal >= 0)
            next[d] -= friction * next[d];
    }
}

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
