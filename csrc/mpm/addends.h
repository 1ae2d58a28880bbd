/* What is added to the nodes (struct gr_addend in engine.h). */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

/* List what the runs of cells add to the nodes. Given: the mesh, but for these, and the number of nodes of its first layer.
 * Returned: 0, GR_ERR_MEMORY or GR_ERR_DEVICE. */
int gr_list_addends(struct gr_engine *e, int64_t n_front, struct gr_team *team, int64_t chunks);
