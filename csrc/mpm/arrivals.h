/* Points that pass from one rank to another (mpm/ranks.h). */
#pragma once

#include "mpm/ranks.h"

/* Send the packed points whose new cells belong to other ranks, and receive those that come from them.
 *
 * Given: the lists of all points that left their cells, in the order of these and of slots; the number of those that have no
 * cell, which is corrected.
 * Returned: 0 or an error; the same points and the arrivals as lists in the order of cells of the grid, ranks->part, and
 * their number. */
int gr_ranks_pass_points(struct gr_engine *e, struct gr_migrants *list, int lists, int64_t *homeless, int *parts);

/* Reserve memory for n points that wait; gr_ranks_stage lets one wait, and gr_ranks_make_pending all of them: as their order
 * is that of all points, each would overwrite records that are still to be read. */
int gr_ranks_reserve_staged(struct gr_engine *e, int64_t n);
void gr_ranks_stage(struct gr_engine *e, int64_t k, const double *record, int64_t id);
int gr_ranks_make_pending(struct gr_engine *e, int64_t n);
