/* Convex edges of the surfaces of bodies. */
#pragma once

#include "mpm/pose.h"

/* True if a contact point with the normal n is at a convex edge or a vertex: the surface recedes nearby from its tangent
 * plane. */
int gr_is_at_edge(const struct gr_engine *e, const struct gr_pose *pose, const double contact[3], const double n[3]);

/* True if a contact point at an edge of body b, of a point at x, is not on the surface that all bodies have together. n:
 * its normal; pose: of all bodies. */
int gr_edge_is_covered(const struct gr_engine *e, const struct gr_pose *pose, int b, const double x[3],
                       const double contact[3], const double n[3]);
