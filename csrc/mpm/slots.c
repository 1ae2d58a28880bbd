#include "mpm/slots.h"
#include "core/memory.h"

#include <string.h>

/* One row more than the fullest cell has points: a tile that needs more gets them when it does, while spare rows of all
 * tiles are memory. An empty tile has a row for the first points of a front. */
int32_t gr_rows_of_tile(int32_t most) { return most + 1; }

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

/* A component of a field, or the ids. Pending points have it as 8 bytes, which a buffer of floats takes as a float. */
struct gr_column {
    void *to;
    const double *pending; /* of pending point k at k x stride */
    int64_t stride;
    size_t size;   /* bytes of a number in the buffer */
    int64_t spare; /* value of a spare slot */
};

int gr_reserve_moves(struct gr_moves *moves)
{
    const size_t n = (size_t)moves->used;
    moves->from = gr_malloc(sizeof *moves->from * (n + 1));
    moves->scratch = gr_malloc(sizeof(double) * (2 * n + 1));
    moves->columns = gr_malloc(sizeof *moves->columns * ((size_t)moves->e->points.n_components + 1));
    return moves->from && moves->scratch && moves->columns ? GR_OK : GR_ERR_MEMORY;
}

void gr_free_moves(struct gr_moves *moves)
{
    gr_free(moves->from);
    gr_free(moves->scratch);
    gr_free(moves->columns);
}

/* Copy the numbers of a column for the slots [first, last) in their new order. */
static inline __attribute__((always_inline)) void reorder(const size_t size, const struct gr_moves *moves,
                                                          const struct gr_column *column, int64_t first, int64_t last,
                                                          char *copy)
{
    const char *const old = column->to;
    for (int64_t s = first; s < last; s++) {
        const int64_t from = moves->from[s];
        char *const to = copy + (size_t)s * size;
        if (from >= 0) {
            memcpy(to, old + (size_t)from * size, size);
        } else if (from == GR_SPARE) {
            memcpy(to, &column->spare, size); /* all bytes of it are alike */
        } else {
            const double *const pending = column->pending + (-1 - from) * column->stride;
            const float narrow = size == sizeof(float) ? (float)*pending : 0;
            memcpy(to, size == sizeof(float) ? (const void *)&narrow : pending, size);
        }
    }
}

/* Move a column of the points to the new slots: first to a copy, which replaces it while the next column is moved. */
GR_SHARED(move_column, struct gr_moves, m->used, m)
{
    const int64_t k = m->column, columns = m->e->points.n_components + 1;
    char *const half[2] = {m->scratch, m->scratch + (size_t)m->used * sizeof(double)};
    (void)chunk;
    if (k > 0) {
        const size_t size = m->columns[k - 1].size, begin = (size_t)first * size;
        memcpy((char *)m->columns[k - 1].to + begin, half[(k - 1) % 2] + begin, size * (size_t)(last - first));
    }
    if (k == columns) return;
    if (m->columns[k].size == sizeof(float))
        reorder(sizeof(float), m, &m->columns[k], first, last, half[k % 2]);
    else
        reorder(sizeof(double), m, &m->columns[k], first, last, half[k % 2]);
}

/* Put spare slots into the middle of their cells; all else is 0 there already. */
GR_SHARED(center_spare, struct gr_moves, m->e->mesh.n_tiles *GR_LANES, m)
{
    (void)chunk;
    for (const struct gr_cell *cell = m->e->mesh.cell + first; cell < m->e->mesh.cell + last; cell++)
        for (int32_t k = cell->count; k < cell->capacity; k++) gr_center_slot(m->e, cell, gr_slot(cell, k));
}

void gr_move_points(struct gr_moves *moves)
{
    struct gr_engine *e = moves->e;
    const int n = e->points.n_components;
    for (int k = 0; k < n; k++)
        moves->columns[k] = (struct gr_column){e->points.column[k], e->migration.pending + k, n,
                                               k < e->points.n_doubles ? sizeof(double) : sizeof(float), 0};
    moves->columns[n] =
        (struct gr_column){e->points.id, (const double *)e->migration.pending_id, 1, sizeof *e->points.id, -1};
    for (moves->column = 0; moves->column <= n + 1; moves->column++) move_column(moves);
    center_spare(moves);
}
