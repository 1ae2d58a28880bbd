/* Patches of walls and bodies (patches.h). */
#include "mpm/patches.h"

#include "core/memory.h"
#include "mpm/ranks.h"

enum { FIRST = 256 }; /* capacity at first */

static uint64_t mixed(uint64_t key, int32_t number)
{
    key = (key ^ (uint32_t)number) * 0x9E3779B97F4A7C15u;
    return key ^ key >> 29;
}

/* Place of a patch in the table, or the free one where it belongs. */
static int64_t place_of(const struct gr_patches *patches, int32_t solid, const int32_t at[3])
{
    const uint64_t key = mixed(mixed(mixed(mixed(0, solid), at[0]), at[1]), at[2]);
    int64_t k = (int64_t)(key >> 1) & (patches->n_places - 1);
    for (;; k = (k + 1) & (patches->n_places - 1)) {
        if (!patches->place[k]) return k;
        const struct gr_patch *patch = &patches->patch[patches->place[k] - 1];
        if (patch->solid == solid && !memcmp(patch->at, at, sizeof patch->at)) return k;
    }
}

/* Grow the list and its table. */
static int grow(struct gr_patches *patches)
{
    const int64_t capacity = patches->capacity ? 2 * patches->capacity : FIRST;
    int64_t *place = gr_calloc((size_t)(2 * capacity), sizeof *place);
    if (!place) return GR_ERR_MEMORY;
    struct gr_patch *patch = gr_realloc(patches->patch, sizeof *patch * (size_t)capacity);
    if (!patch) {
        gr_free(place);
        return GR_ERR_MEMORY;
    }
    gr_free(patches->place);
    patches->patch = patch, patches->capacity = capacity;
    patches->place = place, patches->n_places = 2 * capacity;
    for (int64_t k = 0; k < patches->n; k++) place[place_of(patches, patch[k].solid, patch[k].at)] = k + 1;
    return GR_OK;
}

int gr_watch_patches(struct gr_engine *e)
{
    if (!e->watch || e->watch->patches) return GR_ERR_CONFIG;
    struct gr_patches *patches = gr_calloc(1, sizeof *patches);
    if (!patches || grow(patches)) {
        gr_free(patches);
        return GR_ERR_MEMORY;
    }
    e->watch->patches = patches;
    return GR_OK;
}

void gr_patches_free(struct gr_patches *patches)
{
    if (!patches) return;
    gr_free(patches->patch);
    gr_free(patches->place);
    gr_free(patches);
}

int gr_patch_at(struct gr_patches *patches, int32_t solid, const int32_t at[3], struct gr_patch **patch)
{
    int64_t k = place_of(patches, solid, at);
    if (!patches->place[k]) {
        if (patches->n == patches->capacity) {
            if (grow(patches)) return GR_ERR_MEMORY;
            k = place_of(patches, solid, at);
        }
        struct gr_patch *added = &patches->patch[patches->n];
        memset(added, 0, sizeof *added);
        added->solid = solid;
        memcpy(added->at, at, sizeof added->at);
        patches->place[k] = ++patches->n;
    }
    *patch = &patches->patch[patches->place[k] - 1];
    return GR_OK;
}

int gr_has_patch(const struct gr_engine *e, const struct gr_patch *patch)
{
    if (!e->ranks) return 1;
    return patch->solid < e->watch->n_walls ? gr_ranks_has_number(e, patch->at) : e->ranks->transport.rank == 0;
}

int gr_add_wall_patches(struct gr_engine *e)
{
    const int dim = e->config.dim;
    for (int64_t n = 0; n < e->mesh.n_nodes; n++) {
        if (!e->mesh.node_code[n]) continue;
        int32_t at[3] = {0};
        const struct gr_wall_share *share = gr_wall_share_of(e, n, at);
        if (e->ranks && !gr_ranks_has_number(e, at)) continue;
        for (int d = 0; d < dim; d++) {
            struct gr_patch *patch;
            const double impulse = e->watch->node[n * dim + d];
            if (share->owner[d] < 0 || impulse == 0) continue;
            if (gr_patch_at(e->watch->patches, share->owner[d], at, &patch)) return GR_ERR_MEMORY;
            patch->number[d] += impulse;
        }
    }
    return GR_OK;
}
