/* Tests of mpm/patches.c: the list grows, and finds each patch again. The sums of patches are tested from Python. */
#include "mpm/patches.h"
#include "core/memory.h"

#include <string.h>

#include "tests/check.h"
#include "tests/faults.h"
#include "tests/scene.h"

enum { MANY = 5000 };

static const struct gr_wall_share nobody = {.owner = {-1, -1, -1}, .opens_at = INFINITY};

/* An engine whose walls are watched, without any. */
static void watched(struct scene *s)
{
    scene_seed(3);
    scene_default(s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    CHECK(scene_build(s, 10, 0.2, 0.8) == GR_OK);
    int32_t *code = gr_calloc((size_t)scene_grid_nodes(s), sizeof *code);
    CHECK(code);
    CHECK(gr_watch_walls(s->engine, 0, &nobody, 1, code) == GR_OK);
    gr_free(code);
}

TEST(each_patch_is_found_again)
{
    struct scene s;
    watched(&s);
    CHECK(gr_watch_patches(s.engine) == GR_OK);
    struct gr_patches *patches = s.engine->watch->patches;
    for (int round = 0; round < 2; round++)
        for (int32_t k = 0; k < MANY; k++) {
            struct gr_patch *patch;
            const int32_t at[3] = {k % 17 - 8, k / 17, -(k % 3)};
            CHECK(gr_patch_at(patches, k % 5, at, &patch) == GR_OK);
            CHECK(patch == &patches->patch[k]); /* in the order in which they came */
            CHECK(patch->number[GR_PATCH_NORMAL] == round * k);
            patch->number[GR_PATCH_NORMAL] = k;
        }
    CHECK(patches->n == MANY);
    CHECK(gr_watch_patches(s.engine) == GR_ERR_CONFIG); /* once */
    scene_free(&s);
}

TEST(without_memory)
{
    struct scene s;
    watched(&s);
    for (long n = 1;; n++) {
        faults_at(n);
        const int error = gr_watch_patches(s.engine), hit = faults_end();
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        if (!hit) break;
        CHECK(!s.engine->watch->patches);
    }
    struct gr_patches *patches = s.engine->watch->patches;
    int refused = 0;
    for (int32_t k = 0; k < 1000; k++) {
        struct gr_patch *patch;
        const int32_t at[3] = {k, 0, 0};
        faults_at(1 + refused % 2);
        const int error = gr_patch_at(patches, 0, at, &patch), hit = faults_end();
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        if (!hit) continue;
        refused++, k--; /* the list is as before: it goes on when there is memory */
        CHECK(patches->n == k + 1);
        CHECK(gr_patch_at(patches, 0, at, &patch) == GR_OK);
    }
    CHECK(refused >= 2 && patches->n == 1000);
    scene_free(&s);
}
