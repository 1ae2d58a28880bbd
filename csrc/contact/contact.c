/* Contact of the material with rigid bodies (contact.h). */
#include "contact/contact.h"

#include "contact/contact_points.h"
#include "contact/rigid.h"
#include "contact/shared_contacts.h"
#include "mpm/grid.h"
#include "mpm/numbers.h"
#include "mpm/wall_impulse.h"
#include "mpm/walls.h"

/* Sweeps end when the largest change of a velocity at a contact point in a sweep is this part of the largest that contact
 * makes in the step. Impulses start from the last step, so that few sweeps are enough; more do not change the forces by 0.1
 * %. */
#define TOLERANCE 1e-2
enum { LEAST_SWEEPS = 2, MOST_SWEEPS = 20 };

/* The contacts of bodies with solids are few: they are swept over several times for each sweep over the contact points, and
 * in the end until they hold closely, as they keep bodies from sinking into each other. */
#define RIGID_TOLERANCE 1e-8
enum { RIGID_INNER = 5, RIGID_SWEEPS = 100 };

/* Half of a vector of a node, which has a fourth component to be read as a whole. */
typedef double half __attribute__((vector_size(16), aligned(8)));

/* Velocity of the material at a contact point; v[3] = 0. */
static inline void velocity_at(const struct gr_contact_points *contacts, const struct gr_contact_point *contact, double v[4])
{
    half low = {0}, high = {0};
    for (int i = 0; i < contact->n_nodes; i++) {
        const half *node = (const half *)contacts->node[contact->node[i]].v;
        low += contact->weight[i] * node[0];
        high += contact->weight[i] * node[1];
    }
    ((half *)v)[0] = low, ((half *)v)[1] = high;
}

/* The same relative to the surface. */
static inline void slip(const struct gr_contact_points *contacts, const struct gr_contact_point *contact,
                        const struct gr_moving *m, double u[3])
{
    double v[4], surface[3];
    gr_velocity_of(m, contact->arm, surface);
    velocity_at(contacts, contact, v);
    for (int d = 0; d < 3; d++) u[d] = v[d] - surface[d];
}

/* Give the nodes about a contact point, and its body, a change of its impulse. */
static void push(struct gr_contact_points *contacts, const struct gr_contact_point *contact, const double impulse[3],
                 struct gr_moving *m)
{
    const half low = {impulse[0], impulse[1]}, high = {impulse[2], 0};
    gr_impel(m, contact->arm, (double[]){-impulse[0], -impulse[1], -impulse[2]});
    for (int i = 0; i < contact->n_nodes; i++) {
        struct gr_contact_node *node = &contacts->node[contact->node[i]];
        const half *mobility = (const half *)node->mobility;
        ((half *)node->v)[0] += contact->weight[i] * mobility[0] * low;
        ((half *)node->v)[1] += contact->weight[i] * mobility[1] * high;
    }
}

/* Change the impulse at a contact point so that it fulfils the conditions of contact by itself.
 * Changed: largest, at least the velocity that the impulse gives the contact point.
 * Returned: the velocity that its change gives the contact point, m/s. */
static double correct(struct gr_contact_points *contacts, struct gr_contact_point *contact, struct gr_moving *m,
                      double *largest)
{
    const struct gr_body *body = m->pose.body;
    const double *n = contact->normal;
    double u[3], tangential[3], change[3] = {0}, square = 0, changed = 0, whole = 0;
    slip(contacts, contact, m, u);
    const double along = u[0] * n[0] + u[1] * n[1] + u[2] * n[2];
    double pressing = contact->pressing + (contact->bound - along) / contact->normal_mobility;
    pressing = fmin(fmax(pressing, body->contact == GR_CONTACT_SEPARATING ? 0 : -contact->most), contact->most);
    for (int d = 0; d < 3; d++)
        tangential[d] = contact->impulse[d] - contact->pressing * n[d] - (u[d] - along * n[d]) / contact->mobility;
    for (int k = 0; k < contact->n_barred; k++) gr_take_away(tangential, contact->barred[k]);
    for (int d = 0; d < 3; d++) square += tangential[d] * tangential[d];
    const double most = body->contact == GR_CONTACT_STICKY ? contact->most : body->friction * fabs(pressing);
    const double keep = !(square > most * most) ? 1 : most / sqrt(square);
    for (int d = 0; d < 3; d++) {
        const double impulse = pressing * n[d] + keep * tangential[d];
        change[d] = impulse - contact->impulse[d];
        contact->impulse[d] = impulse;
        changed += change[d] * change[d], whole += impulse * impulse;
    }
    contact->pressing = pressing;
    push(contacts, contact, change, m);
    *largest = fmax(*largest, contact->mobility * sqrt(whole));
    return contact->mobility * sqrt(changed);
}

/* Share by which the impulse of a contact point that may pull approaches the mean one of its nodes in a step, and more by
 * the number of cells that its point crosses in the step. */
#define SMOOTHED 0.01

/* Forget impulses of contact points that may pull where they cancel at all nodes. Such impulses grow as points cross cells,
 * by a quarter in each cell, up to hundreds of times the weight of a bed, and their part that does not cancel is noise. The
 * mean at the nodes has none of them; it retains the sum, and the part that is uniform along a surface. */
static void forget_cancelling(const struct gr_engine *e, struct gr_contact_points *contacts)
{
    const int dim = e->config.dim;
    for (int64_t k = 0; k < contacts->n; k++) {
        const struct gr_contact_point *contact = &contacts->contact[k];
        if (e->config.bodies[contact->body].contact == GR_CONTACT_SEPARATING) continue;
        for (int i = 0; i < contact->n_nodes; i++) {
            struct gr_contact_origin *origin = &contacts->origin[contact->node[i]];
            for (int d = 0; d < dim; d++) origin->mean[d] += contact->weight[i] * contact->impulse[d];
            origin->weight += contact->weight[i];
        }
    }
    for (int64_t k = 0; k < contacts->n; k++) {
        struct gr_contact_point *contact = &contacts->contact[k];
        double mean[3] = {0};
        if (e->config.bodies[contact->body].contact == GR_CONTACT_SEPARATING) continue;
        for (int i = 0; i < contact->n_nodes; i++) {
            const struct gr_contact_origin *origin = &contacts->origin[contact->node[i]];
            for (int d = 0; d < dim; d++) mean[d] += contact->weight[i] * origin->mean[d] / origin->weight;
        }
        const double share = fmin(SMOOTHED + e->clock.dt * contact->speed / e->config.dx, 1);
        contact->pressing = 0;
        for (int d = 0; d < dim; d++) {
            contact->impulse[d] += share * (mean[d] - contact->impulse[d]);
            contact->pressing += contact->impulse[d] * contact->normal[d];
        }
    }
}

/* Undo the friction of the Coulomb walls of the nodes, which is computed again with contact: it acts against the sliding
 * that remains after it. Friction computed before would carry part of the load on a body next to the wall, or act backwards
 * where a body moves material against a pressure. */
static void undo_friction(struct gr_engine *e, const struct gr_kernels *kernels, const double g[3])
{
    for (int64_t k = 0; k < e->bodies.contacts->n_nodes; k++) {
        struct gr_contact_node *node = &e->bodies.contacts->node[k];
        struct gr_contact_origin *origin = &e->bodies.contacts->origin[k];
        const struct gr_wall *wall = gr_wall_now(e, origin->code);
        const int dim = e->config.dim;
        double v[3], next[3];
        for (int d = 0; d < dim; d++) origin->rubs |= wall->friction[d] > 0;
        if (!origin->rubs) continue;
        gr_grid_without_walls(e, kernels, origin->n, g, v, next);
        const int held = gr_holds(wall, dim, next);
        for (int d = 0; d < dim; d++) {
            if (held >> d & 1) origin->taken[d] = gr_taken(wall, d, gr_kept_at(e, origin->n), v, next);
            if (node->mobility[d] > 0) node->v[d] = next[d];
        }
    }
}

/* Add up the impulses of the contact points on components of nodes that walls hold. */
static void press_on_walls(struct gr_contact_points *contacts)
{
    for (int64_t k = 0; k < contacts->n_nodes; k++)
        memset(contacts->origin[k].pressed, 0, sizeof contacts->origin[k].pressed);
    for (int64_t k = 0; k < contacts->n; k++) {
        const struct gr_contact_point *contact = &contacts->contact[k];
        for (int i = 0; i < contact->n_nodes; i++) {
            struct gr_contact_origin *origin = &contacts->origin[contact->node[i]];
            for (int d = 0; origin->held && d < 3; d++)
                if (origin->held >> d & 1) origin->pressed[d] += contact->weight[i] * contact->impulse[d];
        }
    }
}

/* Change the friction of the wall of a node so that it fulfils the condition of Coulomb by itself.
 * Returned: the velocity that its change gives the node, m/s. */
static double rub(const struct gr_engine *e, struct gr_contact_node *node, struct gr_contact_origin *origin)
{
    const struct gr_wall *wall = gr_wall_now(e, origin->code);
    double wanted[3] = {0}, square = 0, changed = 0, most = 0;
    for (int d = 0; d < 3; d++) {
        if (node->mobility[d] > 0) wanted[d] = origin->friction[d] + node->v[d];
        most += gr_friction(wall, d, origin->taken[d] + origin->pressed[d] * origin->inverse_mass);
        square += wanted[d] * wanted[d];
    }
    const double keep = square > most * most ? most / sqrt(square) : 1;
    for (int d = 0; d < 3; d++) {
        const double change = keep * wanted[d] - origin->friction[d];
        origin->friction[d] += change;
        node->v[d] -= change;
        changed += change * change;
    }
    return sqrt(changed);
}

/* One sweep over all contact points and all Coulomb walls of their nodes, the contact points in the opposite order if
 * `back`, and some over the contacts of bodies with solids. `rubs`: whether there are such walls.
 * Changed: largest, at least the velocity that the impulse of any contact point gives it.
 * Returned: the largest change of a velocity, m/s. */
static double sweep(struct gr_engine *e, struct gr_contact_points *contacts, int back, int rubs, struct gr_moving *body,
                    double *largest)
{
    double changed = 0;
    for (int64_t k = 0; k < contacts->n; k++) {
        struct gr_contact_point *contact = &contacts->contact[back ? contacts->n - 1 - k : k];
        changed = fmax(changed, correct(contacts, contact, &body[contact->body], largest));
    }
    if (rubs) press_on_walls(contacts);
    for (int64_t k = 0; rubs && k < contacts->n_nodes; k++)
        if (contacts->origin[k].rubs) changed = fmax(changed, rub(e, &contacts->node[k], &contacts->origin[k]));
    if (e->bodies.rigid) changed = fmax(changed, gr_rigid_sweep(e, RIGID_INNER, TOLERANCE, body, largest));
    return changed;
}

/* Store the velocities of the nodes after contact, and what their walls take. */
static void store(struct gr_engine *e)
{
    const int dim = e->config.dim;
    for (int64_t k = 0; k < e->bodies.contacts->n_nodes; k++) {
        const struct gr_contact_node *node = &e->bodies.contacts->node[k];
        const struct gr_contact_origin *origin = &e->bodies.contacts->origin[k];
        const int joined = e->bodies.n_thin && e->mesh.duplicate[origin->n] >= 0 && !e->mesh.separated[origin->n];
        for (int copy = 0; copy <= joined; copy++) {
            const int64_t n = copy ? e->mesh.duplicate[origin->n] : origin->n;
            for (int d = 0; d < dim; d++) {
                gr_node_field(e, GR_NODE_VELOCITY + d)[n] = node->v[d];
                gr_node_field(e, GR_NODE_UPDATE(dim) + d)[n] += node->v[d] - origin->before[d];
                if (e->watch && origin->rubs && node->mobility[d] > 0)
                    e->watch->node[n * dim + d] = e->nodes.mass[n] * origin->friction[d];
                if (e->watch && !copy) e->watch->node[n * dim + d] += origin->pressed[d];
            }
        }
    }
}

/* Add the reaction of a contact point to its body: what its nodes received, and the walls that hold some of them. */
static void react(const struct gr_contact_points *contacts, const struct gr_contact_point *contact,
                  struct gr_body_state *next)
{
    const double *r = contact->arm;
    const double *given = contact->impulse;
    double u[4];
    velocity_at(contacts, contact, u);
    for (int d = 0; d < 3; d++) {
        next->impulse[d] -= given[d];
        next->work += given[d] * u[d]; /* points are moved and strained by the velocity after contact */
    }
    next->angular_impulse[0] -= r[1] * given[2] - r[2] * given[1];
    next->angular_impulse[1] -= r[2] * given[0] - r[0] * given[2];
    next->angular_impulse[2] -= r[0] * given[1] - r[1] * given[0];
}

/* Change of the velocity of a body along a free axis in the step, by gravity and the load from outside. */
static double fallen(const struct gr_engine *e, int b, const double g[3], int d)
{
    return e->clock.dt * (g[d] + e->bodies.now[b].load[d] / e->config.bodies[b].mass);
}

/* Start of the step for a body: the mean velocities of its motion, and a share of gravity and of the load from outside along
 * free axes. */
static void begin(struct gr_engine *e, int b, double share, const double g[3], struct gr_moving *m)
{
    double mean[6];
    const struct gr_body_state *now = &e->bodies.now[b];
    gr_pose_now(e, b, &m->pose);
    if (now->driven)
        memcpy(mean, now->drive, sizeof mean);
    else
        gr_motion_mean(m->pose.body, e->clock.time, e->clock.dt, mean);
    for (int d = 0; d < 3; d++) {
        m->v[d] = m->pose.body->free >> d & 1 ? now->v[d] + share * fallen(e, b, g, d) : mean[d];
        m->omega[d] = m->pose.body->turns ? now->omega[d] : mean[3 + d];
    }
    if (m->pose.body->turns)
        for (int d = 0; d < 3; d++)
            for (int k = 0; k < 3; k++) m->omega[d] += e->clock.dt * m->pose.inverse_inertia[3 * d + k] * now->load[3 + k];
}

static void end(struct gr_engine *e, int b, const struct gr_moving *m)
{
    double prescribed[6];
    const struct gr_body_state *now = &e->bodies.now[b];
    struct gr_body_state *next = &e->bodies.next[b];
    if (now->driven)
        memcpy(prescribed, now->drive, sizeof prescribed);
    else
        gr_motion_at(m->pose.body, e->clock.time + e->clock.dt, prescribed);
    for (int d = 0; d < 3; d++) {
        next->v[d] = m->pose.body->free >> d & 1 ? m->v[d] : prescribed[d];
        next->x[d] = now->x[d] + e->clock.dt * m->v[d];
        next->omega[d] = m->pose.body->turns ? m->omega[d] : prescribed[3 + d];
    }
    if (m->pose.body->turns)
        gr_turn_freely(m->pose.body, e->clock.dt, next->orientation, next->omega);
    else
        gr_turn(now->orientation, m->omega, e->clock.dt, next->orientation);
}

/* Start of the step for all bodies. With impacts, these see the velocities in the middle of the step: those that are stored
 * are of the middle between two steps, as x += dt v, and bounces would take energy otherwise, g dt/|v| of it each.
 * Returned: 0 or GR_ERR_MEMORY. */
static int begin_all(struct gr_engine *e, const double g[3], struct gr_moving *body)
{
    const int bounces = e->bodies.rigid && e->bodies.rigid->bounces;
    for (int b = 0; b < e->config.n_bodies; b++) begin(e, b, bounces ? 0.5 : 1, g, &body[b]);
    if (!e->bodies.rigid) return GR_OK;
    if (gr_rigid_find(e, g, body)) return GR_ERR_MEMORY;
    if (bounces) {
        gr_rigid_bounce(e, g, body);
        for (int b = 0; b < e->config.n_bodies; b++)
            for (int d = 0; d < 3; d++)
                if (body[b].pose.body->free >> d & 1) body[b].v[d] += 0.5 * fallen(e, b, g, d);
    }
    gr_rigid_start(e);
    return GR_OK;
}

/* Find the impulses of the contact points, and the motion of the bodies in the step.
 * Returned: 0 or GR_ERR_MEMORY. */
static int solve(struct gr_engine *e, struct gr_contact_points *contacts, const double g[3])
{
    struct gr_moving body[GR_MAX_BODIES];
    double changed = INFINITY, largest = 0;
    int rubs = 0;
    if (begin_all(e, g, body)) return GR_ERR_MEMORY;
    for (int64_t k = 0; k < contacts->n_nodes; k++) rubs |= contacts->origin[k].rubs;
    forget_cancelling(e, contacts);
    for (int64_t k = 0; k < contacts->n; k++)
        push(contacts, &contacts->contact[k], contacts->contact[k].impulse, &body[contacts->contact[k].body]);
    for (int made = 0; made < MOST_SWEEPS && (made < LEAST_SWEEPS || changed > TOLERANCE * largest); made++)
        changed = sweep(e, contacts, made % 2, rubs, body, &largest);
    if (e->bodies.rigid) (void)gr_rigid_sweep(e, RIGID_SWEEPS, RIGID_TOLERANCE, body, &largest);
    if (e->watch) press_on_walls(contacts);
    for (int b = 0; b < e->config.n_bodies; b++) e->bodies.next[b] = e->bodies.now[b];
    for (int64_t k = 0; k < contacts->n; k++) {
        const struct gr_contact_point *contact = &contacts->contact[k];
        react(contacts, contact, &e->bodies.next[contact->body]);
    }
    for (int b = 0; b < e->config.n_bodies; b++) end(e, b, &body[b]);
    return GR_OK;
}

int gr_bodies_touch(struct gr_engine *e, const struct gr_kernels *kernels, const double g[3], struct gr_team *team)
{
    double gravity[3] = {0};
    memcpy(gravity, g, sizeof(double) * (size_t)e->config.dim);
    gr_find_contact_points(e, gravity, team);
    undo_friction(e, kernels, gravity);
    int error = gr_gather_contacts(e);
    struct gr_contact_points *all = gr_all_contacts(e);
    if (!error && all) error = solve(e, all, gravity);
    error = gr_scatter_contacts(e, error);
    if (error) return error;
    store(e);
    gr_store_contact_forces(e);
    return GR_OK;
}
