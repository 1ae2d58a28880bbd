/* A byte for each cell or node of a box, stored once for all that are alike: each axis is divided into classes, and there
 * is one value for each combination of classes. A box with walls at its ends has three classes along each axis. */
#pragma once

#include <stdint.h>

#include "core/memory.h"

struct gr_map {
    int32_t n_index[3], n_classes[3]; /* 1 along unused axes */
    const int32_t *class_of[3];       /* of each index along an axis; NULL: the index itself */
    const uint8_t *value;             /* n_classes[2] x n_classes[1] x n_classes[0]; NULL: 0 everywhere */
};

static inline int64_t gr_map_class(const struct gr_map *m, int d, int32_t at)
{
    return m->class_of[d] ? m->class_of[d][at] : at;
}

/* Number of combinations of classes. */
static inline int64_t gr_map_size(const struct gr_map *m)
{
    return (int64_t)m->n_classes[0] * m->n_classes[1] * m->n_classes[2];
}

/* Number of the combination at the given indices, which are 0 along unused axes: where its value is. */
static inline int64_t gr_map_place(const struct gr_map *m, const int32_t at[3])
{
    const int64_t row = gr_map_class(m, 2, at[2]) * m->n_classes[1] + gr_map_class(m, 1, at[1]);
    return row * m->n_classes[0] + gr_map_class(m, 0, at[0]);
}

/* The byte at the given indices. */
static inline uint8_t gr_map_get(const struct gr_map *m, const int32_t at[3])
{
    return m->value ? m->value[gr_map_place(m, at)] : 0;
}

/* Replace the arrays of a caller by copies.
 * Returned: 0 or GR_ERR_MEMORY. */
static inline int gr_map_own(struct gr_map *m)
{
    size_t n = 1;
    int error = GR_OK;
    for (int d = 0; d < 3; d++) {
        n *= (size_t)m->n_classes[d];
        error |= gr_own((const void **)&m->class_of[d], sizeof(int32_t) * (size_t)m->n_index[d]);
    }
    error |= gr_own((const void **)&m->value, n);
    return error ? GR_ERR_MEMORY : GR_OK;
}

static inline void gr_map_free(struct gr_map *m)
{
    for (int d = 0; d < 3; d++) gr_free(m->class_of[d]);
    gr_free(m->value);
}
