/* Tiles: which cells have which lanes, and which lanes are a run (engine.h). */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

/* The lanes of the active cells. */
struct gr_tiles {
    int64_t n_cells, n_front; /* n_front: those of the first layer of the mesh */
    const int64_t *cell;      /* per lane: index in the grid, ascending in each layer */
    int64_t *ordered;         /* the same with thin bodies, which is freed with the tiles; else NULL */
    int8_t *side;             /* per lane (enum gr_side_of_cell); NULL without thin bodies */
    int32_t *other;           /* per lane: the other side of a double cell, or -1; NULL without thin bodies */
    int32_t *lane;            /* of each of the given cells; NULL without thin bodies, where they are in this order */
    uint8_t *joins;           /* per tile, see gr_mesh.tile_joins */
    int64_t *block;           /* number of tiles + 1: where their sums begin, and end */
};

/* Number of tiles. */
static inline int64_t gr_number_of_tiles(const struct gr_tiles *tiles) { return (tiles->n_cells + GR_LANES - 1) / GR_LANES; }

/* Give lanes to cells. They go to `tiles`, which gr_free_tiles frees.
 *
 * Given: n indices in the grid, ascending; double cells twice, the front first. Their sides, NULL without thin bodies, where
 * `tiles` has the indices themselves.
 * Returned: 0, GR_ERR_MEMORY or GR_ERR_DEVICE. */
int gr_make_tiles(struct gr_tiles *tiles, struct gr_engine *e, const int64_t *cells, const int8_t *sides, int64_t n,
                  struct gr_team *team, int64_t chunks);

void gr_free_tiles(struct gr_tiles *tiles);
