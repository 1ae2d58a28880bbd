/* The smoothed density at the nodes. */
#ifndef GR_MPM_SMOOTHED_DENSITY_H
#define GR_MPM_SMOOTHED_DENSITY_H

#include <math.h>

#include "mpm/engine.h"

/* Volumes of nodes, over dx^dim, that are round-off. */
#define GR_NO_VOLUME 1e-12

/* Gap 2 (phi - 1)/(phi + 1) - c of a node that is empty. */
#define GR_EMPTY_GAP -2.0

/* From the sums of a node with the mass m: what an averaging takes from it, to `out`. */
static inline __attribute__((always_inline)) void gr_describe_density(const int dim, const double *sum, double m,
                                                                      double cell_mass, double volume, double *out)
{
    const double phi = volume > GR_NO_VOLUME ? m / (cell_mass * volume) : 0; /* none in a solid, which points may enter */
    double *field = out + GR_NODE_DENSITY(dim);
    sum += GR_SUM_DENSITY(dim);
    const double connected = sum[GR_SUM_CONNECTED], weighted = sum[GR_SUM_WEIGHTED];
    field[GR_NODE_LOG_DENSITY] = weighted > 0 ? sum[GR_SUM_LOG_DENSITY] / weighted : 0;
    field[GR_NODE_EXCESS] = fmax(phi - 1, 0);
    field[GR_NODE_WEIGHT] = connected > 0 ? weighted / connected - 1 : 0;
    for (int d = 0; d < dim; d++) field[GR_NODE_RESIDUAL + d] = sum[GR_SUM_RESIDUAL + d] / cell_mass;
    field[GR_NODE_OWN_GAP] = 2 * (phi - 1) / (phi + 1) - field[GR_NODE_LOG_DENSITY]; /* of ln phi to 4 % where half full */
}

/* After gr_grid_nodes for all nodes, what needs those next to a node: the gap to the fullness, averaged over them; the mean
 * weight of the points less the one that would fill the room; and the residual_force is left only where a uniform pressure
 * should make no force, inside the material: elsewhere it is the force on the surface, or a wall bears it. */
void gr_grid_surroundings(struct gr_engine *e, int64_t first, int64_t last);

#endif
