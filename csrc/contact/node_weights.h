/* The nodes on which a contact point acts, and their weights. */
#pragma once

#include "contact/contact_point.h"

/* Mass of a node, with its duplicate on the other side of a thin body unless they are separated. */
double gr_contact_mass(const struct gr_engine *e, int64_t n);

/* Set nodes, with the numbers of the mesh, weights and mobilities of a contact point that acts at x, of a point on a side of
 * thin bodies. The mean mass of its nodes, over the mass of a full cell, has to be more than `least_filling`.
 * Returned: whether it can act there. */
int gr_weigh_nodes(const struct gr_engine *e, const double x[3], int side, double least_filling,
                   struct gr_contact_point *contact);
