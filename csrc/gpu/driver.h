/* A GPU by the interface of its driver, which is loaded when it is asked for: nothing else need be installed. */
#pragma once

#include <stddef.h>

/* Load the driver, and the kernels from their two texts, in double and in single precision; once in a process.
 * Returned: NULL, or why there is no GPU to be used. */
const char *gr_open_gpu(const char *const text[2], const size_t size[2]);

/* Of the GPU that is open: its name, and bytes of its memory. */
struct gr_gpu_info {
    char name[128];
    size_t free, total;
};
struct gr_gpu_info gr_gpu_info(void);
