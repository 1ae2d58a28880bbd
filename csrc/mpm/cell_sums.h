/* Memory of the sums of cells. */
#pragma once

#include "mpm/engine.h"

/* Give the sums memory for so many tiles and the tile of zeros. What they held is lost; without memory they remain.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_reserve_sums(struct gr_engine *e, int64_t tiles);

/* Decide whether the sums of so many tiles are stored past the caches, with so many slots of points. */
void gr_choose_stream(struct gr_engine *e, int64_t tiles, int64_t slots);
