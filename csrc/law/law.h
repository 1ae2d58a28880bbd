/* A constitutive law: its parameters, and an update that works on blocks of lanes of material points.
 *
 * A law is one file law_<name>.c, included by kernels.c and compiled once for each instruction set, and
 * one line in GR_LAWS. See docs/contributing.md, "Add a law". */
#ifndef GR_LAW_LAW_H
#define GR_LAW_LAW_H

#include <stdint.h>

#include "core/simd.h"

#define GR_LAWS(X) X(elastic) X(drucker_prager) X(mu_i)

enum gr_law_id {
#define GR_X(name) GR_LAW_##name,
    GR_LAWS(GR_X)
#undef GR_X
        GR_LAW_COUNT
};

#define GR_LAW_MAX_PARAMETERS 8

struct gr_parameter_info {
    const char *name, *unit, *doc;
};

struct gr_law_info {
    const char *name, *doc;
    int n_parameters;
    struct gr_parameter_info parameter[GR_LAW_MAX_PARAMETERS];
};

extern const struct gr_law_info gr_law_table[GR_LAW_COUNT];

/* One call: `n_blocks` blocks of GR_W lanes.
 * Given: slot[k], the first place of block k in the point arrays; gradient[k*dim*dim*GR_W...], the
 *   increment L dt of the velocity gradient, row-major components of GR_W lanes each; dt in s;
 *   log_density at the end of the step; parameter values in the law's own order.
 * Updated: stress[c], component arrays, Pa. Returned: shear_rate, 1/s, where the pointer is not NULL. */
struct gr_law_call {
    int64_t n_blocks;
    const int64_t *slot;
    const double *gradient;
    double dt;
    int pressure_from_density; /* 1: p = K log_density (consistent with eq. 2.7); 0: p from the trial stress (3.10) */
    const double *parameter;
    const double *log_density;
    double *stress[6];
    double *shear_rate;
};

typedef void gr_law_update(const struct gr_law_call *call);

#endif
