/* The nodal part of the smoothed density: filling fraction, gap, mean quadrature weight and residual force. */
#pragma once

#include "core/simd.h"
#include "kernels.h"
#include "mpm/engine.h"

/* Volumes of nodes, divided by dx^dim, below which they are round-off. */
#define GR_NO_VOLUME 1e-12

/* Gap 2 (phi - 1)/(phi + 1) - c of an empty node. */
#define GR_EMPTY_GAP -2.0

/* Smallest gap of a node inside the material: that at the filling fraction 0.6. */
#define GR_LEAST_GAP -0.5

/* Instead of the gap of a node that lies nearly all within a body: it counts as full, and has no other meaning. */
#define GR_CLOSED_GAP 1e3

/* Complete the fields of an averaging at groups of nodes from the adjacent nodes; call it after gr_grid_nodes for all nodes.
 * The gap is averaged over them. The mean quadrature weight is reduced by the weight that fills the volume. The residual
 * force is used only inside the material, where a uniform pressure should make no force; elsewhere it is the force on the
 * surface, or a wall balances it. */
void gr_grid_surroundings(struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int64_t last);
