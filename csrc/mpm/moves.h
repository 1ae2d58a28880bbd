/* The way of all points to new slots. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

#define GR_SPARE INT64_MIN

/* Work space to move all points to new slots: the memory of migrants behind the pending points, which has none then. */
struct gr_moves {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks, used; /* slots in use before or after */
    int64_t *from;        /* per new slot: the old one of its point, -1 - k for pending point k, or GR_SPARE */
    void *copy[2];        /* of columns of the points */
    int64_t column;       /* the one to be moved */
};

/* Reserve the work space, in which no slot has a point yet. Returned: 0 or GR_ERR_MEMORY. */
int gr_reserve_moves(struct gr_moves *moves);

/* Move the points to the slots in which the cells of the mesh have them. */
void gr_move_points(struct gr_moves *moves);
