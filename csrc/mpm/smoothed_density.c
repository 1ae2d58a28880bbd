/* The nodal part of the smoothed density: gap, mean quadrature weight and residual force, from adjacent nodes. */
#include "mpm/smoothed_density.h"

#include "mpm/open_volume.h"
#include "mpm/sleep.h"
#include "mpm/walls.h"

/* Smallest gap of a node inside the material: that at the filling fraction 0.6. */
#define LEAST_GAP -0.5

/* Smallest open volume of a node near a body, over dx^dim, whose residual force is balanced. */
#define LEAST_BALANCED 0.02

/* Share of the residual force that a node on an inner wall line takes part with along the normal of that line. The
 * functions are only C0 there, and their slopes large: the largest eigenvalue of the descent on the sum of E^2 is 3.6 in
 * place of 1.5, so that with a weight_correction above 0.55 the weights would grow. With this share it is 1.8, and 1.9
 * where two lines are close (tests/verification/test_layers_at_rest.py). */
#define LINE_SHARE 0.25

/* Differences in node index to the adjacent nodes on both sides along each axis, and to the node itself. Beyond an end
 * there is no node, and the difference is 0.
 * Returned: bit d is set if the node lies at an end along axis d; and, in `lines`, if it lies on a grid line there, as
 * nodes of splines do on inner walls. */
static int around(const struct gr_engine *e, int64_t id, int64_t step[3][3], int *lines)
{
    int64_t rest = id, stride = 1;
    int ends = 0;
    *lines = 0;
    for (int d = 0; d < e->config.dim; d++) {
        const int64_t m = e->axis[d].n_nodes, at = rest % m;
        *lines |= (e->axis[d].node_position[at] == floor(e->axis[d].node_position[at])) << d;
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

/* A field of the nodes that belongs to an averaging of the density. */
static double *density_field(const struct gr_engine *e, int field)
{
    return gr_node_field(e, GR_NODE_DENSITY(e->config.dim) + field);
}

/* Gap of the node with this index in the whole grid; -INFINITY if it is not active. */
static double gap_of(const struct gr_engine *e, int64_t id)
{
    const int64_t n = (int64_t)gr_table_get(&e->mesh.node_of, id) - 1;
    return n < 0 ? -INFINITY : density_field(e, GR_NODE_OWN_GAP)[n];
}

static double volume_of(const struct gr_engine *e, int64_t id)
{
    const int64_t n = (int64_t)gr_table_get(&e->mesh.node_of, id) - 1;
    return n < 0 ? 0 : e->mesh.node_volume[n];
}

/* True if the node and its face neighbours are full enough to lie inside the material. */
static int is_inside(const struct gr_engine *e, int64_t id, const int64_t step[3][3])
{
    int inside = gap_of(e, id) > LEAST_GAP;
    for (int d = 0; d < e->config.dim; d++)
        for (int side = 0; inside && side < 3; side += 2) inside = gap_of(e, id + step[d][side]) > LEAST_GAP;
    return inside;
}

/* Mean gap about a node inside the material, with the weights 1/4, 1/2, 1/4 along each axis. A node that is not full
 * counts with the gap of the node itself. The gap of a single node has a noise of 0.03 to 0.04 with 4 points per cell,
 * this mean one of 0.008. */
static double mean_gap(const struct gr_engine *e, int64_t id, const int64_t step[3][3])
{
    const int dim = e->config.dim;
    const double own = gap_of(e, id);
    double sum = 0, weights = 0;
    for (int c = 0; c < (dim == 3 ? 3 : 1); c++)
        for (int b = 0; b < 3; b++)
            for (int a = 0; a < 3; a++) {
                const double share = (a == 1 ? 0.5 : 0.25) * (b == 1 ? 0.5 : 0.25) * (dim == 2 ? 1.0 : c == 1 ? 0.5 : 0.25);
                const double gap = gap_of(e, id + step[0][a] + step[1][b] + (dim == 3 ? step[2][c] : 0));
                const double weight =
                    e->open ? share * volume_of(e, id + step[0][a] + step[1][b] + (dim == 3 ? step[2][c] : 0)) : share;
                sum += weight * (gap > LEAST_GAP && gap < GR_CLOSED_GAP ? gap : own), weights += weight;
            }
    return e->open ? sum / weights : sum;
}

/* Over-compression at a node in a body: the mean of that of the nodes about it that are open, so that it has no slope
 * across the surface and points do not shift into the body. */
static double excess_about(const struct gr_engine *e, int64_t id, const int64_t step[3][3])
{
    const int dim = e->config.dim;
    double sum = 0, count = 0;
    for (int c = 0; c < (dim == 3 ? 3 : 1); c++)
        for (int b = 0; b < 3; b++)
            for (int a = 0; a < 3; a++) {
                const int64_t at = id + step[0][a] + step[1][b] + (dim == 3 ? step[2][c] : 0);
                const int64_t n = (int64_t)gr_table_get(&e->mesh.node_of, at) - 1;
                const double gap = n < 0 ? -INFINITY : density_field(e, GR_NODE_OWN_GAP)[n];
                if (!(gap > LEAST_GAP && gap < GR_CLOSED_GAP)) continue;
                sum += density_field(e, GR_NODE_EXCESS)[n], count++;
            }
    return count > 0 ? sum / count : 0;
}

void gr_grid_surroundings(struct gr_engine *e, int64_t first, int64_t last)
{
    const int dim = e->config.dim;
    for (int64_t n = first; n < last; n++) {
        if (gr_group_rests(e, n - n % GR_LANES)) {
            n += GR_LANES - 1 - n % GR_LANES;
            continue;
        }
        const int64_t id = e->mesh.node_id[n];
        int64_t step[3][3];
        int lines;
        const int ends = around(e, id, step, &lines), inside = is_inside(e, id, step);
        const int held = ends | gr_wall_now(e, e->mesh.node_code[n])->fixed;
        const int64_t cut = gr_open_place(e->open, id);
        const int closed = !(density_field(e, GR_NODE_OWN_GAP)[n] < GR_CLOSED_GAP);
        if (closed && e->open) density_field(e, GR_NODE_EXCESS)[n] = excess_about(e, id, step);
        density_field(e, GR_NODE_GAP)[n] = inside && !closed ? mean_gap(e, id, step) : 0;
        if (inside && !closed) /* subtract the mean weight with which volumes m/rho fill the volume of the node */
            density_field(e, GR_NODE_WEIGHT)[n] += 1 - exp(-(density_field(e, GR_NODE_OWN_GAP)[n] + e->servo_strain));
        const int kept = inside && (cut < 0 || e->mesh.node_volume[n] > LEAST_BALANCED);
        for (int d = 0; d < dim; d++) {
            if (cut >= 0) density_field(e, GR_NODE_RESIDUAL + d)[n] += e->open->slope[cut * dim + d];
            if (!kept || held >> d & 1) density_field(e, GR_NODE_RESIDUAL + d)[n] = 0;
            if (lines >> d & 1) density_field(e, GR_NODE_RESIDUAL + d)[n] *= LINE_SHARE;
        }
    }
}
