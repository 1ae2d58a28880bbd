/* Grouping of the points by cell. */
#pragma once

#include "mpm/engine.h"

/* Group the points by cell, and keep their order within each. After GR_ERR_CAPACITY needed_capacity is the
 * capacity that is required. */
int gr_regroup(struct gr_engine *e, struct gr_team *team);

/* True, in some steps, if a quarter of the cells that held points at the last grouping hold none. Material that flows away
 * leaves its cells behind, which are visited in each step until the points are grouped again; the results do not depend on
 * it. */
int gr_has_emptied(const struct gr_engine *e);
