/* Walls on grid lines: boundary conditions of the nodes. */
#pragma once

#include <math.h>

#include "mpm/engine.h"

/* The row of the wall table that applies to a node now. */
static inline const struct gr_wall *gr_wall_now(const struct gr_engine *e, uint8_t code)
{
    const struct gr_wall *wall = &e->config.walls[code];
    while (e->clock.time >= wall->opens_at) wall = &e->config.walls[wall->after];
    return wall;
}

/* Bit d is set if a wall holds component d of a node that would have the velocity `next`: not if the node leaves the
 * wall. */
static inline int gr_holds(const struct gr_wall *wall, int dim, const double *next)
{
    int held = wall->fixed;
    for (int d = 0; d < dim; d++)
        if (wall->away[d] && wall->away[d] * (next[d] - wall->velocity[d]) > 0) held &= ~(1 << d);
    return held;
}

/* Momentum that a wall takes of component d of a node that it holds, over the mass of the node: the part of w (mpm/grid.h)
 * that the points would receive, so that with keep = 1 it is the impulse of the forces.
 * Given: the velocities v and v' of the node, and the share `keep` of their velocity that the points keep. */
static inline double gr_taken(const struct gr_wall *wall, int d, double keep, const double *v, const double *next)
{
    return next[d] - wall->velocity[d] - keep * (v[d] - wall->velocity[d]);
}

/* Most that friction takes along the wall normal to axis d, which takes `taken` of component d: of either sign, if the wall
 * holds both ways. */
static inline double gr_friction(const struct gr_wall *wall, int d, double taken)
{
    return wall->friction[d] * (wall->away[d] ? fmax(taken * -wall->away[d], 0) : fabs(taken));
}

/* Apply a wall to the velocity `next` that a node would have. The impulse on a component that is held does not enter the
 * increment that points receive: v is set together with `next`, so that the wall neither pushes nor drags them.
 * Coulomb friction is a force and does enter it. Inline: the loop over nodes is compiled for each dimension. */
static inline void gr_apply_wall(const struct gr_wall *wall, int dim, double keep, double *v, double *next)
{
    const int held = gr_holds(wall, dim, next);
    double most = 0, sliding = 0;
    for (int d = 0; d < dim; d++) {
        if (held >> d & 1)
            most += gr_friction(wall, d, gr_taken(wall, d, keep, v, next));
        else
            sliding += next[d] * next[d];
    }
    sliding = sqrt(sliding);
    const double share = most > 0 && sliding > 0 ? fmin(1.0, most / sliding) : 0;
    for (int d = 0; d < dim; d++) {
        if (held >> d & 1)
            v[d] = next[d] = wall->velocity[d];
        else
            next[d] -= share * next[d];
    }
}
