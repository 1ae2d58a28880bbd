/* How the work of a step is shared out among threads. */
#pragma once

#include "engine/run.h"

/* Divide the tiles so that each chunk has about the same number of slots. Give each chunk space for migrants: all its
 * points may leave their cells at once. */
void gr_share_tiles(struct gr_run *run);

/* Prepare what depends on the mesh. Returned: 0 or GR_ERR_MEMORY. */
int gr_share_out(struct gr_run *run);
