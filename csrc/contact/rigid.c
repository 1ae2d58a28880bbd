/* Contacts of rigid bodies: where they are (rigid.h). */
#include "contact/rigid.h"

#include "body/vector.h"
#include "core/memory.h"

/* Largest decrease of a gap in a step beyond the one by the speeds, in cells: the material may push a light body. */
#define SPARE 0.05

/* Balls of a body that touch another one: the nearest, then those farthest from them. In 2D two ends hold an edge, in 3D
 * four corners a face; the nearest may be between them. */
enum { MOST_2D = 3, MOST_3D = 6 };

/* Contacts for which there is memory at first; there is more when a step has more. */
enum { FIRST_CAPACITY = 1024 };

/* Pairs that overlap by more than this at the start, in cells, do not touch each other. */
#define OVERLAP 0.5

/* Distances to test whether a face of a box continues in another box, in cells. */
#define FLUSH 1e-3

static int is_endless(const struct gr_near_box *box, int d)
{
    return box->lower[d] < -0.5 * GR_FAR || box->upper[d] > 0.5 * GR_FAR;
}

/* Signed distance of x from a box, and the outward normal. */
static double box_distance(const struct gr_engine *e, const struct gr_near_box *box, const double x[3], double n[3])
{
    double beyond[3] = {0}, sign[3] = {1, 1, 1}, square = 0;
    int farthest = 0;
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        double below = box->lower[d] - x[d], above = x[d] - box->upper[d];
        if (axis->periodic && !is_endless(box, d)) {
            const double half = 0.5 * (box->upper[d] - box->lower[d]), from = x[d] - box->lower[d] - half;
            above = from - axis->length * rint(from / axis->length) - half;
            below = -above - 2 * half;
        }
        beyond[d] = fmax(below, above), sign[d] = below > above ? -1 : 1;
        if (beyond[d] > beyond[farthest]) farthest = d;
        if (beyond[d] > 0) square += beyond[d] * beyond[d];
    }
    const double distance = square > 0 ? sqrt(square) : beyond[farthest];
    for (int d = 0; d < 3; d++) n[d] = 0;
    for (int d = 0; square > 0 && d < e->config.dim; d++)
        if (beyond[d] > 0) n[d] = sign[d] * beyond[d] / distance;
    if (!(square > 0)) n[farthest] = sign[farthest];
    return distance;
}

/* A box as the body at x meets it. */
static struct gr_near_box box_at(const struct gr_engine *e, const struct gr_obstacle *o, const double x[3])
{
    struct gr_near_box box = {.obstacle = o};
    memcpy(box.lower, o->lower, sizeof box.lower);
    memcpy(box.upper, o->upper, sizeof box.upper);
    if (o->axis < 0) return box;
    const struct gr_axis *axis = &e->axis[o->axis];
    double from = x[o->axis] - o->lower[o->axis];
    if (axis->periodic) from -= axis->length * rint(from / axis->length);
    if (from < 0)
        box.upper[o->axis] += e->config.dx;
    else
        box.lower[o->axis] -= e->config.dx;
    return box;
}

/* True if another box goes on where a face of box k begins: its surface at x, with the normal n, is no obstacle. There the
 * other box reaches up to x, and this one not beyond its surface. */
static int is_flush(const struct gr_engine *e, int k, const double x[3], const double n[3])
{
    const struct gr_rigid *rigid = e->bodies.rigid;
    const double step = FLUSH * e->config.dx;
    double next[3], up[3], beyond[3], unused[3];
    for (int d = 0; d < 3; d++) next[d] = x[d] + step * n[d];
    for (int other = 0; other < rigid->n_boxes; other++) {
        if (other == k || box_distance(e, &rigid->box[other], next, up) > 0.1 * step) continue;
        for (int d = 0; d < 3; d++) beyond[d] = x[d] + step * (up[d] - n[d]);
        if (box_distance(e, &rigid->box[k], beyond, unused) > 0.1 * step) return 1;
    }
    return 0;
}

/* The pair of a body with something, and the distance within which they may touch in this step. Impulses act where the
 * surfaces meet; before they do, on the surface of the body that can be moved, or between both. */
struct pair {
    int owner;                 /* of the balls */
    double slack, near, share; /* of the gap between the ball and the point where the impulse acts */
};

/* Note a ball, with the centre at `owner` and the radius r, at the distance phi from the other surface.
 * Returned: whether it is near. */
static int take(const struct pair *pair, double phi, double r, struct gr_near_ball *ball)
{
    const double to_place = r + pair->share * (phi - r);
    ball->gap = phi - r + pair->slack;
    for (int d = 0; d < 3; d++) {
        ball->owner[d] -= to_place * ball->n[d];
        ball->other[d] -= to_place * ball->n[d];
    }
    return ball->gap < pair->near;
}

/* The balls of the owner that are near body b or, if b is -1, near the box number k. */
static int64_t near_balls(const struct gr_engine *e, const struct pair *pair, const struct gr_moving *body, int b, int k)
{
    const struct gr_rigid *rigid = e->bodies.rigid;
    const struct gr_pose *pose = &body[pair->owner].pose;
    int64_t n = 0;
    for (int64_t j = rigid->first_ball[pair->owner]; j < rigid->first_ball[pair->owner + 1]; j++) {
        const double *centre = rigid->ball + 4 * j;
        struct gr_near_ball *ball = &rigid->near[n];
        double x[3];
        gr_pose_in_space(pose, centre, ball->owner);
        for (int d = 0; d < 3; d++) x[d] = pose->x[d] + ball->owner[d], ball->other[d] = 0;
        const double phi = b < 0 ? box_distance(e, &rigid->box[k], x, ball->n)
                                 : gr_pose_distance(e, &body[b].pose, x, ball->other, ball->n);
        if (phi - centre[3] + pair->slack >= pair->near) continue;
        for (int d = 0; d < 3; d++) x[d] -= phi * ball->n[d];
        if (b >= 0 || !is_flush(e, k, x, ball->n)) n += take(pair, phi, centre[3], ball);
    }
    return n;
}

/* Choose the nearest of n balls, then in turn the one that is farthest from those already chosen.
 * Returned: how many, `wanted` at most. */
static int64_t spread(struct gr_near_ball *ball, int64_t n, int64_t wanted)
{
    int64_t n_chosen = 0;
    while (n_chosen < n && n_chosen < wanted) {
        int64_t best = n_chosen;
        double most = -1;
        for (int64_t k = n_chosen; k < n; k++) {
            double least = INFINITY;
            for (int64_t j = 0; j < n_chosen; j++) {
                double square = 0;
                for (int d = 0; d < 3; d++)
                    square += (ball[k].owner[d] - ball[j].owner[d]) * (ball[k].owner[d] - ball[j].owner[d]);
                least = fmin(least, square);
            }
            const int better = n_chosen ? least > most : ball[k].gap < ball[best].gap;
            if (better) best = k, most = least;
        }
        const struct gr_near_ball next = ball[best];
        ball[best] = ball[n_chosen];
        ball[n_chosen++] = next;
    }
    return n_chosen;
}

static double friction_of(const struct gr_body *body)
{
    return body->contact == GR_CONTACT_STICKY ? INFINITY : body->friction;
}

/* Make contacts of the n near balls of body `a` with b or an obstacle; `reverse`: the balls belong to b. */
static int add(struct gr_engine *e, const struct gr_moving *body, int a, int b, const struct gr_obstacle *o, int reverse,
               int64_t n)
{
    struct gr_rigid *rigid = e->bodies.rigid;
    n = spread(rigid->near, n, e->config.dim == 2 ? MOST_2D : MOST_3D);
    if (rigid->n + n > rigid->capacity) {
        const int64_t more = 2 * (rigid->n + n);
        rigid->capacity = 0;
        GR_RESIZE(rigid->contact, more);
        rigid->capacity = more;
    }
    for (int64_t k = 0; k < n; k++) {
        const struct gr_near_ball *ball = &rigid->near[k];
        struct gr_rigid_contact c = {.a = a, .b = b, .gap = ball->gap, .restitution = rigid->restitution[a]};
        c.friction = fmin(friction_of(body[a].pose.body), o ? o->friction : friction_of(body[b].pose.body));
        if (!o && gr_can_be_moved(body[b].pose.body)) c.restitution = fmin(c.restitution, rigid->restitution[b]);
        if (o) memcpy(c.velocity, o->velocity, sizeof c.velocity);
        memcpy(c.arm_a, reverse ? ball->other : ball->owner, sizeof c.arm_a);
        memcpy(c.arm_b, reverse ? ball->owner : ball->other, sizeof c.arm_b);
        for (int d = 0; d < 3; d++) c.n[d] = reverse ? -ball->n[d] : ball->n[d];
        c.mobility = gr_rigid_mobility(&c, body, c.n);
        if (c.mobility > 0) rigid->contact[rigid->n++] = c;
    }
    return GR_OK;
}

static int64_t count(const struct gr_rigid *rigid, int b) { return rigid->first_ball[b + 1] - rigid->first_ball[b]; }

/* True if a single ball is all of a body. */
static int is_ball(const struct gr_rigid *rigid, int b)
{
    return count(rigid, b) == 1 && rigid->ball[4 * rigid->first_ball[b] + 3] > 0;
}

/* Contacts of body a with b: the balls of both, or of one that is a ball alone. */
static int touch_body(struct gr_engine *e, const struct gr_moving *body, int a, int b, double slack, double near)
{
    struct gr_rigid *rigid = e->bodies.rigid;
    double arm[3], n[3];
    const struct gr_moving *A = &body[a], *B = &body[b];
    if (gr_pose_distance(e, &B->pose, A->pose.x, arm, n) > A->pose.body->bound + near) return GR_OK;
    if (gr_pose_distance(e, &A->pose, B->pose.x, arm, n) > B->pose.body->bound + near) return GR_OK;
    const int moves = gr_can_be_moved(B->pose.body);
    int error = GR_OK;
    if (is_ball(rigid, a) || !is_ball(rigid, b))
        error = add(e, body, a, b, NULL, 0, near_balls(e, &(struct pair){a, slack, near, moves ? 0.5 : 0}, body, b, -1));
    if (!error && !is_ball(rigid, a))
        error = add(e, body, a, b, NULL, 1, near_balls(e, &(struct pair){b, slack, near, moves ? 0.5 : 1}, body, a, -1));
    return error;
}

/* List the obstacles near a body. */
static void list_boxes(struct gr_engine *e, const struct gr_moving *m, int a, double near)
{
    struct gr_rigid *rigid = e->bodies.rigid;
    rigid->n_boxes = 0;
    for (int k = 0; k < rigid->n_obstacles; k++) {
        struct gr_near_box *box = &rigid->box[rigid->n_boxes];
        double n[3];
        *box = box_at(e, &rigid->obstacle[k], m->pose.x);
        box->slack = rigid->slack[(int64_t)a * (e->config.n_bodies + rigid->n_obstacles) + e->config.n_bodies + k];
        if (!(e->clock.time < box->obstacle->opens_at) || !(box->slack < INFINITY)) continue;
        rigid->n_boxes += box_distance(e, box, m->pose.x, n) < m->pose.body->bound + near;
    }
}

/* All contacts of body a, of pairs that both can be moved only with those after it. */
static int touch_all(struct gr_engine *e, const struct gr_moving *body, int a, double near)
{
    struct gr_rigid *rigid = e->bodies.rigid;
    int error = GR_OK;
    list_boxes(e, &body[a], a, near);
    for (int k = 0; k < rigid->n_boxes && !error; k++) {
        const struct pair pair = {a, rigid->box[k].slack, near, 0};
        error = add(e, body, a, -1, rigid->box[k].obstacle, 0, near_balls(e, &pair, body, -1, k));
    }
    for (int b = 0; b < e->config.n_bodies && !error; b++) {
        const double slack = rigid->slack[(int64_t)a * (e->config.n_bodies + rigid->n_obstacles) + b];
        if (b == a || (b < a && gr_can_be_moved(body[b].pose.body)) || !(slack < INFINITY)) continue;
        error = touch_body(e, body, a, b, slack, near);
    }
    return error;
}

int gr_rigid_find(struct gr_engine *e, const double g[3], const struct gr_moving *body)
{
    int error = GR_OK;
    const double fall = sqrt(gr_dot(g, g)) * e->clock.dt;
    const double near = SPARE * e->config.dx + 2 * e->clock.dt * (2 * gr_bodies_speed(e) + 2 * fall);
    e->bodies.rigid->n = 0;
    for (int a = 0; a < e->config.n_bodies && !error; a++)
        if (gr_can_be_moved(body[a].pose.body)) error = touch_all(e, body, a, near);
    return error;
}

/* ---- Beginning and end ---- */

/* Overlap of each free body with all that is solid at the start. */
static void measure_slack(struct gr_engine *e)
{
    struct gr_rigid *rigid = e->bodies.rigid;
    struct gr_moving body[GR_MAX_BODIES] = {0};
    const int row = e->config.n_bodies + rigid->n_obstacles;
    for (int b = 0; b < e->config.n_bodies; b++)
        gr_pose_at(e, b, e->config.bodies[b].position, e->config.bodies[b].orientation, &body[b].pose);
    for (int a = 0; a < e->config.n_bodies; a++) {
        if (!gr_can_be_moved(body[a].pose.body)) continue;
        list_boxes(e, &body[a], a, 0);
        for (int other = 0, k = 0; other < row; other++) {
            const int is_box = other >= e->config.n_bodies;
            int64_t n = 0;
            double least = 0;
            if (is_box && (k == rigid->n_boxes || rigid->box[k].obstacle != &rigid->obstacle[other - e->config.n_bodies]))
                continue;
            const struct pair pair = {a, 0, 0, 0}, reverse = {other, 0, 0, 0};
            if (is_box) n = near_balls(e, &pair, body, -1, k++);
            if (!is_box && other != a) n = near_balls(e, &pair, body, other, -1);
            for (int64_t j = 0; j < n; j++) least = fmin(least, rigid->near[j].gap);
            if (!is_box && other != a && !is_ball(rigid, a)) n = near_balls(e, &reverse, body, a, -1);
            for (int64_t j = 0; j < n; j++) least = fmin(least, rigid->near[j].gap);
            rigid->slack[(int64_t)a * row + other] = least < -OVERLAP * e->config.dx ? INFINITY : -least;
        }
    }
}

static int build(struct gr_engine *e, const struct gr_rigid_config *c)
{
    struct gr_rigid *rigid = e->bodies.rigid;
    const size_t bodies = (size_t)e->config.n_bodies, obstacles = (size_t)c->n_obstacles;
    const int64_t balls = c->first_ball[bodies];
    int64_t most = 0;
    rigid->n_obstacles = c->n_obstacles;
    GR_RESIZE(rigid->obstacle, obstacles + 1);
    GR_RESIZE(rigid->box, obstacles + 1);
    GR_RESIZE(rigid->ball, 4 * balls + 1);
    GR_RESIZE(rigid->first_ball, bodies + 1);
    GR_RESIZE(rigid->restitution, bodies);
    memcpy(rigid->obstacle, c->obstacle, sizeof *c->obstacle * obstacles);
    memcpy(rigid->ball, c->ball, sizeof *c->ball * 4 * (size_t)balls);
    memcpy(rigid->first_ball, c->first_ball, sizeof *c->first_ball * (bodies + 1));
    memcpy(rigid->restitution, c->restitution, sizeof *c->restitution * bodies);
    for (int b = 0; b < e->config.n_bodies; b++) {
        most = count(rigid, b) > most ? count(rigid, b) : most;
        rigid->bounces |= c->restitution[b] > 0;
    }
    GR_RESIZE(rigid->near, most + 1);
    GR_RESIZE(rigid->contact, FIRST_CAPACITY);
    rigid->capacity = FIRST_CAPACITY;
    rigid->slack = gr_calloc(bodies * (bodies + obstacles), sizeof *rigid->slack);
    return rigid->slack ? GR_OK : GR_ERR_MEMORY;
}

int gr_rigid_new(struct gr_engine *e, const struct gr_rigid_config *config)
{
    gr_rigid_free(e->bodies.rigid);
    e->bodies.rigid = gr_calloc(1, sizeof *e->bodies.rigid);
    const int error = e->bodies.rigid ? build(e, config) : GR_ERR_MEMORY;
    if (!error) measure_slack(e);
    if (error) gr_rigid_free(e->bodies.rigid), e->bodies.rigid = NULL;
    return error;
}

void gr_rigid_free(struct gr_rigid *rigid)
{
    if (!rigid) return;
    gr_free(rigid->obstacle);
    gr_free(rigid->box);
    gr_free(rigid->ball);
    gr_free(rigid->first_ball);
    gr_free(rigid->restitution);
    gr_free(rigid->slack);
    gr_free(rigid->near);
    gr_free(rigid->contact);
    gr_free(rigid);
}
