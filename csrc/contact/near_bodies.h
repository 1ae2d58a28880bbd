/* The cells near bodies, whose points may touch them. */
#pragma once

#include "contact/contact_point.h"

/* Distance in cells within which a point has its contact point, at Courant numbers up to 1/2. */
#define GR_CONTACT_REACH 1.5

/* List the cells near bodies, unless the list still holds: the mesh is the same and no body has moved far. It does not
 * bear on the results.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_list_near_bodies(struct gr_engine *e);
