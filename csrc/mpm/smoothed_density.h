/* The nodal part of the smoothed density: filling fraction, gap, mean quadrature weight and residual force. */
#pragma once

#include <math.h>

#include "core/simd.h"
#include "mpm/engine.h"

/* Volumes of nodes, divided by dx^dim, below which they are round-off. */
#define GR_NO_VOLUME 1e-12

/* Gap 2 (phi - 1)/(phi + 1) - c of an empty node. */
#define GR_EMPTY_GAP -2.0

/* In place of the gap of a node that lies nearly all within a body: it counts as full, and says nothing else. */
#define GR_CLOSED_GAP 1e3

/* Compute the fields that an averaging needs, from the sums of a node with the mass m; stored in `out`. `strain` is that
 * by a wall that keeps a pressure (servo.h). */
GR_INLINE void gr_describe_density(const int dim, const double *sum, double m, double cell_mass, double volume,
                                   double strain, double *out)
{
    const double phi = volume > GR_NO_VOLUME ? m / (cell_mass * volume) : 0; /* 0 in solid cells, which points may enter */
    double *field = out + GR_NODE_DENSITY(dim);
    sum += GR_SUM_DENSITY(dim);
    const double connected = sum[GR_SUM_CONNECTED], weighted = sum[GR_SUM_WEIGHTED];
    field[GR_NODE_LOG_DENSITY] = weighted > 0 ? sum[GR_SUM_LOG_DENSITY] / weighted : 0;
    field[GR_NODE_EXCESS] = fmax(phi - 1, 0);
    field[GR_NODE_WEIGHT] = connected > 0 ? weighted / connected - 1 : 0;
    for (int d = 0; d < dim; d++) field[GR_NODE_RESIDUAL + d] = sum[GR_SUM_RESIDUAL + d] / cell_mass;
    field[GR_NODE_OWN_GAP] =
        2 * (phi - 1) / (phi + 1) - field[GR_NODE_LOG_DENSITY] - strain; /* ln phi to 4 % at phi = 1/2 */
}

/* Complete these fields with those of the adjacent nodes; call it after gr_grid_nodes for all nodes. The gap is
 * averaged over them. The mean quadrature weight is reduced by the weight that fills the volume. The residual force is
 * kept only inside the material, where a uniform pressure should make no force; elsewhere it is the force on the
 * surface, or a wall balances it. */
void gr_grid_surroundings(struct gr_engine *e, int64_t first, int64_t last);
