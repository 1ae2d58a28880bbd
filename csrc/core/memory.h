/* Memory of the core, arrays that grow, and copies of the arrays of a caller.
 *
 * Blocks are of the process, or of a device while one is in use: its threads and those of the processor then see the same
 * blocks. A block knows where it is from, and grows there. */
#pragma once

#include <stdlib.h>
#include <string.h>

#include "core/error.h"

/* Where blocks are from: memory, aligned to GR_BLOCK_HEAD bytes, or NULL. Threads may call both at once. */
struct gr_source {
    void *(*take)(size_t bytes);
    void (*give)(void *block);
};

/* Take blocks from a source from now on, which must outlive them; NULL: from the process. */
void gr_use_source(const struct gr_source *source);

/* As malloc, calloc, realloc and free. */
void *gr_malloc(size_t bytes);
void *gr_calloc(size_t count, size_t bytes);
void *gr_realloc(void *block, size_t bytes);
void gr_free(const void *block);

/* True if a block that begins there is from this source, NULL: from the process. */
int gr_is_from(const void *block, const struct gr_source *source);

/* Give the array p the length `count`. Without memory, GR_ERR_MEMORY is returned from the function where this stands. */
#define GR_RESIZE(p, count)                                     \
    do {                                                        \
        void *q = gr_realloc(p, sizeof *(p) * (size_t)(count)); \
        if (!q) return GR_ERR_MEMORY;                           \
        (p) = q;                                                \
    } while (0)

/* Replace a pointer by one to a copy of its `bytes` bytes; by NULL if there are none.
 * Returned: 0 or GR_ERR_MEMORY. */
static inline int gr_own(const void **pointer, size_t bytes)
{
    void *copy = *pointer && bytes ? gr_malloc(bytes) : 0;
    const int error = *pointer && bytes && !copy ? GR_ERR_MEMORY : GR_OK;
    if (copy) memcpy(copy, *pointer, bytes);
    *pointer = copy;
    return error;
}
