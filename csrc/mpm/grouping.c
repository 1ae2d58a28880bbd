/* Grouping of the points by cell. Every cell that holds points, and each of its neighbours, owns a lane of a tile, with the
 * same number of places for each cell of the tile. Only these active cells and their nodes exist for the kernels, so that
 * memory grows with the material. */
#include <stdlib.h>
#include <string.h>

#include "core/memory.h"
#include "mpm/migrate.h"
#include "mpm/wall_impulse.h"

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

static int compare_ids(const void *a, const void *b)
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
        for (int64_t k = 0; !error && k < (cell ? cell->count : e->n_points); k++) {
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
    qsort(cells, (size_t)r->n_cells, sizeof(int64_t), compare_ids);
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

static int reserve_nodes(struct gr_engine *e, int64_t n)
{
    struct gr_mesh *mesh = &e->mesh;
    if (n <= mesh->node_capacity) return GR_OK;
    const int64_t capacity = n + n / 2;
    mesh->node_capacity = 0;
    GR_RESIZE(mesh->node_source, capacity * e->K);
    GR_RESIZE(mesh->node_run, (capacity / GR_LANES + 1) * e->K);
    GR_RESIZE(mesh->node_code, capacity);
    GR_RESIZE(mesh->node_volume, capacity);
    GR_RESIZE(mesh->node_id, capacity);
    e->node_places = capacity + GR_LANES;
    GR_RESIZE(e->node_data, e->node_fields * e->node_places);
    GR_RESIZE(e->node_mass, capacity);
    GR_RESIZE(e->node_v, capacity * e->config.dim);
    if (e->watch) GR_RESIZE(e->watch->node, capacity * e->config.dim);
    if (e->n_thin) {
        GR_RESIZE(mesh->duplicate, capacity);
        GR_RESIZE(mesh->separated, capacity);
    }
    mesh->node_capacity = capacity;
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
        e->mesh.cell[c].side = 0;
    }
    memset(e->mesh.tile_state, GR_TILE_SUMMED, (size_t)e->mesh.n_tiles);
    for (int64_t p = 0; p < r->n; p++) {
        struct gr_cell *cell = &e->mesh.cell[r->cell_id[p]];
        r->cell_id[p] = gr_slot(cell, cell->count++);
    }
}

static int64_t node_id_of(const struct gr_engine *e, const struct gr_cell *cell, int local)
{
    const int k = gr_basis_nodes_1d(e->config.basis);
    const int part[3] = {local % k, local / k % k, local / (k * k)};
    int64_t id = 0;
    for (int d = e->config.dim - 1; d >= 0; d--) id = id * e->axis[d].n_nodes + e->axis[d].cell[cell->at[d]].node[part[d]];
    return id;
}

/* 1 if local node number `local` of a cell would be beyond an end of an axis (ugimp): it has no weight. */
static int is_beyond(const struct gr_engine *e, const struct gr_cell *cell, int local)
{
    const int k = gr_basis_nodes_1d(e->config.basis);
    for (int d = 0; d < e->config.dim; d++, local /= k) {
        const int32_t *node = e->axis[d].cell[cell->at[d]].node;
        if (!e->axis[d].periodic && local % k != 1 && node[local % k] == node[1]) return 1;
    }
    return 0;
}

double gr_node_volume(const struct gr_engine *e, int64_t id)
{
    int32_t at[3] = {0};
    double volume = 1;
    for (int d = 0; d < e->config.dim; d++) {
        at[d] = (int32_t)(id % e->axis[d].n_nodes);
        volume *= e->axis[d].node_integral[at[d]];
        id /= e->axis[d].n_nodes;
    }
    return volume - gr_solid_volume(e, at);
}

static void describe_node(struct gr_engine *e, int64_t n)
{
    struct gr_mesh *mesh = &e->mesh;
    int64_t id = mesh->node_id[n];
    int32_t at[3] = {0};
    mesh->node_volume[n] = gr_node_volume(e, id);
    for (int d = 0; d < e->config.dim; d++) {
        at[d] = (int32_t)(id % e->axis[d].n_nodes);
        id /= e->axis[d].n_nodes;
    }
    mesh->node_code[n] = gr_map_get(&e->config.node_codes, at);
    for (int i = 0; i < e->K; i++)
        mesh->node_source[n * e->K + i] = gr_sums_of_cell(e, mesh->n_tiles * GR_LANES + n % GR_LANES) +
                                          (e->K - 1 - i) * GR_SUM_DAMPED(e->config.dim) * GR_LANES;
}

/* Clear the nodal fields, which belong to the old nodes: G2P before the next grid stage then finds all nodes at rest. */
static void clear_nodes(struct gr_engine *e)
{
    const size_t n = (size_t)e->mesh.n_nodes * sizeof(double);
    if (!n) return;
    memset(e->node_data, 0, sizeof(double) * (size_t)(e->node_fields * e->node_places));
    memset(e->node_mass, 0, n);
    memset(e->node_v, 0, n * (size_t)e->config.dim);
}

/* List the nodes of the active cells. node_of counts the copies of each: 2 if a double cell has it, else 1. */
static int list_nodes(struct gr_engine *e, int64_t *ids, int64_t *n_ids, int64_t *n_nodes)
{
    struct gr_table *map = &e->mesh.node_of;
    *n_ids = *n_nodes = 0;
    gr_table_clear(map);
    for (int64_t c = 0; c < e->mesh.n_cells; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        const int copies = cell->side == 1 ? 2 : 1;
        for (int a = 0; a < e->K; a++) {
            const int64_t id = node_id_of(e, cell, a);
            const int32_t had = gr_table_get(map, id);
            if (!had) ids[(*n_ids)++] = id;
            if (had >= copies) continue;
            *n_nodes += copies - had;
            if (gr_table_set(map, id, copies)) return GR_ERR_MEMORY;
        }
    }
    qsort(ids, (size_t)*n_ids, sizeof(int64_t), compare_ids);
    return GR_OK;
}

/* Number the nodes; the two copies of a node follow each other. */
static void number_nodes(struct gr_engine *e, const int64_t *ids, int64_t n_ids)
{
    struct gr_mesh *mesh = &e->mesh;
    int64_t n = 0;
    for (int64_t k = 0; k < n_ids; k++) {
        const int copies = gr_table_get(&mesh->node_of, ids[k]);
        (void)gr_table_set(&mesh->node_of, ids[k], (int32_t)(n + 1)); /* cannot fail */
        for (int copy = 0; copy < copies; copy++, n++) {
            mesh->node_id[n] = ids[k];
            if (e->n_thin) mesh->duplicate[n] = copies == 1 ? -1 : (int32_t)(copy ? n - 1 : n + 1);
            describe_node(e, n);
        }
    }
}

/* Find out which local nodes of the cells of a tile follow each other. */
static void find_rows(struct gr_engine *e)
{
    for (int64_t tile = 0; tile < e->mesh.n_tiles; tile++) {
        const int32_t *node = e->mesh.cell_node + tile * e->K * GR_LANES;
        e->mesh.tile_in_row[tile] = 0;
        for (int i = 0; i < e->K; i++, node += GR_LANES) {
            int in_row = 1;
            for (int l = 1; l < GR_LANES; l++) in_row &= node[l] == node[0] + l;
            e->mesh.tile_in_row[tile] |= (uint32_t)in_row << i;
        }
    }
}

/* Find the pieces in which the sums of GR_LANES nodes lie. Nodes beyond the last continue its piece. */
static void find_runs(struct gr_engine *e)
{
    const struct gr_mesh *mesh = &e->mesh;
    for (int64_t group = 0; group * GR_LANES < mesh->n_nodes; group++)
        for (int i = 0; i < e->K; i++) {
            const int64_t *source = mesh->node_source + group * GR_LANES * e->K + i;
            const int64_t left = mesh->n_nodes - group * GR_LANES, n = left < GR_LANES ? left : GR_LANES;
            struct gr_node_run run = {source[0], source[0], GR_LANES};
            for (int l = 1; l < n; l++) {
                const int64_t at = source[l * e->K] - l;
                if (at == (run.split < GR_LANES ? run.second : run.first)) continue;
                if (run.split < GR_LANES || at < 0) {
                    run.split = GR_RUN_BROKEN;
                    break;
                }
                run.split = l;
                run.second = at;
            }
            mesh->node_run[group * e->K + i] = run;
        }
}

/* Index of the neighbour of a cell along axis d, low or high; see enum gr_beside. */
static int64_t cell_beside(const struct gr_engine *e, const struct gr_cell *cell, int d, int high)
{
    int32_t at[3];
    memcpy(at, cell->at, sizeof at);
    if (cell->flags / GR_CELL_WALL >> (2 * d + high) & 1) return GR_BESIDE_CLOSED;
    at[d] += high ? 1 : -1;
    if (at[d] < 0 || at[d] >= e->axis[d].n_cells) {
        if (!e->axis[d].periodic) return GR_BESIDE_CLOSED;
        at[d] = high ? 0 : e->axis[d].n_cells - 1;
    }
    const int64_t index = (int64_t)gr_table_get(&e->mesh.cell_of, gr_cell_id(e, at)) - 1;
    return index < 0 ? GR_BESIDE_NO_POINTS : index;
}

static void find_neighbours(struct gr_engine *e)
{
    const int sides = 2 * e->config.dim;
    for (int64_t c = 0; c < e->mesh.n_tiles * GR_LANES; c++)
        for (int k = 0; k < sides; k++)
            e->mesh.beside[c * sides + k] = (int32_t)cell_beside(e, &e->mesh.cell[c], k / 2, k % 2);
}

/* Connect the nodes and the active cells: for each cell its nodes, and for each node where its sums over each of its
 * cells are, in the order of cells. */
static int connect_nodes(struct gr_engine *e)
{
    struct gr_mesh *mesh = &e->mesh;
    const int K = e->K;
    int64_t n_ids, n_nodes;
    int64_t *ids = malloc(sizeof(int64_t) * (size_t)(mesh->n_cells * K + 1));
    int error = GR_ERR_MEMORY;
    mesh->n_nodes = 0;
    if (!ids || list_nodes(e, ids, &n_ids, &n_nodes) || reserve_nodes(e, n_nodes)) goto out;
    mesh->n_nodes = n_nodes;
    clear_nodes(e);
    number_nodes(e, ids, n_ids);
    for (int64_t c = 0; c < mesh->n_tiles * GR_LANES; c++)
        for (int a = 0; a < K; a++) {
            int32_t n = gr_table_get(&mesh->node_of, node_id_of(e, &mesh->cell[c], a)) - 1;
            if (e->n_thin && mesh->duplicate[n] >= 0) n += mesh->cell[c].side < 0;
            mesh->cell_node[(c / GR_LANES * K + a) * GR_LANES + c % GR_LANES] = n;
            if (c >= mesh->n_cells || is_beyond(e, &mesh->cell[c], a)) continue;
            mesh->node_source[(int64_t)n * K + K - 1 - a] =
                gr_sums_of_cell(e, c) + a * GR_SUM_DAMPED(e->config.dim) * GR_LANES;
        }
    find_rows(e);
    find_runs(e);
    error = GR_OK;
out:
    if (error) gr_table_clear(&mesh->node_of);
    free(ids);
    return error;
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
    if (e->config.cell_averaged) find_neighbours(e);
    error = connect_nodes(e);
    if (!error && e->fluidity) error = cover_cells(e, &r);
    e->disconnected = error != GR_OK; /* the points are grouped, but the mesh must be made again */
    memset(e->sums, 0, sizeof(double) * (size_t)((e->mesh.n_tiles + 1) * e->sum_stride + GR_LANES));
out:
    free(r.source);
    free(r.cell_id);
    free(r.cells);
    free(r.counts);
    free(r.sides);
    free(r.scratch);
    return error;
}
