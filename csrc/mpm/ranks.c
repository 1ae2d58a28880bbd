/* Ranks: who has which cells (ranks.h). */
#include "mpm/ranks.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/index.h"
#include "core/memory.h"
#include "mpm/pose.h"
#include "mpm/thin_bodies.h"

/* ---- Who has a cell ---- */

enum { MOST_BLOCKS = 4 }; /* along an axis, within a distance of a cell of at most that of 1.5 blocks */

int64_t gr_ranks_blocks(const struct gr_engine *e, int d, int edge)
{
    int64_t cells = 1;
    for (int k = 0; k < e->config.dim; k++) cells *= e->axis[k].n_cells;
    if (!edge) return d ? 1 : (cells + GR_RUN_OF_CELLS - 1) / GR_RUN_OF_CELLS;
    return d < e->config.dim ? ((int64_t)e->axis[d].n_cells + edge - 1) / edge : 1;
}

/* True if a cell and all others within a distance are in one block. */
static int is_inside_block(const struct gr_engine *e, const int32_t at[3], int distance)
{
    const int edge = e->ranks->edge;
    for (int d = 0; d < e->config.dim; d++) {
        const int32_t within = at[d] % edge;
        if (within < distance || within >= edge - distance || at[d] + distance >= e->axis[d].n_cells) return 0;
    }
    return 1;
}

/* Add a rank to a list unless it is there. Returned: the length of the list. */
static int add_rank(int rank[GR_MOST_NEAR], int n, int owner)
{
    for (int k = 0; k < n; k++)
        if (rank[k] == owner) return n;
    if (n < GR_MOST_NEAR) rank[n++] = owner;
    return n;
}

/* Add the owners of the cells of a row from x = `first` to `last`, which are in few runs. */
static int add_runs(const struct gr_engine *e, int64_t row, int64_t first, int64_t last, int rank[GR_MOST_NEAR], int n)
{
    const struct gr_ranks *ranks = e->ranks;
    const int64_t begin = row * ranks->n_cells[0] + first, end = row * ranks->n_cells[0] + last;
    for (int64_t run = begin / GR_RUN_OF_CELLS; run <= end / GR_RUN_OF_CELLS; run++)
        n = add_rank(rank, n, ranks->owner[run]);
    return n;
}

/* gr_ranks_in for runs of cells. */
static int ranks_of_runs(const struct gr_engine *e, const int64_t low[3], const int64_t high[3], int rank[GR_MOST_NEAR],
                         int n)
{
    const int64_t *m = e->ranks->n_cells, first = low[0], last = high[0];
    const int around = e->axis[0].periodic;
    for (int64_t z = low[2]; z <= high[2]; z++)
        for (int64_t y = low[1]; y <= high[1]; y++) {
            const int outside =
                (!e->axis[1].periodic && (y < 0 || y >= m[1])) || (!e->axis[2].periodic && (z < 0 || z >= m[2]));
            const int64_t row = (z % m[2] + m[2]) % m[2] * m[1] + (y % m[1] + m[1]) % m[1];
            if (outside) continue;
            n = add_runs(e, row, first < 0 ? 0 : first, last < m[0] ? last : m[0] - 1, rank, n);
            if (around && first < 0) n = add_runs(e, row, first + m[0] < 0 ? 0 : first + m[0], m[0] - 1, rank, n);
            if (around && last >= m[0]) n = add_runs(e, row, 0, last - m[0] < m[0] ? last - m[0] : m[0] - 1, rank, n);
        }
    return n;
}

/* The blocks along axis d of the cells from `low` to `high`, each once. Returned: their number. */
static int blocks_along(const struct gr_engine *e, int d, int64_t low, int64_t high, int64_t block[MOST_BLOCKS])
{
    const int64_t edge = e->ranks->edge, m = e->axis[d].n_cells;
    int n = 0;
    for (int64_t i = low; i <= high; i++) {
        if (!e->axis[d].periodic && (i < 0 || i >= m)) continue;
        const int64_t next = (i % m + m) % m / edge;
        int known = 0;
        for (int k = 0; k < n; k++) known |= block[k] == next;
        if (!known && n < MOST_BLOCKS) block[n++] = next;
    }
    return n;
}

int gr_ranks_in(const struct gr_engine *e, const int64_t low[3], const int64_t high[3], int rank[GR_MOST_NEAR], int n)
{
    const struct gr_ranks *ranks = e->ranks;
    int64_t block[3][MOST_BLOCKS] = {{0}};
    int n_blocks[3] = {1, 1, 1};
    if (!ranks->edge) return ranks_of_runs(e, low, high, rank, n);
    for (int d = 0; d < e->config.dim; d++) n_blocks[d] = blocks_along(e, d, low[d], high[d], block[d]);
    for (int c = 0; c < n_blocks[2]; c++)
        for (int b = 0; b < n_blocks[1]; b++)
            for (int a = 0; a < n_blocks[0]; a++) {
                const int64_t row = block[2][c] * ranks->n_blocks[1] + block[1][b];
                n = add_rank(rank, n, ranks->owner[row * ranks->n_blocks[0] + block[0][a]]);
            }
    return n;
}

int gr_ranks_near(const struct gr_engine *e, const int32_t at[3], int distance, int rank[GR_MOST_NEAR])
{
    int64_t low[3] = {0}, high[3] = {0};
    rank[0] = gr_owner(e->ranks, at);
    if (e->ranks->edge && is_inside_block(e, at, distance)) return 1;
    for (int d = 0; d < e->config.dim; d++) low[d] = at[d] - distance, high[d] = at[d] + distance;
    return gr_ranks_in(e, low, high, rank, 1);
}

int gr_ranks_of_node(const struct gr_engine *e, int64_t id, int rank[GR_MOST_NEAR])
{
    const struct gr_node_cells *cells[3];
    static const struct gr_node_cells one = {.count = 1};
    int32_t at[3] = {0};
    int n = 0;
    for (int d = 0; d < 3; d++) {
        cells[d] = d < e->config.dim ? &e->cells_of_node[d][id % e->axis[d].n_nodes] : &one;
        if (d < e->config.dim) id /= e->axis[d].n_nodes;
    }
    for (int c = 0; c < cells[2]->count; c++)
        for (int b = 0; b < cells[1]->count; b++)
            for (int a = 0; a < cells[0]->count; a++) {
                at[0] = cells[0]->cell[a], at[1] = cells[1]->cell[b], at[2] = cells[2]->cell[c];
                n = add_rank(rank, n, gr_owner(e->ranks, at));
            }
    return n;
}

int gr_ranks_has_number(const struct gr_engine *e, const int32_t at[3])
{
    int32_t cell[3] = {0};
    for (int d = 0; d < e->config.dim; d++) {
        if (at[d] < 0 || at[d] >= e->axis[d].n_nodes) return e->ranks->transport.rank == 0; /* of a restart alone */
        cell[d] = e->ranks->cell_of_number[d][at[d]];
    }
    return gr_owner(e->ranks, cell) == e->ranks->transport.rank;
}

int gr_node_is_mixed(const struct gr_engine *e, const int32_t at[3], int a)
{
    const int k = gr_basis_nodes_1d(e->config.basis);
    return !gr_is_of_one_rank(e, at, at[0] + a - (k - 1), at[0] + a);
}

/* ---- Bodies ---- */

#define FOLLOW 0.5 /* cells by which bodies may move before the points are grouped again */

int gr_ranks_near_body(const struct gr_engine *e, const int32_t at[3], int row)
{
    const int k = gr_basis_nodes_1d(e->config.basis);
    /* The cells of the nodes about a point of a surface are no more than k - 1 from its cell along each axis. */
    const double near = (k - 0.5) * sqrt(e->config.dim) + FOLLOW + (row ? k - 1 : 0);
    double x[3], arm[3], normal[3];
    gr_cell_position(e, at, x);
    for (int b = 0; b < e->config.n_bodies; b++) {
        struct gr_pose pose;
        gr_pose_at(e, b, e->ranks->pose[b].x, e->ranks->pose[b].orientation, &pose);
        if (fabs(gr_pose_distance(e, &pose, x, arm, normal)) < near * e->config.dx) return 1;
    }
    return 0;
}

void gr_ranks_note_bodies(struct gr_engine *e)
{
    for (int b = 0; b < e->config.n_bodies; b++) {
        struct gr_split_pose *pose = &e->ranks->pose[b];
        memcpy(pose->x, e->bodies.now[b].x, sizeof pose->x);
        memcpy(pose->orientation, e->bodies.now[b].orientation, sizeof pose->orientation);
    }
}

int gr_ranks_bodies_moved(const struct gr_engine *e)
{
    for (int b = 0; e->ranks->transport.size > 1 && b < e->config.n_bodies; b++)
        if (gr_body_moved(e, b, &e->ranks->pose[b]) > FOLLOW * e->config.dx) return 1;
    return 0;
}

int gr_ranks_having(const struct gr_engine *e, const int32_t at[3], int rank[GR_MOST_NEAR])
{
    const struct gr_ranks *ranks = e->ranks;
    const int n = gr_ranks_near(e, at, ranks->farther, rank);
    if (n == 1 || ranks->farther == ranks->reach || gr_ranks_near_body(e, at, 1)) return n;
    return gr_ranks_near(e, at, ranks->reach, rank);
}

enum gr_sharing gr_sharing_of(const struct gr_engine *e, int64_t id)
{
    int32_t at[3];
    int rank[GR_MOST_NEAR], here = 0;
    gr_indices_of_cell(e, id, at);
    const int n = gr_ranks_having(e, at, rank), me = e->ranks->transport.rank;
    for (int k = 0; k < n; k++) here |= rank[k] == me;
    if (!here) return GR_NOT_HERE;
    return rank[0] != me ? GR_GHOST : n > 1 ? GR_SHARED_OWN : GR_ALONE;
}

int gr_ranks_reserve_sharing(struct gr_ranks *ranks, int64_t n)
{
    if (n <= ranks->sharing_capacity) return GR_OK;
    GR_RESIZE(ranks->sharing, n + n / 2);
    ranks->sharing_capacity = n + n / 2;
    return GR_OK;
}

/* ---- Construction ---- */

/* List the ranks that own cells within a distance of own ones. */
static int find_peers(struct gr_engine *e, int distance)
{
    struct gr_ranks *ranks = e->ranks;
    const int64_t *n = ranks->n_blocks;
    const int here = ranks->transport.rank;
    char *is_peer = gr_calloc((size_t)ranks->transport.size, 1);
    int rank[GR_MOST_NEAR];
    if (!is_peer) return GR_ERR_MEMORY;
    for (int k = 0; k < ranks->transport.size; k++) is_peer[k] = !ranks->edge && k != here;
    for (int64_t block = 0; ranks->edge && block < n[0] * n[1] * n[2]; block++) {
        const int64_t first[3] = {block % n[0], block / n[0] % n[1], block / (n[0] * n[1])};
        if (ranks->owner[block] != here) continue;
        for (int corner = 0; corner < 1 << e->config.dim; corner++) {
            int32_t at[3] = {0};
            for (int d = 0; d < e->config.dim; d++) {
                const int64_t end = (first[d] + 1) * ranks->edge, m = e->axis[d].n_cells;
                at[d] = (int32_t)(corner >> d & 1 ? (end < m ? end : m) - 1 : first[d] * ranks->edge);
            }
            const int near = gr_ranks_near(e, at, distance, rank);
            for (int k = 0; k < near; k++) is_peer[rank[k]] = rank[k] != here;
        }
    }
    for (int k = 0; k < ranks->transport.size; k++) ranks->n_peers += is_peer[k];
    ranks->peer = gr_calloc((size_t)ranks->n_peers + 1, sizeof *ranks->peer);
    ranks->message = gr_calloc((size_t)ranks->n_peers + 1, sizeof *ranks->message);
    for (int k = 0, p = 0; ranks->peer && k < ranks->transport.size; k++)
        if (is_peer[k]) ranks->peer[p++].rank = k;
    gr_free(is_peer);
    return ranks->peer && ranks->message ? GR_OK : GR_ERR_MEMORY;
}

/* Find a cell for the numbers of nodes: of the first node that has it, the one in the middle of its cells. */
static int number_cells(struct gr_engine *e)
{
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        int32_t *cell = e->ranks->cell_of_number[d] = gr_calloc((size_t)axis->n_nodes, sizeof *cell);
        if (!cell) return GR_ERR_MEMORY;
        for (int64_t i = axis->n_nodes - 1; i >= 0; i--) {
            const struct gr_node_cells *cells = &e->cells_of_node[d][i];
            cell[axis->node_number[i]] = cells->cell[cells->count / 2];
        }
    }
    return GR_OK;
}

static int is_valid(const struct gr_engine *e, const struct gr_transport *transport, int edge, int reach)
{
    return !e->ranks && !e->mesh.node_capacity && 2 * (reach + 1) <= 3 * (edge ? edge : 2 * reach) &&
           !(e->nonlocal.fluidity && edge) && transport->size > 0 && transport->rank >= 0 &&
           transport->rank < transport->size;
}

int gr_ranks_new(struct gr_engine *e, const struct gr_transport *transport, int edge, const int32_t *owner)
{
    const int averages = e->config.smoothed || e->config.cell_averaged, nodes = gr_basis_nodes_1d(e->config.basis) - 1;
    const int of_nodes = nodes + (averages ? GR_REACH_OF_AVERAGES : 0);
    const int reach = e->nonlocal.fluidity && of_nodes < GR_REACH_OF_LINKS ? GR_REACH_OF_LINKS : of_nodes;
    const int at_bodies = e->config.n_bodies ? nodes + GR_REACH_OF_BODIES : 0;
    const int farther = at_bodies > reach ? at_bodies : reach;
    int64_t blocks = 1;
    if (!is_valid(e, transport, edge, farther)) return GR_ERR_CONFIG;
    for (int d = 0; d < 3; d++) blocks *= gr_ranks_blocks(e, d, edge);
    for (int64_t b = 0; b < blocks; b++)
        if (owner[b] < 0 || owner[b] >= transport->size) return GR_ERR_CONFIG;
    struct gr_ranks *ranks = e->ranks = gr_calloc(1, sizeof *ranks);
    if (!ranks) return GR_ERR_MEMORY;
    ranks->transport = *transport;
    ranks->reach = reach, ranks->farther = farther;
    ranks->edge = edge;
    for (int d = 0; d < 3; d++) ranks->n_blocks[d] = gr_ranks_blocks(e, d, edge);
    for (int d = 0; d < 3; d++) ranks->n_cells[d] = d < e->config.dim ? e->axis[d].n_cells : 1;
    ranks->owner = gr_malloc(sizeof *ranks->owner * (size_t)blocks);
    ranks->pose = gr_calloc((size_t)e->config.n_bodies + 1, sizeof *ranks->pose);
    if (!ranks->owner || !ranks->pose) return GR_ERR_MEMORY;
    memcpy(ranks->owner, owner, sizeof *ranks->owner * (size_t)blocks);
    return number_cells(e) ? GR_ERR_MEMORY : find_peers(e, farther + 1);
}

void gr_ranks_free(struct gr_ranks *ranks)
{
    if (!ranks) return;
    for (int k = 0; ranks->peer && k < ranks->n_peers; k++) {
        gr_free(ranks->peer[k].own);
        gr_free(ranks->peer[k].ghost);
        gr_free(ranks->peer[k].out);
        gr_free(ranks->peer[k].in);
        gr_free(ranks->peer[k].leaving.sum);
        gr_free(ranks->peer[k].arriving.sum);
    }
    for (int d = 0; d < 3; d++) gr_free(ranks->cell_of_number[d]);
    void *const owned[] = {ranks->owner,  ranks->peer,    ranks->message, ranks->number,  ranks->arrival,
                           ranks->record, ranks->staged,  ranks->id,      ranks->order,   ranks->staged_id,
                           ranks->part,   ranks->sharing, ranks->taken,   ranks->entered, ranks->fluidity.foreign,
                           ranks->pose};
    for (size_t k = 0; k < sizeof owned / sizeof *owned; k++) gr_free(owned[k]);
    gr_free(ranks);
}

/* ---- The cells of others ---- */

/* Write the own cells that hold points, and are near to cells of others, into the messages to these. */
static int pack_occupied(struct gr_engine *e, const int64_t *own, int64_t n)
{
    struct gr_ranks *ranks = e->ranks;
    int rank[GR_MOST_NEAR];
    int32_t at[3];
    for (int p = 0; p < ranks->n_peers; p++) ranks->peer[p].n_leaving = 0;
    for (int64_t c = 0; c < n; c++) {
        gr_indices_of_cell(e, own[c], at);
        const int near = gr_ranks_near(e, at, ranks->farther + 1, rank);
        for (int k = 1; k < near; k++)
            for (int p = 0; p < ranks->n_peers; p++) {
                struct gr_peer *peer = &ranks->peer[p];
                if (peer->rank != rank[k]) continue;
                if (gr_ranks_reserve(ranks, p, (peer->n_leaving + 1) * (int64_t)sizeof *own, 0)) return GR_ERR_MEMORY;
                ((int64_t *)(void *)peer->out)[peer->n_leaving++] = own[c];
            }
    }
    return GR_OK;
}

int gr_ranks_list_occupied(struct gr_engine *e, const int64_t *own, int64_t n, int64_t **all, int64_t *n_all)
{
    struct gr_ranks *ranks = e->ranks;
    const int64_t size = sizeof *own;
    int64_t others = 0, at = n, *list;
    int error = gr_ranks_agree(e, pack_occupied(e, own, n), NULL, 0);
    if (!error) error = gr_ranks_exchange_counts(e);
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        struct gr_peer *peer = &ranks->peer[p];
        error = gr_ranks_reserve(ranks, p, peer->n_leaving * size, peer->n_arriving * size);
        others += peer->n_arriving;
    }
    list = error ? NULL : gr_malloc((size_t)((n + others + 1) * size));
    error = gr_ranks_agree(e, error || list ? error : GR_ERR_MEMORY, NULL, 0);
    if (!error) error = gr_ranks_exchange(e);
    if (error) {
        gr_free(list);
        return error;
    }
    memcpy(list, own, (size_t)(n * size));
    for (int p = 0; p < ranks->n_peers; p++) {
        if (ranks->peer[p].n_arriving) memcpy(list + at, ranks->peer[p].in, (size_t)(ranks->peer[p].n_arriving * size));
        at += ranks->peer[p].n_arriving;
    }
    const struct gr_axis *axis = e->axis;
    const int64_t cells = (int64_t)axis[0].n_cells * axis[1].n_cells * (e->config.dim == 3 ? axis[2].n_cells : 1);
    for (int64_t k = n; k < at && !error; k++)
        if (list[k] < 0 || list[k] >= cells) error = GR_ERR_TRANSPORT;
    if (error) {
        gr_free(list);
        return error;
    }
    if (others) qsort(list, (size_t)at, sizeof *list, gr_compare_ids);
    *all = list;
    *n_all = at;
    return GR_OK;
}
