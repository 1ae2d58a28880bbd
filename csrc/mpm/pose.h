/* Pose of a body: the transformation between coordinates of the scene and of the body. */
#pragma once

#include <math.h>
#include <string.h>

#include "body/turning.h"
#include "mpm/engine.h"

struct gr_pose {
    const struct gr_body *body;
    const struct gr_part *parts;
    double period[3]; /* m: the body is repeated with this period; 0 along an axis without images */
    double x[3], rotation[9];
    double inverse_inertia[9]; /* 1/(kg m^2), of a body that turns freely; only where gr_pose_now has set the pose */
};

static inline void gr_pose_at(const struct gr_engine *e, int b, const double x[3], const double orientation[4],
                              struct gr_pose *pose)
{
    pose->body = &e->config.bodies[b];
    pose->parts = e->config.parts + pose->body->first_part;
    memcpy(pose->x, x, sizeof pose->x);
    gr_rotation_matrix(orientation, pose->rotation);
    for (int d = 0; d < 3; d++) {
        const struct gr_axis *axis = &e->axis[d];
        pose->period[d] =
            d < e->config.dim && axis->periodic && 2 * pose->body->extent[d] <= axis->length ? axis->length : 0;
    }
}

/* The present pose of a body. */
static inline void gr_pose_now(const struct gr_engine *e, int b, struct gr_pose *pose)
{
    const struct gr_body_state *now = &e->bodies.now[b];
    gr_pose_at(e, b, now->x, now->orientation, pose);
    if (pose->body->turns) gr_inverse_inertia(pose->body, e->config.dim, now->orientation, pose->inverse_inertia);
}

/* Component d of the vector from the position of the nearest image of a body to x. */
static inline double gr_pose_arm(const struct gr_pose *pose, double x, int d)
{
    const double r = x - pose->x[d], period = pose->period[d];
    return period > 0 ? r - period * rint(r / period) : r;
}

static inline void gr_pose_in_body(const struct gr_pose *pose, const double r[3], double local[3])
{
    const double *q = pose->rotation;
    for (int d = 0; d < 3; d++) local[d] = q[d] * r[0] + q[3 + d] * r[1] + q[6 + d] * r[2];
}

static inline void gr_pose_in_space(const struct gr_pose *pose, const double local[3], double r[3])
{
    const double *q = pose->rotation;
    for (int d = 0; d < 3; d++) r[d] = q[3 * d] * local[0] + q[3 * d + 1] * local[1] + q[3 * d + 2] * local[2];
}

/* Signed distance of x from a body, and the normal in axes of the scene.
 * Set: arm, from the position of the body to x. */
static inline double gr_pose_distance(const struct gr_engine *e, const struct gr_pose *pose, const double x[3],
                                      double arm[3], double normal[3])
{
    double local[3], at[3];
    for (int d = 0; d < 3; d++) arm[d] = d < e->config.dim ? gr_pose_arm(pose, x[d], d) : 0;
    gr_pose_in_body(pose, arm, at);
    const double phi = gr_union_distance(pose->parts, pose->body->n_parts, at, local);
    gr_pose_in_space(pose, local, normal);
    return phi;
}

/* Position of a node; 0 along unused axes. */
static inline void gr_node_position(const struct gr_engine *e, int64_t node, double x[3])
{
    int64_t id = e->mesh.node_id[node];
    for (int d = 0; d < 3; d++) {
        const struct gr_axis *axis = &e->axis[d];
        x[d] = 0;
        if (d >= e->config.dim) continue;
        x[d] = axis->origin + axis->node_position[id % axis->n_nodes] * e->config.dx;
        id /= axis->n_nodes;
    }
}

/* Numbers of a node along each axis (axis.h); 0 along unused ones. */
static inline void gr_node_numbers(const struct gr_engine *e, int64_t node, int32_t at[3])
{
    int64_t id = e->mesh.node_id[node];
    for (int d = 0; d < 3; d++) {
        at[d] = 0;
        if (d >= e->config.dim) continue;
        at[d] = e->axis[d].node_number[id % e->axis[d].n_nodes];
        id /= e->axis[d].n_nodes;
    }
}

/* Centre of a cell. */
static inline void gr_cell_position(const struct gr_engine *e, const int32_t at[3], double x[3])
{
    for (int d = 0; d < 3; d++) {
        x[d] = 0;
        if (d < e->config.dim) x[d] = 0.5 * (e->axis[d].cell[at[d]].begin + e->axis[d].cell[at[d]].end);
    }
}
