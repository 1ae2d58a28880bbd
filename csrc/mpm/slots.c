#include "mpm/slots.h"

int gr_grow_tile(struct gr_engine *e, int64_t tile)
{
    struct gr_cell *cell = &e->mesh.cell[tile * GR_LANES];
    const int32_t rows = cell->capacity, more = rows + rows / 8 + 2;
    const int64_t begin = e->points.used, end = begin + (int64_t)GR_LANES * (more - rows);
    if (cell->rows < rows || end > e->points.capacity) return 0;
    for (int l = 0; l < GR_LANES; l++) {
        cell[l].apart = begin + l - gr_slot(&cell[l], rows);
        cell[l].capacity = more;
        for (int32_t k = rows; k < more; k++) gr_clear_slot(e, &cell[l], gr_slot(&cell[l], k));
    }
    e->points.used = end;
    e->migration.tiles_grown = 1;
    return 1;
}
