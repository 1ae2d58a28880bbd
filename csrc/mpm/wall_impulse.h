/* Impulses of the material on the walls, for those who ask.
 *
 * A wall changes the velocity of a node from (v, v') to (v_w, v'_w), before and after the forces of a step. The points
 * receive f (v' - v) + (1 - f) v' (mpm/grid.h), so that the momentum they give to the wall at a node of mass m is
 *
 *   J = m (v' - v'_w) - f m (v - v_w).
 *
 * The sum over the walls, the bodies and gravity is the change of the momentum of the points, but for what a sponge layer
 * takes and what leaves the domain. */
#pragma once

#include "mpm/engine.h"

/* Which wall each component of the impulse on a node counts for; rows follow one another when walls open. */
struct gr_wall_share {
    int32_t owner[3]; /* index of a wall, -1 for none */
    int32_t after;    /* the row that holds from `opens_at` on */
    double opens_at;  /* s */
};

enum { GR_WALL_NUMBERS = 6 }; /* impulse, N s; angular impulse about the origin, N m s */

struct gr_wall_watch {
    int n_walls, n_shares;
    struct gr_wall_share *share; /* row 0: nodes without walls */
    int32_t *code;               /* per combination of the classes of e->config.node_codes: the row of these nodes */
    double *node;                /* n_nodes x dim, N s: the impulse in this step */
    double *step, *total;        /* n_walls x GR_WALL_NUMBERS: in this step; since the run began */
};

/* Begin to add up the impulses; before the points are grouped. The arguments are copied; `code` is per combination of
 * the classes of e->config.node_codes, x fastest.
 * Returned: 0, GR_ERR_CONFIG or GR_ERR_MEMORY. */
int gr_watch_walls(struct gr_engine *e, int n_walls, const struct gr_wall_share *share, int n_shares, const int32_t *code);
void gr_watch_free(struct gr_wall_watch *watch);

/* Sum the impulses of the nodes over each wall, in the order of the nodes; and add those of a step that is done. */
void gr_sum_wall_impulses(struct gr_engine *e);
void gr_add_wall_impulses(struct gr_engine *e);
