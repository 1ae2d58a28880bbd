/* Numbers for the cells or nodes of a box of which all but a few are 0: blocks of GR_BLOCK places, and only those with
 * another number have memory, so that an empty box costs 1/8 byte a place. */
#ifndef GR_CORE_TABLE_H
#define GR_CORE_TABLE_H

#include <stdint.h>

enum { GR_BLOCK = 32 };

struct gr_table {
    int64_t n, n_blocks, room; /* places; blocks, block 0 is of zeros and stands for all that are not there */
    int32_t *block_of, *value;
    int64_t *used; /* numbers of the blocks of the box that are there, from 1 on */
};

/* n zeros. Returned: 0 or GR_ERR_MEMORY; also of the next. */
int gr_table_new(struct gr_table *t, int64_t n);
int gr_table_set(struct gr_table *t, int64_t i, int32_t value);

/* The table of n bytes. */
int gr_table_of_bytes(struct gr_table *t, const uint8_t *bytes, int64_t n);

/* All zeros again; the memory of the blocks stays, so that nothing can fail that is set where something was set before. */
void gr_table_clear(struct gr_table *t);
void gr_table_free(struct gr_table *t);

static inline int32_t gr_table_get(const struct gr_table *t, int64_t i)
{
    return t->value[(int64_t)t->block_of[i / GR_BLOCK] * GR_BLOCK + i % GR_BLOCK];
}

#endif
