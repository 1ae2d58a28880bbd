/* Inlets (core/inlets.h) of the material point method: the points that enter become pending, as migrants do. */
#pragma once

#include "core/inlets.h"
#include "mpm/engine.h"

/* Add an inlet, from before the points are bound. The records are copied.
 * Returned: 0, GR_ERR_MEMORY, or GR_ERR_CONFIG. */
int gr_inflow_add(struct gr_engine *e, const struct gr_inlet *inlet);

/* Largest number of points that enter in a step. */
int64_t gr_inflow_most(const struct gr_engine *e);

/* Reserve memory for the points that enter in a step with other ranks. Returned: 0 or GR_ERR_MEMORY. */
int gr_inflow_reserve(struct gr_engine *e);

/* Let the points enter that are due at the time of the engine. Points without a free slot in their cell become pending.
 * Returned: 0 or an error of ranks. */
int gr_inflow_enter(struct gr_engine *e);
