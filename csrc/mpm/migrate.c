/* Migration of points between cells, through periodic ends, and out of the domain (migrate.h). */
#include "mpm/migrate.h"

#include <math.h>
#include <string.h>

#include "core/index.h"
#include "core/memory.h"
#include "mpm/arrivals.h"
#include "mpm/device.h"
#include "mpm/sleep.h"
#include "mpm/slots.h"
#include "mpm/tally.h"
#include "mpm/thin_bodies.h"
#include "mpm/walls.h"

/* True if all nodes are walls along axis d on the face with which the domain ends at cell `from`. */
static int is_closed(const struct gr_engine *e, const int32_t from[3], int d, int high)
{
    const int dim = e->config.dim, k = gr_basis_nodes_1d(e->config.basis);
    const double end = high ? e->axis[d].length / e->config.dx : 0;
    for (int n = 0; n < e->K; n++) {
        const int local[3] = {n % k, n / k % k, n / (k * k)};
        int32_t number[3] = {0};
        for (int j = 0; j < dim; j++) number[j] = e->axis[j].node_number[e->axis[j].cell[from[j]].node[local[j]]];
        const int on_face = fabs(e->axis[d].node_position[e->axis[d].cell[from[d]].node[local[d]]] - end) < 1e-9;
        if (on_face && !(gr_wall_now(e, gr_map_get(&e->config.node_codes, number))->fixed >> d & 1)) return 0;
    }
    return 1;
}

int gr_confine(struct gr_engine *e, double x[3], int64_t at[3], const int32_t from[3])
{
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        const int32_t last = axis->n_cells - 1;
        const int high = at[d] > last;
        const double begin = axis->cell[0].begin, end = axis->cell[last].end;
        if (at[d] >= 0 && !high) continue;
        if (axis->periodic) {
            x[d] += high ? -axis->length : axis->length;
            x[d] = fmax(begin, fmin(x[d], nextafter(end, begin))); /* against rounding of the sum */
            at[d] = gr_locate(axis, e->inv_dx, x[d]);
            continue;
        }
        if ((high ? e->config.open_high : e->config.open_low)[d] && !is_closed(e, from, d, high)) return 0;
        x[d] = high ? nextafter(end, begin) : begin; /* the nearest number inside */
        at[d] = high ? last : 0;
        e->clamped++;
    }
    return 1;
}

static int fail(struct gr_engine *e, int code, const double *record, int64_t id)
{
    e->failure.code = code;
    e->failure.id = id;
    e->failure.step = e->clock.step;
    for (int d = 0; d < e->config.dim; d++) e->failure.x[d] = record[d];
    return code;
}

int gr_reserve_pending(struct gr_engine *e, int64_t n)
{
    if (n <= e->migration.pending_capacity) return GR_OK;
    const int64_t capacity = n + n / 2 + 64;
    GR_RESIZE(e->migration.pending, capacity * e->points.n_components);
    GR_RESIZE(e->migration.pending_id, capacity);
    GR_RESIZE(e->migration.migrant, capacity);
    e->migration.pending_capacity = capacity;
    return GR_OK;
}

/* Put all migrants back into their old cells, which still have the slots for them, and report the first that is
 * invalid. */
static int refuse(struct gr_engine *e, const struct gr_migrants *list, int lists)
{
    int error = GR_OK;
    for (int t = 0; t < lists; t++)
        for (int64_t k = 0; k < list[t].count; k++) {
            struct gr_cell *cell = &e->mesh.cell[list[t].from[k].cell];
            const double *record = list[t].record + k * e->points.n_components;
            int64_t at[3];
            gr_locate_packed(e, record, at);
            if (!error && (error = gr_check_packed(e, cell, record, at))) (void)fail(e, error, record, list[t].id[k]);
            gr_unpack(e, gr_slot(cell, cell->count++), record, list[t].id[k]);
        }
    return error;
}

/* Note that the points of a tile have changed, and list the tile unless it is listed already. */
static void mark(struct gr_engine *e, int64_t index, int64_t *dirty, int64_t *n_dirty)
{
    uint8_t *now = &e->mesh.tile_changed[index / GR_LANES];
    if (!*now) dirty[(*n_dirty)++] = index / GR_LANES;
    *now = 1;
}

/* Put a point into an active cell; `dirty` lists the tiles whose points have changed.
 * Returned: 0 if the cell is full. */
static int put(struct gr_engine *e, int64_t index, double *record, int64_t id, int64_t *dirty, int64_t *n_dirty)
{
    if (!gr_put_point(e, &e->mesh.cell[index], record, id)) return 0;
    mark(e, index, dirty, n_dirty);
    return 1;
}

/* Put a point into an active cell, whose tile gets more rows if the cell is full.
 * Returned: 0 if the buffers have no slots left for them. */
static int take_slot(struct gr_engine *e, int64_t index, double *record, int64_t id)
{
    if (put(e, index, record, id, e->sums.dirty, &e->sums.n_dirty)) return 1;
    return gr_grow_tile(e, index / GR_LANES) && put(e, index, record, id, e->sums.dirty, &e->sums.n_dirty);
}

/* Let a point wait for a slot. */
static void wait(struct gr_engine *e, const double *record, int64_t id)
{ /* pending records never pass the one read now: nothing is overwritten */
    memmove(e->migration.pending + e->migration.n_pending * e->points.n_components, record,
            sizeof(double) * (size_t)e->points.n_components);
    e->migration.pending_id[e->migration.n_pending++] = id;
}

/* Bring a point that left the domain back, or drop it.
 * Returned: its new cell, or that it is gone. */
static int64_t bring_back(struct gr_engine *e, const struct gr_cell *from, double *record)
{
    int64_t at[3];
    gr_locate_packed(e, record, at);
    gr_tally_carry(e, record, -1);
    if (gr_confine(e, record, at, from->at)) {
        gr_tally_carry(e, record, 1);
        return gr_cell_of_packed(e, at, record);
    }
    gr_tally_outflow(e, record);
    e->dropped++;
    e->points.n--;
    return GR_TO_NOWHERE;
}

/* The points that arrive in a step, to be inserted by a team, each chunk into tiles of its own. */
struct arrivals {
    struct gr_engine *e;
    struct gr_migrants *list;
    int lists;
    int64_t chunks, n_dirty[GR_MAX_CHUNKS];
    int full[GR_MAX_CHUNKS]; /* whether a cell was */
};

static void insert_chunk(void *context, int64_t chunk, int t)
{
    struct arrivals *a = context;
    struct gr_engine *e = a->e;
    int64_t first, last, n = 0;
    (void)t;
    gr_share(e->mesh.n_tiles, chunk, a->chunks, &first, &last);
    int64_t *const dirty = e->sums.dirty + first;
    first *= GR_LANES, last *= GR_LANES;
    a->full[chunk] = 0;
    for (int l = 0; l < a->lists; l++) {
        const struct gr_migrants *list = &a->list[l];
        for (int64_t k = 0; k < list->count && list->highest >= first && list->lowest < last; k++) {
            struct gr_migrant *migrant = &list->from[k];
            if (migrant->to < first || migrant->to >= last) continue;
            if (put(e, migrant->to, list->record + k * e->points.n_components, list->id[k], dirty, &n)) continue;
            migrant->slot = GR_NOT_PUT; /* not `to`, which other threads read */
            a->full[chunk] = 1;
        }
    }
    a->n_dirty[chunk] = n;
}

/* Insert the packed points into the cells that have slots for them.
 * Returned: whether a cell was full. */
static int insert_all(struct gr_engine *e, struct gr_migrants *list, int lists, struct gr_team *team)
{
    struct arrivals a; /* not cleared, as its arrays are long */
    int full = 0;
    a.e = e, a.list = list, a.lists = lists;
    a.chunks = team ? gr_chunks(team, e->mesh.n_tiles) : 1;
    gr_team_run(team, insert_chunk, &a, a.chunks);
    for (int64_t chunk = 0; chunk < a.chunks; chunk++) {
        int64_t first, last;
        gr_share(e->mesh.n_tiles, chunk, a.chunks, &first, &last);
        memmove(e->sums.dirty + e->sums.n_dirty, e->sums.dirty + first, sizeof(int64_t) * (size_t)a.n_dirty[chunk]);
        e->sums.n_dirty += a.n_dirty[chunk];
        full |= a.full[chunk];
    }
    return full;
}

/* Find the cells of the points that left the domain and came back.
 * Returned: the number of points that have no cell. */
static int64_t bring_back_all(struct gr_engine *e, struct gr_migrants *list, int lists)
{
    int64_t homeless = 0;
    for (int l = 0; l < lists; l++) {
        for (int64_t k = 0; list[l].outside && k < list[l].count; k++) {
            struct gr_migrant *migrant = &list[l].from[k];
            if (migrant->to != GR_TO_OUTSIDE) continue;
            const int64_t to = migrant->to =
                bring_back(e, &e->mesh.cell[migrant->cell], list[l].record + k * e->points.n_components);
            homeless += to == GR_TO_NO_CELL;
            if (to < 0) continue;
            if (to < list[l].lowest) list[l].lowest = to;
            if (to > list[l].highest) list[l].highest = to;
        }
        homeless += list[l].homeless;
    }
    return homeless;
}

/* True if an active cell has not taken a point. */
static int is_left(const struct gr_migrant *migrant) { return migrant->to == GR_TO_NO_CELL || migrant->slot == GR_NOT_PUT; }

/* Give more rows to the tiles whose cells are full, or let points wait. If some have no cell all are grouped anyway. */
static int insert_rest(struct gr_engine *e, struct gr_migrants *list, int lists, int homeless)
{
    int64_t left = 0, n = 0;
    for (int l = 0; e->ranks && l < lists; l++)
        for (int64_t k = 0; k < list[l].count; k++) left += is_left(&list[l].from[k]);
    if (e->ranks && gr_ranks_reserve_staged(e, left)) return GR_ERR_MEMORY;
    for (int l = 0; l < lists; l++)
        for (int64_t k = 0; k < list[l].count; k++) {
            const struct gr_migrant *migrant = &list[l].from[k];
            double *record = list[l].record + k * e->points.n_components;
            if (!is_left(migrant) || (!homeless && take_slot(e, migrant->to, record, list[l].id[k]))) continue;
            if (e->ranks)
                gr_ranks_stage(e, n++, record, list[l].id[k]);
            else
                wait(e, record, list[l].id[k]);
        }
    return e->ranks ? gr_ranks_make_pending(e, n) : GR_OK;
}

int gr_migrate(struct gr_engine *e, struct gr_migrants *list, int lists, struct gr_team *team)
{
    enum { FEW = 256 }; /* an estimate: fewer points are inserted sooner than a team is called */
    int64_t invalid = 0, count = 0;
    e->sums.n_dirty = 0;
    for (int l = 0; l < lists; l++) invalid += list[l].invalid, count += list[l].count;
    int elsewhere = e->ranks ? gr_ranks_agree(e, invalid ? GR_ERR_NOT_FINITE : GR_OK, NULL, 0) : GR_OK;
    if (invalid || elsewhere) { /* the state before migration */
        const int error = refuse(e, list, lists);
        return error ? error : elsewhere;
    }
    int64_t homeless = bring_back_all(e, list, lists);
    if (e->ranks) {
        const int error = gr_ranks_pass_points(e, list, lists, &homeless, &lists);
        if (error) return error;
        list = e->ranks->part;
    }
    int full = 0;
    if (!e->device)
        full = insert_all(e, list, lists, count > FEW ? team : NULL);
    else if (gr_device_insert(e, list, &full))
        return GR_ERR_DEVICE;
    return homeless || full ? insert_rest(e, list, lists, homeless > 0) : GR_OK;
}

/* Insert a single point into a cell; it waits if there is none, or no slot for it. */
static void insert(struct gr_engine *e, int64_t index, double *record, int64_t id)
{
    if (index == GR_TO_NO_CELL || !take_slot(e, index, record, id)) wait(e, record, id);
}

/* The cell of the domain that is nearest to a packed point. */
static struct gr_cell nearest_cell(const struct gr_engine *e, const double *record)
{
    struct gr_cell nearest = {0};
    int64_t at[3];
    gr_locate_packed(e, record, at);
    for (int d = 0; d < e->config.dim; d++)
        nearest.at[d] = (int32_t)(at[d] < 0 ? 0 : at[d] < e->axis[d].n_cells ? at[d] : e->axis[d].n_cells - 1);
    return nearest;
}

int gr_place_new(struct gr_engine *e, const double *record, double x[3], int32_t cell[3])
{
    const struct gr_cell nearest = nearest_cell(e, record);
    const int64_t clamped = e->clamped;
    int64_t at[3] = {0};
    gr_locate_packed(e, record, at);
    for (int d = 0; d < 3; d++) x[d] = d < e->config.dim ? record[d] : 0;
    const int inside = gr_confine(e, x, at, nearest.at);
    e->clamped = clamped;
    for (int d = 0; d < 3; d++) cell[d] = inside ? (int32_t)at[d] : nearest.at[d];
    return inside;
}

void gr_insert_new(struct gr_engine *e, double *record, int64_t id)
{
    const struct gr_cell nearest = nearest_cell(e, record);
    int64_t at[3] = {0};
    e->points.n++;
    gr_tally_carry(e, record, 1);
    gr_locate_packed(e, record, at);
    int64_t to = gr_cell_of_packed(e, at, record);
    if (to == GR_TO_OUTSIDE) to = bring_back(e, &nearest, record);
    if (to != GR_TO_NOWHERE) insert(e, to, record, id);
}

/* Note that the points of a cell have changed. */
static void mark_changed(struct gr_engine *e, int64_t index)
{
    gr_wake(e, &e->mesh.cell[index]);
    mark(e, index, e->sums.dirty, &e->sums.n_dirty);
}

void gr_change_sides(struct gr_engine *e)
{
    for (int64_t k = 0; k < 2 * e->mesh.n_paired; k++) {
        const int64_t front = e->mesh.paired[k / 2], index = k % 2 ? e->mesh.other[front] : front;
        struct gr_cell *cell = &e->mesh.cell[index];
        if (!cell->count || gr_cell_faces_thin(e, cell->at)) continue;
        for (int32_t s = 0; s < cell->count; s++) {
            const int64_t slot = gr_slot(cell, s);
            double *record = e->migration.pending + e->migration.n_pending * e->points.n_components, x[3] = {0};
            for (int d = 0; d < e->config.dim; d++) x[d] = gr_x(e, d)[slot];
            if (gr_point_side(e, x, cell->side) == cell->side) continue;
            const int64_t id = e->points.id[slot];
            gr_pack(e, slot, record);
            gr_close_hole(e, cell, slot), s--;
            mark_changed(e, index);
            insert(e, e->mesh.other[index], record, id);
        }
    }
}

struct gr_migrants gr_begin_replacing(struct gr_engine *e)
{
    struct gr_migrants list = {.from = e->migration.migrant,
                               .record = e->migration.pending + e->migration.n_pending * e->points.n_components,
                               .id = e->migration.pending_id + e->migration.n_pending};
    gr_clear_migrants(&list);
    return list;
}

int gr_replace_point(struct gr_engine *e, struct gr_migrants *list, int64_t index, int64_t slot, const double x[3])
{
    struct gr_cell *cell = &e->mesh.cell[index];
    const int64_t k = list->count;
    int same = 1;
    mark_changed(e, index);
    for (int d = 0; d < e->config.dim; d++) {
        gr_x(e, d)[slot] = x[d];
        same &= gr_locate(&e->axis[d], e->inv_dx, x[d]) == cell->at[d];
    }
    if (same) return 0;
    list->from[k] = (struct gr_migrant){index, slot, 0};
    list->id[k] = e->points.id[slot];
    gr_pack(e, slot, list->record + k * e->points.n_components);
    list->count++;
    gr_address(e, list, k);
    gr_close_hole(e, cell, slot);
    return 1;
}

int gr_end_replacing(struct gr_engine *e, struct gr_migrants *list)
{
    int lists = 1;
    int64_t homeless = bring_back_all(e, list, lists);
    if (e->ranks) {
        const int error = gr_ranks_pass_points(e, list, lists, &homeless, &lists);
        if (error) return error;
        list = e->ranks->part;
    }
    for (int l = 0; l < lists; l++) /* each takes its slot by itself: they are few */
        for (int64_t k = 0; k < list[l].count; k++)
            if (list[l].from[k].to >= 0) list[l].from[k].slot = GR_NOT_PUT;
    return insert_rest(e, list, lists, homeless > 0);
}
