/* Walls on grid lines: boundary conditions of the nodes. */
#pragma once

#include <math.h>

#include "mpm/engine.h"

/* The row of the wall table that applies to a node now. */
static inline const struct gr_wall *gr_wall_now(const struct gr_engine *e, uint8_t code)
{
    const struct gr_wall *wall = &e->config.walls[code];
    while (e->time >= wall->opens_at) wall = &e->config.walls[wall->after];
    return wall;
}

/* Normal impulse of a node on a Coulomb wall, over the mass of the node: what the wall takes of the momentum that the points
 * receive. Given: the velocities of the node before and after the forces, and the share `kept` of the points' own velocity.
 * With kept = 1 it is the impulse of the forces. The velocity v itself stays with the points, and is no part of it. */
static inline double gr_into_wall(const struct gr_wall *wall, double kept, const double *v, const double *next)
{
    const double at = wall->velocity[wall->normal], into = next[wall->normal] - at - kept * (v[wall->normal] - at);
    return wall->side ? into * -wall->side : fabs(into);
}

/* Apply a wall to the velocity `next` that a node would have. The impulse on a fixed component does not enter the
 * increment that points receive: v is set together with `next`, so that the wall neither pushes nor drags them.
 * Coulomb friction is a force and does enter it. Inline: the loop over nodes is compiled for each dimension. */
static inline void gr_apply_wall(const struct gr_wall *wall, int dim, double kept, double *v, double *next)
{
    double friction = 0;
    if (wall->normal >= 0) {
        const double taken = gr_into_wall(wall, kept, v, next);
        double sliding = 0;
        for (int d = 0; d < dim; d++)
            if (d != wall->normal) sliding += next[d] * next[d];
        sliding = sqrt(sliding);
        if (taken > 0 && sliding > 0) friction = fmin(1.0, wall->friction * taken / sliding);
    }
    for (int d = 0; d < dim; d++) {
        if (wall->fixed >> d & 1)
            v[d] = next[d] = wall->velocity[d];
        else if (wall->normal >= 0)
            next[d] -= friction * next[d];
    }
}
