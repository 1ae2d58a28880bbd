/* Impulses at the contacts of rigid bodies (rigid.h). */
#include "body/vector.h"
#include "contact/rigid.h"

/* Overlaps are undone in so many steps, as if they were at most so many cells. They come of the rotation within a step, and
 * are of the order of dt^2. */
#define OUT_STEPS 50
#define MOST_OUT 0.1

/* Sweeps of an impact, and their tolerance. */
#define TOLERANCE 1e-12
enum { MOST_SWEEPS = 100 };

/* Velocity of body a relative to b at a contact. */
static void relative(const struct gr_rigid_contact *c, const struct gr_moving *body, double u[3])
{
    double other[3];
    gr_velocity_of(&body[c->a], c->arm_a, u);
    if (c->b >= 0) gr_velocity_of(&body[c->b], c->arm_b, other);
    for (int d = 0; d < 3; d++) u[d] -= c->b >= 0 ? other[d] : c->velocity[d];
}

static void push(struct gr_rigid_contact *c, const double impulse[3], struct gr_moving *body)
{
    const double opposite[3] = {-impulse[0], -impulse[1], -impulse[2]};
    gr_impel(&body[c->a], c->arm_a, impulse);
    if (c->b >= 0) gr_impel(&body[c->b], c->arm_b, opposite);
}

static double mobility_of(const struct gr_moving *m, const double arm[3], const double n[3])
{
    const struct gr_body *body = m->pose.body;
    double mobility = body->turns ? gr_turning_mobility(m->pose.inverse_inertia, arm, n) : 0;
    for (int d = 0; d < 3; d++)
        if (body->free >> d & 1) mobility += n[d] * n[d] / body->mass;
    return mobility;
}

double gr_rigid_mobility(const struct gr_rigid_contact *c, const struct gr_moving *body, const double n[3])
{
    return mobility_of(&body[c->a], c->arm_a, n) + (c->b >= 0 ? mobility_of(&body[c->b], c->arm_b, n) : 0);
}

/* Change the impulse of a contact so that it fulfils its conditions by itself: first along the normal, then along the
 * sliding that is left. Both minimise the kinetic energy in the set that the conditions allow.
 * Returned: the change of a velocity, m/s. */
static double correct(struct gr_rigid_contact *c, struct gr_moving *body, double *largest)
{
    double u[3], change[3], wanted[3], square = 0, slip = 0;
    relative(c, body, u);
    const double pressing = fmax(c->pressing + (c->bound - gr_dot(u, c->n)) / c->mobility, 0);
    double changed = fabs(pressing - c->pressing) * c->mobility;
    for (int d = 0; d < 3; d++) {
        change[d] = (pressing - c->pressing) * c->n[d];
        c->impulse[d] += change[d];
    }
    c->pressing = pressing;
    push(c, change, body);
    *largest = fmax(*largest, pressing * c->mobility);
    if (!(c->friction > 0)) return changed;
    relative(c, body, u);
    const double along = gr_dot(u, c->n);
    for (int d = 0; d < 3; d++) u[d] -= along * c->n[d], slip += u[d] * u[d];
    slip = sqrt(slip);
    if (slip > 0)
        for (int d = 0; d < 3; d++) u[d] /= slip;
    const double mobility = slip > 0 ? gr_rigid_mobility(c, body, u) : 0;
    for (int d = 0; d < 3; d++) {
        wanted[d] = c->impulse[d] - pressing * c->n[d] - (mobility > 0 ? slip / mobility * u[d] : 0);
        square += wanted[d] * wanted[d];
    }
    const double most = pressing > 0 ? c->friction * pressing : 0;
    const double keep = square > most * most ? most / sqrt(square) : 1;
    double moved = 0;
    for (int d = 0; d < 3; d++) {
        const double impulse = pressing * c->n[d] + keep * wanted[d];
        change[d] = impulse - c->impulse[d];
        c->impulse[d] = impulse;
        moved += change[d] * change[d];
    }
    push(c, change, body);
    *largest = fmax(*largest, slip);
    return fmax(changed, sqrt(moved) * fmax(mobility, c->mobility));
}

double gr_rigid_sweep(struct gr_engine *e, int most, double tolerance, struct gr_moving *body, double *largest)
{
    struct gr_rigid *rigid = e->bodies.rigid;
    double first = 0, changed = INFINITY, scale = *largest;
    for (int made = 0; made < most && changed > tolerance * scale; made++) {
        changed = 0;
        for (int64_t k = 0; k < rigid->n; k++) {
            struct gr_rigid_contact *c = &rigid->contact[made % 2 ? rigid->n - 1 - k : k];
            if (c->closing) changed = fmax(changed, correct(c, body, &scale));
        }
        if (!made) first = changed;
    }
    *largest = scale;
    return first;
}

/* Let contacts that act on each other, through bodies that can be moved, have the least restitution of them. */
static void share_restitution(struct gr_rigid *rigid, const struct gr_moving *body)
{
    double least[GR_MAX_BODIES];
    int changes = 1;
    for (int b = 0; b < GR_MAX_BODIES; b++) least[b] = 1;
    while (changes) {
        changes = 0;
        for (int64_t k = 0; k < rigid->n; k++) {
            struct gr_rigid_contact *c = &rigid->contact[k];
            if (!(c->closing && c->pressing > 0)) continue;
            const int moves = c->b >= 0 && gr_can_be_moved(body[c->b].pose.body);
            const double e = fmin(c->restitution, fmin(least[c->a], moves ? least[c->b] : 1));
            changes |= e < c->restitution || e < least[c->a] || (moves && e < least[c->b]);
            c->restitution = least[c->a] = e;
            if (moves) least[c->b] = e;
        }
    }
}

void gr_rigid_bounce(struct gr_engine *e, const double g[3], struct gr_moving *body)
{
    struct gr_rigid *rigid = e->bodies.rigid;
    double largest = 0;
    for (int64_t k = 0; k < rigid->n; k++) {
        struct gr_rigid_contact *c = &rigid->contact[k];
        double u[3], into = 0;
        relative(c, body, u);
        for (int d = 0; d < 3; d++) {
            const int falls = (body[c->a].pose.body->free >> d & 1) - (c->b >= 0 && body[c->b].pose.body->free >> d & 1);
            into -= c->n[d] * (u[d] + 0.5 * e->clock.dt * g[d] * falls);
        }
        c->closing = gr_dot(u, c->n) < 0 && e->clock.dt * into > c->gap;
        c->bound = 0;
    }
    gr_rigid_sweep(e, MOST_SWEEPS, TOLERANCE, body, &largest);
    share_restitution(rigid, body);
    for (int64_t k = 0; k < rigid->n; k++) {
        struct gr_rigid_contact *c = &rigid->contact[k];
        double more[3];
        for (int d = 0; d < 3; d++) more[d] = c->restitution * c->impulse[d];
        if (c->closing) push(c, more, body);
    }
}

void gr_rigid_start(struct gr_engine *e)
{
    for (int64_t k = 0; k < e->bodies.rigid->n; k++) {
        struct gr_rigid_contact *c = &e->bodies.rigid->contact[k];
        c->closing = 1;
        c->bound = c->gap > 0 ? -c->gap / e->clock.dt : fmin(-c->gap, MOST_OUT * e->config.dx) / (OUT_STEPS * e->clock.dt);
        c->pressing = 0;
        memset(c->impulse, 0, sizeof c->impulse);
    }
}
