/* Bodies during a step. */
#pragma once

#include "mpm/pose.h"

/* A body with the velocities of the step. */
struct gr_moving {
    struct gr_pose pose;
    double v[3], omega[3];
};

/* True if an impulse can change the motion of a body. */
static inline int gr_can_be_moved(const struct gr_body *body) { return body->free || body->turns; }

/* Give a body an impulse at `arm` from its position: fixed components do not change. */
static inline void gr_impel(struct gr_moving *m, const double arm[3], const double impulse[3])
{
    const struct gr_body *body = m->pose.body;
    for (int d = 0; d < 3; d++)
        if (body->free >> d & 1) m->v[d] += impulse[d] / body->mass;
    if (body->turns) {
        double change[3];
        gr_spin_up(m->pose.inverse_inertia, arm, impulse, change);
        for (int d = 0; d < 3; d++) m->omega[d] += change[d];
    }
}

/* Velocity of the point of a body at `arm`. */
static inline void gr_velocity_of(const struct gr_moving *m, const double arm[3], double v[3])
{
    const double *w = m->omega;
    v[0] = m->v[0] + w[1] * arm[2] - w[2] * arm[1];
    v[1] = m->v[1] + w[2] * arm[0] - w[0] * arm[2];
    v[2] = m->v[2] + w[0] * arm[1] - w[1] * arm[0];
}

/* Velocity along a direction that the turning of a body by a unit impulse along it gives the point at `arm`, 1/kg. */
static inline double gr_turning_mobility(const double inverse[9], const double arm[3], const double n[3])
{
    double w[3];
    gr_spin_up(inverse, arm, n, w);
    return n[0] * (w[1] * arm[2] - w[2] * arm[1]) + n[1] * (w[2] * arm[0] - w[0] * arm[2]) +
           n[2] * (w[0] * arm[1] - w[1] * arm[0]);
}

/* Set the state of the bodies at the beginning of a run. */
void gr_bodies_start(struct gr_engine *e);

/* Largest present speed of a body within the domain, m/s. */
double gr_bodies_speed(const struct gr_engine *e);
