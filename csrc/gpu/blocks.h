/* Blocks of the memory of a device, in a list: of the emulated one, or of a GPU. */
#pragma once

#include <stddef.h>

/* What stands before a block. */
struct gr_link {
    _Alignas(64) struct gr_link *next, *last;
    size_t bytes; /* of the block without this */
};

/* Where blocks are from and where they go: as malloc and free. */
struct gr_pool {
    void *(*raw)(size_t bytes);
    void (*drop)(void *block);
};

/* Take a block, and give it back. Threads may call both at once. Blocks that are given back are kept for others of much the
 * same size, as a device takes and frees memory slowly: a quarter of what is in use at most, so that none remains at the
 * end. */
void *gr_take_block(const struct gr_pool *pool, size_t bytes);
void gr_give_block(const struct gr_pool *pool, void *block);

/* True if an address lies in a block in use. */
int gr_in_block(const void *address);

/* Call a function for each block in use, with what stands before it. */
void gr_each_block(void (*visit)(void *begin, size_t bytes));
