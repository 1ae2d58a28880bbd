/* Contact of rigid bodies with the nodes of the grid. */
#pragma once

#include "mpm/engine.h"

/* Set the state of the bodies at the beginning of a run. */
void gr_bodies_start(struct gr_engine *e);

/* Largest present speed of a body within the domain, m/s. */
double gr_bodies_speed(const struct gr_engine *e);

/* Mark which of the cells [first, last) have their centre in a rough body, for the fluidity grid. */
void gr_bodies_mark(struct gr_engine *e, int64_t first, int64_t last);

/* Find which of the nodes [first, last) with mass lie within a body, and store it in `touched`. Call it after
 * gr_grid_nodes. */
void gr_bodies_find(struct gr_engine *e, int64_t first, int64_t last);

/* Apply contact to the nodes that were found, and the reaction to the bodies. It is done by one thread, so that the
 * sums have one order:
 *
 *   v_i' <- contact rule (body/body.h) with the surface velocity V + omega x r, r = x_i - X;
 *   w_i changes as v_i' does, so that the points receive the whole impulse;
 *   P = -sum m_i (change of v_i'), and the same sum of r x P_i.
 *
 * Free components of the velocity obey M (V' - V) = P(V') + M g dt. The equation is implicit, because P(V) would throw
 * about a body as light as the nodes that it touches; it is solved by Newton's method. Whatever error the iteration
 * leaves, V' receives exactly the impulse P. The state after the step goes to body_next. */
void gr_bodies_touch(struct gr_engine *e, const double g[3]);
