/* The nodes of the active cells, the connections between both, and the neighbours of cells. */
#include "mpm/connect.h"

#include <math.h>
#include <string.h>

#include "core/memory.h"
#include "mpm/addends.h"
#include "mpm/device.h"
#include "mpm/fill_table.h"
#include "mpm/places.h"
#include "mpm/solid_cells.h"
#include "mpm/spread.h"
#include "mpm/wall_impulse.h"

/* The nodes that are to be connected: of the layers, one after the other. */
struct connect {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks, n_nodes;
    struct gr_tiles tiles;
    int64_t *ids[2], n[2], first[2]; /* indices of the nodes of a layer in the grid, their number, the first */
};

static void describe_node(struct gr_engine *e, int64_t n)
{
    struct gr_mesh *mesh = &e->mesh;
    int64_t id = mesh->node_id[n];
    int32_t at[3] = {0};
    mesh->node_volume[n] = gr_node_volume(e, id);
    if (mesh->node_radius) mesh->node_radius[n] = e->axis[0].node_radius[id % e->axis[0].n_nodes];
    for (int d = 0; d < e->config.dim; d++) {
        at[d] = e->axis[d].node_number[id % e->axis[d].n_nodes];
        id /= e->axis[d].n_nodes;
    }
    mesh->node_code[n] = gr_map_get(&e->config.node_codes, at);
}

/* Clear the nodal fields, which belong to the old nodes: G2P before the next grid stage then finds all nodes at rest. */
GR_DEFINE_PASS(clear_nodes, struct connect, q)
{
    const int dim = e->config.dim;
    for (int f = 0; f < e->nodes.n_fields; f++) {
        double *const field = gr_node_field(e, f);
        float *const single = e->nodes.single ? e->nodes.single + f * e->nodes.capacity : 0;
        for (int64_t n = first; n < last; n++) field[n] = 0;
        for (int64_t n = first; single && n < last; n++) single[n] = 0;
    }
    for (int64_t n = first; n < last && n < q->n_nodes; n++) {
        e->nodes.mass[n] = 0;
        if (e->nodes.filled) e->nodes.filled[n] = 0;
        for (int d = 0; e->nodes.v && d < dim; d++) e->nodes.v[n * dim + d] = 0;
    }
}

GR_DEFINE_PASS(describe_nodes, struct connect, q)
{
    struct gr_mesh *mesh = &e->mesh;
    for (int64_t n = first; n < last; n++) {
        mesh->node_id[n] = n < q->n[0] ? q->ids[0][n] : q->ids[1][n - q->n[0]];
        describe_node(e, n);
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
static void find_about_node(struct gr_engine *e, int64_t n)
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
GR_DEFINE_PASS(find_about, struct connect, q)
{
    for (int64_t n = first; n < last; n++) {
        if (n < q->n_nodes) {
            find_about_node(e, n);
            continue;
        }
        for (int k = 0; k < gr_about(e->config.dim); k++) gr_about_node(e, n)[k * GR_LANES] = (int32_t)n;
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

/* Number of the node of a layer with this index in the grid. */
static int64_t node_in_layer(const struct gr_engine *e, const struct connect *q, int k, int64_t id)
{
    int64_t low = 0, high = q->n[k];
    if (!k) return (int64_t)gr_table_get(&e->mesh.node_of, id) - 1;
    while (low < high) {
        const int64_t middle = (low + high) / 2;
        if (q->ids[k][middle] < id)
            low = middle + 1;
        else
            high = middle;
    }
    return q->first[k] + low;
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

/* Find the rows of nodes of a cell, and where they begin in the grid. Those of the cells that fill up the last tile are those
 * of its last cell. */
static void find_rows(struct gr_engine *e, const struct connect *q, int64_t c)
{
    const int64_t source = c < e->mesh.n_cells ? c : e->mesh.n_cells - 1, n_x = e->axis[0].n_nodes;
    const int k = e->K / e->n_rows, behind = source >= e->mesh.n_front;
    const struct gr_cell *cell = &e->mesh.cell[source];
    for (int row = 0; row < e->n_rows; row++) {
        const int64_t at = (c / GR_LANES * e->n_rows + row) * GR_LANES + c % GR_LANES, id = node_id_of(e, cell, row * k);
        const int wraps = e->mesh.row_begin && cell->at[0] + k > n_x;
        e->mesh.row_node[at] = (int32_t)node_in_layer(e, q, behind, id);
        if (e->mesh.row_begin) e->mesh.row_begin[at] = wraps ? (int32_t)node_in_layer(e, q, behind, id - id % n_x) : -1;
    }
}

/* Find out which nodes of the lanes of a tile follow each other. */
static uint32_t find_order(const struct gr_engine *e, int64_t tile)
{
    const int64_t first = tile * GR_LANES;
    uint32_t in_order = 0;
    for (int i = 0; i < e->K; i++) {
        int l = 1;
        while (l < GR_LANES && gr_cell_node(e, first + l, i) == gr_cell_node(e, first, i) + l) l++;
        in_order |= (uint32_t)(l == GR_LANES) << i;
    }
    const int run = e->mesh.tile_joins[tile] == GR_ONE_RUN;
    return run && in_order == (1u << e->K) - 1 ? GR_IN_ROW : in_order;
}

/* Find the nodes of the lanes of tiles, and the neighbours of their cells. */
GR_DEFINE_PASS(connect_cells, struct connect, q)
{
    for (int64_t c = first; c < last; c++) {
        find_rows(e, q, c);
        if (e->mesh.neighbour) find_neighbours(e, c);
    }
}

/* Find the order of the nodes of tiles, and how many of them the lanes have by themselves. */
GR_DEFINE_PASS(find_orders, struct connect, q)
{
    (void)q;
    for (int64_t tile = first; tile < last; tile++) {
        const uint32_t order = e->mesh.tile_in_order[tile] = find_order(e, tile);
        e->mesh.tile_nodes[tile] = order == GR_IN_ROW ? 0 : e->K * GR_LANES;
    }
}

/* List the nodes of the lanes of tiles in which they are not in a row. */
GR_DEFINE_PASS(list_lane_nodes, struct connect, q)
{
    const struct gr_mesh *mesh = &e->mesh;
    (void)q;
    for (int64_t c = first; c < last; c++) {
        const int64_t tile = c / GR_LANES;
        for (int i = 0; mesh->tile_in_order[tile] != GR_IN_ROW && i < e->K; i++)
            mesh->lane_node[mesh->tile_nodes[tile] + i * GR_LANES + c % GR_LANES] = gr_cell_node(e, c, i);
    }
}

#ifndef GR_ON_DEVICE
static int reserve_nodes(struct gr_engine *e, int64_t n)
{
    struct gr_mesh *mesh = &e->mesh;
    if (n <= mesh->node_capacity) return GR_OK;
    const int64_t capacity = n + n / 2;
    mesh->node_capacity = 0;
    GR_RESIZE(mesh->node_code, capacity);
    GR_RESIZE(mesh->node_id, capacity);
    e->nodes.capacity = capacity + 2 * GR_LANES;
    GR_RESIZE(mesh->node_volume, e->nodes.capacity);
    if (e->config.axisymmetric) GR_RESIZE(mesh->node_radius, e->nodes.capacity);
    if (e->config.smoothed) {
        GR_RESIZE(mesh->node_about, (capacity + GR_LANES) * gr_about(e->config.dim));
        GR_RESIZE(mesh->node_at, capacity);
    }
    GR_RESIZE(e->nodes.data, e->nodes.n_fields * e->nodes.capacity);
    if (e->config.single) GR_RESIZE(e->nodes.single, e->nodes.n_fields * e->nodes.capacity);
    GR_RESIZE(e->nodes.mass, e->nodes.capacity);
    if (e->config.cell_averaged && e->own_volumes) GR_RESIZE(e->nodes.filled, e->nodes.capacity);
    if (e->config.xpic_order > 0) GR_RESIZE(e->nodes.v, capacity * e->config.dim);
    if (e->watch) GR_RESIZE(e->watch->node, capacity * e->config.dim);
    if (e->bodies.n_thin) {
        GR_RESIZE(mesh->duplicate, capacity);
        GR_RESIZE(mesh->separable, capacity);
        GR_RESIZE(mesh->separated, capacity);
    }
    mesh->node_capacity = capacity;
    return GR_OK;
}

/* Fill node_of from both layers, of a node in both with the first. */
static int number_nodes(struct connect *q)
{
    const size_t n = (size_t)q->n_nodes + 1;
    int64_t *ids = gr_malloc(sizeof *ids * n);
    int32_t *number = gr_malloc(sizeof *number * n);
    int64_t at[2] = {0, 0}, all = 0;
    int error = GR_ERR_MEMORY;
    while (ids && number && (at[0] < q->n[0] || at[1] < q->n[1])) {
        const int behind = at[0] == q->n[0] || (at[1] < q->n[1] && q->ids[1][at[1]] < q->ids[0][at[0]]);
        ids[all] = q->ids[behind][at[behind]];
        number[all++] = (int32_t)(q->first[behind] + at[behind]++);
    }
    if (ids && number) error = gr_fill_table(q->e, &q->e->mesh.node_of, ids, number, all, q->team, q->chunks);
    gr_free(ids);
    gr_free(number);
    return error;
}

/* List the nodes of the active cells; node_of gives their numbers. */
static int list_nodes(struct connect *q)
{
    const struct gr_tiles *tiles = &q->tiles;
    const int64_t begin[3] = {0, tiles->n_front, tiles->n_cells};
    for (int k = 0; k < (tiles->side ? 2 : 1); k++) {
        q->first[k] = q->n_nodes;
        const int error = gr_spread(q->e, GR_SPREAD_NODES, tiles->cell + begin[k], begin[k + 1] - begin[k], q->team,
                                    q->chunks, &q->ids[k], &q->n[k]);
        if (error) return error;
        q->n_nodes += q->n[k];
    }
    if (tiles->side) return number_nodes(q);
    return gr_fill_table(q->e, &q->e->mesh.node_of, q->ids[0], NULL, q->n[0], q->team, q->chunks);
}

/* Find which nodes are in both layers, and which of them belong to double cells. */
static void pair_nodes(struct connect *q)
{
    struct gr_mesh *mesh = &q->e->mesh;
    for (int64_t n = 0; n < q->n_nodes; n++) mesh->duplicate[n] = -1, mesh->separable[n] = mesh->separated[n] = 0;
    for (int64_t n = 0, other = q->first[1]; n < q->n[0]; n++) {
        while (other < q->n_nodes && mesh->node_id[other] < mesh->node_id[n]) other++;
        if (other == q->n_nodes || mesh->node_id[other] != mesh->node_id[n]) continue;
        mesh->duplicate[n] = (int32_t)other;
        mesh->duplicate[other] = (int32_t)n;
    }
    for (int64_t k = 0; k < mesh->n_paired; k++)
        for (int i = 0; i < q->e->K; i++) {
            const int64_t n = gr_cell_node(q->e, mesh->paired[k], i);
            mesh->separable[n] = mesh->separable[mesh->duplicate[n]] = 1;
        }
}

/* Set the last entry, which stands for absent nodes: no gap that counts, and no volume. */
static void describe_none(struct gr_engine *e)
{
    const int gap = GR_NODE_DENSITY(e->config.dim) + GR_NODE_OWN_GAP(e->config.dim);
    if (!e->nodes.capacity) return; /* no node was there ever */
    gr_node_field(e, gap)[e->nodes.capacity - 1] = -INFINITY;
    e->mesh.node_volume[e->nodes.capacity - 1] = 0;
    if (e->mesh.node_radius) e->mesh.node_radius[e->nodes.capacity - 1] = 0;
}

/* Give the nodes of the lanes of tiles in which they are not in a row their places. */
static int place_lane_nodes(struct gr_engine *e)
{
    struct gr_mesh *mesh = &e->mesh;
    int64_t n = 0;
    const int error = gr_make_places(e, mesh->tile_nodes, mesh->n_tiles, &n);
    if (error || n <= mesh->lane_node_capacity) return error;
    mesh->lane_node_capacity = 0;
    GR_RESIZE(mesh->lane_node, n + n / 2);
    mesh->lane_node_capacity = n + n / 2;
    return GR_OK;
}

/* Find the nodes of the tiles. */
static int connect_tiles(struct connect *q)
{
    struct gr_engine *e = q->e;
    const int64_t lanes = e->mesh.n_tiles * GR_LANES;
    GR_MAKE(connect_cells, q, lanes);
    GR_MAKE(find_orders, q, e->mesh.n_tiles);
    int error = gr_device_wait(e);
    if (error) return error;
    if (q->tiles.side) pair_nodes(q);
    error = place_lane_nodes(e);
    if (error) return error;
    GR_MAKE(list_lane_nodes, q, lanes);
    return gr_device_wait(e);
}

int gr_connect(struct gr_engine *e, const struct gr_tiles *tiles, struct gr_team *team, int64_t chunks)
{
    struct connect q = {.e = e, .team = team, .chunks = chunks, .tiles = *tiles};
    e->mesh.n_nodes = 0;
    int error = list_nodes(&q);
    if (!error) error = reserve_nodes(e, q.n_nodes);
    if (!error) {
        e->mesh.n_nodes = q.n_nodes;
        GR_MAKE(clear_nodes, &q, e->nodes.capacity);
        GR_MAKE(describe_nodes, &q, q.n_nodes);
        error = connect_tiles(&q);
        if (!error) error = gr_list_addends(e, q.n[0], team, chunks);
    }
    if (!error && e->config.smoothed) {
        GR_MAKE(find_about, &q, gr_groups(e) * GR_LANES);
        error = gr_device_wait(e);
        describe_none(e);
    }
    if (error) {
        e->mesh.n_nodes = 0;
        gr_table_clear(&e->mesh.node_of);
    }
    for (int k = 0; k < 2; k++) gr_free(q.ids[k]);
    return error;
}
#endif
