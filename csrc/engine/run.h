/* A call for steps. */
#pragma once

#include "core/team.h"
#include "kernels.h"
#include "mpm/engine.h"

struct gr_run {
    struct gr_engine *e;
    const struct gr_kernels *kernels; /* in the precision of the scheme */
    const struct gr_passes *passes;
    struct gr_team *team;
    int again, pass;
    int64_t left; /* steps left */
    double until, gravity[3];
    int n_chunks; /* of tiles */
};
