/* The contact points of a run that ranks share (mpm/ranks.h).
 *
 * Each rank finds the contact points of its own points, with nodes whose sums are complete there. The sweeps over all of
 * them have one order, that of the cells of the grid and of slots: rank 0 makes them, with the contact points of all
 * ranks. The others receive the impulses of theirs, the velocities of the nodes of their cells, and the motion of the
 * bodies. With a single process all of this does nothing. */
#pragma once

#include "contact/contact_point.h"

/* Prepare for bodies in a run that ranks share from now on. Returned: 0 or GR_ERR_MEMORY. */
int gr_shared_contacts_new(struct gr_engine *e);

struct gr_shared_contacts;
void gr_shared_contacts_free(struct gr_shared_contacts *shared);

/* Send the contact points to rank 0. Returned: 0, GR_ERR_MEMORY or an error of other ranks. */
int gr_gather_contacts(struct gr_engine *e);

/* The contact points of all ranks: those of the engine in a single process, NULL on ranks other than 0. */
struct gr_contact_points *gr_all_contacts(const struct gr_engine *e);

/* Send the results of rank 0, or its error: the impulses, e->bodies.next, and the nodes of contact points, which become those
 * of e->bodies.contacts.
 * Returned: 0 or an error. */
int gr_scatter_contacts(struct gr_engine *e, int error);
