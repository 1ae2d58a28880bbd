/* Grouping of the points by cell. Every cell that holds points, and each of its neighbours, owns a lane of a tile, with the
 * same number of places for each cell of the tile. Only these active cells and their nodes exist for the kernels, so that
 * memory grows with the material. */
#include <stdlib.h>
#include <string.h>

#include "core/memory.h"
#include "mpm/migrate.h"
#include "mpm/sleep.h"

/* Number of rows of a tile whose fullest cell has `most` points: some more than it has or a cell usually has. Neither a cell
 * that gains many points nor a front that enters empty cells then requires a regrouping in every step. An empty tile has
 * few: a front fills it slowly, and soon needs the cells beyond it, for which all are regrouped. */
static int32_t rows_of_tile(int32_t most, int32_t usual)
{
    enum { EMPTY_ROWS = 4 };
    if (!most) return EMPTY_ROWS;
    const int32_t many = most > usual ? most : usual;
    return many + many / 8 + 2;
}

/* Buffers that are too small become larger than needed by one part in this number, as material that spreads soon needs
 * more. Twice as much makes no run faster. */
enum { GROWTH = 16 };

int gr_compare_ids(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

/* Work space of a regrouping, between the old order of the points and the new. */
struct regroup {
    int64_t n, n_cells, n_tiles, total;
    int32_t usual;    /* mean number of points of an occupied cell */
    int64_t *source;  /* per point: its old place, or -1 - k for pending point k */
    int64_t *cell_id; /* per point: index of its cell in the grid; then number of its new cell; then its new place */
    int64_t *cells;   /* indices of the active cells in the grid, ascending; double cells twice */
    int8_t *sides;    /* side of each cell; NULL without thin parts */
    int32_t *counts;
    int32_t *calm; /* of the cells that had points before; NULL without sleep */
    double *scratch;
};

static void decode(const struct gr_engine *e, int64_t id, int32_t at[3])
{
    at[2] = 0;
    for (int d = 0; d < e->config.dim; d++) {
        at[d] = (int32_t)(id % e->axis[d].n_cells);
        id /= e->axis[d].n_cells;
    }
}

static int add_point(struct gr_engine *e, struct regroup *r, int64_t source, const double x[3], int64_t error_id)
{
    int64_t at[3];
    int32_t cell[3] = {0, 0, 0};
    double y[3] = {x[0], x[1], e->config.dim == 3 ? x[2] : 0};
    int inside = 1;
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        at[d] = gr_locate(axis, e->inv_dx, y[d]);
        if (axis->periodic && at[d] == axis->n_cells) y[d] -= axis->length, at[d] = 0; /* ugimp: the last half-cell */
        if (at[d] < 0 || at[d] >= axis->n_cells) inside = 0;
        cell[d] = (int32_t)at[d];
    }
    if (!inside) {
        e->error_id = error_id;
        memcpy(e->error_x, y, sizeof y);
        return e->error = GR_ERR_OUTSIDE;
    }
    if (source >= 0)
        for (int d = 0; d < e->config.dim; d++) e->field[GR_FIELD_x][d * e->capacity + source] = y[d];
    r->source[r->n] = source;
    r->cell_id[r->n++] = gr_cell_id(e, cell);
    return GR_OK;
}

/* List all points: those in cells, in their order, then the pending ones. */
static int list_points(struct gr_engine *e, struct regroup *r)
{
    int error = GR_OK;
    double x[3] = {0};
    const int grouped = e->mesh.n_cells > 0;
    for (int64_t g = 0; g < (grouped ? e->mesh.n_cells : 1); g++) {
        const struct gr_cell *cell = grouped ? &e->mesh.cell[g] : 0;
        for (int64_t k = 0; !error && k < (cell ? cell->count : e->n_points - e->n_pending); k++) {
            const int64_t slot = cell ? gr_slot(cell, k) : k;
            for (int d = 0; d < e->config.dim; d++) x[d] = e->field[GR_FIELD_x][d * e->capacity + slot];
            error = add_point(e, r, slot, x, e->id[slot]);
        }
    }
    for (int64_t k = 0; !error && k < e->n_pending; k++)
        error = add_point(e, r, -1 - k, e->pending + k * e->n_components, e->pending_id[k]);
    return error;
}

/* List a cell, unless it is listed already. */
static int list_cell(struct gr_engine *e, struct regroup *r, int64_t id)
{
    if (gr_table_get(&e->mesh.next_of, id)) return GR_OK;
    r->cells[r->n_cells++] = id;
    return gr_table_set(&e->mesh.next_of, id, 1);
}

/* Position of a listed point; it is read from its old place or from its record.
 * Returned: a pointer to its side. */
static double *look_up(struct gr_engine *e, const struct regroup *r, int64_t p, double x[3])
{
    const int64_t place = r->source[p];
    double *record = place < 0 ? e->pending + (-1 - place) * e->n_components : 0;
    x[2] = 0;
    for (int d = 0; d < e->config.dim; d++) x[d] = record ? record[d] : e->field[GR_FIELD_x][d * e->capacity + place];
    return record ? record + gr_component_of(e, GR_FIELD_side) : e->field[GR_FIELD_side] + place;
}

/* Make the cells near thin parts double. */
static int split_cells(struct gr_engine *e, struct regroup *r)
{
    const int64_t n = r->n_cells;
    int64_t last = n, *cells = realloc(r->cells, sizeof(int64_t) * (size_t)(2 * n + 1));
    if (!cells) return GR_ERR_MEMORY;
    r->cells = cells;
    r->sides = malloc((size_t)(2 * n + 1));
    if (!r->sides) return GR_ERR_MEMORY;
    for (int64_t c = 0; c < n; c++) {
        int32_t at[3];
        decode(e, cells[c], at);
        r->sides[c] = (int8_t)gr_cell_side(e, at);
        last += abs(r->sides[c]) == 1;
    }
    r->n_cells = last;
    for (int64_t c = n; c-- > 0;) { /* backwards, so that no entry is overwritten that is still needed */
        const int8_t side = r->sides[c], is_double = abs(side) == 1;
        if (is_double) cells[--last] = cells[c], r->sides[last] = -1;
        cells[--last] = cells[c], r->sides[last] = is_double ? 1 : side;
        (void)gr_table_set(&e->mesh.next_of, cells[last], (int32_t)(last + 1)); /* cannot fail */
    }
    return GR_OK;
}

/* Replace the cell of each point by the number of the active cell, of the back of a double cell if the point is there. */
static void number_cells(struct gr_engine *e, struct regroup *r)
{
    for (int64_t p = 0; p < r->n; p++) {
        int64_t c = (int64_t)gr_table_get(&e->mesh.next_of, r->cell_id[p]) - 1;
        if (r->sides) {
            double x[3], *side = look_up(e, r, p, x);
            *side = r->sides[c] == 1 ? gr_point_side(e, x, (int)*side) : 0;
            c += *side < 0;
        }
        r->cell_id[p] = c;
    }
}

/* Number of rows of the tile that begins with a cell. */
static int32_t rows_from(const struct regroup *r, int64_t first)
{
    int32_t most = 0;
    for (int64_t c = first; c < first + GR_LANES && c < r->n_cells; c++) most = r->counts[c] > most ? r->counts[c] : most;
    return rows_of_tile(most, r->usual);
}

/* List the occupied cells and their neighbours, and count the points of each. next_of, set here, becomes cell_of. */
static int list_cells(struct gr_engine *e, struct regroup *r)
{
    const int dim = e->config.dim, around = dim == 2 ? 9 : 27;
    struct gr_table *map = &e->mesh.next_of;
    gr_table_clear(map);
    for (int64_t p = 0; p < r->n; p++)
        if (list_cell(e, r, r->cell_id[p])) return GR_ERR_MEMORY;
    const int64_t occupied = r->n_cells;
    int64_t *cells = realloc(r->cells, sizeof(int64_t) * (size_t)(occupied * around + 1));
    if (!cells) return GR_ERR_MEMORY;
    r->cells = cells;
    for (int64_t c = 0; c < occupied; c++) {
        int32_t at[3];
        decode(e, cells[c], at);
        for (int k = 0; k < around; k++) {
            int32_t next[3] = {at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, dim == 3 ? at[2] + k / 9 - 1 : 0};
            int inside = 1;
            for (int d = 0; d < dim; d++) {
                const int m = e->axis[d].n_cells;
                if (e->axis[d].periodic) next[d] = (next[d] + m) % m;
                if (next[d] < 0 || next[d] >= m) inside = 0;
            }
            if (inside && list_cell(e, r, gr_cell_id(e, next))) return GR_ERR_MEMORY;
        }
    }
    qsort(cells, (size_t)r->n_cells, sizeof(int64_t), gr_compare_ids);
    /* cannot fail: these entries were set before */
    for (int64_t c = 0; c < r->n_cells; c++) (void)gr_table_set(map, cells[c], (int32_t)(c + 1));
    if (e->n_thin && split_cells(e, r)) return GR_ERR_MEMORY;
    r->counts = calloc((size_t)r->n_cells + 1, sizeof(int32_t));
    if (!r->counts) return GR_ERR_MEMORY;
    number_cells(e, r);
    for (int64_t p = 0; p < r->n; p++) r->counts[r->cell_id[p]]++;
    r->usual = occupied ? (int32_t)(r->n / occupied) : 0;
    for (int64_t c = 0; c < r->n_cells; c += GR_LANES) r->total += GR_LANES * rows_from(r, c);
    return GR_OK;
}

static int reserve_mesh(struct gr_engine *e, int64_t n_cells)
{
    struct gr_mesh *mesh = &e->mesh;
    if (n_cells <= mesh->cell_capacity && e->sums) return GR_OK;
    const int64_t tiles = (n_cells + n_cells / 2) / GR_LANES + 2, capacity = tiles * GR_LANES;
    mesh->cell_capacity = 0;
    GR_RESIZE(mesh->cell, capacity);
    GR_RESIZE(mesh->cell_node, capacity * e->K);
    GR_RESIZE(mesh->tile_state, tiles);
    GR_RESIZE(mesh->tile_in_row, tiles);
    if (e->fluidity) GR_RESIZE(mesh->place, capacity);
    if (e->n_thin) GR_RESIZE(mesh->paired, capacity);
    if (e->config.cell_averaged) {
        GR_RESIZE(mesh->beside, capacity * 2 * e->config.dim);
        GR_RESIZE(e->average, capacity * GR_AVERAGES(e->config.dim));
    }
    if (e->fluidity && e->config.nonlocal.substeps > 1) {
        GR_RESIZE(e->substep_mass, capacity);
        GR_RESIZE(e->substep_flow, capacity);
    }
    GR_RESIZE(e->dirty, tiles);
    GR_RESIZE(e->sums, (tiles + 1) * e->sum_stride + GR_LANES); /* loads of node_sums.inl end beyond the last */
    mesh->cell_capacity = capacity;
    return GR_OK;
}

/* Move one component of all points to their new places. */
static void move_component(double *array, const struct regroup *r, const double *pending, int stride, int64_t used)
{
    memset(r->scratch, 0, sizeof(double) * (size_t)used);
    for (int64_t p = 0; p < r->n; p++)
        r->scratch[r->cell_id[p]] = r->source[p] >= 0 ? array[r->source[p]] : pending[(-1 - r->source[p]) * stride];
    memcpy(array, r->scratch, sizeof(double) * (size_t)used);
}

static void move_points(struct gr_engine *e, struct regroup *r)
{
    int component = 0;
    const int64_t used = r->total > e->used ? r->total : e->used;
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        for (int c = 0; e->field[f] && c < gr_field_components(f, e->config.dim); c++, component++)
            move_component(e->field[f] + c * e->capacity, r, e->pending + component, e->n_components, used);
    int64_t *ids = (int64_t *)(void *)r->scratch;
    for (int64_t s = 0; s < used; s++) ids[s] = -1;
    for (int64_t p = 0; p < r->n; p++)
        ids[r->cell_id[p]] = r->source[p] >= 0 ? e->id[r->source[p]] : e->pending_id[-1 - r->source[p]];
    memcpy(e->id, ids, sizeof(int64_t) * (size_t)used);
    e->used = r->total;
}

/* Calm of the new cells (mpm/sleep.h): what it was, but an asleep cell wakes if points have come to it. */
static int keep_calm(struct gr_engine *e, struct regroup *r)
{
    if (!e->sleep) return GR_OK;
    r->calm = calloc((size_t)r->n_cells + 1, sizeof *r->calm);
    if (!r->calm) return GR_ERR_MEMORY;
    for (int64_t c = 0; c < r->n_cells; c++) {
        if (r->sides && abs(r->sides[c]) == 1) continue; /* double cells do not sleep */
        const int64_t before = (int64_t)gr_table_get(&e->mesh.cell_of, r->cells[c]) - 1;
        const struct gr_cell *cell = before < 0 ? 0 : &e->mesh.cell[before];
        if (cell && cell->count && (cell->calm != GR_ASLEEP || cell->count == r->counts[c])) r->calm[c] = cell->calm;
    }
    return GR_OK;
}

/* Set up the new cells, and for each point its new place in r->cell_id. */
static void place_cells(struct gr_engine *e, struct regroup *r)
{
    int64_t offset = 0;
    int32_t rows = 0;
    const struct gr_table old = e->mesh.cell_of;
    e->mesh.cell_of = e->mesh.next_of;
    e->mesh.next_of = old;
    e->mesh.n_paired = 0;
    for (int64_t c = 0; c < r->n_cells; c++) {
        struct gr_cell *cell = &e->mesh.cell[c];
        if (c % GR_LANES == 0) rows = rows_from(r, c);
        cell->offset = offset + c % GR_LANES;
        cell->count = cell->summed = 0;
        cell->calm = r->calm ? r->calm[c] : 0;
        cell->capacity = rows;
        cell->side = r->sides ? r->sides[c] : 0;
        if (cell->side == 1) e->mesh.paired[e->mesh.n_paired++] = c;
        decode(e, r->cells[c], cell->at);
        cell->flags = gr_map_get(&e->config.cell_flags, cell->at);
        if ((c + 1) % GR_LANES == 0) offset += GR_LANES * rows;
    }
    e->mesh.n_cells = r->n_cells;
    e->mesh.n_tiles = (r->n_cells + GR_LANES - 1) / GR_LANES;
    for (int64_t c = r->n_cells; c < e->mesh.n_tiles * GR_LANES; c++) { /* fill up the last tile */
        e->mesh.cell[c] = e->mesh.cell[c - 1];
        e->mesh.cell[c].offset++;
        e->mesh.cell[c].calm = 0;
        e->mesh.cell[c].side = 0;
    }
    memset(e->mesh.tile_state, GR_TILE_SUMMED, (size_t)e->mesh.n_tiles);
    for (int64_t p = 0; p < r->n; p++) {
        struct gr_cell *cell = &e->mesh.cell[r->cell_id[p]];
        r->cell_id[p] = gr_slot(cell, cell->count++);
    }
}

/* Give the active cells their places on the fluidity grid. */
static int cover_cells(struct gr_engine *e, const struct regroup *r)
{
    const int error = gr_fluidity_cover(e->fluidity, r->cells, r->sides, r->n_cells);
    for (int64_t c = 0; c < e->mesh.n_cells && !error; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        e->mesh.place[c] = (int32_t)gr_fluidity_place(e->fluidity, gr_cell_id(e, cell->at), cell->side == -1);
    }
    return error;
}

int gr_regroup(struct gr_engine *e)
{
    struct regroup r = {0};
    const int64_t n = e->n_points;
    int error = GR_ERR_MEMORY;
    r.source = malloc(sizeof(int64_t) * (size_t)(n + 1));
    r.cell_id = malloc(sizeof(int64_t) * (size_t)(n + 1));
    r.cells = malloc(sizeof(int64_t) * (size_t)(n + 1));
    r.scratch = malloc(sizeof(double) * (size_t)(e->capacity + 1));
    if (!r.source || !r.cell_id || !r.cells || !r.scratch) goto out;
    error = list_points(e, &r);
    if (!error) error = list_cells(e, &r);
    if (!error && r.total > e->capacity) {
        e->needed_capacity = r.total + r.total / GROWTH;
        error = GR_ERR_CAPACITY;
    }
    if (!error) error = keep_calm(e, &r);
    if (!error) error = reserve_mesh(e, r.n_cells);
    if (error) goto out; /* the old cells are kept */
    place_cells(e, &r);
    move_points(e, &r);
    e->n_pending = 0;
    e->sums_valid = 0;
    e->n_dirty = 0;
    for (int64_t c = 0; c < e->mesh.n_tiles * GR_LANES; c++)
        for (int32_t k = e->mesh.cell[c].count; k < e->mesh.cell[c].capacity; k++)
            gr_clear_place(e, &e->mesh.cell[c], gr_slot(&e->mesh.cell[c], k));
    error = gr_connect(e);
    if (!error && e->fluidity) error = cover_cells(e, &r);
    e->disconnected = error != GR_OK; /* the points are grouped, but the mesh must be made again */
    memset(e->sums, 0, sizeof(double) * (size_t)((e->mesh.n_tiles + 1) * e->sum_stride + GR_LANES));
out:
    free(r.source);
    free(r.cell_id);
    free(r.cells);
    free(r.counts);
    free(r.calm);
    free(r.sides);
    free(r.scratch);
    return error;
}
