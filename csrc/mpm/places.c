#include "mpm/places.h"

#include "mpm/migrate.h"

/* One row more than the fullest cell has points: a tile that needs more gets them when it does, while spare rows of all tiles
 * are memory. An empty tile has a row for the first points of a front. */
int32_t gr_rows_of_tile(int32_t most) { return most + 1; }

int gr_grow_tile(struct gr_engine *e, int64_t tile)
{
    struct gr_cell *cell = &e->mesh.cell[tile * GR_LANES];
    const int32_t rows = cell->capacity, more = rows + rows / 8 + 2;
    const int64_t begin = e->used, end = begin + (int64_t)GR_LANES * (more - rows);
    if (cell->rows < rows || end > e->capacity) return 0;
    for (int l = 0; l < GR_LANES; l++) {
        cell[l].apart = begin + l - gr_slot(&cell[l], rows);
        cell[l].capacity = more;
        for (int32_t k = rows; k < more; k++) gr_clear_place(e, &cell[l], gr_slot(&cell[l], k));
    }
    e->used = end;
    e->tiles_grown = 1;
    return 1;
}
