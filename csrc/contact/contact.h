/* Contact of the material with rigid bodies, and their motion. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

/* Apply contact to the nodes about the contact points of the points (contact_points.h), and the reaction to the bodies. Call
 * it after the grid stage. The contact points are computed by all threads of a team; the rest is done by one, of rank 0 if
 * ranks share the run (shared_contacts.h), so that the sums have one order. The impulses J at the contact points fulfil
 *
 *   separating   J_n >= 0,  u_n >= b,  J_n (u_n - b) = 0,  |J_t| <= mu J_n, against u_t
 *   bilateral    u_n = 0,  |J_t| <= mu |J_n|, against u_t
 *   sticky       u = 0
 *
 * with u = sum N_i v_i' - (V + omega x r) the velocity of the material relative to the surface and b its bound. They are
 * computed by sweeps of projected Gauss-Seidel over the contact points, each of which changes v_i' by N_i J/m_i, free
 * components of V by -J/M, and omega of bodies that turn by -I^-1 (r x J). The points receive the change of v_i' as a whole.
 * Components that walls hold stay as they are.
 *
 * With e->bodies.rigid, bodies that move freely also touch solids (rigid.h), and these impulses belong to the same sweeps.
 * Returned: 0, GR_ERR_MEMORY or an error of other ranks. */
int gr_bodies_touch(struct gr_engine *e, const struct gr_kernels *kernels, const double g[3], struct gr_team *team);
