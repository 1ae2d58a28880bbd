/* Nodes of the active cells. */
#pragma once

#include "core/team.h"
#include "mpm/tiles.h"

/* List the nodes of the active cells, and connect nodes and tiles: for each tile its rows of nodes and the neighbours of its
 * cells, and for each row of nodes the tiles that add to it.
 * Returned: 0, GR_ERR_MEMORY or GR_ERR_DEVICE. */
int gr_connect(struct gr_engine *e, const struct gr_tiles *tiles, struct gr_team *team, int64_t chunks);
