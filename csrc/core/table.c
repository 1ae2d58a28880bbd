/* Sparse table of integers (table.h). */
#include "core/table.h"

#include "core/memory.h"

/* Reserve memory for n blocks. */
static int reserve(struct gr_table *t, int64_t n)
{
    if (n <= t->capacity) return GR_OK;
    const int64_t capacity = 2 * n + 2;
    GR_RESIZE(t->value, capacity * GR_BLOCK);
    GR_RESIZE(t->used, capacity);
    t->capacity = capacity;
    return GR_OK;
}

int gr_table_new(struct gr_table *t, int64_t n)
{
    memset(t, 0, sizeof *t);
    t->n = n;
    t->block_of = gr_calloc((size_t)(n / GR_BLOCK + 1), sizeof *t->block_of);
    if (!t->block_of || reserve(t, 1)) {
        gr_table_free(t);
        return GR_ERR_MEMORY;
    }
    memset(t->value, 0, GR_BLOCK * sizeof *t->value);
    t->n_blocks = 1;
    return GR_OK;
}

int gr_table_set(struct gr_table *t, int64_t i, int32_t value)
{
    int32_t *block = &t->block_of[i / GR_BLOCK];
    if (!*block) {
        if (!value) return GR_OK;
        if (reserve(t, t->n_blocks + 1)) return GR_ERR_MEMORY;
        memset(t->value + t->n_blocks * GR_BLOCK, 0, GR_BLOCK * sizeof *t->value);
        t->used[t->n_blocks] = i / GR_BLOCK;
        *block = (int32_t)t->n_blocks++;
    }
    t->value[(int64_t)*block * GR_BLOCK + i % GR_BLOCK] = value;
    return GR_OK;
}

void gr_table_clear(struct gr_table *t)
{
    for (int64_t b = 1; b < t->n_blocks; b++) t->block_of[t->used[b]] = 0;
    if (t->n_blocks) t->n_blocks = 1;
}

/* Entries to be set. Chunks begin where a block does, so that each block belongs to one of them. */
struct fill {
    struct gr_table *t;
    struct gr_team *team;
    const int64_t *index;
    const int32_t *number;
    int64_t n, chunks, *blocks; /* of each chunk: number of its blocks, then its first */
};

/* The first entry of a block from k on. */
static int64_t next_block(const struct fill *f, int64_t k)
{
    while (k > 0 && k < f->n && f->index[k] / GR_BLOCK == f->index[k - 1] / GR_BLOCK) k++;
    return k;
}

GR_SHARED(count_blocks, struct fill, f->n, f)
{
    int64_t count = 0, block = -1;
    first = next_block(f, first), last = next_block(f, last);
    for (int64_t k = first; k < last; k++)
        if (f->index[k] / GR_BLOCK != block) block = f->index[k] / GR_BLOCK, count++;
    f->blocks[chunk] = count;
}

GR_SHARED(fill_blocks, struct fill, f->n, f)
{
    struct gr_table *t = f->t;
    int64_t b = f->blocks[chunk] - 1, block = -1;
    int32_t *value = 0;
    first = next_block(f, first), last = next_block(f, last);
    for (int64_t k = first; k < last; k++) {
        if (f->index[k] / GR_BLOCK != block) {
            block = f->index[k] / GR_BLOCK;
            t->block_of[block] = (int32_t)++b;
            t->used[b] = block;
            value = t->value + b * GR_BLOCK;
            memset(value, 0, GR_BLOCK * sizeof *value);
        }
        int32_t *entry = &value[f->index[k] % GR_BLOCK];
        if (!*entry) *entry = f->number ? f->number[k] + 1 : (int32_t)(k + 1);
    }
}

/* The number of an item of a table that is emptied is the number of its block, less one. */
GR_SHARED(forget_blocks, struct fill, f->t->n_blocks - 1, f)
{
    (void)chunk;
    for (int64_t b = first + 1; b < last + 1; b++) f->t->block_of[f->t->used[b]] = 0;
}

int gr_table_fill(struct gr_table *t, const int64_t *index, const int32_t *number, int64_t n, struct gr_team *team,
                  int64_t chunks)
{
    struct fill f = {.t = t, .team = team, .index = index, .number = number, .n = n, .chunks = chunks};
    int64_t blocks = 1; /* the block of zeros */
    int error = GR_ERR_MEMORY;
    forget_blocks(&f);
    t->n_blocks = 1;
    f.blocks = gr_malloc(sizeof *f.blocks * (size_t)chunks);
    if (!f.blocks) goto out;
    count_blocks(&f);
    for (int64_t c = 0; c < chunks; c++) {
        const int64_t count = f.blocks[c];
        f.blocks[c] = blocks;
        blocks += count;
    }
    if (reserve(t, blocks)) goto out;
    fill_blocks(&f);
    t->n_blocks = blocks;
    error = GR_OK;
out:
    gr_free(f.blocks);
    return error;
}

void gr_table_free(struct gr_table *t)
{
    gr_free(t->block_of);
    gr_free(t->value);
    gr_free(t->used);
    memset(t, 0, sizeof *t);
}
