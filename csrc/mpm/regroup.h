/* A regrouping under way (grouping.c), between the old order of the points and the new.
 *
 * As a rule the points are in their cells, to which each step brings them. Then cells are grouped, not points: those of an
 * old cell go to the new cell of the same index, and behind them the pending ones. At first, where the positions have been
 * replaced, with thin bodies and with ranks the points are listed one by one (listing.h); the new order is the same. */
#pragma once

#include "mpm/moves.h"
#include "mpm/tiles.h"

/* Points that are listed together: of a share of the old cells, or the pending ones. */
struct gr_list {
    int64_t first, n;        /* numbers of its points */
    int64_t n_cells;         /* length of its list of their cells */
    int64_t lowest, highest; /* of their new cells */
    int64_t outside;         /* id of the first point outside the domain, and its position; `failed` if there is one */
    double outside_x[3];
    int failed;
};

/* What is found in a chunk of the old cells: how many hold points, and how many of these points are not in their cells. */
struct gr_survey {
    int64_t occupied, strays;
};

/* A pending point: index of its cell in the grid, and its number among them. */
struct gr_newcomer {
    int64_t cell, number;
};

struct gr_regroup {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks, n_active, n_occupied, total; /* active cells, and how many of them hold points; slots */
    int64_t *listed; /* indices in the grid of the cells that will hold points, ascending; some may be there twice */
    int64_t n_listed;
    /* of points in their cells */
    struct gr_survey *survey; /* per chunk of the old cells; then `occupied` is the number of those before the chunk */
    int64_t n_surveys;
    int64_t *occupied;            /* indices in the grid of the old cells that hold points */
    int64_t n_before;             /* their number */
    struct gr_newcomer *newcomer; /* by cells, then by numbers */
    int64_t n_newcomers;
    uint8_t *fresh;  /* per newcomer: whether it is the first point in its cell */
    int32_t *before; /* per new cell: its number among the old ones, or -1; NULL if the points are listed one by one */
    /* of points that are listed one by one */
    int64_t n;
    struct gr_list *list; /* chunks + 1; the last is of the pending points */
    int64_t *source;      /* per point: its old slot, or -1 - k for pending point k */
    int64_t *slot;        /* per point: index of its cell in the grid; then its number in the new cell */
    int32_t *cell;        /* per point: number of its new cell */
    int8_t *sides;        /* side of each of the cells; NULL without thin parts */
    /* the new cells */
    int64_t *cells; /* indices of the active cells in the grid, ascending; double cells twice */
    struct gr_tiles tiles;
    int32_t *counts; /* points of each new cell, which are the lanes of the tiles */
    int32_t *calm;   /* of the new cells; NULL without sleep */
    int64_t *offset; /* of the new tiles; number of tiles + 1 */
    struct gr_moves moves;
};

/* Number of the new slot of point k of a new cell. */
static inline int64_t gr_new_slot(const struct gr_regroup *r, int64_t c, int64_t k)
{
    return r->offset[c / GR_LANES] + c % GR_LANES + k * GR_LANES;
}
