/* Which cells are asleep, and which nodes are needed (sleep.h). */
#include "mpm/sleep.h"

#include <math.h>
#include <string.h>

#include "core/memory.h"
#include "mpm/device.h"
#include "mpm/pose.h"
#include "mpm/ranks.h"

int gr_sleep_new(struct gr_engine *e)
{
    if (!(e->config.scheme.sleep_speed > 0)) return GR_OK;
    e->sleep = gr_calloc(1, sizeof *e->sleep);
    return e->sleep ? GR_OK : GR_ERR_MEMORY;
}

void gr_sleep_free(struct gr_sleep *sleep)
{
    if (!sleep) return;
    gr_free(sleep->use);
    gr_free(sleep->restless);
    gr_free(sleep->tile_rests);
    gr_free(sleep);
}

int gr_sleep_begin(struct gr_engine *e)
{
    struct gr_sleep *sleep = e->sleep;
    if (e->nodes.capacity > sleep->capacity) {
        sleep->capacity = 0;
        GR_RESIZE(sleep->use, e->nodes.capacity);
        GR_RESIZE(sleep->restless, e->nodes.capacity);
        sleep->capacity = e->nodes.capacity;
    }
    if (e->mesh.n_tiles > sleep->tile_capacity) {
        sleep->tile_capacity = 0;
        GR_RESIZE(sleep->tile_rests, e->mesh.cell_capacity / GR_LANES);
        sleep->tile_capacity = e->mesh.cell_capacity / GR_LANES;
    }
    sleep->asleep = 0;
    for (int64_t c = 0; c < e->mesh.n_cells; c++) sleep->asleep += e->mesh.cell[c].calm == GR_ASLEEP;
    sleep->changed = sleep->all_nodes = 1;
    return GR_OK;
}

/* Run n threads of a stage of a device. */
static void run_stage(struct gr_engine *e, enum gr_device_stage stage, int64_t n)
{
    const struct gr_launch launch = {.e = e};
    gr_device_run(&launch, stage, n);
}

/* Run a stage whose threads count their cells. Returned: the number of cells counted; 0 after a failure. */
static int64_t count_on_device(struct gr_engine *e, enum gr_device_stage stage)
{
    e->device->counts.cells = 0;
    run_stage(e, stage, e->mesh.n_cells);
    return gr_device_wait(e) ? 0 : e->device->counts.cells;
}

void gr_sleep_wake_all(struct gr_engine *e)
{
    if (!e->sleep->asleep) return;
    e->sleep->asleep = 0;
    e->sleep->changed = 1;
    if (e->device && e->device->makes_steps) { /* else a body is driven from outside */
        run_stage(e, GR_STAGE_wake, e->mesh.n_cells);
        return;
    }
    for (int64_t c = 0; c < e->mesh.n_cells; c++) gr_wake(e, &e->mesh.cell[c]);
}

/* Chunks of tiles. */
struct look {
    struct gr_engine *e;
    int64_t chunks, calm[GR_MAX_CHUNKS], fell[GR_MAX_CHUNKS];
};

/* Define a pass over the items of a chunk: a function for number c of them, in chunk `chunk`. */
#define GR_PASS(pass, items)                                                                  \
    static void pass##_one(struct look *look, struct gr_engine *e, int64_t chunk, int64_t c); \
    static void pass(void *context, int64_t chunk, int t)                                     \
    {                                                                                         \
        struct look *look = context;                                                          \
        int64_t first, last;                                                                  \
        (void)t;                                                                              \
        gr_share(look->e->mesh.items, chunk, look->chunks, &first, &last);                    \
        for (int64_t c = first; c < last; c++) pass##_one(look, look->e, chunk, c);           \
    }                                                                                         \
    static void pass##_one(struct look *look, struct gr_engine *e, int64_t chunk, int64_t c)

/* True for a cell of another rank, whose calm that one tells. */
static int is_ghost(const struct gr_engine *e, int64_t c) { return e->ranks && e->ranks->sharing[c] == GR_GHOST; }

/* Count for how many checks each cell has been calm. */
GR_PASS(count_checks, n_cells)
{
    if (!is_ghost(e, c)) look->calm[chunk] += gr_count_checks(e, c);
}

/* Note the nodes of the cells that are not calm. */
GR_PASS(note_restless, n_cells)
{
    (void)look, (void)chunk;
    gr_note_restless(e, c);
}

/* Let calm cells fall asleep that have no restless node. */
GR_PASS(fall_asleep, n_cells)
{
    if (is_ghost(e, c) || !gr_fall_asleep(e, c)) return;
    look->fell[chunk]++;
    if (e->mesh.cell[c].count) gr_set_byte(&e->mesh.tile_changed[c / GR_LANES], 1);
}

static int moves(const struct gr_body_state *body)
{
    int any = 0;
    for (int d = 0; d < 3; d++) any |= body->v[d] != 0 || body->omega[d] != 0;
    return any;
}

/* Keep the cells awake that a moving body may touch in the next steps. All whose centres are so near are listed
 * (near_bodies.h). */
static void wake_near_bodies(struct gr_engine *e)
{
    const double near = 1.5 * e->config.dx;
    for (int b = 0; b < e->config.n_bodies; b++) {
        struct gr_pose pose;
        if (!moves(&e->bodies.now[b])) continue;
        gr_pose_at(e, b, e->bodies.now[b].x, e->bodies.now[b].orientation, &pose);
        for (int64_t k = 0; k < e->bodies.near.n; k++) {
            struct gr_cell *cell = &e->mesh.cell[e->bodies.near.cell[k]];
            double x[3], arm[3], normal[3];
            gr_cell_position(e, cell->at, x);
            if (!(gr_pose_distance(e, &pose, x, arm, normal) < near)) continue;
            gr_wake(e, cell);
            cell->calm = 0;
        }
    }
}

int64_t gr_sleep_count(struct gr_engine *e, struct gr_team *team)
{
    struct look look = {.e = e, .chunks = gr_chunks(team, e->mesh.n_cells)};
    int64_t calm = 0;
    if (e->device)
        calm = count_on_device(e, GR_STAGE_check);
    else
        gr_team_run(team, count_checks, &look, look.chunks);
    if (e->bodies.contacts) wake_near_bodies(e);
    for (int64_t c = 0; c < look.chunks; c++) calm += look.calm[c];
    return calm;
}

/* Note the nodes of ghost cells with points that are not calm. */
static void note_restless_ghosts(struct gr_engine *e)
{
    for (int p = 0; e->ranks && p < e->ranks->n_peers; p++)
        for (int64_t k = 0; k < e->ranks->peer[p].n_ghost; k++) {
            const struct gr_shared_cell *ghost = &e->ranks->peer[p].ghost[k];
            if (!ghost->occupied || e->mesh.cell[ghost->lane].calm >= GR_CALM_CHECKS) continue;
            for (int i = 0; i < e->K; i++) e->sleep->restless[gr_cell_node(e, ghost->lane, i)] = 1;
        }
}

/* The same by the threads of a device, which make the sums again of the cells that fall asleep. */
static void fall_on_device(struct gr_engine *e)
{
    run_stage(e, GR_STAGE_calm, e->mesh.n_nodes);
    run_stage(e, GR_STAGE_restless, e->mesh.n_cells);
    const int64_t fell = count_on_device(e, GR_STAGE_fall);
    e->sleep->asleep += fell;
    if (fell) e->sleep->changed = e->sleep->all_nodes = 1;
}

void gr_sleep_fall(struct gr_engine *e, struct gr_team *team)
{
    struct look look = {.e = e, .chunks = gr_chunks(team, e->mesh.n_cells)};
    int64_t fell = 0;
    if (e->device) {
        fall_on_device(e);
        return;
    }
    memset(e->sleep->restless, 0, (size_t)e->mesh.n_nodes);
    gr_team_run(team, note_restless, &look, look.chunks);
    note_restless_ghosts(e);
    memset(e->mesh.tile_changed, 0, (size_t)e->mesh.n_tiles);
    gr_team_run(team, fall_asleep, &look, look.chunks);
    for (int64_t c = 0; c < look.chunks; c++) fell += look.fell[c];
    if (!fell) return;
    e->sleep->asleep += fell;
    e->sleep->changed = e->sleep->all_nodes = 1;
    for (int64_t tile = 0; tile < e->mesh.n_tiles; tile++)
        if (e->mesh.tile_changed[tile]) e->sums.dirty[e->sums.n_dirty++] = tile;
}

/* Note the nodes of cells that are awake. */
GR_PASS(use_nodes, n_cells)
{
    (void)look, (void)chunk;
    if (e->mesh.cell[c].calm != GR_ASLEEP) gr_use_nodes(e, c);
}

/* Note the other nodes of cells that these may wake. */
GR_PASS(watch_nodes, n_cells)
{
    (void)look, (void)chunk;
    gr_watch_nodes(e, c);
}

/* Find out which tiles are left alone. */
GR_PASS(find_resting, n_tiles)
{
    (void)look, (void)chunk;
    gr_find_resting(e, c);
}

/* The same by the threads of a device. */
static void find_uses_on_device(struct gr_engine *e)
{
    run_stage(e, GR_STAGE_unuse, e->sleep->capacity);
    run_stage(e, GR_STAGE_use, e->mesh.n_cells);
    if (e->bodies.contacts) run_stage(e, GR_STAGE_use_near, e->bodies.near.n);
    run_stage(e, GR_STAGE_watch, e->mesh.n_cells);
    run_stage(e, GR_STAGE_rest, e->mesh.n_tiles);
}

void gr_sleep_find_uses(struct gr_engine *e, struct gr_team *team)
{
    if (!e->sleep->changed) return;
    struct look look = {.e = e, .chunks = gr_chunks(team, e->mesh.n_cells)};
    e->sleep->changed = 0;
    e->sleep->asleep = 0;
    if (e->device) {
        find_uses_on_device(e);
        return;
    }
    if (e->sleep->capacity) memset(e->sleep->use, GR_NODE_UNUSED, (size_t)e->sleep->capacity);
    gr_team_run(team, use_nodes, &look, look.chunks);
    for (int64_t k = 0; e->bodies.contacts && k < e->bodies.near.n; k++) /* contact changes the nodes near bodies in place */
        gr_use_nodes(e, e->bodies.near.cell[k]);
    gr_team_run(team, watch_nodes, &look, look.chunks);
    gr_team_run(team, find_resting, &look, look.chunks);
    for (int64_t c = 0; c < e->mesh.n_cells; c++) e->sleep->asleep += e->mesh.cell[c].calm == GR_ASLEEP;
}

int64_t gr_sleep_list(const struct gr_engine *e, int64_t *const out[2])
{
    int64_t n = 0;
    for (int64_t c = 0; c < e->mesh.n_cells; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        if (!cell->count || !cell->calm) continue;
        if (out) out[0][n] = gr_cell_id(e, cell->at), out[1][n] = cell->calm;
        n++;
    }
    return n;
}

int gr_sleep_restore(struct gr_engine *e, int64_t n, const int64_t *cells, const int64_t *calm)
{
    const int64_t all = e->mesh.cell_of.n;
    for (int64_t k = 0; k < n; k++)
        if (calm[k] < 0 || (calm[k] > GR_CALM_CHECKS && calm[k] != GR_ASLEEP) || cells[k] < 0 || cells[k] >= all)
            return GR_ERR_CONFIG;
    for (int64_t k = 0; k < n; k++) {
        const int64_t c = (int64_t)gr_table_get(&e->mesh.cell_of, cells[k]) - 1;
        if (c >= 0 && e->mesh.cell[c].count && !GR_IS_DOUBLE(&e->mesh.cell[c])) e->mesh.cell[c].calm = (int32_t)calm[k];
    }
    return GR_OK;
}
