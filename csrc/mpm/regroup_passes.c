/* The passes of a regrouping over cells and points (passes.h). */
#include "mpm/passes.h"

#include "mpm/numbers.h"
#include "mpm/regroup.h"
#include "mpm/slots.h"

/* ---- The cells that hold points ---- */

/* Number of the points of a cell that are not in it. */
static int64_t strays_of(const struct gr_engine *e, const struct gr_cell *cell)
{
    int64_t strays = 0;
    for (int32_t k = 0; k < cell->count; k++) {
        const int64_t slot = gr_slot(cell, k);
        int inside = 1;
        for (int d = 0; d < e->config.dim; d++) {
            const struct gr_axis_cell *part = &e->axis[d].cell[cell->at[d]];
            const double x = gr_x(e, d)[slot];
            inside &= x >= part->begin && x < part->end;
        }
        strays += !inside;
    }
    return strays;
}

GR_DEFINE_PASS(find_occupied, struct gr_regroup, r)
{
    struct gr_survey survey = {0, 0};
    for (const struct gr_cell *cell = e->mesh.cell + first; cell < e->mesh.cell + last; cell++) {
        survey.occupied += cell->count > 0;
        survey.strays += strays_of(e, cell);
    }
    r->survey[chunk] = survey;
}

GR_DEFINE_PASS(list_occupied, struct gr_regroup, r)
{
    int64_t n = r->survey[chunk].occupied;
    for (const struct gr_cell *cell = e->mesh.cell + first; cell < e->mesh.cell + last; cell++)
        if (cell->count) r->occupied[n++] = gr_cell_id(e, cell->at);
}

/* Number of the newcomers whose cells have a lower index in the grid. */
static int64_t newcomers_before(const struct gr_regroup *r, int64_t cell)
{
    int64_t low = 0, high = r->n_newcomers;
    while (low < high) {
        const int64_t middle = (low + high) / 2;
        if (r->newcomer[middle].cell < cell)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* Number of the old cells with points whose index is at most that of a cell. */
static int64_t occupied_up_to(const struct gr_regroup *r, int64_t cell)
{
    int64_t low = 0, high = r->n_before;
    while (low < high) {
        const int64_t middle = (low + high) / 2;
        if (r->occupied[middle] <= cell)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* Merge the cells of the newcomers, which are the items behind the old cells, with these. */
GR_DEFINE_PASS(merge_occupied, struct gr_regroup, r)
{
    for (int64_t k = first; k < last; k++) {
        if (k < r->n_before) {
            r->listed[k + newcomers_before(r, r->occupied[k])] = r->occupied[k];
            continue;
        }
        const int64_t n = k - r->n_before, cell = r->newcomer[n].cell, before = occupied_up_to(r, cell);
        const int again = n && r->newcomer[n - 1].cell == cell;
        r->listed[n + before] = cell;
        r->fresh[n] = !again && !(before && r->occupied[before - 1] == cell);
    }
}

/* ---- The new cells ---- */

/* Find the new cells among the old ones, and count their points. */
GR_DEFINE_PASS(count_points, struct gr_regroup, r)
{
    for (int64_t c = first; c < last; c++) {
        const int64_t cell = r->tiles.cell[c], before = (int64_t)gr_table_get(&e->mesh.cell_of, cell) - 1;
        r->before[c] = (int32_t)before;
        r->counts[c] = before < 0 ? 0 : e->mesh.cell[before].count;
        if (r->n_newcomers) r->counts[c] += (int32_t)(newcomers_before(r, cell + 1) - newcomers_before(r, cell));
    }
}

/* Find the number of slots of each tile. */
GR_DEFINE_PASS(size_tiles, struct gr_regroup, r)
{
    for (int64_t tile = first; tile < last; tile++) {
        int32_t most = 0;
        for (int64_t c = tile * GR_LANES; c < (tile + 1) * GR_LANES && c < r->tiles.n_cells; c++)
            most = r->counts[c] > most ? r->counts[c] : most;
        r->offset[tile] = GR_LANES * gr_rows_of_tile(most);
    }
}

/* Set up the new tiles and their cells. The last tile is filled up with cells that lie where its last does. */
GR_DEFINE_PASS(place_cells, struct gr_regroup, r)
{
    const struct gr_tiles *tiles = &r->tiles;
    for (int64_t c = first; c < last; c++) {
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
        if (c % GR_LANES) continue;
        e->mesh.tile_changed[tile] = 0;
        e->mesh.tile_joins[tile] = tiles->joins[tile];
        e->mesh.tile_block[tile] = tiles->block[tile];
    }
}

/* Clear the sums of the tiles, of which an item is a number. */
GR_DEFINE_PASS(clear_sums, struct gr_regroup, r)
{
    double *const sums = e->sums.data;
    float *const in_single = e->sums.data;
    (void)r;
    for (int64_t k = first; !e->config.single && k < last; k++) sums[k] = 0;
    for (int64_t k = first; e->config.single && k < last; k++) in_single[k] = 0;
}

/* ---- The points in their new slots ---- */

/* Find from where the points of the new cells move: those that are there, in their order, then the newcomers. */
GR_DEFINE_PASS(find_moves, struct gr_regroup, r)
{
    for (int64_t c = first; c < last; c++) {
        const struct gr_cell *const before = r->before[c] < 0 ? 0 : &e->mesh.cell[r->before[c]];
        const int32_t here = before ? before->count : 0;
        for (int32_t k = 0; k < here; k++) r->moves.from[gr_new_slot(r, c, k)] = gr_slot(before, k);
        if (here == r->counts[c]) continue;
        const struct gr_newcomer *newcomer = r->newcomer + newcomers_before(r, r->tiles.cell[c]);
        for (int32_t k = here; k < r->counts[c]; k++, newcomer++)
            r->moves.from[gr_new_slot(r, c, k)] = -1 - newcomer->number;
    }
}
