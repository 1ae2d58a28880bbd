/* Construction and destruction of an engine. */
#pragma once

#include "mpm/engine.h"

/* The config is copied, together with the arrays it points to. Returned: 0, GR_ERR_CONFIG or GR_ERR_MEMORY. */
int gr_engine_new(struct gr_engine **out, const struct gr_config *config);
void gr_engine_free(struct gr_engine *e);

/* Set the borrowed buffers of the points. On the first call rows [0, n_points) hold the points, in any order. */
void gr_engine_bind(struct gr_engine *e, void *const field[GR_FIELD_COUNT], int64_t *id, int64_t capacity);
