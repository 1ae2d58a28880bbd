/* Bodies during a step (moving.h). */
#include "contact/moving.h"

#include "mpm/thin_bodies.h"

void gr_bodies_start(struct gr_engine *e)
{
    for (int b = 0; b < e->config.n_bodies; b++) {
        const struct gr_body *body = &e->config.bodies[b];
        struct gr_body_state *state = &e->bodies.now[b];
        double rates[6];
        memset(state, 0, sizeof *state);
        memcpy(state->x, body->position, sizeof state->x);
        memcpy(state->orientation, body->orientation, sizeof state->orientation);
        gr_motion_at(body, 0, rates);
        memcpy(state->v, rates, sizeof state->v);
        memcpy(state->omega, rates + 3, sizeof state->omega);
        e->bodies.next[b] = *state;
        memcpy(e->bodies.split[b].x, state->x, sizeof state->x);
        memcpy(e->bodies.split[b].orientation, state->orientation, sizeof state->orientation);
    }
}

double gr_bodies_speed(const struct gr_engine *e)
{
    double fastest = 0;
    for (int b = 0; b < e->config.n_bodies; b++) {
        const struct gr_body *body = &e->config.bodies[b];
        const struct gr_body_state *now = &e->bodies.now[b];
        double square = 0;
        for (int d = 0; d < e->config.dim; d++) { /* distance of the farthest corner of the domain */
            const struct gr_axis *axis = &e->axis[d];
            const double low = now->x[d] - axis->origin, high = low - axis->length;
            square += fmax(low * low, high * high);
        }
        fastest = fmax(fastest, gr_largest_speed(body, e->config.parts + body->first_part, now->orientation, now->v,
                                                 now->omega, sqrt(square)));
    }
    return fastest;
}
