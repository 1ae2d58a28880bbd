/* The nodes of the active cells, the connections between both, and the neighbours of cells. */
#include <stdlib.h>
#include <string.h>

#include "core/memory.h"
#include "mpm/migrate.h"
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
    qsort(ids, (size_t)*n_ids, sizeof(int64_t), gr_compare_ids);
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

int gr_connect(struct gr_engine *e)
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
    if (e->config.cell_averaged) find_neighbours(e);
    error = GR_OK;
out:
    if (error) gr_table_clear(&mesh->node_of);
    free(ids);
    return error;
}
