/* Which cells are a tile (tiles.h). */
#include "mpm/tiles.h"
#include "core/memory.h"

#include "mpm/cell_sums.h"
#include "mpm/device.h"
#include "mpm/places.h"
#include "mpm/ranks.h"

/* Tiles whose runs are to be found. */
struct runs {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks;
    struct gr_tiles tiles;
};

/* Whether a lane may continue the run of the lane before. */
static int continues(const struct gr_tiles *tiles, const struct gr_engine *e, int64_t c)
{
    if (c == tiles->n_front || tiles->cell[c] != tiles->cell[c - 1] + 1) return 0;
    const int64_t x = tiles->cell[c] % e->axis[0].n_cells;
    const struct gr_axis_cell *cell = e->axis[0].cell + x;
    return x > 0 && cell[0].node[0] == cell[-1].node[0] + 1;
}

/* True if ranks exchange the sums of a cell of a tile alone. */
static int is_shared(const struct gr_tiles *tiles, const struct gr_engine *e, int64_t first, int64_t n)
{
    int32_t at[3];
    for (int64_t c = first; e->ranks && c < first + n; c++) {
        if (e->ranks->sharing[c] == GR_ALONE) continue;
        gr_indices_of_cell(e, tiles->cell[c], at);
        if (gr_is_mixed(e, at)) return 1;
    }
    return 0;
}

/* Find the runs of tiles, and the numbers of their blocks. */
GR_DEFINE_PASS(find_runs, struct runs, r)
{
    const struct gr_tiles *tiles = &r->tiles;
    for (int64_t tile = first; tile < last; tile++) {
        const int64_t begin = tile * GR_LANES, left = tiles->n_cells - begin, n = left < GR_LANES ? left : GR_LANES;
        unsigned joins = 0;
        int runs = 1;
        for (int l = 1; l < n; l++) {
            const unsigned joined = (unsigned)continues(tiles, e, begin + l);
            joins |= joined << l;
            runs += !joined;
        }
        if (runs * e->sums.of_run >= e->sums.of_apart || e->device || is_shared(tiles, e, begin, n)) joins = 0;
        tiles->joins[tile] = (uint8_t)joins;
        tiles->block[tile] = e->sums.of_lanes + (joins ? runs * e->sums.of_run : e->sums.of_apart);
    }
}

#ifndef GR_ON_DEVICE
/* Give lanes to the cells in front of thin bodies, and then to those behind. */
static int order_layers(struct gr_tiles *tiles, const int64_t *cells, const int8_t *sides, int64_t n)
{
    const size_t size = (size_t)n + 1;
    int64_t at = 0, *const cell = gr_malloc(size * sizeof *cell);
    tiles->cell = tiles->ordered = cell;
    tiles->side = gr_malloc(size * sizeof *tiles->side);
    tiles->other = gr_malloc(size * sizeof *tiles->other);
    tiles->lane = gr_malloc(size * sizeof *tiles->lane);
    if (!cell || !tiles->side || !tiles->other || !tiles->lane) return GR_ERR_MEMORY;
    for (int behind = 0; behind < 2; behind++) {
        for (int64_t k = 0; k < n; k++) {
            if ((sides[k] < 0) != behind) continue;
            cell[at] = cells[k];
            tiles->side[at] = sides[k];
            tiles->other[at] = sides[k] == GR_BACK ? tiles->lane[k - 1] : -1;
            if (sides[k] == GR_BACK) tiles->other[tiles->lane[k - 1]] = (int32_t)at;
            tiles->lane[k] = (int32_t)at++;
        }
        if (!behind) tiles->n_front = at;
    }
    return GR_OK;
}

int gr_make_tiles(struct gr_tiles *tiles, struct gr_engine *e, const int64_t *cells, const int8_t *sides, int64_t n,
                  struct gr_team *team, int64_t chunks)
{
    struct runs runs = {.e = e, .team = team, .chunks = chunks};
    int64_t at = GR_FIRST_BLOCK;
    tiles->n_cells = tiles->n_front = n;
    tiles->cell = cells;
    const int64_t n_tiles = gr_number_of_tiles(tiles);
    if (sides && order_layers(tiles, cells, sides, n)) return GR_ERR_MEMORY;
    tiles->joins = gr_malloc((size_t)n_tiles + 1);
    tiles->block = gr_malloc(((size_t)n_tiles + 1) * sizeof *tiles->block);
    if (!tiles->joins || !tiles->block) return GR_ERR_MEMORY;
    for (int64_t c = 0; e->ranks && sides && c < n; c++) e->ranks->sharing[c] = (uint8_t)gr_sharing_of(e, tiles->cell[c]);
    runs.tiles = *tiles;
    GR_MAKE(find_runs, &runs, n_tiles);
    const int error = gr_make_places(e, tiles->block, n_tiles, &at);
    tiles->block[n_tiles] = at;
    return error;
}

void gr_free_tiles(struct gr_tiles *tiles)
{
    gr_free(tiles->ordered);
    gr_free(tiles->side);
    gr_free(tiles->other);
    gr_free(tiles->lane);
    gr_free(tiles->joins);
    gr_free(tiles->block);
}
#endif
