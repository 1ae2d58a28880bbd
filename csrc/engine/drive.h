/* Bodies driven from outside between two steps, by a controller or a multibody code. What it sets holds until it sets
 * something else, and is a part of the state of the body, which a restart has; so are the time and the impulses until then,
 * from which the mean load of the interval that follows is computed. */
#pragma once

#include "mpm/engine.h"

/* Replace the prescribed motion of a body by constant velocities. Steps become shorter at once if they must. */
void gr_drive(struct gr_engine *e, int b, const double rates[6]);

/* Let a constant force and torque act on what moves freely of a body. */
void gr_load(struct gr_engine *e, int b, const double load[6]);
