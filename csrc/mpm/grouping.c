/* Grouping of the points by cell. Every cell that holds points, and each of its neighbours, owns a lane of a tile, with the
 * same number of slots for each cell of the tile. Only these active cells and their nodes exist for the kernels, so that
 * memory grows with the material.
 *
 * A team does the work in passes. Each chunk of a pass has cells, tiles, points or slots of its own, and no order depends on
 * their number: the points of a new cell are in the order in which all are listed. */
#include "mpm/grouping.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/index.h"
#include "core/memory.h"
#include "mpm/cell_sums.h"
#include "mpm/connect.h"
#include "mpm/ghosts.h"
#include "mpm/migrate.h"
#include "mpm/sleep.h"
#include "mpm/slots.h"
#include "mpm/spread.h"
#include "mpm/thin_bodies.h"
#include "mpm/tiles.h"

/* Buffers that are too small become larger than needed by one part in this number, as material that spreads soon needs
 * more. Twice as much makes no run faster. Those that would be left with less than half of that to spare are too small as
 * well: tiles that grow would use it up within some steps, and have all points of a flow grouped again. */
enum { GROWTH = 16 };

/* Steps after which emptied cells are counted again. A count is far cheaper than a step. */
enum { EMPTIED_INTERVAL = 64 };

/* Points that are listed together: of a share of the old cells, or the pending ones. */
struct list {
    int64_t first, n;        /* numbers of its points */
    int64_t n_cells;         /* length of its list of their cells */
    int64_t lowest, highest; /* of their new cells */
    int64_t outside;         /* id of the first point outside the domain, and its position; `failed` if there is one */
    double outside_x[3];
    int failed;
};

/* Work space of a regrouping, between the old order of the points and the new. */
struct regroup {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks, n, n_active, n_occupied, total; /* points; active cells, and how many of them hold points; slots */
    struct list *list;                              /* chunks + 1; the last is of the pending points */
    int64_t *source;                                /* per point: its old slot, or -1 - k for pending point k */
    int64_t *slot;   /* per point: index of its cell in the grid; then its number in the new cell; then its new slot */
    int32_t *cell;   /* per point: number of its new cell */
    int64_t *listed; /* indices of the cells of the points in the grid; of each list only where they change */
    int64_t *cells;  /* indices of the active cells in the grid, ascending; double cells twice */
    int8_t *sides;   /* side of each of these; NULL without thin parts */
    struct gr_tiles tiles;
    int32_t *counts; /* points of each new cell, which are the lanes of the tiles */
    int32_t *calm;   /* of the new cells; NULL without sleep */
    int64_t *offset; /* of the new tiles; number of tiles + 1 */
    struct gr_moves moves;
};

enum { FEW_POINTS = 2048 }; /* an estimate: fewer are grouped sooner than a team is called */

/* ---- The points and their cells ---- */

/* List a point. Returned: 0 if it is outside of the domain. */
static int add_point(struct regroup *r, struct list *list, int64_t source, const double x[3], int64_t id)
{
    struct gr_engine *e = r->e;
    int64_t at[3];
    int32_t cell[3] = {0, 0, 0};
    double y[3] = {x[0], x[1], e->config.dim == 3 ? x[2] : 0};
    int inside = 1;
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        at[d] = gr_locate(axis, e->inv_dx, y[d]);
        if (axis->periodic && at[d] == axis->n_cells) { /* ugimp: the last half-cell; fmax against rounding */
            y[d] = fmax(axis->cell[0].begin, y[d] - axis->length);
            at[d] = 0;
        }
        if (at[d] < 0 || at[d] >= axis->n_cells) inside = 0;
        cell[d] = (int32_t)at[d];
    }
    if (inside && e->ranks && gr_owner(e->ranks, cell) != e->ranks->transport.rank) inside = 0;
    if (!inside) {
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
GR_SHARED(count_old, struct regroup, r->e->mesh.n_cells, r)
{
    struct list *list = &r->list[chunk];
    for (int64_t c = first; c < last; c++) list->n += r->e->mesh.cell[c].count;
    if (!r->e->mesh.n_cells) {
        gr_share(r->e->points.n - r->e->migration.n_pending, chunk, r->chunks, &first, &last);
        list->n = last - first;
    }
}

GR_SHARED(list_old, struct regroup, r->e->mesh.n_cells, r)
{
    struct gr_engine *e = r->e;
    struct list *list = &r->list[chunk];
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

/* List all points: those in cells, in their order, then the pending ones. */
static int list_points(struct regroup *r)
{
    struct gr_engine *e = r->e;
    struct list *pending = &r->list[r->chunks];
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
 * ascend already, unless the points have been replaced.
 * Returned: its length. */
static int64_t merge_listed(struct regroup *r)
{
    int64_t n = 0, sorted = 1, n_unique = 0;
    for (int64_t c = 0; c < r->chunks; c++) {
        memmove(r->listed + n, r->listed + r->list[c].first, sizeof *r->listed * (size_t)r->list[c].n_cells);
        n += r->list[c].n_cells;
    }
    for (int64_t k = 1; k < n && sorted; k++) sorted = r->listed[k - 1] <= r->listed[k];
    if (!sorted) qsort(r->listed, (size_t)n, sizeof *r->listed, gr_compare_ids);
    /* n + n_pending <= number of points: behind the pending cells is space for all of them once more */
    struct list *pending = &r->list[r->chunks];
    int64_t *late = r->listed + pending->first, left = pending->n_cells;
    qsort(late, (size_t)left, sizeof *late, gr_compare_ids);
    for (int64_t k = 0, at = 0; k < n || at < left;) { /* to `merged`, behind them */
        const int64_t next = at == left || (k < n && r->listed[k] <= late[at]) ? r->listed[k++] : late[at++];
        int64_t *merged = r->listed + r->n;
        if (!n_unique || merged[n_unique - 1] != next) merged[n_unique++] = next;
    }
    memmove(r->listed, r->listed + r->n, sizeof *r->listed * (size_t)n_unique);
    return n_unique;
}

/* ---- The new cells ---- */

/* Find the side of a listed point in a cell that has the side `of_cell`, and note it where the point is read from: at its
 * old slot or in its record. */
static int find_side(const struct regroup *r, int64_t p, int of_cell)
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

/* Make the cells near thin parts double. */
static int split_cells(struct regroup *r)
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
#define GR_LISTED(pass)                                                                                               \
    static void pass##_list(struct regroup *r, struct list *list);                                                    \
    static void pass##_chunk(void *context, int64_t chunk, int t)                                                     \
    {                                                                                                                 \
        struct regroup *r = context;                                                                                  \
        (void)t;                                                                                                      \
        pass##_list(r, &r->list[chunk]);                                                                              \
    }                                                                                                                 \
    static void pass(struct regroup *r) { gr_team_run(r->chunks > 1 ? r->team : 0, pass##_chunk, r, r->chunks + 1); } \
    static void pass##_list(struct regroup *r, struct list *list)

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
GR_SHARED(count_new, struct regroup, r->tiles.n_cells, r)
{
    (void)chunk;
    for (const struct list *list = r->list; list <= r->list + r->chunks; list++) {
        if (list->lowest >= last || list->highest < first) continue;
        for (int64_t p = list->first; p < list->first + list->n; p++)
            if (r->cell[p] >= first && r->cell[p] < last) r->slot[p] = r->counts[r->cell[p]]++;
    }
}

/* Find the number of slots of each tile. */
GR_SHARED(size_tiles, struct regroup, gr_number_of_tiles(&r->tiles), r)
{
    (void)chunk;
    for (int64_t tile = first; tile < last; tile++) {
        int32_t most = 0;
        for (int64_t c = tile * GR_LANES; c < (tile + 1) * GR_LANES && c < r->tiles.n_cells; c++)
            most = r->counts[c] > most ? r->counts[c] : most;
        r->offset[tile] = GR_LANES * gr_rows_of_tile(most);
    }
}

GR_SHARED(find_sharing, struct regroup, r->n_active, r)
{
    (void)chunk;
    for (int64_t c = first; c < last; c++) r->e->ranks->sharing[c] = (uint8_t)gr_sharing_of(r->e, r->cells[c]);
}

/* List the occupied cells and their neighbours; of those of other ranks only the ones that this rank has, too. */
static int list_active(struct regroup *r)
{
    struct gr_engine *e = r->e;
    int64_t *occupied = NULL, n = r->n_occupied, here = 0;
    int error = e->ranks ? gr_ranks_list_occupied(e, r->listed, r->n_occupied, &occupied, &n) : GR_OK;
    if (!error &&
        gr_spread(e, GR_SPREAD_CELLS, occupied ? occupied : r->listed, n, r->team, r->chunks, &r->cells, &r->n_active))
        error = GR_ERR_MEMORY;
    gr_free(occupied);
    if (!error && e->ranks) error = gr_ranks_reserve_sharing(e->ranks, (1 + (e->bodies.n_thin > 0)) * r->n_active);
    if (error || !e->ranks) return error;
    find_sharing(r);
    for (int64_t c = 0; c < r->n_active; c++) {
        if (e->ranks->sharing[c] == GR_NOT_HERE) continue;
        e->ranks->sharing[here] = e->ranks->sharing[c];
        r->cells[here++] = r->cells[c];
    }
    r->n_active = here;
    return GR_OK;
}

/* List the active cells, make tiles of them, and count the points of each. next_of, set here, becomes cell_of. */
static int list_cells(struct regroup *r)
{
    struct gr_engine *e = r->e;
    r->n_occupied = merge_listed(r);
    const int error = list_active(r);
    if (error) return error;
    if (e->bodies.n_thin && split_cells(r)) return GR_ERR_MEMORY;
    if (gr_make_tiles(&r->tiles, e, r->cells, r->sides, r->n_active) ||
        gr_table_fill(&e->mesh.next_of, r->cells, r->tiles.lane, r->n_active, r->team, r->chunks))
        return GR_ERR_MEMORY;
    const int64_t n_tiles = gr_number_of_tiles(&r->tiles);
    r->counts = gr_calloc((size_t)r->tiles.n_cells + 1, sizeof *r->counts);
    r->offset = gr_malloc(sizeof *r->offset * (size_t)(n_tiles + 1));
    if (!r->counts || !r->offset) return GR_ERR_MEMORY;
    number_cells(r);
    count_new(r);
    size_tiles(r);
    for (int64_t tile = 0; tile <= n_tiles; tile++) {
        const int64_t slots = r->offset[tile];
        r->offset[tile] = r->total;
        if (tile < n_tiles) r->total += slots;
    }
    r->moves = (struct gr_moves){
        .e = e, .team = r->team, .chunks = r->chunks, .used = r->total > e->points.used ? r->total : e->points.used};
    return GR_OK;
}

static int reserve_mesh(struct gr_engine *e, int64_t n_tiles)
{
    struct gr_mesh *mesh = &e->mesh;
    if (n_tiles * GR_LANES <= mesh->cell_capacity && mesh->cell_capacity) return GR_OK; /* also without tiles */
    const int64_t tiles = n_tiles + n_tiles / 2 + 2, capacity = tiles * GR_LANES;
    mesh->cell_capacity = 0;
    GR_RESIZE(mesh->cell, capacity);
    GR_RESIZE(mesh->row_node, capacity * e->n_rows);
    if (e->axis[0].periodic) GR_RESIZE(mesh->row_begin, capacity * e->n_rows);
    GR_RESIZE(mesh->tile_changed, tiles);
    GR_RESIZE(mesh->tile_joins, tiles);
    GR_RESIZE(mesh->tile_in_order, tiles);
    GR_RESIZE(mesh->tile_nodes, tiles);
    GR_RESIZE(mesh->tile_block, tiles + 1);
    if (e->nonlocal.fluidity) GR_RESIZE(mesh->place, capacity);
    if (e->bodies.n_thin) GR_RESIZE(mesh->paired, capacity);
    if (e->bodies.n_thin) GR_RESIZE(mesh->other, capacity);
    if (gr_averages_of_cell(&e->config)) {
        GR_RESIZE(mesh->neighbour, capacity * 2 * e->config.dim);
        GR_RESIZE(e->sums.average, capacity * gr_averages_of_cell(&e->config));
    }
    if (e->nonlocal.fluidity && e->config.nonlocal.substeps > 1) {
        GR_RESIZE(e->nonlocal.substep_mass, capacity);
        GR_RESIZE(e->nonlocal.substep_flow, capacity);
        GR_RESIZE(e->nonlocal.substep_gain, capacity);
    }
    GR_RESIZE(e->sums.dirty, tiles);
    mesh->cell_capacity = capacity;
    return GR_OK;
}

/* Calm of the new cells (mpm/sleep.h): as before, but a sleeping cell wakes if points have come to it. */
GR_SHARED(keep_calm, struct regroup, r->tiles.n_cells, r)
{
    (void)chunk;
    for (int64_t c = first; c < last; c++) {
        r->calm[c] = 0;
        if (r->tiles.side && abs(r->tiles.side[c]) == GR_FRONT) continue; /* double cells do not sleep */
        const int64_t before = (int64_t)gr_table_get(&r->e->mesh.cell_of, r->tiles.cell[c]) - 1;
        const struct gr_cell *cell = before < 0 ? 0 : &r->e->mesh.cell[before];
        const int unchanged = cell && (cell->count == r->counts[c] || (cell->count && cell->calm != GR_ASLEEP));
        if (unchanged) r->calm[c] = cell->calm;
    }
}

/* Set up the cells of the new tiles and clear their sums. The last tile is filled up with cells that lie where its last
 * does. */
GR_SHARED(place_tiles, struct regroup, gr_number_of_tiles(&r->tiles), r)
{
    struct gr_engine *e = r->e;
    const struct gr_tiles *tiles = &r->tiles;
    (void)chunk;
    for (int64_t c = first * GR_LANES; c < last * GR_LANES; c++) {
        struct gr_cell *cell = &e->mesh.cell[c];
        const int64_t tile = c / GR_LANES, source = c < tiles->n_cells ? c : tiles->n_cells - 1;
        cell->offset = r->offset[tile] + c % GR_LANES;
        cell->count = source == c ? r->counts[c] : 0;
        cell->calm = r->calm && source == c ? r->calm[c] : 0;
        cell->capacity = cell->rows = (int32_t)((r->offset[tile + 1] - r->offset[tile]) / GR_LANES);
        cell->apart = 0;
        cell->side = tiles->side && source == c ? tiles->side[c] : 0;
        gr_indices_of_cell(e, tiles->cell[source], cell->at);
        cell->flags = gr_map_get(&e->config.cell_flags, cell->at);
    }
    memset(e->mesh.tile_changed + first, 0, (size_t)(last - first));
    memset((char *)e->sums.data + gr_bytes_of_sums(e, tiles->block[first]), 0,
           gr_bytes_of_sums(e, tiles->block[last] - tiles->block[first]));
}

/* Set up the mesh of the new cells. */
static void place_cells(struct regroup *r)
{
    struct gr_mesh *mesh = &r->e->mesh;
    const struct gr_tiles *tiles = &r->tiles;
    const struct gr_table old = mesh->cell_of;
    mesh->cell_of = mesh->next_of;
    mesh->next_of = old;
    mesh->n_cells = tiles->n_cells;
    mesh->n_front = tiles->n_front;
    mesh->n_tiles = gr_number_of_tiles(tiles);
    memcpy(mesh->tile_joins, tiles->joins, (size_t)mesh->n_tiles);
    memcpy(mesh->tile_block, tiles->block, sizeof *tiles->block * (size_t)(mesh->n_tiles + 1));
    gr_note_size(r->e, tiles->block[mesh->n_tiles], r->total);
    memset(r->e->sums.data, 0, gr_bytes_of_sums(r->e, GR_FIRST_BLOCK));
    place_tiles(r);
    mesh->n_paired = 0;
    for (int64_t c = 0; r->sides && c < mesh->n_cells; c++) {
        mesh->other[c] = tiles->other[c];
        if (tiles->side[c] == GR_FRONT) mesh->paired[mesh->n_paired++] = c;
    }
}

/* ---- The points in their new slots ---- */

GR_SHARED(clear_from, struct regroup, r->moves.used, r)
{
    (void)chunk;
    for (int64_t s = first; s < last; s++) r->moves.from[s] = GR_SPARE;
}

GR_LISTED(find_slots)
{
    for (int64_t p = list->first; p < list->first + list->n; p++)
        r->moves.from[gr_slot(&r->e->mesh.cell[r->cell[p]], r->slot[p])] = r->source[p];
}

static void move_points(struct regroup *r)
{
    clear_from(r);
    find_slots(r);
    gr_move_points(&r->moves);
    r->e->points.used = r->total;
}

/* Find the places of the active cells on the fluidity grid. */
GR_SHARED(find_fluidity, struct regroup, r->tiles.n_cells, r)
{
    const struct gr_engine *e = r->e;
    (void)chunk;
    for (int64_t c = first; c < last; c++) {
        const int back = e->mesh.cell[c].side == GR_BACK;
        e->mesh.place[c] = (int32_t)gr_fluidity_place(e->nonlocal.fluidity, r->tiles.cell[c], back);
    }
}

static int reserve_points(struct regroup *r)
{
    const size_t n = (size_t)r->e->points.n + 1;
    r->list = gr_calloc((size_t)r->chunks + 1, sizeof *r->list);
    r->source = gr_malloc(sizeof *r->source * n);
    r->slot = gr_malloc(sizeof *r->slot * n);
    r->cell = gr_malloc(sizeof *r->cell * n);
    r->listed = gr_malloc(sizeof *r->listed * 2 * n);
    return r->list && r->source && r->slot && r->cell && r->listed ? GR_OK : GR_ERR_MEMORY;
}

static int reserve_slots(struct regroup *r)
{
    const int error = gr_reserve_moves(&r->moves);
    if (error) return error;
    if (!r->e->sleep) return GR_OK;
    r->calm = gr_malloc(sizeof *r->calm * ((size_t)r->tiles.n_cells + 1));
    if (!r->calm) return GR_ERR_MEMORY;
    keep_calm(r);
    return GR_OK;
}

static void free_regroup(struct regroup *r)
{
    void *const owned[] = {r->list,  r->source, r->slot,   r->cell,   r->listed,
                           r->cells, r->sides,  r->counts, r->offset, r->calm};
    for (size_t k = 0; k < sizeof owned / sizeof *owned; k++) gr_free(owned[k]);
    gr_free_tiles(&r->tiles);
    gr_free_moves(&r->moves);
}

int gr_has_emptied(const struct gr_engine *e)
{
    int64_t occupied = 0;
    if (e->clock.step % EMPTIED_INTERVAL) return 0;
    for (int64_t c = 0; c < e->mesh.n_cells; c++) occupied += e->mesh.cell[c].count > 0;
    return 4 * occupied < 3 * e->mesh.n_occupied;
}

/* Agree on whether all ranks have slots for their points. One that has waits for those that have not. */
static int agree_on_slots(struct regroup *r, int error)
{
    struct gr_engine *e = r->e;
    const int agreed = gr_ranks_agree(e, error, NULL, 0);
    if (agreed == GR_ERR_CAPACITY && !error) e->migration.needed_capacity = e->points.capacity;
    return agreed;
}

static int agree_on_ghosts(struct gr_engine *e, int error)
{
    if (!error && e->nonlocal.fluidity) error = gr_ghosts_share_fluidity(e);
    error = gr_ranks_agree(e, error, NULL, 0);
    if (!error) error = gr_ghosts_list(e);
    e->ranks->grouped = !error;
    return error;
}

int gr_regroup(struct gr_engine *e, struct gr_team *team)
{
    struct regroup r = {.e = e, .team = team, .chunks = e->points.n > FEW_POINTS ? gr_chunks(team, GR_MAX_CHUNKS) : 1};
    int error = reserve_points(&r);
    if (!error) error = list_points(&r);
    if (e->ranks) gr_ranks_note_bodies(e);
    if (e->ranks) error = gr_ranks_agree(e, error, NULL, 0);
    if (!error) error = list_cells(&r);
    if (!error && r.total + r.total / (2 * GROWTH) > e->points.capacity) {
        e->migration.needed_capacity = r.total + r.total / GROWTH;
        error = GR_ERR_CAPACITY;
    }
    if (!error) error = reserve_slots(&r);
    if (!error) error = reserve_mesh(e, gr_number_of_tiles(&r.tiles));
    if (!error) error = gr_reserve_sums(e, r.tiles.block[gr_number_of_tiles(&r.tiles)]);
    if (e->ranks) error = agree_on_slots(&r, error);
    if (error) goto out; /* the old cells remain */
    place_cells(&r);
    move_points(&r);
    e->migration.n_pending = 0;
    e->sums.valid = 0;
    e->sums.n_dirty = 0;
    e->mesh.n_occupied = r.n_occupied;
    error = gr_connect(e, &r.tiles, team, r.chunks);
    if (!error && e->nonlocal.fluidity) error = gr_fluidity_cover(e->nonlocal.fluidity, r.cells, r.sides, r.n_active);
    if (!error && e->nonlocal.fluidity) find_fluidity(&r);
    if (e->ranks) error = agree_on_ghosts(e, error);
    e->disconnected = error != GR_OK; /* the points are grouped, but the mesh must be made again */
out:
    free_regroup(&r);
    return error;
}
