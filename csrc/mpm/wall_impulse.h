/* Impulses of the material on the walls, on request.
 *
 * A wall changes the velocity of a node from (v, v') to (v_w, v'_w), before and after the forces of a step. The points
 * receive f (v' - v) + (1 - f) v' (mpm/grid.h), so that the momentum they give to the wall at a node of mass m is
 *
 *   J = m (v' - v'_w) - f m (v - v_w).
 *
 * The sum over the walls, the bodies and gravity is the change of the momentum of the points, but for losses in a sponge
 * layer and through open sides; under uGIMP with an affine transfer the momentum of the points itself is not conserved. */
#pragma once

#include "core/exact.h"
#include "mpm/servo.h"

/* Which wall each component of the impulse on a node counts for; rows follow one another when walls open. */
struct gr_wall_share {
    int32_t owner[3]; /* index of a wall, -1 for none */
    int32_t after;    /* the row that holds from `opens_at` on */
    double opens_at;  /* s */
};

/* Numbers of a wall: impulse, N s; angular impulse about the origin, N m s; displacement outwards of a wall that keeps a
 * pressure, m; work of the wall on the material, J; and the time integral, since it moved last, of the pressure in excess
 * of the one that it keeps, Pa s. */
enum { GR_WALL_DISPLACEMENT = 6, GR_WALL_WORK, GR_WALL_EXCESS, GR_WALL_NUMBERS };

struct gr_wall_watch {
    int n_walls, n_shares;
    struct gr_wall_share *share; /* row 0: nodes without walls */
    int32_t *code;               /* per combination of the classes of e->config.node_codes: the row of these nodes */
    double *node;                /* n_nodes x dim, N s: the impulse in this step */
    double *step, *total;        /* n_walls x GR_WALL_NUMBERS: in this step; since the run began */
    struct gr_exact *sum;        /* gr_wall_sums: those of this step; then the mass of nodes at the wall of the servo */
    struct gr_servo servo;       /* height 0: no wall keeps a pressure */
    struct gr_patches *patches;  /* patches.h; NULL unless asked for; freed by their own function */
};

static inline int gr_wall_sums(const struct gr_wall_watch *watch) { return watch->n_walls * GR_WALL_NUMBERS + 1; }

/* Begin to add up the impulses; before the points are grouped. The arguments are copied; `code` is per combination of
 * the classes of e->config.node_codes, x fastest.
 * Returned: 0, GR_ERR_CONFIG or GR_ERR_MEMORY. */
int gr_watch_walls(struct gr_engine *e, int n_walls, const struct gr_wall_share *share, int n_shares, const int32_t *code);

/* Let a wall that is watched keep a pressure; once. `full_mass` and `mass` are not taken from the argument.
 * Returned: 0 or GR_ERR_CONFIG. */
int gr_watch_servo(struct gr_engine *e, const struct gr_servo *servo);
void gr_watch_free(struct gr_wall_watch *watch);

/* The owners of the impulse on a node of a wall in this step.
 * Set: at, the indices of the node. */
const struct gr_wall_share *gr_wall_share_of(const struct gr_engine *e, int64_t n, int32_t at[3]);

/* Sum the impulses of the nodes over each wall, exactly; and add the sums of a finished step.
 * Returned: 0, or an error of other ranks. */
int gr_sum_wall_impulses(struct gr_engine *e);
void gr_add_wall_impulses(struct gr_engine *e);
