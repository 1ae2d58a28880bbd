/* Memory of the sums of cells: a block for each tile, with the sums of its lanes; and behind them the tails of its runs, or
 * what its lanes have for their second and third nodes if each is a run by itself (engine.h). */
#pragma once

#include "mpm/engine.h"

/* Where the tail of the run of a lane is, or that of the lane if it is a run by itself. */
static inline int64_t gr_end_of_run(const struct gr_engine *e, int64_t index)
{
    const int64_t tile = index / GR_LANES, behind = e->mesh.tile_block[tile] + e->sums.of_lanes;
    const unsigned lane = (unsigned)(index % GR_LANES), joins = e->mesh.tile_joins[tile];
    if (!joins) return behind + lane;
    const int run = __builtin_popcount(~joins & ((2u << lane) - 1)) - 1; /* lane 0 always begins one */
    return behind + (int64_t)run * e->sums.of_run;
}

enum { GR_FIRST_BLOCK = GR_LANES }; /* behind a line of zeros, which stand for sums that are not there */

/* Give the sums memory for so many numbers. What they held is lost; without memory they remain.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_reserve_sums(struct gr_engine *e, int64_t numbers);

/* Note whether the caches hold so many sums, and so many slots of points. */
void gr_note_size(struct gr_engine *e, int64_t numbers, int64_t slots);
