/* Contact of rigid bodies with the nodes of the grid, and the motion of the bodies (contact.h). */
#include "mpm/contact.h"

#include "mpm/pose.h"
#include "mpm/migrate.h"
#include "mpm/walls.h"

enum { MAX_SWEEPS = 50 };

#define NO_CHANGE 1e-14 /* relative change of a velocity that is round-off */

/* A body during a step, with the velocities of the step. */
struct moving {
    struct gr_pose pose;
    int number;
    double v[3], omega[3];
};

/* Reaction of the nodes on a body: impulse, angular impulse, minus the derivative of the impulse with respect to the
 * velocity of the body, and the work on the nodes. */
struct sums {
    double impulse[3], angular[3], slope[3][3], work;
};

void gr_bodies_start(struct gr_engine *e)
{
    for (int b = 0; b < e->config.n_bodies; b++) {
        const struct gr_body *body = &e->config.bodies[b];
        struct gr_body_state *state = &e->body[b];
        double rates[6];
        memset(state, 0, sizeof *state);
        memcpy(state->x, body->position, sizeof state->x);
        memcpy(state->orientation, body->orientation, sizeof state->orientation);
        gr_motion_at(body, 0, rates);
        memcpy(state->v, rates, sizeof state->v);
        memcpy(state->omega, rates + 3, sizeof state->omega);
        e->body_next[b] = *state;
        memcpy(e->split[b].x, state->x, sizeof state->x);
        memcpy(e->split[b].orientation, state->orientation, sizeof state->orientation);
    }
}

static void place(const struct gr_engine *e, int b, struct moving *m)
{
    m->number = b;
    gr_pose_at(e, b, e->body[b].x, e->body[b].orientation, &m->pose);
}

/* The arm r = x - X from the nearest image of the body. */
static void arm(const struct gr_engine *e, const struct moving *m, const double x[3], double r[3])
{
    for (int d = 0; d < 3; d++) r[d] = d < e->config.dim ? gr_pose_arm(&m->pose, x[d], d) : 0;
}

/* True if a point lies in a body.
 * Returned: then also the normal, in axes of the scene. */
static int contains(const struct moving *m, const double r[3], double normal[3])
{
    const double bound = m->pose.body->bound;
    double local[3], at[3];
    if (r[0] * r[0] + r[1] * r[1] + r[2] * r[2] > bound * bound) return 0;
    gr_pose_in_body(&m->pose, r, at);
    if (!(gr_union_distance(m->pose.parts, m->pose.body->n_parts, at, local) < 0)) return 0;
    gr_pose_in_space(&m->pose, local, normal);
    return 1;
}

/* True if a node lies in the body. For a separated node of a thin part this includes all nodes behind the face of its
 * side.
 * Returned: also the arm r and the normal. */
static int is_within(const struct gr_engine *e, int64_t node, const struct moving *m, double r[3], double normal[3])
{
    double x[3];
    gr_node_position(e, node, x);
    arm(e, m, x, r);
    if (e->n_thin && e->mesh.duplicate[node] >= 0 && e->mesh.separated[node]) {
        struct gr_facing side;
        gr_nearest_thin(e, x, 1, &side);
        const double front = e->mesh.duplicate[node] > node ? 1 : -1;
        if (side.body == m->number && front * side.mid < side.half) {
            for (int d = 0; d < 3; d++) normal[d] = front * side.normal[d];
            return 1;
        } /* else the node may still lie in another part */
    }
    return contains(m, r, normal);
}

double gr_bodies_speed(const struct gr_engine *e)
{
    double fastest = 0;
    for (int b = 0; b < e->config.n_bodies; b++) {
        const struct gr_body *body = &e->config.bodies[b];
        const struct gr_body_state *now = &e->body[b];
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

/* Set the gr_inside bits of the two copies of a double cell. They are separated if its centre faces the thin part. */
static void mark_copies(int rough, const struct gr_facing *side, uint8_t *front, uint8_t *back)
{
    const int behind = side->mid < 0, beyond = rough ? GR_BEYOND_ROUGH : 0, body = *front & GR_INSIDE_BODY;
    if (side->facing) {
        *front = (uint8_t)(body | GR_SEPARATED | (behind ? beyond : 0));
        *back = (uint8_t)(body | GR_SEPARATED | GR_BEHIND | (behind ? 0 : beyond));
    } else {
        *front = (uint8_t)(body | (behind ? GR_BEHIND : 0));
        *back = GR_HIDDEN;
    }
}

void gr_bodies_mark(struct gr_engine *e, int64_t first, int64_t last)
{
    struct gr_fluidity *f = e->fluidity;
    for (int64_t c = first; c < last; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        struct gr_facing side;
        double x[3];
        if (cell->side == -1) continue; /* set with its front */
        uint8_t *inside = f->inside + gr_fluidity_place(f, gr_cell_id(e, cell->at), 0);
        *inside = cell->side < 0 ? GR_BEHIND : 0;
        gr_cell_position(e, cell->at, x);
        for (int b = 0; b < e->config.n_bodies; b++) {
            struct moving m;
            double r[3], normal[3];
            if (!e->config.bodies[b].rough) continue;
            place(e, b, &m);
            arm(e, &m, x, r);
            if (contains(&m, r, normal)) *inside |= GR_INSIDE_BODY;
        }
        if (cell->side != 1) continue;
        gr_nearest_thin(e, x, 1, &side);
        mark_copies(e->config.bodies[side.body].rough, &side, inside,
                    f->inside + gr_fluidity_place(f, gr_cell_id(e, cell->at), 1));
    }
}

void gr_bodies_find(struct gr_engine *e, int64_t first, int64_t last)
{
    if (first == last) return; /* without nodes there is no array */
    memset(e->touched + first, 0, (size_t)(last - first));
    for (int b = 0; b < e->config.n_bodies; b++) {
        struct moving m;
        place(e, b, &m);
        for (int64_t n = first; n < last; n++) {
            double r[3], normal[3];
            if (e->touched[n] || !(e->node_mass[n] > e->config.mass_cutoff)) continue;
            e->touched[n] = (uint8_t)is_within(e, n, &m, r, normal);
        }
    }
}

static void add_slope(struct sums *sums, double mass, const double n[3], int held)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) sums->slope[i][j] += mass * (held == 2 ? i == j : n[i] * n[j]);
}

/* Contact of one node. Components that a wall fixes stay fixed. The velocities are stored only if `keep` is set. */
static void touch(struct gr_engine *e, int64_t node, const struct moving *m, struct sums *sums, int keep)
{
    const int dim = e->config.dim;
    double r[3], n[3], v[3] = {0}, after[3], impulse[3] = {0};
    if (!is_within(e, node, m, r, n)) return;
    double *out = e->node_data + node * e->node_stride;
    const double *w = m->omega, mass = e->node_mass[node];
    const struct gr_wall *wall = gr_wall_now(e, e->mesh.node_code[node]);
    const double surface[3] = {m->v[0] + w[1] * r[2] - w[2] * r[1], m->v[1] + w[2] * r[0] - w[0] * r[2],
                               m->v[2] + w[0] * r[1] - w[1] * r[0]};
    memcpy(v, out, sizeof(double) * (size_t)dim);
    memcpy(after, v, sizeof v);
    const int held = gr_contact(m->pose.body, n, surface, after);
    if (!held) return;
    add_slope(sums, mass, n, held);
    for (int d = 0; d < dim; d++) {
        if (wall->fixed >> d & 1) after[d] = v[d];
        impulse[d] = -mass * (after[d] - v[d]);
        sums->impulse[d] += impulse[d];
        sums->work -= impulse[d] * after[d]; /* points are moved and strained by the velocity after contact */
        if (!keep) continue;
        out[d] = after[d];
        out[dim + d] += after[d] - v[d];
    }
    sums->angular[0] += r[1] * impulse[2] - r[2] * impulse[1];
    sums->angular[1] += r[2] * impulse[0] - r[0] * impulse[2];
    sums->angular[2] += r[0] * impulse[1] - r[1] * impulse[0];
}

static void touch_all(struct gr_engine *e, const struct moving *m, struct sums *sums, int keep)
{
    memset(sums, 0, sizeof *sums);
    for (int64_t n = 0; n < e->mesh.n_nodes; n++)
        if (e->touched[n]) touch(e, n, m, sums, keep);
}

/* Solve a x = b in the components of `free`, for a symmetric positive definite a; the other components of x are 0. */
static void solve(double a[3][3], double b[3], int free, double x[3])
{
    for (int i = 0; i < 3; i++) {
        if (!(free >> i & 1)) continue;
        for (int j = i + 1; j < 3; j++) {
            if (!(free >> j & 1)) continue;
            const double share = a[j][i] / a[i][i];
            for (int k = i; k < 3; k++) a[j][k] -= share * a[i][k];
            b[j] -= share * b[i];
        }
    }
    for (int i = 2; i >= 0; i--) {
        x[i] = 0;
        if (!(free >> i & 1)) continue;
        double rest = b[i];
        for (int j = i + 1; j < 3; j++) rest -= a[i][j] * x[j];
        x[i] = rest / a[i][i];
    }
}

/* Find the free velocity components after the step. Backward Euler, because contact is stiff for a light body. */
static void find_velocity(struct gr_engine *e, struct moving *m, const double before[3], const double g[3])
{
    const struct gr_body *body = m->pose.body;
    const double dt = e->dt, mass = body->mass;
    double scale = 0;
    for (int d = 0; d < 3; d++) {
        scale = fmax(scale, fabs(before[d]) + fabs(dt * g[d]));
        if (body->free >> d & 1) m->v[d] = before[d] + dt * g[d];
    }
    for (int sweep = 0; sweep < MAX_SWEEPS; sweep++) {
        struct sums sums;
        double rest[3], change[3], largest = 0;
        touch_all(e, m, &sums, 0);
        for (int d = 0; d < 3; d++) {
            rest[d] = sums.impulse[d] - mass * (m->v[d] - before[d] - dt * g[d]);
            sums.slope[d][d] += mass;
        }
        solve(sums.slope, rest, body->free, change);
        for (int d = 0; d < 3; d++) {
            m->v[d] += change[d];
            largest = fmax(largest, fabs(change[d]));
            scale = fmax(scale, fabs(m->v[d]));
        }
        if (!(largest > NO_CHANGE * scale)) return;
    }
}

static void touch_body(struct gr_engine *e, int b, const double g[3])
{
    const double dt = e->dt;
    const struct gr_body_state *now = &e->body[b];
    struct gr_body_state *next = &e->body_next[b];
    struct moving m;
    struct sums sums;
    double mean[6], end[6];
    place(e, b, &m);
    gr_motion_mean(m.pose.body, e->time, dt, mean);
    gr_motion_at(m.pose.body, e->time + dt, end);
    memcpy(m.v, mean, sizeof m.v);
    memcpy(m.omega, mean + 3, sizeof m.omega);
    if (m.pose.body->free) find_velocity(e, &m, now->v, g);
    touch_all(e, &m, &sums, 1);
    *next = *now;
    for (int d = 0; d < 3; d++) {
        const int free = m.pose.body->free >> d & 1;
        next->v[d] = free ? now->v[d] + sums.impulse[d] / m.pose.body->mass + dt * g[d] : end[d];
        next->x[d] = now->x[d] + dt * (free ? next->v[d] : mean[d]);
        next->omega[d] = end[3 + d];
        next->impulse[d] += sums.impulse[d];
        next->angular_impulse[d] += sums.angular[d];
    }
    next->work += sums.work;
    gr_turn(now->orientation, m.omega, dt, next->orientation);
}

void gr_bodies_touch(struct gr_engine *e, const double g[3])
{
    double gravity[3] = {0};
    memcpy(gravity, g, sizeof(double) * (size_t)e->config.dim);
    for (int b = 0; b < e->config.n_bodies; b++) touch_body(e, b, gravity);
}
