/* Memory of the sums of cells. */
#pragma once

#include "mpm/engine.h"

/* Give the sums memory for so many tiles and the tile of zeros. What they held is lost; without memory they remain.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_reserve_sums(struct gr_engine *e, int64_t tiles);

/* Note whether the caches hold the sums of so many tiles, and so many slots of points. */
void gr_note_size(struct gr_engine *e, int64_t tiles, int64_t slots);
