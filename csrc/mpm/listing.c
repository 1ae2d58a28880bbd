/* The points listed one by one (listing.h). */
#include "mpm/listing.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/index.h"
#include "core/memory.h"
#include "mpm/numbers.h"
#include "mpm/ranks.h"
#include "mpm/thin_bodies.h"

int gr_find_cell_at(const struct gr_engine *e, double x[3], int32_t cell[3])
{
    int inside = 1;
    cell[2] = 0;
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        int64_t at = gr_locate(axis, e->inv_dx, x[d]);
        if (axis->periodic && at == axis->n_cells) { /* ugimp: the last half-cell; fmax against rounding */
            x[d] = fmax(axis->cell[0].begin, x[d] - axis->length);
            at = 0;
        }
        if (at < 0 || at >= axis->n_cells) inside = 0;
        cell[d] = (int32_t)at;
    }
    return inside && !(e->ranks && gr_owner(e->ranks, cell) != e->ranks->transport.rank);
}

/* List a point. Returned: 0 if it is outside of the domain. */
static int add_point(struct gr_regroup *r, struct gr_list *list, int64_t source, const double x[3], int64_t id)
{
    struct gr_engine *e = r->e;
    int32_t cell[3];
    double y[3] = {x[0], x[1], e->config.dim == 3 ? x[2] : 0};
    if (!gr_find_cell_at(e, y, cell)) {
        list->failed = 1;
        list->outside = id;
        memcpy(list->outside_x, y, sizeof y);
        return 0;
    }
    if (source >= 0)
        for (int d = 0; d < e->config.dim; d++) gr_x(e, d)[source] = y[d];
    int64_t *listed = r->listed + list->first;
    const int64_t index = gr_cell_id(e, cell);
    if (!list->n_cells || listed[list->n_cells - 1] != index) listed[list->n_cells++] = index;
    r->source[list->first + list->n] = source;
    r->slot[list->first + list->n++] = index;
    return 1;
}

/* Count the points of the old cells. Without cells there are only points, and those that wait to enter. */
GR_SHARED(count_old, struct gr_regroup, r->e->mesh.n_cells, r)
{
    struct gr_list *list = &r->list[chunk];
    for (int64_t c = first; c < last; c++) list->n += r->e->mesh.cell[c].count;
    if (!r->e->mesh.n_cells) {
        gr_share(r->e->points.n - r->e->migration.n_pending, chunk, r->chunks, &first, &last);
        list->n = last - first;
    }
}

GR_SHARED(list_old, struct gr_regroup, r->e->mesh.n_cells, r)
{
    struct gr_engine *e = r->e;
    struct gr_list *list = &r->list[chunk];
    double x[3] = {0};
    const int64_t n = list->n;
    int64_t c = first - 1, k = 0;
    const struct gr_cell *cell = 0;
    (void)last;
    list->n = 0;
    for (int64_t p = 0; p < n && !list->failed; p++, k++) {
        while (e->mesh.n_cells && (!cell || k == cell->count)) cell = &e->mesh.cell[++c], k = 0;
        const int64_t slot = cell ? gr_slot(cell, k) : list->first + k;
        for (int d = 0; d < e->config.dim; d++) x[d] = gr_x(e, d)[slot];
        (void)add_point(r, list, slot, x, e->points.id[slot]);
    }
}

static int reserve_points(struct gr_regroup *r)
{
    const size_t n = (size_t)r->e->points.n + 1;
    r->list = gr_calloc((size_t)r->chunks + 1, sizeof *r->list);
    r->source = gr_malloc(sizeof *r->source * n);
    r->slot = gr_malloc(sizeof *r->slot * n);
    r->cell = gr_malloc(sizeof *r->cell * n);
    r->listed = gr_malloc(sizeof *r->listed * 2 * n);
    return r->list && r->source && r->slot && r->cell && r->listed ? GR_OK : GR_ERR_MEMORY;
}

/* List all points: those in cells, in their order, then the pending ones. */
static int list_all(struct gr_regroup *r)
{
    struct gr_engine *e = r->e;
    struct gr_list *pending = &r->list[r->chunks];
    count_old(r);
    for (int64_t c = 0; c < r->chunks; c++) r->list[c + 1].first = r->list[c].first + r->list[c].n;
    list_old(r);
    for (int64_t k = 0; k < e->migration.n_pending; k++)
        if (!add_point(r, pending, -1 - k, e->migration.pending + k * e->points.n_components, e->migration.pending_id[k]))
            break;
    r->n = pending->first + pending->n;
    for (int64_t c = 0; c <= r->chunks; c++) {
        if (!r->list[c].failed) continue;
        e->failure.id = r->list[c].outside;
        memcpy(e->failure.x, r->list[c].outside_x, sizeof e->failure.x);
        return e->failure.code = GR_ERR_OUTSIDE;
    }
    return GR_OK;
}

/* Merge the cells of the lists into one ascending list without repetitions, at `listed`. The cells of the points in cells
 * ascend already, unless the points have been replaced. */
static void merge_listed(struct gr_regroup *r)
{
    int64_t n = 0, sorted = 1, n_unique = 0;
    for (int64_t c = 0; c < r->chunks; c++) {
        memmove(r->listed + n, r->listed + r->list[c].first, sizeof *r->listed * (size_t)r->list[c].n_cells);
        n += r->list[c].n_cells;
    }
    for (int64_t k = 1; k < n && sorted; k++) sorted = r->listed[k - 1] <= r->listed[k];
    if (!sorted) qsort(r->listed, (size_t)n, sizeof *r->listed, gr_compare_ids);
    /* n + n_pending <= number of points: behind the pending cells is space for all of them once more */
    struct gr_list *pending = &r->list[r->chunks];
    int64_t *late = r->listed + pending->first, left = pending->n_cells;
    qsort(late, (size_t)left, sizeof *late, gr_compare_ids);
    for (int64_t k = 0, at = 0; k < n || at < left;) { /* to `merged`, behind them */
        const int64_t next = at == left || (k < n && r->listed[k] <= late[at]) ? r->listed[k++] : late[at++];
        int64_t *merged = r->listed + r->n;
        if (!n_unique || merged[n_unique - 1] != next) merged[n_unique++] = next;
    }
    memmove(r->listed, r->listed + r->n, sizeof *r->listed * (size_t)n_unique);
    r->n_listed = r->n_occupied = n_unique;
}

int gr_list_points(struct gr_regroup *r)
{
    int error = reserve_points(r);
    if (!error) error = list_all(r);
    if (!error) merge_listed(r);
    return error;
}

/* Find the side of a listed point in a cell that has the side `of_cell`, and note it where the point is read from: at its
 * old slot or in its record. */
static int find_side(const struct gr_regroup *r, int64_t p, int of_cell)
{
    struct gr_engine *e = r->e;
    const int64_t slot = r->source[p];
    double *const record = slot < 0 ? e->migration.pending + (-1 - slot) * e->points.n_components : 0;
    double x[3] = {0};
    double *const packed = record ? record + gr_component_of(e, GR_FIELD_side) : 0;
    for (int d = 0; d < e->config.dim; d++) x[d] = record ? record[d] : gr_x(e, d)[slot];
    const double before = packed ? *packed : gr_number(e, GR_FIELD_side, 0, slot);
    const int side = of_cell == GR_FRONT ? gr_point_side(e, x, gr_sign(before)) : 0;
    if (packed)
        *packed = side;
    else
        gr_set_number(e, GR_FIELD_side, 0, slot, side);
    return side;
}

int gr_split_cells(struct gr_regroup *r)
{
    const int64_t n = r->n_active;
    int64_t last = n, *cells = gr_realloc(r->cells, sizeof(int64_t) * (size_t)(2 * n + 1));
    if (!cells) return GR_ERR_MEMORY;
    r->cells = cells;
    r->sides = gr_malloc((size_t)(2 * n + 1));
    if (!r->sides) return GR_ERR_MEMORY;
    for (int64_t c = 0; c < n; c++) {
        int32_t at[3];
        gr_indices_of_cell(r->e, cells[c], at);
        r->sides[c] = (int8_t)gr_cell_side(r->e, at);
        last += abs(r->sides[c]) == GR_FRONT;
    }
    r->n_active = last;
    for (int64_t c = n; c-- > 0;) { /* backwards, so that no entry is overwritten that is still needed */
        const int8_t side = r->sides[c], is_double = abs(side) == GR_FRONT;
        if (is_double) cells[--last] = cells[c], r->sides[last] = GR_BACK;
        cells[--last] = cells[c], r->sides[last] = is_double ? GR_FRONT : side;
    }
    return GR_OK;
}

/* Define pass(r): a stage with a chunk for each list of points. */
#define GR_LISTED(pass)                                                                                                  \
    static void pass##_list(struct gr_regroup *r, struct gr_list *list);                                                 \
    static void pass##_chunk(void *context, int64_t chunk, int t)                                                        \
    {                                                                                                                    \
        struct gr_regroup *r = context;                                                                                  \
        (void)t;                                                                                                         \
        pass##_list(r, &r->list[chunk]);                                                                                 \
    }                                                                                                                    \
    static void pass(struct gr_regroup *r) { gr_team_run(r->chunks > 1 ? r->team : 0, pass##_chunk, r, r->chunks + 1); } \
    static void pass##_list(struct gr_regroup *r, struct gr_list *list)

/* Find the number of the new cell of each point, of the back of a double cell if the point is there. */
GR_LISTED(number_cells)
{
    list->lowest = INT64_MAX, list->highest = -1;
    for (int64_t p = list->first; p < list->first + list->n; p++) {
        int64_t c = (int64_t)gr_table_get(&r->e->mesh.next_of, r->slot[p]) - 1;
        if (r->sides && find_side(r, p, r->tiles.side[c]) < 0 && r->tiles.side[c] == GR_FRONT) c = r->tiles.other[c];
        r->cell[p] = (int32_t)c;
        if (c < list->lowest) list->lowest = c;
        if (c > list->highest) list->highest = c;
    }
}

/* Count the points of each new cell, and number them. */
GR_SHARED(count_new, struct gr_regroup, r->tiles.n_cells, r)
{
    (void)chunk;
    for (const struct gr_list *list = r->list; list <= r->list + r->chunks; list++) {
        if (list->lowest >= last || list->highest < first) continue;
        for (int64_t p = list->first; p < list->first + list->n; p++)
            if (r->cell[p] >= first && r->cell[p] < last) r->slot[p] = r->counts[r->cell[p]]++;
    }
}

void gr_count_listed(struct gr_regroup *r)
{
    number_cells(r);
    count_new(r);
}

GR_LISTED(find_moves)
{
    for (int64_t p = list->first; p < list->first + list->n; p++)
        r->moves.from[gr_new_slot(r, r->cell[p], r->slot[p])] = r->source[p];
}

void gr_find_listed_moves(struct gr_regroup *r) { find_moves(r); }

void gr_free_listing(struct gr_regroup *r)
{
    void *const owned[] = {r->list, r->source, r->slot, r->cell};
    for (size_t k = 0; k < sizeof owned / sizeof *owned; k++) gr_free(owned[k]);
}
