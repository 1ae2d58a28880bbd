/* Ascending lists of the cells about given cells, and of their nodes, made by a team or a device. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

enum gr_spread { GR_SPREAD_CELLS, GR_SPREAD_NODES };

/* List the indices to which the given cells lead: the cells themselves and their neighbours, or their nodes.
 *
 * Given: n indices in the whole grid, ascending, each once or more often.
 * Returned: 0, GR_ERR_MEMORY or GR_ERR_DEVICE; `out`, *n_out indices, ascending, each once, to be freed by the caller. */
int gr_spread(struct gr_engine *e, enum gr_spread what, const int64_t *cells, int64_t n, struct gr_team *team,
              int64_t chunks, int64_t **out, int64_t *n_out);
