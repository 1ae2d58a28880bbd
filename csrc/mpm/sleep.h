/* Sleep: material that has come to rest is not computed until something moves it.
 *
 * Cells fall asleep if no point in them, nor in a cell with which they have a node in common, has been faster than
 * sleep_speed in GR_CALM_CHECKS checks, one every GR_SLEEP_INTERVAL steps. Their points lose their velocity and its
 * gradient, and keep position, stress and density. Their sums then do not change, nor do nodes that have no other cells:
 * both are stored and not computed. Cells without points fall asleep by the same rule, so that the surface of material at
 * rest costs nothing. A cell wakes if one of its nodes would move faster than sleep_speed, if a point arrives, before
 * gravity changes or a wall opens, and while a body moves near it.
 *
 * Whether a cell is asleep is a matter of that cell and its nodes alone. Skipping tiles of which all cells are asleep and
 * groups of nodes saves time and does not affect the results: these depend neither on the number of threads nor on when the
 * points were grouped. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"
#include "mpm/numbers.h"

/* The interval is the one of dt. The checks take so long that waves cross 150 cells at the usual time steps: slow
 * oscillations are noticed. */
enum { GR_SLEEP_INTERVAL = 16, GR_CALM_CHECKS = 32, GR_ASLEEP = INT32_MAX };

/* Who needs the values of a node in each step: nobody; a cell that is awake; one that it may wake. */
enum gr_node_use { GR_NODE_UNUSED, GR_NODE_OF_AWAKE, GR_NODE_OF_WATCHED };

struct gr_sleep {
    uint8_t *use;        /* enum gr_node_use of the nodes; the last group of GR_LANES is filled up with unused ones */
    uint8_t *restless;   /* of the nodes: whether points about them were too fast, while cells fall asleep */
    uint8_t *tile_rests; /* of the tiles: whether all their nodes are unused, so that all their cells are asleep */
    int64_t capacity, tile_capacity;
    int changed;    /* whether a cell has woken or fallen asleep since the uses were computed */
    int all_nodes;  /* whether the values of all nodes are to be computed in this step */
    int64_t asleep; /* number of cells that are asleep */
};

int gr_sleep_new(struct gr_engine *e);
void gr_sleep_free(struct gr_sleep *sleep);

/* Prepare for a new mesh, or for another call of steps: the values of all nodes are computed once more. */
int gr_sleep_begin(struct gr_engine *e);

/* Look whether the points are slow. Returned: the number of cells that may fall asleep. */
int64_t gr_sleep_count(struct gr_engine *e, struct gr_team *team);

/* Let cells fall asleep. Their sums are to be made again, with the sums of the density: their tiles are added to `dirty`, or a
 * device makes them at once. */
void gr_sleep_fall(struct gr_engine *e, struct gr_team *team);

/* Find the uses of the nodes if they have changed. */
void gr_sleep_find_uses(struct gr_engine *e, struct gr_team *team);

/* The calm of the cells that are calm, for a restart: out[0] has their indices in the whole grid and out[1] their calm; NULL
 * to count them.
 * Returned: their number. */
int64_t gr_sleep_list(const struct gr_engine *e, int64_t *const out[2]);

/* Set it again, once the points are grouped. Cells without points are passed over.
 * Returned: 0, or GR_ERR_CONFIG for a calm that no cell can have, and nothing is set. */
int gr_sleep_restore(struct gr_engine *e, int64_t n, const int64_t *cells, const int64_t *calm);

/* Wake all cells. */
void gr_sleep_wake_all(struct gr_engine *e);

/* Wake a cell. Several threads may do so at once, for different cells. */
static inline void gr_wake(struct gr_engine *e, struct gr_cell *cell)
{
    if (!e->sleep || cell->calm != GR_ASLEEP) return;
    cell->calm = 0;
    __atomic_store_n(&e->sleep->changed, 1, __ATOMIC_RELAXED);
}

/* The same for one to which a point comes. An empty one is as one that has just become active. */
static inline void gr_wake_for_arrival(struct gr_engine *e, struct gr_cell *cell)
{
    gr_wake(e, cell);
    if (!cell->count) cell->calm = 0;
}

/* True if the values of the group of GR_LANES nodes that node n is of are from the last step. */
static inline int gr_group_rests(const struct gr_engine *e, int64_t n)
{
    uint64_t uses;
    if (!e->sleep || !e->sleep->asleep || e->sleep->all_nodes) return 0;
    _Static_assert(sizeof uses == GR_LANES, "a byte for each node of a group");
    memcpy(&uses, e->sleep->use + n - n % GR_LANES, sizeof uses);
    return !uses;
}

/* The same for all nodes of a tile. */
static inline int gr_tile_rests(const struct gr_engine *e, int64_t tile)
{
    return e->sleep && e->sleep->asleep && !e->sleep->all_nodes && e->sleep->tile_rests[tile];
}

/* Bit l: lane l of a tile is a cell that is asleep. */
static inline unsigned gr_lanes_asleep(const struct gr_engine *e, int64_t tile)
{
    unsigned lanes = 0;
    for (unsigned l = 0; l < GR_LANES; l++) lanes |= (unsigned)(e->mesh.cell[tile * GR_LANES + l].calm == GR_ASLEEP) << l;
    return lanes;
}

/* ---- What is asked of a cell or a tile: for a team, and for the threads of a device, of all at once ---- */

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
