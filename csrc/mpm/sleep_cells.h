/* What sleep asks of a cell, or of a tile: for the chunks of a team (sleep.c), and for the threads of a device, which may do
 * so for all cells at once. */
#pragma once

#include "mpm/numbers.h"
#include "mpm/sleep.h"

/* Set a byte that other threads may set, too. */
static inline void gr_set_byte(uint8_t *byte, uint8_t value) { __atomic_store_n(byte, value, __ATOMIC_RELAXED); }

static inline uint8_t gr_get_byte(const uint8_t *byte) { return __atomic_load_n(byte, __ATOMIC_RELAXED); }

/* True if no point of a cell is fast; also if it has none. */
static inline int gr_is_slow(const struct gr_engine *e, const struct gr_cell *cell)
{
    const double most = e->config.scheme.sleep_speed * e->config.scheme.sleep_speed;
    for (int32_t k = 0; k < cell->count; k++) {
        if (!(gr_speed_squared(e, gr_slot(cell, k)) < most)) return 0;
    }
    return 1;
}

/* Count for how many checks cell c has been calm. Returned: whether it may fall asleep. */
static inline int gr_count_checks(struct gr_engine *e, int64_t c)
{
    struct gr_cell *cell = &e->mesh.cell[c];
    if (cell->calm == GR_ASLEEP) return 0;
    const int slow = !GR_IS_DOUBLE(cell) && gr_is_slow(e, cell);
    cell->calm = !slow ? 0 : cell->calm < GR_CALM_CHECKS ? cell->calm + 1 : GR_CALM_CHECKS;
    return cell->calm == GR_CALM_CHECKS;
}

/* Note the nodes of cell c if it has points and is not calm. */
static inline void gr_note_restless(struct gr_engine *e, int64_t c)
{
    for (int i = 0; e->mesh.cell[c].count && e->mesh.cell[c].calm < GR_CALM_CHECKS && i < e->K; i++)
        gr_set_byte(&e->sleep->restless[gr_cell_node(e, c, i)], 1);
}

/* Take the motion from the points of a cell that falls asleep. */
static inline void gr_stop(struct gr_engine *e, const struct gr_cell *cell)
{
    static const int fields[] = {GR_FIELD_v, GR_FIELD_affine, GR_FIELD_shift_velocity, GR_FIELD_shear_rate};
    for (size_t f = 0; f < sizeof fields / sizeof *fields; f++)
        for (int c = 0; e->points.field[fields[f]] && c < gr_field_components(fields[f], e->config.dim); c++)
            for (int32_t k = 0; k < cell->count; k++) gr_set_number(e, fields[f], c, gr_slot(cell, k), 0);
}

/* Let cell c fall asleep if it is calm and has no restless node. Returned: whether it did. */
static inline int gr_fall_asleep(struct gr_engine *e, int64_t c)
{
    struct gr_cell *cell = &e->mesh.cell[c];
    int restless = cell->calm != GR_CALM_CHECKS;
    for (int i = 0; i < e->K && !restless; i++) restless = e->sleep->restless[gr_cell_node(e, c, i)];
    if (restless) return 0;
    cell->calm = GR_ASLEEP;
    gr_stop(e, cell);
    return 1;
}

/* Note the nodes of cell c as those of one that is awake. */
static inline void gr_use_nodes(struct gr_engine *e, int64_t c)
{
    for (int i = 0; i < e->K; i++) gr_set_byte(&e->sleep->use[gr_cell_node(e, c, i)], GR_NODE_OF_AWAKE);
}

/* Note the other nodes of cell c if it is asleep and those that are awake may wake it. */
static inline void gr_watch_nodes(struct gr_engine *e, int64_t c)
{
    int watched = 0;
    if (e->mesh.cell[c].calm != GR_ASLEEP) return;
    for (int i = 0; i < e->K && !watched; i++)
        watched = gr_get_byte(&e->sleep->use[gr_cell_node(e, c, i)]) == GR_NODE_OF_AWAKE;
    for (int i = 0; watched && i < e->K; i++) {
        uint8_t *use = &e->sleep->use[gr_cell_node(e, c, i)];
        if (gr_get_byte(use) == GR_NODE_UNUSED) gr_set_byte(use, GR_NODE_OF_WATCHED);
    }
}

/* Find out whether a tile is left alone. */
static inline void gr_find_resting(struct gr_engine *e, int64_t tile)
{
    int used = 0;
    for (int64_t lane = tile * GR_LANES; lane < (tile + 1) * GR_LANES; lane++)
        for (int i = 0; i < e->K && !used; i++) used = e->sleep->use[gr_cell_node(e, lane, i)];
    e->sleep->tile_rests[tile] = !used;
}
