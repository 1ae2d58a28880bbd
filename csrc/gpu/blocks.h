/* Blocks of the memory of a device, in a list: of the emulated one, or of a GPU. */
#pragma once

#include <stddef.h>

/* What stands before a block. */
struct gr_link {
    _Alignas(64) struct gr_link *next, *last;
    size_t bytes; /* of the block without this */
};

/* Take a block from `raw`, and give it back to `drop`. Threads may call both at once. */
void *gr_take_block(void *(*raw)(size_t bytes), size_t bytes);
void gr_give_block(void (*drop)(void *), void *block);

/* True if an address lies in a block. */
int gr_in_block(const void *address);

/* Call a function for each block, with what stands before it. */
void gr_each_block(void (*visit)(void *begin, size_t bytes));
