/* The numbers of the points, in the arrays that the engine borrows. They are doubles; with kernels in single precision
 * they are floats, but for the positions, since a point moves by a small part of its coordinate in a step. */
#pragma once

#include "core/simd.h"
#include "mpm/engine.h"

/* True if the points of a scene have the field. */
int gr_config_uses(const struct gr_config *config, int field);

/* True if the numbers of a field are doubles. */
static inline int gr_is_double(const struct gr_config *config, int field) { return field == GR_FIELD_x || !config->single; }

/* Component d of the positions. */
static inline double *gr_x(const struct gr_engine *e, int d)
{
    return (double *)e->points.field[GR_FIELD_x] + d * e->points.capacity;
}

/* Component c of a field of the point at a slot. */
static inline double gr_number(const struct gr_engine *e, int field, int c, int64_t slot)
{
    const int64_t at = c * e->points.capacity + slot;
    return gr_is_double(&e->config, field) ? ((const double *)e->points.field[field])[at]
                                           : ((const float *)e->points.field[field])[at];
}

static inline void gr_set_number(const struct gr_engine *e, int field, int c, int64_t slot, double number)
{
    const int64_t at = c * e->points.capacity + slot;
    if (gr_is_double(&e->config, field))
        ((double *)e->points.field[field])[at] = number;
    else
        ((float *)e->points.field[field])[at] = (float)number;
}

/* Component k of all that a point has, in the order of a packed record: x first. */
static inline double gr_component(const struct gr_engine *e, int k, int64_t slot)
{
    return k < e->points.n_doubles ? ((const double *)e->points.column[k])[slot]
                                   : ((const float *)e->points.column[k])[slot];
}

static inline void gr_set_component(const struct gr_engine *e, int k, int64_t slot, double number)
{
    if (k < e->points.n_doubles)
        ((double *)e->points.column[k])[slot] = number;
    else
        ((float *)e->points.column[k])[slot] = (float)number;
}

/* Square of the speed of the point at a slot. */
static inline double gr_speed_squared(const struct gr_engine *e, int64_t slot)
{
    double square = 0;
    for (int d = 0; d < e->config.dim; d++) {
        const double v = gr_number(e, GR_FIELD_v, d, slot);
        square += v * v;
    }
    return square;
}

/* For kernels, which are compiled for one precision: component c of a field other than the positions, from a slot on. */
GR_INLINE gr_real *gr_numbers(const struct gr_engine *e, int field, int c, int64_t slot)
{
    return (gr_real *)e->points.field[field] + c * e->points.capacity + slot;
}

/* Index of the first component of a field in a packed record. */
static inline int gr_component_of(const struct gr_engine *e, int field)
{
    int component = 0;
    for (int f = 0; f < field; f++) component += e->points.field[f] ? gr_field_components(f, e->config.dim) : 0;
    return component;
}
