/* Moment arms of the contact points of bodies that turn freely (moment_arm.h). */
#include "contact/moment_arm.h"

#include "contact/moving.h"

void gr_set_moment_arm(const struct gr_engine *e, const struct gr_pose *pose, struct gr_contact_point *contact)
{
    static const double unit[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    double arm[3] = {0};
    for (int i = 0; i < contact->n_nodes; i++) {
        double x[3];
        gr_node_position(e, contact->node[i], x);
        for (int d = 0; d < e->config.dim; d++) {
            const struct gr_axis *axis = &e->axis[d];
            double beyond = x[d] - pose->x[d] - contact->arm[d]; /* of the image of the node next to the contact point */
            if (axis->periodic) beyond -= axis->length * rint(beyond / axis->length);
            arm[d] += contact->weight[i] * beyond;
        }
    }
    for (int d = 0; d < 3; d++) contact->arm[d] += arm[d];
    contact->normal_mobility += gr_turning_mobility(pose->inverse_inertia, contact->arm, contact->normal);
    for (int d = 0; d < e->config.dim; d++)
        contact->mobility += gr_turning_mobility(pose->inverse_inertia, contact->arm, unit[d]);
}
