/* Arrays that grow, and copies of the arrays of a caller. */
#pragma once

#include <stdlib.h>
#include <string.h>

#include "core/error.h"

/* Give the array p the length `count`. Without memory, GR_ERR_MEMORY is returned from the function where this stands. */
#define GR_RESIZE(p, count)                                  \
    do {                                                     \
        void *q = realloc(p, sizeof *(p) * (size_t)(count)); \
        if (!q) return GR_ERR_MEMORY;                        \
        (p) = q;                                             \
    } while (0)

/* Replace a pointer by one to a copy of its `bytes` bytes; by NULL if there are none.
 * Returned: 0 or GR_ERR_MEMORY. */
static inline int gr_own(const void **pointer, size_t bytes)
{
    void *copy = *pointer && bytes ? malloc(bytes) : 0;
    const int error = *pointer && bytes && !copy ? GR_ERR_MEMORY : GR_OK;
    if (copy) memcpy(copy, *pointer, bytes);
    *pointer = copy;
    return error;
}
