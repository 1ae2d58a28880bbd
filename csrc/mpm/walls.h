/* Walls on grid lines: boundary conditions of the nodes. */
#ifndef GR_MPM_WALLS_H
#define GR_MPM_WALLS_H

#include "mpm/engine.h"

/* The row of the wall table that applies to a node now. */
static inline const struct gr_wall *gr_wall_now(const struct gr_engine *e, uint8_t code)
{
    const struct gr_wall *wall = &e->config.walls[code];
    while (e->time >= wall->opens_at) wall = &e->config.walls[wall->after];
    return wall;
}

/* Apply a wall to the velocity `next` that a node would have, and to its velocity v before the forces. */
void gr_apply_wall(const struct gr_wall *wall, int dim, double *v, double *next);

/* True if all nodes are walls along axis d on the face with which the domain ends at cell `from`. */
int gr_face_is_closed(const struct gr_engine *e, const int32_t from[3], int d, int high);

#endif
