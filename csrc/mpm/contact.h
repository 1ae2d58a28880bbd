/* Contact of the bodies with the nodes of the grid. */
#ifndef GR_MPM_CONTACT_H
#define GR_MPM_CONTACT_H

#include "mpm/engine.h"

/* Bodies as they are at the begin of a run. */
void gr_bodies_start(struct gr_engine *e);

/* Largest speed of a body within the domain now, m/s. */
double gr_bodies_speed(const struct gr_engine *e);

/* Which of the cells [first, last) have their centre in a rough body: to the lattice of the fluidity. */
void gr_bodies_mark(struct gr_engine *e, int64_t first, int64_t last);

/* After gr_grid_nodes of the nodes [first, last): which of those with mass lie within a body, to `touched`. */
void gr_bodies_find(struct gr_engine *e, int64_t first, int64_t last);

/* What the bodies do to the nodes that were found, and these to the bodies. One thread, so that the sums have one order:
 *   v_i' <- contact (body/body.h), with V + omega x r, r = x_i - X;  w_i changes as v_i' does, so that the points receive
 *   the whole impulse;  P = -sum m_i (change of v_i'), and the same of r x P_i.
 *   Free components: M (V' - V) = P(V') + M g dt, solved for V' by Newton's method, where a body as light as the
 *   nodes it touches would be thrown about by P(V). Whatever remains of the iteration, V' takes up P exactly.
 * The state after the step goes to body_next. */
void gr_bodies_touch(struct gr_engine *e, const double g[3]);

/* The step is complete: body_next becomes the state. */
void gr_bodies_move(struct gr_engine *e);

#endif
