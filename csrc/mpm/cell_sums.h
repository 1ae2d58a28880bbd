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

/* True if a lane continues the run of the lane before. */
static inline int gr_joins(const struct gr_engine *e, int64_t index)
{
    return e->mesh.tile_joins[index / GR_LANES] >> index % GR_LANES & 1;
}

/* Where the sums of a group for a row of nodes begin, from the position of an addend on, and how far apart they are. */
struct gr_sums_of_row {
    int64_t begin[GR_KINDS_OF_SUMS];
    int apart[GR_KINDS_OF_SUMS];
};

static inline struct gr_sums_of_row gr_sums_of_row(const int k, const struct gr_engine *e, enum gr_group_of_sums group,
                                                   int row, int sum)
{
    const struct gr_rows *const rows = &e->sums.rows[group];
    const int64_t at = (int64_t)row * rows->width + sum, all = (int64_t)e->n_rows * rows->width;
    struct gr_sums_of_row of = {{0}, {0}};
    of.begin[GR_OF_LANES] = rows->main + at * GR_LANES;
    of.begin[GR_SECOND] = rows->apart + at * GR_LANES;
    of.begin[GR_THIRD] = rows->apart + (all + at) * GR_LANES;
    of.apart[GR_OF_LANES] = of.apart[GR_SECOND] = of.apart[GR_THIRD] = GR_LANES;
    for (int j = 0; j < 3; j++) {
        of.begin[GR_TAIL_1 + j] = rows->tail + at * GR_TAIL(k) + j;
        of.apart[GR_TAIL_1 + j] = GR_TAIL(k);
    }
    return of;
}

enum { GR_FIRST_BLOCK = GR_LANES }; /* behind a line of zeros, which stand for sums that are not there */

/* Give the sums memory for so many numbers. What they held is lost; without memory they remain.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_reserve_sums(struct gr_engine *e, int64_t numbers);

/* Note whether the caches hold so many sums, and so many slots of points. */
void gr_note_size(struct gr_engine *e, int64_t numbers, int64_t slots);
