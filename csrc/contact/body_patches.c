/* The impulses of the contact points on the patches of bodies (body_patches.h). */
#include "contact/body_patches.h"

#include "contact/shared_contacts.h"
#include "mpm/patches.h"
#include "mpm/pose.h"

#define FARTHEST 1e9 /* cells: the index of a patch along an axis is no larger */

int gr_add_body_patches(struct gr_engine *e)
{
    const struct gr_contact_points *contacts = gr_all_contacts(e);
    struct gr_pose pose[GR_MAX_BODIES];
    if (!contacts) return GR_OK;
    for (int b = 0; b < e->config.n_bodies; b++)
        gr_pose_at(e, b, e->bodies.now[b].x, e->bodies.now[b].orientation, &pose[b]);
    for (int64_t k = 0; k < contacts->n; k++) {
        const struct gr_contact_point *contact = &contacts->contact[k];
        double local[3];
        int32_t at[3] = {0};
        struct gr_patch *patch;
        gr_pose_in_body(&pose[contact->body], contact->arm, local);
        for (int d = 0; d < e->config.dim; d++)
            at[d] = (int32_t)fmax(fmin(floor(local[d] / e->config.dx), FARTHEST), -FARTHEST);
        if (gr_patch_at(e->watch->patches, e->watch->n_walls + contact->body, at, &patch)) return GR_ERR_MEMORY;
        for (int d = 0; d < 3; d++) {
            patch->number[d] -= contact->impulse[d];
            patch->number[GR_PATCH_TANGENTIAL + d] -= contact->impulse[d] - contact->pressing * contact->normal[d];
        }
        patch->number[GR_PATCH_NORMAL] += contact->pressing;
    }
    return GR_OK;
}
