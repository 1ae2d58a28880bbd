/* From numbers to indices. A cast of a number that is not finite, or too large for the type, is undefined. Numbers become
 * indices only by this function, or behind a comparison with both ends of the range, which is false for NaN. */
#pragma once

#include <stdint.h>

/* A number without its fraction, kept within [least, most]; `least` for NaN. */
static inline int64_t gr_index(double x, int64_t least, int64_t most)
{
    return !(x > (double)least) ? least : x < (double)most ? (int64_t)x : most;
}

/* The sign of a number: 1, -1, or 0, also for NaN. */
static inline int gr_sign(double x) { return (x > 0) - (x < 0); }

/* For qsort: indices, ascending. */
static inline int gr_compare_ids(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}
