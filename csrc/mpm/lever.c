/* Levers of the feet of bodies that turn freely (lever.h). */
#include "mpm/lever.h"

#include "mpm/moving.h"

void gr_foot_lever(const struct gr_engine *e, const struct gr_pose *pose, struct gr_foot *foot)
{
    static const double unit[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    double arm[3] = {0};
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
    foot->normal_mobility += gr_turning_mobility(pose->inverse_inertia, foot->arm, foot->normal);
    for (int d = 0; d < e->config.dim; d++) foot->mobility += gr_turning_mobility(pose->inverse_inertia, foot->arm, unit[d]);
}
