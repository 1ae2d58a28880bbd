/* Inlets: places where material enters a running simulation.
 *
 * An inlet is a row of n sites across the stream. The material that enters is a seeding lattice with the spacing h along the
 * axis of the inlet, which moves with the velocity V; point j of it, j = 0, 1, ..., belongs to site j mod n and enters at
 *
 *   t_j = begin + (j + 1) h/(|V_axis| n),   x = site + V (t - t_j) in the first step at or past that time.
 *
 * Its columns thus enter one after the other, so that the mass that has entered is the rate times the time to within a point,
 * and the points of a column keep the distance h whatever the time step. What enters, and in which step, depends on the
 * time alone.
 *
 * Where points are not to be pushed into others, a point whose place is taken waits, at most one at each site: it enters in
 * the first step in which no other point of its column is nearer than h (or a little less, if it is in time). A point that
 * is due while one waits is missed. */
#pragma once

#include "mpm/engine.h"

struct gr_inlet {
    int64_t n_sites;
    int axis, yields;                        /* whether points wait for a free place */
    double velocity[3], spacing, begin, end; /* m/s, m, s */
    double *record;                          /* n_sites x n_components: the points that enter */
    int64_t due, missed;                     /* points that were due; those of them that found another one waiting */
    int64_t *entered, *waits;                /* per site: points that have entered; whether one waits */
};

struct gr_inflow {
    int n_inlets;
    int64_t next_id; /* larger than all ids that have been used */
    struct gr_inlet *inlet;
};

/* Add an inlet, from before the points are bound. The records are copied.
 * Returned: 0, GR_ERR_MEMORY, or GR_ERR_CONFIG. */
int gr_inflow_add(struct gr_engine *e, const struct gr_inlet *inlet);
void gr_inflow_free(struct gr_inflow *inflow);

/* Largest number of points that enter in a step. */
int64_t gr_inflow_most(const struct gr_engine *e);

/* Largest speed of what enters. */
double gr_inflow_speed(const struct gr_engine *e);

/* Let the points enter that are due at the time of the engine. Those without a free place in their cell become pending. */
void gr_inflow_enter(struct gr_engine *e);

/* State of the inlets: the next id; then for each inlet due, missed, entered and waits of its sites. `size` numbers. */
int64_t gr_inflow_size(const struct gr_inflow *inflow);
void gr_inflow_state(const struct gr_inflow *inflow, int64_t *out);

/* Set it again.
 * Returned: 0, or GR_ERR_CONFIG for numbers that cannot be, and nothing is set. */
int gr_inflow_restore(struct gr_inflow *inflow, const int64_t *state);
