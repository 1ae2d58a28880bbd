/* Grouping of the points by cell. Every cell that holds points, and each of its neighbours, owns a lane of a tile, with the
 * same number of slots for each cell of the tile. Only these active cells and their nodes exist for the kernels, so that
 * memory grows with the material.
 *
 * A team does the work in passes, or the device of the engine (passes.h). Each chunk of a pass has cells, tiles, points or
 * slots of its own, and no order depends on their number: the points of a new cell are in the order in which all are
 * listed. */
#include "mpm/grouping.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/index.h"
#include "core/memory.h"
#include "mpm/cell_sums.h"
#include "mpm/connect.h"
#include "mpm/device.h"
#include "mpm/fill_table.h"
#include "mpm/ghosts.h"
#include "mpm/listing.h"
#include "mpm/places.h"
#include "mpm/sleep.h"
#include "mpm/spread.h"
#include "mpm/thin_bodies.h"
#include "mpm/tiles.h"

/* Buffers that are too small become larger than needed by one part in this number, as material that spreads soon needs
 * more. Twice as much makes no run faster. Those that would be left with less than half of that to spare are too small as
 * well: tiles that grow would use it up within some steps, and have all points of a flow grouped again. */
enum { GROWTH = 16 };

/* Steps after which emptied cells are counted again. A count is far cheaper than a step. */
enum { EMPTIED_INTERVAL = 64 };

enum { FEW_POINTS = 2048 }; /* an estimate: fewer are grouped sooner than a team is called */

/* ---- The cells of the points ---- */

/* For qsort: by cells, then by numbers. */
static int compare_newcomers(const void *a, const void *b)
{
    const struct gr_newcomer *x = a, *y = b;
    const int by_cell = gr_compare_ids(&x->cell, &y->cell);
    return by_cell ? by_cell : gr_compare_ids(&x->number, &y->number);
}

/* Find the cells of the pending points, and put these into the order of cells.
 * Returned: 0, GR_ERR_MEMORY, or GR_ERR_OUTSIDE, which is the failure of the engine. */
static int find_newcomers(struct gr_regroup *r)
{
    struct gr_engine *e = r->e;
    const int64_t n = e->migration.n_pending;
    r->newcomer = gr_malloc(sizeof *r->newcomer * (size_t)(n + 1));
    r->fresh = gr_malloc((size_t)(n + 1));
    if (!r->newcomer || !r->fresh) return GR_ERR_MEMORY;
    for (int64_t k = 0; k < n; k++) {
        const double *record = e->migration.pending + k * e->points.n_components;
        double x[3] = {record[0], record[1], e->config.dim == 3 ? record[2] : 0};
        int32_t cell[3];
        if (!gr_find_cell_at(e, x, cell)) {
            e->failure.id = e->migration.pending_id[k];
            memcpy(e->failure.x, x, sizeof x);
            return e->failure.code = GR_ERR_OUTSIDE;
        }
        r->newcomer[k] = (struct gr_newcomer){gr_cell_id(e, cell), k};
    }
    r->n_newcomers = n;
    qsort(r->newcomer, (size_t)n, sizeof *r->newcomer, compare_newcomers);
    return GR_OK;
}

/* List the cells of the old cells with points, and those of the newcomers. */
static int list_by_cells(struct gr_regroup *r)
{
    int error = find_newcomers(r);
    if (error) return error;
    r->n_occupied = r->n_before;
    r->n_listed = r->n_before + r->n_newcomers;
    r->occupied = gr_malloc(sizeof *r->occupied * (size_t)(r->n_before + 1));
    r->listed = gr_malloc(sizeof *r->listed * (size_t)(r->n_listed + 1));
    if (!r->occupied || !r->listed) return GR_ERR_MEMORY;
    GR_MAKE_IN(list_occupied, r, r->e->mesh.n_cells, r->n_surveys);
    GR_MAKE(merge_occupied, r, r->n_listed);
    error = gr_device_wait(r->e);
    for (int64_t n = 0; n < r->n_newcomers && !error; n++) r->n_occupied += r->fresh[n];
    return error;
}

/* Look whether the points are in their cells, and count the cells that hold some.
 * Returned: 0 or an error; set: whether they are. */
static int are_in_cells(struct gr_regroup *r, int *in_cells)
{
    struct gr_engine *e = r->e;
    int64_t strays = 0;
    *in_cells = 0;
    if (!e->mesh.n_cells || e->bodies.n_thin || e->ranks) return GR_OK;
    r->n_surveys = gr_pass_chunks(e, e->mesh.n_cells, r->chunks);
    r->survey = gr_malloc(sizeof *r->survey * (size_t)r->n_surveys);
    if (!r->survey) return GR_ERR_MEMORY;
    GR_MAKE_IN(find_occupied, r, e->mesh.n_cells, r->n_surveys);
    const int error = gr_device_wait(e);
    for (int64_t c = 0; c < r->n_surveys && !error; c++) {
        const int64_t occupied = r->survey[c].occupied;
        r->survey[c].occupied = r->n_before;
        r->n_before += occupied;
        strays += r->survey[c].strays;
    }
    *in_cells = !strays;
    return error;
}

/* List the cells that will hold points. */
static int list_occupied(struct gr_regroup *r)
{
    int in_cells, error = are_in_cells(r, &in_cells);
    if (error) return error;
    return in_cells ? list_by_cells(r) : gr_list_points(r);
}

/* ---- The new cells ---- */

GR_SHARED(find_sharing, struct gr_regroup, r->n_active, r)
{
    (void)chunk;
    for (int64_t c = first; c < last; c++) r->e->ranks->sharing[c] = (uint8_t)gr_sharing_of(r->e, r->cells[c]);
}

/* List the occupied cells and their neighbours; of those of other ranks only the ones that this rank has, too. */
static int list_active(struct gr_regroup *r)
{
    struct gr_engine *e = r->e;
    int64_t *occupied = NULL, n = r->n_listed, here = 0;
    int error = e->ranks ? gr_ranks_list_occupied(e, r->listed, r->n_listed, &occupied, &n) : GR_OK;
    if (!error)
        error =
            gr_spread(e, GR_SPREAD_CELLS, occupied ? occupied : r->listed, n, r->team, r->chunks, &r->cells, &r->n_active);
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

/* Count the points of the new cells, and give these their slots. */
static int count_points(struct gr_regroup *r)
{
    const int64_t n = r->tiles.n_cells, n_tiles = gr_number_of_tiles(&r->tiles);
    r->counts = r->list ? gr_calloc((size_t)n + 1, sizeof *r->counts) : gr_malloc(((size_t)n + 1) * sizeof *r->counts);
    r->offset = gr_malloc(sizeof *r->offset * (size_t)(n_tiles + 1));
    if (!r->list) r->before = gr_malloc(sizeof *r->before * (size_t)(n + 1));
    if (!r->counts || !r->offset || !(r->list || r->before)) return GR_ERR_MEMORY;
    if (r->list)
        gr_count_listed(r);
    else
        GR_MAKE(count_points, r, n);
    GR_MAKE(size_tiles, r, n_tiles);
    const int error = gr_make_places(r->e, r->offset, n_tiles, &r->total);
    r->offset[n_tiles] = r->total;
    return error;
}

/* List the active cells, make tiles of them, and count the points of each. next_of, set here, becomes cell_of. */
static int list_cells(struct gr_regroup *r)
{
    struct gr_engine *e = r->e;
    int error = list_active(r);
    if (error) return error;
    if (e->bodies.n_thin && gr_split_cells(r)) return GR_ERR_MEMORY;
    error = gr_make_tiles(&r->tiles, e, r->cells, r->sides, r->n_active, r->team, r->chunks);
    if (!error) error = gr_fill_table(e, &e->mesh.next_of, r->cells, r->tiles.lane, r->n_active, r->team, r->chunks);
    if (!error) error = count_points(r);
    const int64_t used = r->total > e->points.used ? r->total : e->points.used;
    r->moves = (struct gr_moves){.e = e, .team = r->team, .chunks = r->chunks, .used = used};
    return error;
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
GR_SHARED(keep_calm, struct gr_regroup, r->tiles.n_cells, r)
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

/* Set up the mesh of the new cells. */
static void make_mesh(struct gr_regroup *r)
{
    struct gr_mesh *mesh = &r->e->mesh;
    const struct gr_tiles *tiles = &r->tiles;
    const struct gr_table old = mesh->cell_of;
    mesh->cell_of = mesh->next_of;
    mesh->next_of = old;
    mesh->n_cells = tiles->n_cells;
    mesh->n_front = tiles->n_front;
    mesh->n_tiles = gr_number_of_tiles(tiles);
    mesh->tile_block[mesh->n_tiles] = tiles->block[mesh->n_tiles];
    gr_note_size(r->e, tiles->block[mesh->n_tiles], r->total);
    GR_MAKE(clear_sums, r, tiles->block[mesh->n_tiles]);
    GR_MAKE(place_cells, r, mesh->n_tiles * GR_LANES);
    mesh->n_paired = 0;
    for (int64_t c = 0; r->sides && c < mesh->n_cells; c++) {
        mesh->other[c] = tiles->other[c];
        if (tiles->side[c] == GR_FRONT) mesh->paired[mesh->n_paired++] = c;
    }
}

/* ---- The points in their new slots ---- */

/* Find where the points go, before the cells are replaced. */
static int find_moves(struct gr_regroup *r)
{
    int error = gr_reserve_moves(&r->moves);
    if (error) return error;
    if (r->before) GR_MAKE(find_moves, r, r->tiles.n_cells);
    error = gr_device_wait(r->e);
    if (!r->before && !error) gr_find_listed_moves(r);
    return error;
}

/* Find the places of the active cells on the fluidity grid. */
GR_SHARED(find_fluidity, struct gr_regroup, r->tiles.n_cells, r)
{
    const struct gr_engine *e = r->e;
    (void)chunk;
    for (int64_t c = first; c < last; c++) {
        const int back = e->mesh.cell[c].side == GR_BACK;
        e->mesh.place[c] = (int32_t)gr_fluidity_place(e->nonlocal.fluidity, r->tiles.cell[c], back);
    }
}

static int note_calm(struct gr_regroup *r)
{
    if (!r->e->sleep) return GR_OK;
    r->calm = gr_malloc(sizeof *r->calm * ((size_t)r->tiles.n_cells + 1));
    if (!r->calm) return GR_ERR_MEMORY;
    keep_calm(r);
    return GR_OK;
}

static void free_regroup(struct gr_regroup *r)
{
    void *const owned[] = {r->listed, r->survey, r->occupied, r->newcomer, r->fresh, r->before,
                           r->sides,  r->cells,  r->counts,   r->calm,     r->offset};
    for (size_t k = 0; k < sizeof owned / sizeof *owned; k++) gr_free(owned[k]);
    gr_free_listing(r);
    gr_free_tiles(&r->tiles);
}

int gr_has_emptied(const struct gr_engine *e)
{
    int64_t occupied = 0;
    if (e->clock.step % EMPTIED_INTERVAL) return 0;
    if (e->device) return 4 * gr_device_occupied(e) < 3 * e->mesh.n_occupied;
    for (int64_t c = 0; c < e->mesh.n_cells; c++) occupied += e->mesh.cell[c].count > 0;
    return 4 * occupied < 3 * e->mesh.n_occupied;
}

/* Agree on whether all ranks have slots for their points. One that has waits for those that have not. */
static int agree_on_slots(struct gr_regroup *r, int error)
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
    struct gr_regroup r = {.e = e, .team = team, .chunks = e->points.n > FEW_POINTS ? gr_chunks(team, GR_MAX_CHUNKS) : 1};
    int error = list_occupied(&r);
    if (e->ranks) gr_ranks_note_bodies(e);
    if (e->ranks) error = gr_ranks_agree(e, error, NULL, 0);
    if (!error) error = list_cells(&r);
    if (!error && r.total + r.total / (2 * GROWTH) > e->points.capacity) {
        e->migration.needed_capacity = r.total + r.total / GROWTH;
        error = GR_ERR_CAPACITY;
    }
    if (!error) error = find_moves(&r);
    if (!error) error = note_calm(&r);
    if (!error) error = reserve_mesh(e, gr_number_of_tiles(&r.tiles));
    if (!error) error = gr_reserve_sums(e, r.tiles.block[gr_number_of_tiles(&r.tiles)]);
    if (e->ranks) error = agree_on_slots(&r, error);
    if (error) goto out; /* the old cells remain */
    make_mesh(&r);
    gr_move_points(&r.moves);
    e->points.used = r.total;
    error = gr_device_wait(e);
    e->migration.n_pending = 0;
    e->sums.valid = 0;
    e->sums.n_dirty = 0;
    e->mesh.n_occupied = r.n_occupied;
    if (!error) error = gr_connect(e, &r.tiles, team, r.chunks);
    if (!error && e->nonlocal.fluidity) error = gr_fluidity_cover(e->nonlocal.fluidity, r.cells, r.sides, r.n_active);
    if (!error && e->nonlocal.fluidity) find_fluidity(&r);
    if (e->ranks) error = agree_on_ghosts(e, error);
    e->disconnected = error != GR_OK; /* the points are grouped, but the mesh must be made again */
out:
    free_regroup(&r);
    return error;
}
