/* Memory of the core, arrays that grow, and copies of the arrays of a caller.
 *
 * Blocks are of the process, or of the source that a thread uses: what a device is to see must be from its own. A block knows
 * where it is from, and grows there. */
#pragma once

#include <stdlib.h>
#include <string.h>

#include "core/error.h"

/* Where blocks are from: as malloc and free, by several threads at once. */
struct gr_source {
    void *(*take)(size_t bytes);
    void (*give)(void *block);
};

/* Let this thread take blocks from a source, which must outlive them; NULL: from the process. */
void gr_use_source(const struct gr_source *source);

/* As malloc, calloc, realloc and free. */
void *gr_malloc(size_t bytes);
void *gr_calloc(size_t count, size_t bytes);
void *gr_realloc(void *block, size_t bytes);
void gr_free(const void *block);

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
