/* The longest stable time step. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

/* Stable time step at the present speeds, s: waves, points, bodies and walls cross a part cfl of a cell in it. */
double gr_stable_dt(const struct gr_engine *e, struct gr_team *team);
