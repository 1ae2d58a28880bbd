#include "mpm/smoothed_density.h"

#include "mpm/walls.h"

/* That of a node that is 0.6 full. */
#define LEAST_GAP -0.5

/* Steps in node ids to the nodes on both sides of a node along each axis, and to itself; beyond an end there is none,
 * and the step is 0. Returned: whether the node lies at an end along axis d, as bits. */
static int around(const struct gr_engine *e, int64_t id, int64_t step[3][3])
{
    int64_t rest = id, stride = 1;
    int ends = 0;
    for (int d = 0; d < e->config.dim; d++) {
        const int64_t m = e->axis[d].n_nodes, at = rest % m;
        for (int side = 0; side < 3; side++) {
            const int64_t next = at + side - 1;
            const int beyond = !e->axis[d].periodic && (next < 0 || next >= m);
            step[d][side] = beyond ? 0 : ((next + m) % m - at) * stride;
            ends |= beyond << d;
        }
        rest /= m;
        stride *= m;
    }
    return ends;
}

static double gap_of(const struct gr_engine *e, int64_t id)
{
    const int64_t n = (int64_t)gr_table_get(&e->mesh.node_of, id) - 1;
    return n < 0 ? -INFINITY : e->node_data[n * e->node_stride + GR_NODE_DENSITY(e->config.dim) + GR_NODE_OWN_GAP];
}

/* Whether the node and those next to it are full enough to lie inside the material. */
static int is_inside(const struct gr_engine *e, int64_t id, const int64_t step[3][3])
{
    int inside = gap_of(e, id) > LEAST_GAP;
    for (int d = 0; d < e->config.dim; d++)
        for (int side = 0; inside && side < 3; side += 2) inside = gap_of(e, id + step[d][side]) > LEAST_GAP;
    return inside;
}

/* The mean of the gaps about a node inside the material, 1/4, 1/2, 1/4 along each axis; one that is not full counts as
 * the node's own. That of a single node is noise of .03 to .04 with 4 points per cell, this one of .008. */
static double mean_gap(const struct gr_engine *e, int64_t id, const int64_t step[3][3])
{
    const int dim = e->config.dim;
    const double own = gap_of(e, id);
    double sum = 0;
    for (int c = 0; c < (dim == 3 ? 3 : 1); c++)
        for (int b = 0; b < 3; b++)
            for (int a = 0; a < 3; a++) {
                const double share = (a == 1 ? 0.5 : 0.25) * (b == 1 ? 0.5 : 0.25) * (dim == 2 ? 1.0 : c == 1 ? 0.5 : 0.25);
                const double gap = gap_of(e, id + step[0][a] + step[1][b] + (dim == 3 ? step[2][c] : 0));
                sum += share * (gap > LEAST_GAP ? gap : own);
            }
    return sum;
}

void gr_grid_surroundings(struct gr_engine *e, int64_t first, int64_t last)
{
    const int dim = e->config.dim;
    for (int64_t n = first; n < last; n++) {
        double *field = e->node_data + n * e->node_stride + GR_NODE_DENSITY(dim);
        const int64_t id = e->mesh.node_id[n];
        int64_t step[3][3];
        const int ends = around(e, id, step), inside = is_inside(e, id, step);
        const int held = ends | gr_wall_now(e, e->mesh.node_code[n])->fixed;
        field[GR_NODE_GAP] = inside ? mean_gap(e, id, step) : 0;
        if (inside)
            field[GR_NODE_WEIGHT] +=
                1 - exp(-field[GR_NODE_OWN_GAP]); /* the mean weight of volumes m/rho that fill the room */
        for (int d = 0; d < dim; d++)
            if (!inside || held >> d & 1) field[GR_NODE_RESIDUAL + d] = 0;
    }
}
