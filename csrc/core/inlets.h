/* Inlets: rows of sites where material enters a running simulation, of either method.
 *
 * An inlet is a row of n sites across the stream. The material that enters is a seeding lattice with the spacing h along the
 * axis of the inlet, which moves with the velocity V; point j of it, j = 0, 1, ..., belongs to site j mod n and enters at
 *
 *   t_j = begin + (j + 1) h/(|V_axis| n),   x = site + V (t - t_j) in the first step at or past that time.
 *
 * Its columns thus enter one after the other, so that the mass that has entered is the rate times the time to within a
 * point, and the points of a column keep the distance h whatever the time step. What enters, and in which step, depends
 * on the time alone.
 *
 * Where points are not to be pushed into others, a point whose position is occupied waits, at most one at each site: it
 * enters in the first step in which no other point of its column is nearer than h (or a little less, if it is in time). A
 * point that is due while one waits is missed. */
#pragma once

#include <stdint.h>

#include "core/error.h"

struct gr_inlet {
    int64_t n_sites;
    int axis, yields;                        /* whether points wait for a free position */
    double velocity[3], spacing, begin, end; /* m/s, m, s */
    double *record;                          /* n_sites x n_components: the points that enter */
    int64_t due, missed;                     /* points that were due; those that were due while another one was waiting */
    int64_t *entered, *waits;                /* per site: points that have entered; whether one waits */
};

struct gr_inlets {
    int n_inlets;
    int64_t next_id;   /* larger than all ids that have been used */
    int64_t candidate; /* number, in this step, of the point that `enter` is asked for */
    struct gr_inlet *inlet;
};

/* True if the numbers of an inlet are valid, and its records are finite. */
int gr_inlet_is_valid(const struct gr_inlet *inlet, int dim, int n_components);

/* Add an inlet to the inlets of an engine, NULL for none. The records are copied.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_inlets_add(struct gr_inlets **inlets, const struct gr_inlet *inlet, int n_components);
void gr_inlets_free(struct gr_inlets *inlets);

/* Largest number of points that enter by an inlet in a time of `seconds`. */
int64_t gr_inlet_most(const struct gr_inlet *inlet, double seconds);

/* Largest speed of what enters; 0 for no inlets. */
double gr_inlets_speed(const struct gr_inlets *inlets);

/* Put the point of a site into an engine, `since` after it was at the site, if others of its column are farther than
 * `distance` spacings. Returned: 0 if its position is occupied. */
typedef int gr_enter(void *engine, struct gr_inlet *inlet, int64_t site, double since, double distance);

/* Let the points enter that are due at a time, with `enter` giving each the number next_id and counting that up. No more
 * enter than gr_inlet_most gives for `seconds`, the longest step: if more are due, by a time that was set, they are late. */
void gr_inlets_enter(struct gr_inlets *inlets, double time, double seconds, gr_enter *enter, void *engine);

/* Call `enter` for the points that gr_inlets_enter might call it for, with the same numbers `candidate`; it must not let them
 * enter, and nothing changes.
 * Returned: their number. */
int64_t gr_inlets_ask(struct gr_inlets *inlets, double time, double seconds, gr_enter *enter, void *engine);

/* State of the inlets: the next id; then for each inlet due, missed, entered and waits of its sites. `size` numbers. */
int64_t gr_inlets_size(const struct gr_inlets *inlets);
void gr_inlets_state(const struct gr_inlets *inlets, int64_t *out);

/* Set it again.
 * Returned: 0, or GR_ERR_CONFIG for numbers that cannot be, and nothing is set. */
int gr_inlets_restore(struct gr_inlets *inlets, const int64_t *state);
