/* Levers of the feet of bodies that turn freely (lever.h). */
#include "mpm/lever.h"

#include "body/turning.h"

/* Velocity along a direction that a unit impulse along it gives the place of the body at `arm`. */
static double mobility_along(const double inverse[9], const double arm[3], const double n[3])
{
    double w[3];
    gr_spin_up(inverse, arm, n, w);
    return n[0] * (w[1] * arm[2] - w[2] * arm[1]) + n[1] * (w[2] * arm[0] - w[0] * arm[2]) +
           n[2] * (w[0] * arm[1] - w[1] * arm[0]);
}

void gr_foot_lever(const struct gr_engine *e, const struct gr_pose *pose, struct gr_foot *foot)
{
    static const double unit[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    double inverse[9], arm[3] = {0};
    for (int i = 0; i < foot->n_nodes; i++) {
        double x[3];
        gr_node_position(e, foot->node[i], x);
        for (int d = 0; d < e->config.dim; d++) {
            const struct gr_axis *axis = &e->axis[d];
            double beyond = x[d] - pose->x[d] - foot->arm[d]; /* of the image of the node next to the foot */
            if (axis->periodic) beyond -= axis->length * rint(beyond / axis->length);
            arm[d] += foot->weight[i] * beyond;
        }
    }
    for (int d = 0; d < 3; d++) foot->arm[d] += arm[d];
    gr_inverse_inertia(pose->body, e->config.dim, e->body[foot->body].orientation, inverse);
    foot->normal_mobility += mobility_along(inverse, foot->arm, foot->normal);
    for (int d = 0; d < e->config.dim; d++) foot->mobility += mobility_along(inverse, foot->arm, unit[d]);
}
