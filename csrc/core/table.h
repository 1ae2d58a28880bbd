/* Sparse table of integers for the cells or nodes of a box, of which almost all are 0. The table is divided into blocks
 * of GR_BLOCK entries; only blocks with a nonzero entry have memory, so that an empty box costs 1/8 byte per entry. */
#pragma once

#include <stdint.h>

enum { GR_BLOCK = 32 };

struct gr_table {
    int64_t n, n_blocks, capacity; /* number of entries; of blocks, block 0 being the zeros of all absent ones; of blocks
                                      with memory */
    int32_t *block_of, *value;
    int64_t *used; /* for each block in use, from 1 on: which block of the box it is */
};

/* Make a table of n zeros.
 * Returned: 0 or GR_ERR_MEMORY; the same holds for the next two functions. */
int gr_table_new(struct gr_table *t, int64_t n);
int gr_table_set(struct gr_table *t, int64_t i, int32_t value);

/* Reserve memory for n blocks. */
int gr_table_reserve(struct gr_table *t, int64_t n);

/* Set all entries to zero. The memory of the blocks is retained, so that setting entries where some were set before cannot
 * fail. */
void gr_table_clear(struct gr_table *t);
void gr_table_free(struct gr_table *t);

static inline int32_t gr_table_get(const struct gr_table *t, int64_t i)
{
    return t->value[(int64_t)t->block_of[i / GR_BLOCK] * GR_BLOCK + i % GR_BLOCK];
}
