/* The way of all points to new slots (moves.h). */
#include "mpm/moves.h"

#include "mpm/device.h"
#include "mpm/migrate.h"
#include "mpm/slots.h"

GR_DEFINE_PASS(clear_moves, struct gr_moves, m)
{
    for (int64_t s = first; s < last; s++) m->from[s] = GR_SPARE;
}

/* Numbers as they are in the buffers: doubles and ids; floats. */
typedef int64_t wide __attribute__((may_alias));
typedef float narrow __attribute__((may_alias));

/* A component of a field, or the ids. Pending points have it as 8 bytes, which a buffer of floats takes as a float. */
struct column {
    void *number;
    const void *pending; /* of pending point k at k x stride */
    int64_t stride, spare;
    int is_wide;
};

static struct column column_of(const struct gr_engine *e, int64_t k)
{
    const int n = e->points.n_components;
    if (k == n) return (struct column){e->points.id, e->migration.pending_id, 1, -1, 1};
    return (struct column){e->points.column[k], e->migration.pending + k, n, 0, k < e->points.n_doubles};
}

/* Copy the numbers of a column for the slots [first, last) in their new order. */
static void reorder_wide(const struct gr_moves *m, const struct column *column, int64_t first, int64_t last, wide *copy)
{
    const wide *const old = column->number, *const pending = column->pending;
    for (int64_t s = first; s < last; s++) {
        const int64_t from = m->from[s];
        copy[s] = from >= 0 ? old[from] : from == GR_SPARE ? column->spare : pending[(-1 - from) * column->stride];
    }
}

static void reorder_narrow(const struct gr_moves *m, const struct column *column, int64_t first, int64_t last, narrow *copy)
{
    const narrow *const old = column->number;
    const double *const pending = column->pending;
    for (int64_t s = first; s < last; s++) {
        const int64_t from = m->from[s];
        copy[s] = from >= 0 ? old[from] : from == GR_SPARE ? 0 : (float)pending[(-1 - from) * column->stride];
    }
}

/* Copy the numbers of a column back. */
static void bring_back(const struct column *column, int64_t first, int64_t last, const void *copy)
{
    wide *const to = column->number;
    narrow *const to_narrow = column->number;
    const wide *const from = copy;
    const narrow *const from_narrow = copy;
    for (int64_t s = first; column->is_wide && s < last; s++) to[s] = from[s];
    for (int64_t s = first; !column->is_wide && s < last; s++) to_narrow[s] = from_narrow[s];
}

/* Move a column of the points to its copy, and the copy of the one before back. */
GR_DEFINE_PASS(move_column, struct gr_moves, m)
{
    const int64_t k = m->column, columns = e->points.n_components + 1;
    if (k > 0) {
        const struct column column = column_of(e, k - 1);
        bring_back(&column, first, last, m->copy[(k - 1) % 2]);
    }
    if (k == columns) return;
    const struct column column = column_of(e, k);
    if (column.is_wide)
        reorder_wide(m, &column, first, last, m->copy[k % 2]);
    else
        reorder_narrow(m, &column, first, last, m->copy[k % 2]);
}

/* Put spare slots into the middle of their cells; all else is 0 there already. */
GR_DEFINE_PASS(center_spare, struct gr_moves, m)
{
    (void)m;
    for (const struct gr_cell *cell = e->mesh.cell + first; cell < e->mesh.cell + last; cell++)
        for (int32_t k = cell->count; k < cell->capacity; k++) gr_center_slot(e, cell, gr_slot(cell, k));
}

#ifndef GR_ON_DEVICE
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
#endif
