/* Passes of a regrouping: work on n items, each of which can be done by itself. A team divides the items into chunks; a device
 * has a thread for each item, or for each of more chunks than a team has (device.h).
 *
 * A pass has a line in GR_REGROUP_PASSES, and a body behind GR_DEFINE_PASS in a file that is compiled for devices, too
 * (gpu_kernels.c). What it writes are arrays of the memory of the engine, never members of it. */
#pragma once

#include "core/team.h"

struct gr_engine;

/* X(pass, one of its items) */
#define GR_REGROUP_PASSES(X)  \
    X(find_occupied, cell)    \
    X(list_occupied, cell)    \
    X(merge_occupied, cell)   \
    X(count_given_rows, cell) \
    X(list_given_rows, cell)  \
    X(set_bits, row)          \
    X(read_bits, row)         \
    X(find_runs, tile)        \
    X(forget_blocks, block)   \
    X(count_blocks, entry)    \
    X(fill_blocks, entry)     \
    X(count_points, cell)     \
    X(size_tiles, tile)       \
    X(sum_numbers, number)    \
    X(place_numbers, number)  \
    X(clear_moves, slot)      \
    X(find_moves, cell)       \
    X(clear_sums, number)     \
    X(place_cells, cell)      \
    X(move_column, slot)      \
    X(center_spare, cell)     \
    X(clear_nodes, node)      \
    X(describe_nodes, node)   \
    X(connect_cells, cell)    \
    X(find_orders, tile)      \
    X(list_lane_nodes, cell)  \
    X(count_lines, node)      \
    X(list_lines, node)       \
    X(list_addends, row)      \
    X(find_about, node)

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
