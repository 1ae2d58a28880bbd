#include "mpm/slots.h"
#include "mpm/device.h"
#include "mpm/migrate.h"

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

int gr_reserve_moves(struct gr_moves *moves)
{
    struct gr_engine *e = moves->e;
    const int64_t pending = e->migration.n_pending; /* each record has more numbers than a slot takes here */
    if (gr_reserve_pending(e, e->points.capacity + pending)) return GR_ERR_MEMORY;
    double *const space = e->migration.pending + pending * e->points.n_components;
    for (int k = 0; k < 2; k++) moves->copy[k] = space + k * moves->used;
    moves->from = (int64_t *)(space + 2 * moves->used);
    GR_MAKE(clear_moves, moves, moves->used);
    return GR_OK;
}

/* Each column moves to a copy first, which replaces it while the next column moves. */
void gr_move_points(struct gr_moves *moves)
{
    const int64_t columns = moves->e->points.n_components + 1; /* with the ids */
    for (moves->column = 0; moves->column <= columns; moves->column++) GR_MAKE(move_column, moves, moves->used);
    GR_MAKE(center_spare, moves, moves->e->mesh.n_tiles * GR_LANES);
}
