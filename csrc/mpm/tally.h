/* Tally of a run: sums and extremes of its points, kept for its verdict (granular/run/diagnostics.py).
 *
 * One is made every GR_TALLY_INTERVAL steps. Each cell is summed over its points in their order, and the cells exactly, so
 * that the bits depend neither on the number of threads or ranks nor on when the points were grouped. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

/* Steps between two tallies; a point of one takes about as long as in half a step. The plastic power is integrated from
 * one to the next, over impacts of some ten steps: with 64 steps the block that falls on a bed came out with 12 % of the
 * work more than in the sum over all steps, with 17 steps 1 % at most. Not a multiple of the steps between two averagings
 * of the density, which is 4: the power is largest in these, and at every fourth step it comes out 10 % too small in slow
 * flow. */
enum { GR_TALLY_INTERVAL = 17 };

/* True if a tally is to be made of the present state. */
int gr_tally_is_due(const struct gr_engine *e);

/* Make it; the points are grouped. Returned: 0 or GR_ERR_MEMORY. */
int gr_tally_make(struct gr_engine *e, struct gr_team *team);

/* Account for a packed point that appears, or is taken away, in this step: `sign` is 1 or -1. */
void gr_tally_carry(struct gr_engine *e, const double *record, int sign);

/* Account for the energy and the mass of a packed point that leaves. */
void gr_tally_outflow(struct gr_engine *e, const double *record);

/* Enter what came and went in this step. Returned: 0, or an error of other ranks. */
int gr_tally_settle(struct gr_engine *e);
