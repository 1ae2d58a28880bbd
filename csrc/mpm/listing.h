/* The points listed one by one, in any order: those in cells, in their order, then the pending ones. A team does it. The
 * points of a new cell are in the order of this list. */
#pragma once

#include "mpm/regroup.h"

/* Find the cell of a point at x, which is brought to the other end of a periodic axis if it is at its end.
 * Returned: 0 if it is outside of the domain, or of the cells of this rank. */
int gr_find_cell_at(const struct gr_engine *e, double x[3], int32_t cell[3]);

/* List the points and their cells.
 * Returned: 0, GR_ERR_MEMORY, or GR_ERR_OUTSIDE, which is the failure of the engine. */
int gr_list_points(struct gr_regroup *r);

/* Make the cells near thin parts double. Returned: 0 or GR_ERR_MEMORY. */
int gr_split_cells(struct gr_regroup *r);

/* Count the points of each new cell, and number them in it. */
void gr_count_listed(struct gr_regroup *r);

/* Find from where the points move to their new slots. */
void gr_find_listed_moves(struct gr_regroup *r);

void gr_free_listing(struct gr_regroup *r);
