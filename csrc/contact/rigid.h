/* Contact of bodies that move freely with walls, blocks and other bodies.
 *
 * Each body has balls, in its own coordinates, of which the union represents its surface: one for a ball or a disc, else
 * points of its surface with the radius 0. A ball of one body with the centre x and the radius r touches another one by the
 * gap phi(x) - r, with the signed distance phi of the other. Walls and blocks are boxes along the axes.
 *
 * The impulses at all contacts of a step are computed together with those at the contact points of the material
 * (contact.c), by sweeps of projected Gauss-Seidel, so that the relative velocity u after the step fulfils
 *
 *   J_n >= 0,  u_n >= -gap/dt,  J_n (u_n + gap/dt) = 0,  |J_t| <= mu J_n, against u_t.
 *
 * There is no stiffness, so that nothing limits the time step. Each condition is a projection in the norm of the kinetic
 * energy, which therefore does not grow, whether or not the sweeps have converged.
 *
 * Impacts with restitution come first. Bodies have the velocity v in the middle of the time of the step; those contacts
 * that would close in the step get the impulses J_c of a plastic impact, by the conditions above with u_n >= 0, which lead
 * to v_c; then (1 + e) J_c, so that v+ = v_c + e (v_c - v). Hence u_n+ = -e u_n. The friction of a plastic impact does not
 * give energy, <v_c, M (v_c - v)> <= 0, and the energy changes by at most
 *
 *   -(1 - e)(1 + e)/2 |v_c - v|^2 <= 0,    |.| in the norm of the mass,
 *
 * for any number of contacts and with friction, if e is the same for all contacts that act on each other: it is the least
 * of them. (The restitution acts along the surface, too: Moreau 1988; Leine & van de Wouw 2008, Nonlinear Dynamics 51.) */
#pragma once

#include "contact/moving.h"

/* A wall or block: a box, whose sides may be infinitely far (GR_FAR). A wall within the domain is as thin as nothing, and
 * counts as a cell thick on its side away from the position of the body. */
#define GR_FAR 1e50
struct gr_obstacle {
    double lower[3], upper[3]; /* m */
    double velocity[3];        /* m/s, along its surface */
    double friction;           /* may be infinite */
    double opens_at;           /* s */
    int axis;                  /* normal to a wall within the domain; -1 else */
};

/* A contact of body a with body b, or an obstacle if b < 0. */
struct gr_rigid_contact {
    int a, b, closing;         /* closing: takes part in the present sweeps */
    double n[3];               /* direction in which a is pushed */
    double arm_a[3], arm_b[3]; /* from the positions of both to the contact, m */
    double velocity[3];        /* of an obstacle, m/s */
    double gap;                /* m, negative if they overlap */
    double friction, restitution;
    double mobility;             /* of both along n, 1/kg */
    double bound;                /* of u_n, m/s */
    double impulse[3], pressing; /* on a, N s; its part along n */
};

/* A ball near another surface: the part that is the same for any owner. */
struct gr_near_ball {
    double owner[3], other[3]; /* arms of the contact from the positions of its owner and of the other, m */
    double n[3], gap;          /* outward normal of the other */
};

/* A box as a body meets it. */
struct gr_near_box {
    const struct gr_obstacle *obstacle;
    double lower[3], upper[3], slack;
};

struct gr_rigid {
    int n_obstacles, n_boxes, bounces;
    struct gr_obstacle *obstacle;
    struct gr_near_box *box; /* of the obstacles near a body */
    double *ball;            /* n x 4: centre in coordinates of the body, and radius; m */
    int64_t *first_ball;     /* n_bodies + 1 */
    double *restitution;     /* n_bodies */
    double *slack;           /* n_bodies x (n_bodies + n_obstacles): overlap at the start, which counts as none, m;
                                infinite: the two do not touch each other */
    struct gr_near_ball *near;
    struct gr_rigid_contact *contact;
    int64_t n, capacity;
};

/* Description by the caller: balls (first_ball[n_bodies], 4), obstacles, and the restitution of each body. */
struct gr_rigid_config {
    int n_obstacles;
    const struct gr_obstacle *obstacle;
    const double *ball, *restitution;
    const int64_t *first_ball;
};

/* Let the free bodies of an engine, which are at their initial positions, touch solids; all is copied.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_rigid_new(struct gr_engine *e, const struct gr_rigid_config *config);
void gr_rigid_free(struct gr_rigid *rigid);

/* rigid.c: find the contacts of the step.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_rigid_find(struct gr_engine *e, const double g[3], const struct gr_moving *body);

/* rigid_impulse.c: the impacts with restitution, from the velocities in the middle of the step, and what of gravity is
 * still to come, g dt/2. */
void gr_rigid_bounce(struct gr_engine *e, const double g[3], struct gr_moving *body);

/* Velocity along a direction that a unit impulse along it gives a contact, 1/kg. */
double gr_rigid_mobility(const struct gr_rigid_contact *c, const struct gr_moving *body, const double n[3]);

/* Let the contacts of a step start without impulse. */
void gr_rigid_start(struct gr_engine *e);

/* Sweep over the contacts, at most so many times, until no velocity changes by more than `tolerance` times the largest that
 * an impulse makes.
 * Changed: largest, at least the latter.
 * Returned: the largest change of a velocity in the first sweep, m/s. */
double gr_rigid_sweep(struct gr_engine *e, int most, double tolerance, struct gr_moving *body, double *largest);
