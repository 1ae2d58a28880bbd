/* Thin bodies: which parts are thin, and poses that follow bodies (thin_bodies.h). */
#include "mpm/thin_bodies.h"

#include "mpm/pose.h"

/* A part is thin if an edge of it is shorter than this, in cells: points at its two faces then share a node. */
static double thin_cells(const struct gr_config *config) { return config->basis == GR_LINEAR ? 2 : 3; }

/* Bodies may move so far, in cells, before the split follows. */
#define FOLLOW 1.0

/* Axis across a thin part; -1 if the part is not thin. What operations make of a box is not one. */
static int axis_across(const struct gr_config *config, const struct gr_body *body, int number)
{
    const struct gr_part *part = &config->parts[number], *first = &config->parts[body->first_part];
    int axis = 0;
    if (part->kind != GR_PART_BOX || part->inside) return -1;
    if (!gr_part_is_whole(first, body->n_parts, number - body->first_part)) return -1;
    for (int d = 1; d < config->dim; d++)
        if (part->size[d] < part->size[axis]) axis = d;
    return 2 * part->size[axis] < thin_cells(config) * config->dx * (1 - 1e-9) ? axis : -1;
}

int gr_list_thin(const struct gr_config *config, struct gr_thin_part *thin)
{
    int n = 0;
    if (config->smoothed || config->cell_averaged || config->xpic_order) return 0;
    for (int b = 0; b < config->n_bodies; b++) {
        const struct gr_body *body = &config->bodies[b];
        double middle[3] = {0};
        for (int k = 0; k < body->n_parts; k++)
            for (int d = 0; d < 3; d++) middle[d] += config->parts[body->first_part + k].center[d] / body->n_parts;
        for (int k = body->first_part; k < body->first_part + body->n_parts; k++) {
            const struct gr_part *part = &config->parts[k];
            const int axis = axis_across(config, body, k);
            double out = 0;
            if (axis < 0) continue;
            for (int d = 0; d < 3; d++) out += (part->center[d] - middle[d]) * part->rotation[3 * d + axis];
            if (thin) thin[n] = (struct gr_thin_part){b, k, axis, out < 0 ? -1 : 1};
            n++;
        }
    }
    return n;
}

double gr_body_moved(const struct gr_engine *e, int b, const struct gr_split_pose *pose)
{
    const struct gr_body_state *now = &e->bodies.now[b];
    const struct gr_body *body = &e->config.bodies[b];
    const double *p = pose->orientation, *q = now->orientation;
    double moved = 0, far = 0;
    for (int d = 0; d < 3; d++) moved += (now->x[d] - pose->x[d]) * (now->x[d] - pose->x[d]);
    for (int d = 0; d < e->config.dim; d++) far += e->axis[d].length * e->axis[d].length;
    /* axis of the rotation since then, in axes of the body, times the sine of half its angle */
    const double axis[3] = {p[0] * q[1] - p[1] * q[0] - p[2] * q[3] + p[3] * q[2],
                            p[0] * q[2] - p[2] * q[0] - p[3] * q[1] + p[1] * q[3],
                            p[0] * q[3] - p[3] * q[0] - p[1] * q[2] + p[2] * q[1]};
    const double sine = fmin(1, sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]));
    const int same = !(sine > 0) || gr_union_is_round(e->config.parts + body->first_part, body->n_parts, axis);
    return sqrt(moved) + (same ? 0 : 2 * asin(sine) * fmin(body->bound, sqrt(far)));
}

int gr_follow_body(struct gr_engine *e, int b, double far)
{
    const struct gr_body_state *now = &e->bodies.now[b];
    struct gr_split_pose *split = &e->bodies.split[b];
    if (!(gr_body_moved(e, b, split) > far)) return 0;
    memcpy(split->x, now->x, sizeof split->x);
    memcpy(split->orientation, now->orientation, sizeof split->orientation);
    return 1;
}

int gr_follow_bodies(struct gr_engine *e)
{
    int followed = 0;
    for (int k = 0; k < e->bodies.n_thin; k++) followed |= gr_follow_body(e, e->bodies.thin[k].body, FOLLOW * e->config.dx);
    return followed;
}
