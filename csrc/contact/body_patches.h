/* The impulses of the contact points on the patches of bodies (mpm/patches.h). */
#pragma once

#include "mpm/engine.h"

/* Add the impulses of a finished step, before the bodies move.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_add_body_patches(struct gr_engine *e);
