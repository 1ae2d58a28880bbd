/* Solid cells: their part of the volume of nodes. */
#pragma once

#include "mpm/engine.h"

/* Find whether there are solid cells. */
void gr_find_solid_cells(struct gr_engine *e);

/* Part of the volume of a node, in cells, that lies in solid cells; the node is given by its indices. It is worked out
 * when a node gets mass near it, so that neither time nor memory grows with a box that is mostly solid. */
double gr_solid_volume(const struct gr_engine *e, const int32_t at[3]);

/* Volume of a node of the grid over dx^dim, without what solid cells take of it. */
double gr_node_volume(const struct gr_engine *e, int64_t id);
