/* Rows of slots of a tile. */
#pragma once

#include "mpm/numbers.h"

/* Number of rows of a tile whose fullest cell has `most` points. One row more: a tile that needs more gets them when it does,
 * while spare rows of all tiles are memory. An empty tile has a row for the first points of a front. */
static inline int32_t gr_rows_of_tile(int32_t most) { return most + 1; }

/* Give a tile more rows, once until all points are grouped anew. They lie behind all slots in use.
 * Returned: 0 if it has been given some, or if the buffers have no slots left. */
int gr_grow_tile(struct gr_engine *e, int64_t tile);

/* Put a slot into the middle of its cell. */
static inline void gr_center_slot(struct gr_engine *e, const struct gr_cell *cell, int64_t slot)
{
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis_cell *ac = &e->axis[d].cell[cell->at[d]];
        gr_x(e, d)[slot] = 0.5 * (ac->begin + ac->end);
    }
}

/* Make a slot spare: it has no mass and no id, and all its values are finite, with x at the centre of its cell. */
static inline void gr_clear_slot(struct gr_engine *e, const struct gr_cell *cell, int64_t slot)
{
    for (int k = 0; k < e->points.n_components; k++) gr_set_component(e, k, slot, 0);
    gr_center_slot(e, cell, slot);
    e->points.id[slot] = -1;
}
