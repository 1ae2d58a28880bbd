/* Filling of a table of the engine (core/table.h) by a team or a device. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

/* Set the entries index[k] to number[k] + 1, or to k + 1 if `number` is NULL; of equal ones to the first; and all others to
 * 0. The indices ascend.
 * Returned: 0; GR_ERR_MEMORY, and all entries are 0; or GR_ERR_DEVICE. */
int gr_fill_table(struct gr_engine *e, struct gr_table *t, const int64_t *index, const int32_t *number, int64_t n,
                  struct gr_team *team, int64_t chunks);
