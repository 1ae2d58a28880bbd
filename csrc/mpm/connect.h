/* Nodes of the active cells. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

/* List the nodes of the active cells, and connect nodes and cells: for each cell its nodes and its neighbours,
 * and for each node where its sums over each of its cells are, in the order of cells. `cells` are the indices of the active
 * cells in the whole grid, in their order. */
int gr_connect(struct gr_engine *e, const int64_t *cells, struct gr_team *team, int64_t chunks);

/* Volume of a node of the grid over dx^dim, without what solid cells take of it. */
double gr_node_volume(const struct gr_engine *e, int64_t id);
