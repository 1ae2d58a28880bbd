/* The longest stable time step. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

/* That of the present speeds: waves, points, bodies and walls cross a part cfl of a cell in it, s. */
double gr_stable_dt(const struct gr_engine *e, struct gr_team *team);
