/* Passes of a regrouping: work on n items, each of which can be done by itself. A team divides the items into chunks; a device
 * has a thread for each item, or for each of more chunks than a team has (device.h).
 *
 * A pass has a list of its own in GR_REGROUP_PASSES and a body behind GR_DEFINE_PASS, in a file that is compiled for devices, too. All that it
 * writes is in arrays of the memory of the engine. */
#pragma once

#include "core/team.h"

struct gr_engine;

/* X(pass, one of its items) */
#define GR_REGROUP_PASSES(X) \
    X(find_occupied, cell)   \
    X(list_occupied, cell)   \
    X(merge_occupied, cell)  \
    X(count_points, cell)    \
    X(size_tiles, tile)      \
    X(clear_moves, slot)     \
    X(find_moves, cell)      \
    X(move_column, slot)     \
    X(place_cells, cell)     \
    X(clear_sums, number)    \
    X(center_spare, cell)

/* Do the items [first, last), which are chunk number `chunk`. For a device `work` is copied, without what it points to. */
typedef void gr_pass(struct gr_engine *e, const void *work, int64_t first, int64_t last, int64_t chunk);

#define GR_X(pass, item) gr_pass gr_pass_##pass;
GR_REGROUP_PASSES(GR_X)
#undef GR_X

/* Define a pass, whose work w is of a type. What follows is the body, with the arguments of gr_pass. */
#define GR_DEFINE_PASS(pass, type, w)                                                                                 \
    static void pass##_share(__attribute__((unused)) struct gr_engine *e, const type *w, int64_t first, int64_t last, \
                             __attribute__((unused)) int64_t chunk);                                                  \
    void gr_pass_##pass(struct gr_engine *e, const void *work, int64_t first, int64_t last, int64_t chunk)            \
    {                                                                                                                 \
        pass##_share(e, work, first, last, chunk);                                                                    \
    }                                                                                                                 \
    static void pass##_share(__attribute__((unused)) struct gr_engine *e, const type *w, int64_t first, int64_t last, \
                             __attribute__((unused)) int64_t chunk)
