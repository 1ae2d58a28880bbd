/* Filling of a table (fill_table.h). */
#include "mpm/fill_table.h"

#include "core/memory.h"
#include "mpm/device.h"
#include "mpm/places.h"

/* Entries to be set. Chunks begin where a block does, so that each block belongs to one of them. */
struct fill {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks;
    struct gr_table t;
    const int64_t *index;
    const int32_t *number;
    int64_t n, *blocks; /* of each chunk: number of its blocks, then its first */
};

/* The first entry of a block from k on. */
static int64_t next_block(const struct fill *f, int64_t k)
{
    while (k > 0 && k < f->n && f->index[k] / GR_BLOCK == f->index[k - 1] / GR_BLOCK) k++;
    return k;
}

GR_DEFINE_PASS(count_blocks, struct fill, f)
{
    int64_t count = 0, block = -1;
    first = next_block(f, first), last = next_block(f, last);
    for (int64_t k = first; k < last; k++)
        if (f->index[k] / GR_BLOCK != block) block = f->index[k] / GR_BLOCK, count++;
    f->blocks[chunk] = count;
}

GR_DEFINE_PASS(fill_blocks, struct fill, f)
{
    const struct gr_table *t = &f->t;
    int64_t b = f->blocks[chunk] - 1, block = -1;
    int32_t *value = 0;
    first = next_block(f, first), last = next_block(f, last);
    for (int64_t k = first; k < last; k++) {
        if (f->index[k] / GR_BLOCK != block) {
            block = f->index[k] / GR_BLOCK;
            t->block_of[block] = (int32_t)++b;
            t->used[b] = block;
            value = t->value + b * GR_BLOCK;
            for (int i = 0; i < GR_BLOCK; i++) value[i] = 0;
        }
        int32_t *entry = &value[f->index[k] % GR_BLOCK];
        if (!*entry) *entry = f->number ? f->number[k] + 1 : (int32_t)(k + 1);
    }
}

/* The number of an item of a table that is emptied is the number of its block, less one. */
GR_DEFINE_PASS(forget_blocks, struct fill, f)
{
    for (int64_t b = first + 1; b < last + 1; b++) f->t.block_of[f->t.used[b]] = 0;
}

#ifndef GR_ON_DEVICE
int gr_fill_table(struct gr_engine *e, struct gr_table *t, const int64_t *index, const int32_t *number, int64_t n,
                  struct gr_team *team, int64_t chunks)
{
    struct fill f = {.e = e, .team = team, .chunks = chunks, .t = *t, .index = index, .number = number, .n = n};
    const int64_t pieces = gr_pass_chunks(e, n, chunks);
    int64_t blocks = 1; /* the block of zeros */
    GR_MAKE(forget_blocks, &f, t->n_blocks - 1);
    int error = gr_device_wait(e);
    t->n_blocks = 1;
    f.blocks = gr_malloc(sizeof *f.blocks * (size_t)(pieces + 1));
    if (!f.blocks && !error) error = GR_ERR_MEMORY;
    if (error) goto out;
    GR_MAKE_IN(count_blocks, &f, n, pieces);
    error = gr_make_places(e, f.blocks, pieces, &blocks);
    if (!error) error = gr_table_reserve(t, blocks);
    if (error) goto out;
    f.t = *t;
    GR_MAKE_IN(fill_blocks, &f, n, pieces);
    error = gr_device_wait(e);
    if (!error) t->n_blocks = blocks;
out:
    gr_free(f.blocks);
    return error;
}
#endif
