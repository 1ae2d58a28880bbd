/* Patches of walls and bodies, about a cell wide each, and the impulses of the material on them, on request.
 *
 * A patch of a wall or a block is one of its nodes. A patch of a body is a cell of a grid that moves with the body: its
 * cells begin at multiples of dx from the position of the body, along the axes of the body. Patches are listed when they are
 * touched first, and never leave the list. */
#pragma once

#include "mpm/wall_impulse.h"

/* Numbers of a patch: impulse of the material, N s, in the axes of the scene; its part along the surface; and its part along
 * the normal, into the solid. Walls have the first three alone, as their normals are known. */
enum { GR_PATCH_TANGENTIAL = 3, GR_PATCH_NORMAL = 6, GR_PATCH_NUMBERS };

struct gr_patch {
    int32_t solid, at[3]; /* index of a wall, or that of a body behind all walls; indices of the node or cell */
    double number[GR_PATCH_NUMBERS];
};

struct gr_patches {
    struct gr_patch *patch;
    int64_t n, capacity;
    int64_t *place; /* of 2^k places, at least twice the capacity: the index of a patch + 1, 0 for none */
    int64_t n_places;
};

/* Begin to add up the impulses on patches, as well as on the walls that are watched; once.
 * Returned: 0, GR_ERR_CONFIG or GR_ERR_MEMORY. */
int gr_watch_patches(struct gr_engine *e);
void gr_patches_free(struct gr_patches *patches);

/* Find a patch in the list, or add it without an impulse.
 * Set: patch. Returned: 0 or GR_ERR_MEMORY. */
int gr_patch_at(struct gr_patches *patches, int32_t solid, const int32_t at[3], struct gr_patch **patch);

/* True if this process has the impulse on a patch; with ranks (mpm/ranks.h) one of them has it, rank 0 those of bodies. */
int gr_has_patch(const struct gr_engine *e, const struct gr_patch *patch);

/* Add the impulses of a finished step on the nodes of walls, before the mesh changes.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_add_wall_patches(struct gr_engine *e);
