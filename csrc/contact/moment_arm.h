/* Moment arms of the contact points of bodies that turn freely. */
#pragma once

#include "contact/contact_point.h"
#include "mpm/pose.h"

/* Set the arm of a contact point to the point at which its impulse acts on the nodes, sum N_i x_i, and add the rotation
 * of the body to its mobilities: (r x n).I^-1 (r x n) along the normal, and the trace of the same for all directions at
 * most. */
void gr_set_moment_arm(const struct gr_engine *e, const struct gr_pose *pose, struct gr_contact_point *contact);
