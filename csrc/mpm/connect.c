/* The nodes of the active cells, the connections between both, and the neighbours of cells. */
#include "mpm/connect.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/memory.h"
#include "mpm/migrate.h"
#include "mpm/solid_cells.h"
#include "mpm/spread.h"
#include "mpm/wall_impulse.h"

static int reserve_nodes(struct gr_engine *e, int64_t n)
{
    struct gr_mesh *mesh = &e->mesh;
    if (n <= mesh->node_capacity) return GR_OK;
    const int64_t capacity = n + n / 2;
    mesh->node_capacity = 0;
    GR_RESIZE(mesh->node_source, capacity * e->K);
    GR_RESIZE(mesh->node_run, (capacity / GR_LANES + 1) * e->K);
    GR_RESIZE(mesh->node_code, capacity);
    GR_RESIZE(mesh->node_id, capacity);
    e->nodes.capacity = capacity + 2 * GR_LANES;
    GR_RESIZE(mesh->node_volume, e->nodes.capacity);
    if (e->config.smoothed) {
        GR_RESIZE(mesh->node_about, (capacity + GR_LANES) * gr_about(e->config.dim));
        GR_RESIZE(mesh->node_at, capacity);
    }
    GR_RESIZE(e->nodes.data, e->nodes.n_fields * e->nodes.capacity);
    if (e->config.single) GR_RESIZE(e->nodes.single, e->nodes.n_fields * e->nodes.capacity);
    GR_RESIZE(e->nodes.mass, capacity + GR_LANES);
    if (e->config.xpic_order > 0) GR_RESIZE(e->nodes.v, capacity * e->config.dim);
    if (e->watch) GR_RESIZE(e->watch->node, capacity * e->config.dim);
    if (e->bodies.n_thin) {
        GR_RESIZE(mesh->duplicate, capacity);
        GR_RESIZE(mesh->separated, capacity);
    }
    mesh->node_capacity = capacity;
    return GR_OK;
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

/* The nodes that are to be connected. A node of double cells is listed twice, its copy for the front first. */
struct connect {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks, n_nodes, *ids;
};

/* Clear the nodal fields, which belong to the old nodes: G2P before the next grid stage then finds all nodes at rest. */
GR_SHARED(clear_nodes, struct connect, q->e->nodes.capacity, q)
{
    struct gr_engine *e = q->e;
    const size_t size = sizeof(double) * (size_t)(last - first);
    (void)chunk;
    if (first >= last) return;
    for (int f = 0; f < e->nodes.n_fields; f++) memset(gr_node_field(e, f) + first, 0, size);
    for (int f = 0; e->nodes.single && f < e->nodes.n_fields; f++)
        memset(e->nodes.single + f * e->nodes.capacity + first, 0, sizeof(float) * (size_t)(last - first));
    if (last > q->n_nodes) last = q->n_nodes;
    if (first >= last) return;
    memset(e->nodes.mass + first, 0, sizeof(double) * (size_t)(last - first));
    if (e->nodes.v) memset(e->nodes.v + first * e->config.dim, 0, sizeof(double) * (size_t)((last - first) * e->config.dim));
}

/* List the second copies of nodes, too. */
static int list_copies(struct connect *q)
{
    const struct gr_engine *e = q->e;
    int64_t n = q->n_nodes, all = n;
    int64_t *ids = realloc(q->ids, sizeof *ids * (size_t)(2 * n + 1));
    if (!ids) return GR_ERR_MEMORY;
    q->ids = ids;
    uint8_t *doubled = calloc((size_t)n + 1, 1);
    if (!doubled) return GR_ERR_MEMORY;
    for (int64_t k = 0; k < e->mesh.n_paired; k++)
        for (int a = 0; a < e->K; a++) {
            uint8_t *copy = &doubled[gr_table_get(&e->mesh.node_of, node_id_of(e, &e->mesh.cell[e->mesh.paired[k]], a)) - 1];
            all += !*copy;
            *copy = 1;
        }
    q->n_nodes = all;
    while (n-- > 0) { /* backwards, so that no entry is overwritten that is still needed */
        ids[--all] = ids[n];
        if (doubled[n]) ids[--all] = ids[n];
    }
    free(doubled);
    return GR_OK;
}

/* List the nodes of the active cells; node_of gives their numbers. */
static int list_nodes(struct connect *q, const int64_t *cells)
{
    struct gr_table *const numbers = &q->e->mesh.node_of;
    if (gr_spread(q->e, GR_SPREAD_NODES, cells, q->e->mesh.n_cells, q->team, q->chunks, &q->ids, &q->n_nodes) ||
        gr_table_fill(numbers, q->ids, q->n_nodes, q->team, q->chunks))
        return GR_ERR_MEMORY;
    if (!q->e->mesh.n_paired) return GR_OK;
    return list_copies(q) || gr_table_fill(numbers, q->ids, q->n_nodes, q->team, q->chunks) ? GR_ERR_MEMORY : GR_OK;
}

GR_SHARED(describe_nodes, struct connect, q->n_nodes, q)
{
    struct gr_mesh *mesh = &q->e->mesh;
    (void)chunk;
    for (int64_t n = first; n < last; n++) {
        mesh->node_id[n] = q->ids[n];
        if (q->e->bodies.n_thin) {
            const int is_front = n + 1 < q->n_nodes && q->ids[n + 1] == q->ids[n], is_back = n && q->ids[n - 1] == q->ids[n];
            mesh->duplicate[n] = is_front ? (int32_t)(n + 1) : is_back ? (int32_t)(n - 1) : -1;
        }
        describe_node(q->e, n);
    }
}

/* Find out which local nodes of the cells of a tile follow each other. */
static void find_rows(struct gr_engine *e, int64_t tile)
{
    const int32_t *node = e->mesh.cell_node + tile * e->K * GR_LANES;
    e->mesh.tile_in_row[tile] = 0;
    for (int i = 0; i < e->K; i++, node += GR_LANES) {
        int in_row = 1;
        for (int l = 1; l < GR_LANES; l++) in_row &= node[l] == node[0] + l;
        e->mesh.tile_in_row[tile] |= (uint32_t)in_row << i;
    }
}

/* Index of the node `id` of the grid, the last of all if it is not active. It mostly is at `guess`, as nodes of a row
 * follow each other; where nodes have copies, that might be the second one. */
static int32_t place_of_node(const struct gr_engine *e, int64_t id, int32_t guess)
{
    if (!e->bodies.n_thin && guess < e->mesh.n_nodes && e->mesh.node_id[guess] == id) return guess;
    const int32_t number = gr_table_get(&e->mesh.node_of, id);
    return number ? number - 1 : (int32_t)e->nodes.capacity - 1;
}

/* Find the nodes about node n, and whether it is at an end or on a grid line. */
static void find_about(struct gr_engine *e, int64_t n)
{
    const int dim = e->config.dim;
    int64_t rest = e->mesh.node_id[n], stride = 1, step[3][3] = {{0}};
    uint8_t at_end = 0, on_line = 0;
    for (int d = 0; d < dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        const int64_t m = axis->n_nodes, at = rest % m;
        on_line |= (uint8_t)((axis->node_position[at] == floor(axis->node_position[at])) << d);
        for (int side = 0; side < 3; side++) {
            const int64_t next = at + side - 1;
            const int beyond = !axis->periodic && (next < 0 || next >= m);
            step[d][side] = beyond ? 0 : ((next + m) % m - at) * stride;
            at_end |= (uint8_t)(beyond << d);
        }
        rest /= m;
        stride *= m;
    }
    e->mesh.node_at[n] = (uint8_t)(at_end | on_line << 3);
    int32_t *about = gr_about_node(e, n);
    for (int k = 0; k < gr_about(dim); k++, about += GR_LANES) {
        const int64_t id = e->mesh.node_id[n] + step[0][k % 3] + step[1][k / 3 % 3] + step[2][k / 9];
        *about = place_of_node(e, id, k ? about[-GR_LANES] + 1 : (int32_t)n);
    }
}

/* Find the nodes about all. Nodes of the last group beyond the number of nodes are their own neighbours. */
GR_SHARED(find_all_about, struct connect, (q->n_nodes + GR_LANES - 1) / GR_LANES, q)
{
    struct gr_engine *e = q->e;
    (void)chunk;
    for (int64_t group = first; group < last; group++)
        for (int64_t n = group * GR_LANES; n < (group + 1) * GR_LANES; n++) {
            if (n < q->n_nodes) {
                find_about(e, n);
                continue;
            }
            for (int k = 0; k < gr_about(e->config.dim); k++) gr_about_node(e, n)[k * GR_LANES] = (int32_t)n;
        }
}

/* Set the last entry, which stands for absent nodes: no gap that counts, and no volume. */
static void describe_none(struct gr_engine *e)
{
    const int gap = GR_NODE_DENSITY(e->config.dim) + GR_NODE_OWN_GAP(e->config.dim);
    if (!e->nodes.capacity) return; /* no node was there ever */
    gr_node_field(e, gap)[e->nodes.capacity - 1] = -INFINITY;
    e->mesh.node_volume[e->nodes.capacity - 1] = 0;
}

/* Find the pieces in which the sums of GR_LANES nodes lie. Nodes beyond the last continue its piece. */
GR_SHARED(find_runs, struct connect, (q->n_nodes + GR_LANES - 1) / GR_LANES, q)
{
    const struct gr_engine *e = q->e;
    const struct gr_mesh *mesh = &e->mesh;
    (void)chunk;
    for (int64_t group = first; group < last; group++)
        for (int i = 0; i < e->K; i++) {
            const int64_t *source = mesh->node_source + group * GR_LANES * e->K + i;
            const int64_t left = mesh->n_nodes - group * GR_LANES, n = left < GR_LANES ? left : GR_LANES;
            struct gr_node_run run = {.at = {source[0]}, .pieces = 1};
            for (int l = 1; l < n && run.pieces != GR_RUN_BROKEN; l++) {
                const int64_t at = source[l * e->K] - l;
                if (at == run.at[run.pieces - 1]) continue;
                if (run.pieces == GR_RUN_PIECES || at < 0) {
                    run.pieces = GR_RUN_BROKEN;
                } else {
                    run.begin[run.pieces] = (int8_t)l;
                    run.at[run.pieces++] = at;
                }
            }
            mesh->node_run[group * e->K + i] = run;
        }
}

/* Index of the neighbour of a cell along axis d, low or high; see enum gr_neighbour. */
static int64_t neighbour_of_cell(const struct gr_engine *e, const struct gr_cell *cell, int d, int high)
{
    int32_t at[3];
    memcpy(at, cell->at, sizeof at);
    if (cell->flags / GR_CELL_WALL >> (2 * d + high) & 1) return GR_NEIGHBOUR_CLOSED;
    at[d] += high ? 1 : -1;
    if (at[d] < 0 || at[d] >= e->axis[d].n_cells) {
        if (!e->axis[d].periodic) return GR_NEIGHBOUR_CLOSED;
        at[d] = high ? 0 : e->axis[d].n_cells - 1;
    }
    const int64_t index = (int64_t)gr_table_get(&e->mesh.cell_of, gr_cell_id(e, at)) - 1;
    return index < 0 ? GR_NEIGHBOUR_NO_POINTS : index;
}

static void find_neighbours(struct gr_engine *e, int64_t c)
{
    const int sides = 2 * e->config.dim;
    for (int k = 0; k < sides; k++)
        e->mesh.neighbour[c * sides + k] = (int32_t)neighbour_of_cell(e, &e->mesh.cell[c], k / 2, k % 2);
}

/* Find the nodes and the neighbours of the cells of tiles. Each source of a node belongs to one cell. */
GR_SHARED(connect_tiles, struct connect, q->e->mesh.n_tiles, q)
{
    struct gr_engine *e = q->e;
    struct gr_mesh *mesh = &e->mesh;
    const int K = e->K;
    (void)chunk;
    for (int64_t c = first * GR_LANES; c < last * GR_LANES; c++) {
        for (int a = 0; a < K; a++) {
            int32_t n = gr_table_get(&mesh->node_of, node_id_of(e, &mesh->cell[c], a)) - 1;
            if (e->bodies.n_thin && mesh->duplicate[n] >= 0) n += mesh->cell[c].side < 0;
            mesh->cell_node[(c / GR_LANES * K + a) * GR_LANES + c % GR_LANES] = n;
            if (c >= mesh->n_cells || is_beyond(e, &mesh->cell[c], a)) continue;
            mesh->node_source[(int64_t)n * K + K - 1 - a] =
                gr_sums_of_cell(e, c) + a * GR_SUM_DAMPED(e->config.dim) * GR_LANES;
        }
        if (mesh->neighbour) find_neighbours(e, c);
    }
    for (int64_t tile = first; tile < last; tile++) find_rows(e, tile);
}

int gr_connect(struct gr_engine *e, const int64_t *cells, struct gr_team *team, int64_t chunks)
{
    struct connect q = {.e = e, .team = team, .chunks = chunks};
    e->mesh.n_nodes = 0;
    const int error = list_nodes(&q, cells) || reserve_nodes(e, q.n_nodes) ? GR_ERR_MEMORY : GR_OK;
    if (!error) {
        e->mesh.n_nodes = q.n_nodes;
        clear_nodes(&q);
        describe_nodes(&q);
        connect_tiles(&q);
        find_runs(&q);
        if (e->config.smoothed) {
            find_all_about(&q);
            describe_none(e);
        }
    } else {
        gr_table_clear(&e->mesh.node_of);
    }
    free(q.ids);
    return error;
}
