/* Solid cells: their part of the volume of nodes. */
#pragma once

#include "mpm/engine.h"

/* Prepare gr_solid_volume if there are solid cells. Returned: 0 or GR_ERR_MEMORY. */
int gr_list_solid_cells(struct gr_engine *e);

/* Part of the volume of a node, in cells, that lies in solid cells; the node is given by its indices. It is worked out
 * when a node gets mass near it, so that neither time nor memory grows with a box that is mostly solid. */
double gr_solid_volume(const struct gr_engine *e, const int32_t at[3]);
