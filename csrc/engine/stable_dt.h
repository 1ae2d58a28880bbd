/* The longest stable time step. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

/* Stable time step at the present speeds, s: waves, points, bodies and walls cross a part cfl of a cell in it. */
double gr_stable_dt(const struct gr_engine *e, struct gr_team *team);

/* The same at the speed of the bodies alone. */
double gr_stable_dt_of_bodies(const struct gr_engine *e);

/* Make steps of dt from now on. */
void gr_use_dt(struct gr_engine *e, double dt);
