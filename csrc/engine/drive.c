/* Bodies driven from outside (drive.h). */
#include "engine/drive.h"

#include <string.h>

#include "engine/stable_dt.h"
#include "mpm/sleep.h"

/* Change six numbers of a state, and begin an interval. A change may set material in motion that is asleep. */
static void set(struct gr_engine *e, struct gr_body_state *now, double *numbers, const double to[6])
{
    now->met[0] = e->clock.time;
    memcpy(now->met + 1, now->impulse, sizeof now->impulse);
    memcpy(now->met + 4, now->angular_impulse, sizeof now->angular_impulse);
    if (!memcmp(numbers, to, 6 * sizeof *to)) return;
    memcpy(numbers, to, 6 * sizeof *to);
    if (e->sleep) gr_sleep_wake_all(e);
}

void gr_drive(struct gr_engine *e, int b, const double rates[6])
{
    const struct gr_body *body = &e->config.bodies[b];
    struct gr_body_state *now = &e->bodies.now[b];
    now->driven = 1;
    set(e, now, now->drive, rates);
    for (int d = 0; d < 3; d++) {
        if (!(body->free >> d & 1)) now->v[d] = rates[d];
        if (!body->turns) now->omega[d] = rates[3 + d];
    }
    const double longest = gr_stable_dt_of_bodies(e);
    if (!(e->config.dt > 0) && e->clock.dt > longest) gr_use_dt(e, longest);
}

void gr_load(struct gr_engine *e, int b, const double load[6])
{
    struct gr_body_state *now = &e->bodies.now[b];
    set(e, now, now->load, load);
}
