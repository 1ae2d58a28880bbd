/* Rows of places of a tile. */
#pragma once

#include "mpm/engine.h"

/* Number of rows of a tile whose fullest cell has `most` points. */
int32_t gr_rows_of_tile(int32_t most);

/* Give a tile more rows, once until all points are grouped anew. They lie behind all places in use.
 * Returned: 0 if it has been given some, or if the buffers have no places left. */
int gr_grow_tile(struct gr_engine *e, int64_t tile);
