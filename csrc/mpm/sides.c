/* The sides of thin bodies: which cells, nodes and points are on which (thin_bodies.h). Threads of a device ask, too. */
#include "mpm/pose.h"
#include "mpm/thin_bodies.h"

/* Cells nearer than this to a thin part are double, in cells. Points of one side reach nodes of the other from a
 * distance of sqrt(3) at most, and bodies may move by one cell before the split follows. */
#define REACH 2.75

/* Position of x relative to one thin part. */
static void look(const struct gr_engine *e, const struct gr_thin_part *thin, const struct gr_pose *pose, const double x[3],
                 struct gr_facing *side)
{
    const struct gr_part *part = &e->config.parts[thin->part];
    const double *p = part->rotation;
    double r[3] = {0}, local[3], y[3], across[3], square = 0;
    for (int d = 0; d < e->config.dim; d++) r[d] = gr_pose_arm(pose, x[d], d);
    gr_pose_in_body(pose, r, local);
    for (int d = 0; d < 3; d++) local[d] -= part->center[d];
    for (int j = 0; j < 3; j++) y[j] = p[j] * local[0] + p[3 + j] * local[1] + p[6 + j] * local[2];
    side->facing = 1;
    side->inset = INFINITY;
    for (int j = 0; j < 3; j++) {
        const double beyond = fabs(y[j]) - part->size[j];
        if (j == thin->axis) continue;
        side->inset = fmin(side->inset, -beyond);
        if (!(beyond > 0)) continue;
        square += beyond * beyond;
        side->facing = 0;
    }
    side->body = thin->body;
    side->part = thin->part;
    side->mid = thin->front * y[thin->axis];
    side->distance = sqrt(square + side->mid * side->mid);
    side->half = part->size[thin->axis];
    for (int d = 0; d < 3; d++) across[d] = thin->front * p[3 * d + thin->axis];
    gr_pose_in_space(pose, across, side->normal);
}

void gr_nearest_thin(const struct gr_engine *e, const double x[3], int now, struct gr_facing *side)
{
    struct gr_pose pose;
    double next = INFINITY;
    for (int k = 0; k < e->bodies.n_thin; k++) {
        const int b = e->bodies.thin[k].body;
        struct gr_facing other;
        if (!k || e->bodies.thin[k - 1].body != b) {
            const struct gr_split_pose *split = &e->bodies.split[b];
            gr_pose_at(e, b, now ? e->bodies.now[b].x : split->x, now ? e->bodies.now[b].orientation : split->orientation,
                       &pose);
        }
        look(e, &e->bodies.thin[k], &pose, x, &other);
        if (!k) {
            *side = other;
            continue;
        }
        next = fmin(next, fmax(other.distance, side->distance));
        if (other.distance < side->distance) *side = other;
    }
    side->next = next;
}

enum gr_side_of_cell gr_cell_side(const struct gr_engine *e, const int32_t at[3])
{
    struct gr_facing side;
    double x[3];
    gr_cell_position(e, at, x);
    gr_nearest_thin(e, x, 0, &side);
    return side.distance < REACH * e->config.dx ? (side.mid < 0 ? GR_BACK : GR_FRONT)
                                                : (side.mid < 0 ? GR_WHOLE_BEHIND : GR_WHOLE_IN_FRONT);
}

int gr_cell_faces_thin(const struct gr_engine *e, const int32_t at[3])
{
    const double corner = 0.5 * sqrt(e->config.dim) * e->config.dx; /* from the centre to a corner */
    struct gr_facing side;
    double x[3];
    gr_cell_position(e, at, x);
    gr_nearest_thin(e, x, 1, &side);
    return side.inset > 1.01 * corner && side.next - side.distance > 2.02 * corner;
}

int gr_point_side(const struct gr_engine *e, const double x[3], int current)
{
    struct gr_facing side;
    gr_nearest_thin(e, x, 1, &side);
    return side.facing && current ? current : side.mid < 0 ? -1 : 1;
}

void gr_split_nodes(struct gr_engine *e, int64_t first, int64_t last)
{
    for (int64_t n = first; n < last; n++) {
        struct gr_facing side;
        double x[3];
        if (!e->mesh.separable[n]) continue;
        gr_node_position(e, n, x);
        gr_nearest_thin(e, x, 1, &side);
        e->mesh.separated[n] = (uint8_t)side.facing;
    }
}
