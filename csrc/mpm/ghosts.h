/* Ghost cells: those of other ranks (mpm/ranks.h) whose sums this one receives. */
#pragma once

#include "core/team.h"
#include "mpm/ranks.h"

/* What is sent of a cell: its sums of mass and momentum; of forces; those of an averaging of the density; and the numbers of
 * enum gr_average. */
enum gr_ghost_part { GR_GHOST_MOMENTUM = 1, GR_GHOST_FORCE = 2, GR_GHOST_DENSITY = 4, GR_GHOST_AVERAGES = 8 };

/* List the ghost cells of the mesh, and the own cells that others have as such. Returned: 0 or an error, the same for all
 * ranks. */
int gr_ghosts_list(struct gr_engine *e);

/* Note which chunks of the fluidity grid are those of others. Returned: 0 or GR_ERR_MEMORY. */
int gr_ghosts_share_fluidity(struct gr_engine *e);

/* Send these parts of own cells, and put those of ghost cells in their places. Returned: 0 or an error. */
int gr_ghosts_exchange(struct gr_engine *e, unsigned parts, struct gr_team *team);

/* Give the ghost cells the calm of their owners (mpm/sleep.h). Returned: 0 or an error. */
int gr_ghosts_exchange_calm(struct gr_engine *e);
