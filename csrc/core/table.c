/* Sparse table of integers (table.h). */
#include "core/table.h"

#include "core/memory.h"

int gr_table_reserve(struct gr_table *t, int64_t n)
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
    if (!t->block_of || gr_table_reserve(t, 1)) {
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
        if (gr_table_reserve(t, t->n_blocks + 1)) return GR_ERR_MEMORY;
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

void gr_table_free(struct gr_table *t)
{
    gr_free(t->block_of);
    gr_free(t->value);
    gr_free(t->used);
    memset(t, 0, sizeof *t);
}
