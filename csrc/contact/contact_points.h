/* Contact points of the material with the surfaces of bodies.
 *
 * A material point near a body touches it at its contact point, the nearest point x_s = x - phi n of the surface, with
 * phi the signed distance and n the outward normal. There the velocity of the material is interpolated from the nodes. A
 * point takes part if its distance is below r, half the spacing of points,
 *
 *   r = (m/rho_c)^(1/dim)/2,
 *
 * or can fall below it within the next two steps; of sticky and bilateral surfaces, if it is below 1.5 r. The impulses at
 * all contact points are computed together (contact.c).
 *
 * An impulse is at most m c_w, with the speed c_w of compression waves: a traction of about rho c_w^2. Where material is
 * pinched between surfaces that approach each other no impulse fulfils all conditions, and this alone bounds it.
 *
 * Where the nodes about a contact point have hardly any mass, a point acts at its position instead, where its own mass
 * contributes. At convex edges the impulse is bounded by the stress of the point (edges.h).
 *
 * In a corner, where a point has contact points on several surfaces, a contact point has no friction in the directions that
 * another surface bars: there only the load on that surface acts. */
#pragma once

#include "contact/contact_point.h"
#include "core/team.h"

int gr_contact_points_new(struct gr_engine *e);
void gr_contact_points_free(struct gr_contact_points *contacts);

/* Find the contact points of this step, by all threads of a team. Call it after the grid stage. The impulses start from the
 * last step, which the points have stored as forces: of a point with several contact points, each has the part of the force
 * along its normal. */
void gr_find_contact_points(struct gr_engine *e, const double g[3], struct gr_team *team);

/* Keep the impulses of the contact points as forces on their points. */
void gr_store_contact_forces(struct gr_engine *e);

/* Move points that have slipped into a body at one of its edges towards its surface. Call it when the points are in their
 * cells, and before the sums of the cells that lost or gained points are made anew.
 * Returned: 0 or an error of ranks. */
int gr_move_out_of_bodies(struct gr_engine *e);
