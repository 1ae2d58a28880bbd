/* Ghost cells (ghosts.h). */
#include "mpm/ghosts.h"

#include <stdlib.h>
#include <string.h>

#include "core/memory.h"
#include "mpm/sleep.h"

/* ---- Lists ---- */

static struct gr_peer *peer_of(struct gr_ranks *ranks, int rank)
{
    for (int p = 0; p < ranks->n_peers; p++)
        if (ranks->peer[p].rank == rank) return &ranks->peer[p];
    return NULL; /* not of a cell in the mesh */
}

static int append(struct gr_shared_cell **list, int64_t *n, int64_t *capacity, struct gr_shared_cell cell)
{
    if (*n == *capacity) {
        const int64_t more = 2 * *capacity + 64;
        GR_RESIZE(*list, more);
        *capacity = more;
    }
    (*list)[(*n)++] = cell;
    return GR_OK;
}

/* Local nodes of a cell that are nodes of cells of a rank, or next to such; bit i is local node i. */
static uint32_t nodes_for(const struct gr_engine *e, const int32_t at[3], int rank, int next_to)
{
    const struct gr_ranks *ranks = e->ranks;
    const int k = e->K / e->n_rows;
    int32_t block[3][3][4] = {{{0}}};
    int n_blocks[3][3] = {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
    uint32_t nodes = 0;
    if (!ranks->edge) return ~(uint32_t)0;
    for (int d = 0; d < e->config.dim; d++)
        for (int a = 0; a < k; a++) {
            const struct gr_node_cells *cells = &e->cells_of_node[d][e->axis[d].cell[at[d]].node[a]];
            n_blocks[d][a] = 0;
            for (int c = 0; c < cells->count; c++)
                n_blocks[d][a] = gr_ranks_add_blocks(e, d, cells->cell[c], next_to, block[d][a], n_blocks[d][a]);
        }
    for (int i = 0; i < e->K; i++) {
        const int local[3] = {i % k, i / k % k, i / (k * k)};
        int needed = 0;
        for (int z = 0; z < n_blocks[2][local[2]] && !needed; z++)
            for (int y = 0; y < n_blocks[1][local[1]] && !needed; y++)
                for (int x = 0; x < n_blocks[0][local[0]] && !needed; x++) {
                    const int64_t row = block[2][local[2]][z] * ranks->n_blocks[1] + block[1][local[1]][y];
                    needed = ranks->owner[row * ranks->n_blocks[0] + block[0][local[0]][x]] == rank;
                }
        nodes |= (uint32_t)needed << i;
    }
    return nodes;
}

static int list_cells(struct gr_engine *e)
{
    struct gr_ranks *ranks = e->ranks;
    const int me = ranks->transport.rank;
    const int motion = e->config.n_bodies ? GR_REACH_OF_BODIES : 0;
    const int averages = motion > GR_REACH_OF_AVERAGES ? motion : GR_REACH_OF_AVERAGES;
    int rank[GR_MOST_NEAR], error = GR_OK;
    for (int p = 0; p < ranks->n_peers; p++) ranks->peer[p].n_own = ranks->peer[p].n_ghost = 0;
    for (int64_t c = 0; c < e->mesh.n_cells && !error; c++) {
        if (ranks->sharing[c] == GR_ALONE) continue;
        const int32_t *const at = e->mesh.cell[c].at;
        const int near = gr_ranks_near(e, at, ranks->reach, rank);
        const int is_here = rank[0] == me;
        for (int k = is_here; k < (is_here ? near : 1) && !error; k++) {
            struct gr_peer *peer = peer_of(ranks, rank[k]);
            const int user = is_here ? rank[k] : me;
            const struct gr_shared_cell cell = {c, {nodes_for(e, at, user, motion), nodes_for(e, at, user, averages)}, 0};
            error = is_here ? append(&peer->own, &peer->n_own, &peer->own_capacity, cell)
                            : append(&peer->ghost, &peer->n_ghost, &peer->ghost_capacity, cell);
        }
    }
    return error;
}

int gr_ghosts_list(struct gr_engine *e)
{
    struct gr_ranks *ranks = e->ranks;
    int error = gr_ranks_agree(e, list_cells(e), NULL, 0);
    for (int p = 0; p < ranks->n_peers; p++) ranks->peer[p].n_leaving = ranks->peer[p].n_own;
    if (!error) error = gr_ranks_exchange_counts(e);
    for (int p = 0; p < ranks->n_peers && !error; p++)
        if (ranks->peer[p].n_arriving != ranks->peer[p].n_ghost) error = GR_ERR_TRANSPORT;
    return error;
}

/* ---- Sums ---- */

/* Sums of each node that are sent: vectors of GR_LANES numbers that follow each other in the block of a tile. */
struct span {
    int32_t first[3]; /* of local node 0, 1 and 2 of the first row; of the next ones `width` further */
    int width, n;
};

/* What is sent of a cell. */
struct content {
    struct span span[3];
    int n_spans, numbers; /* of each node */
    int wide;             /* whether nodes next to those of the other rank count, too; and the filling of the cell */
    int averages;         /* numbers of enum gr_average */
};

/* Add the sums [begin, end) of the nodes of a group. */
static void add_span(const struct gr_engine *e, enum gr_group_of_sums group, int begin, int end, struct content *content)
{
    const struct gr_rows *rows = &e->sums.rows[group];
    const int apart = (e->sums.of_lanes + rows->apart) / GR_LANES, all = e->n_rows * rows->width;
    content->span[content->n_spans++] =
        (struct span){.first = {rows->main / GR_LANES + begin, apart + begin, apart + all + begin},
                      .width = rows->width,
                      .n = end - begin};
    content->numbers += end - begin;
}

static struct content content_of(const struct gr_engine *e, unsigned parts)
{
    const int force = GR_SUM_FORCE(e->config.dim), all = e->sums.rows[GR_SUMS_OF_MOTION].width;
    struct content content = {.wide = (parts & GR_GHOST_DENSITY) != 0};
    const int begin = parts & GR_GHOST_MOMENTUM ? 0 : force, end = parts & GR_GHOST_FORCE ? all : force;
    add_span(e, GR_SUMS_OF_MOTION, begin, end, &content);
    if (parts & GR_GHOST_AVERAGES) content.averages = gr_averages_of_cell(&e->config);
    if (!content.wide) return content;
    add_span(e, GR_SUMS_OF_DENSITY, 0, e->sums.rows[GR_SUMS_OF_DENSITY].width, &content);
    if (e->config.n_materials > 1) add_span(e, GR_SUMS_OF_VOLUME, 0, e->sums.rows[GR_SUMS_OF_VOLUME].width, &content);
    return content;
}

static uint32_t nodes_of(const struct gr_engine *e, const struct content *content, const struct gr_shared_cell *cell)
{
    return cell->nodes[content->wide] & (uint32_t)(((uint64_t)1 << e->K) - 1);
}

/* A message to be written, or one to be read. */
struct halo {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks, n;
    const struct content *content;
    const struct gr_shared_cell *cell;
    const int64_t *offset; /* of the numbers of each cell in the message, bytes */
    char *message;
    int into; /* whether cells are written from the message */
};

/* Copy a number to a message, or from it. */
#define GR_COPY(at, size)                                                                         \
    do {                                                                                          \
        memcpy(halo->into ? (char *)(at) : message, halo->into ? message : (char *)(at), (size)); \
        message += (size);                                                                        \
    } while (0)

/* Copy the sums of a cell to its message, or back. */
static inline __attribute__((always_inline)) void copy_sums(const size_t size, const struct halo *halo,
                                                            const struct gr_shared_cell *cell, char *message)
{
    const struct gr_engine *e = halo->e;
    const struct content *content = halo->content;
    const int k = e->K / e->n_rows;
    const size_t vector = GR_LANES * size;
    char *const block =
        (char *)e->sums.data + ((size_t)e->mesh.tile_block[cell->lane / GR_LANES] + (size_t)(cell->lane % GR_LANES)) * size;
    if (content->wide) GR_COPY(block + (size_t)(e->sums.of_cells / GR_LANES + GR_CELL_FILLED) * vector, size);
    for (uint32_t nodes = nodes_of(e, content, cell); nodes; nodes &= nodes - 1) {
        const int i = __builtin_ctz(nodes);
        for (int g = 0; g < content->n_spans; g++) {
            const struct span *span = &content->span[g];
            char *at = block + (size_t)(span->first[i % k] + i / k * span->width) * vector;
            for (int q = 0; q < span->n; q++, at += vector) GR_COPY(at, size);
        }
    }
}

GR_SHARED(copy_cells, struct halo, h->n, h)
{
    struct gr_engine *e = h->e;
    const struct halo *const halo = h;
    (void)chunk;
    for (int64_t c = first; c < last; c++) {
        char *message = h->message + h->offset[c];
        double *const average = e->sums.average + h->cell[c].lane;
        for (int q = 0; q < h->content->averages; q++) GR_COPY(average + q * e->mesh.cell_capacity, sizeof *average);
        if (e->config.single)
            copy_sums(sizeof(float), h, &h->cell[c], message);
        else
            copy_sums(sizeof(double), h, &h->cell[c], message);
    }
}

/* Find where the numbers of n cells are in a message. Returned: its length, or -1 without memory. */
static int64_t place_cells(const struct gr_engine *e, const struct content *content, const struct gr_shared_cell *cell,
                           int64_t n, int64_t **offset, int64_t *capacity)
{
    int64_t bytes = 0;
    if (n > *capacity) {
        int64_t *more = realloc(*offset, sizeof *more * (size_t)(n + n / 2));
        if (!more) return -1;
        *offset = more;
        *capacity = n + n / 2;
    }
    for (int64_t c = 0; c < n; c++) {
        (*offset)[c] = bytes;
        bytes += content->averages * (int64_t)sizeof(double) +
                 (int64_t)gr_bytes_of_sums(e, content->wide +
                                                  content->numbers * __builtin_popcount(nodes_of(e, content, &cell[c])));
    }
    return bytes;
}

/* Write the message to a peer, or read the one from it. */
static void copy_message(struct halo *halo, const struct gr_peer *peer, int into)
{
    enum { FEW_CELLS = 256 }; /* an estimate: fewer are copied sooner than a team is called */
    halo->into = into;
    halo->n = into ? peer->n_ghost : peer->n_own;
    halo->cell = into ? peer->ghost : peer->own;
    halo->offset = into ? peer->in_offset : peer->out_offset;
    halo->message = into ? peer->in : peer->out;
    halo->chunks = halo->n > FEW_CELLS ? gr_chunks(halo->team, halo->n) : 1;
    copy_cells(halo);
}

int gr_ghosts_exchange(struct gr_engine *e, unsigned parts, struct gr_team *team)
{
    struct gr_ranks *ranks = e->ranks;
    const struct content content = content_of(e, parts);
    struct halo halo = {.e = e, .team = team, .content = &content};
    const double begin = gr_ranks_clock(), waiting = ranks->seconds_waiting;
    int error = GR_OK;
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        struct gr_peer *peer = &ranks->peer[p];
        const int64_t out = place_cells(e, &content, peer->own, peer->n_own, &peer->out_offset, &peer->out_offsets);
        const int64_t in = place_cells(e, &content, peer->ghost, peer->n_ghost, &peer->in_offset, &peer->in_offsets);
        error = out < 0 || in < 0 ? GR_ERR_MEMORY : gr_ranks_reserve(ranks, p, out, in);
        if (!error) copy_message(&halo, peer, 0);
    }
    if (!error) error = gr_ranks_exchange(e);
    for (int p = 0; p < ranks->n_peers && !error; p++) copy_message(&halo, &ranks->peer[p], 1);
    ranks->seconds_copying += gr_ranks_clock() - begin - (ranks->seconds_waiting - waiting);
    return error;
}

/* ---- Sleep ---- */

/* The calm of a cell, and whether it has points. */
struct calm {
    int32_t calm, occupied;
};

int gr_ghosts_exchange_calm(struct gr_engine *e)
{
    struct gr_ranks *ranks = e->ranks;
    const int64_t size = sizeof(struct calm);
    int error = GR_OK;
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        const struct gr_peer *peer = &ranks->peer[p];
        error = gr_ranks_reserve(ranks, p, peer->n_own * size, peer->n_ghost * size);
        for (int64_t k = 0; k < peer->n_own && !error; k++) {
            const struct gr_cell *cell = &e->mesh.cell[peer->own[k].lane];
            ((struct calm *)(void *)peer->out)[k] = (struct calm){cell->calm, cell->count > 0};
        }
    }
    if (!error) error = gr_ranks_exchange(e);
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        const struct gr_peer *peer = &ranks->peer[p];
        for (int64_t k = 0; k < peer->n_ghost; k++) {
            const struct calm *calm = (const struct calm *)(const void *)peer->in + k;
            struct gr_cell *cell = &e->mesh.cell[peer->ghost[k].lane];
            const int sleeps = calm->calm == GR_ASLEEP, slept = cell->calm == GR_ASLEEP;
            if (sleeps != slept) e->sleep->changed = 1;
            if (sleeps && !slept) e->sleep->all_nodes = 1;
            cell->calm = calm->calm;
            peer->ghost[k].occupied = calm->occupied;
        }
    }
    return error;
}

void gr_ghosts_note_restless(struct gr_engine *e)
{
    for (int p = 0; p < e->ranks->n_peers; p++)
        for (int64_t k = 0; k < e->ranks->peer[p].n_ghost; k++) {
            const struct gr_shared_cell *ghost = &e->ranks->peer[p].ghost[k];
            if (!ghost->occupied || e->mesh.cell[ghost->lane].calm >= GR_CALM_CHECKS) continue;
            for (int i = 0; i < e->K; i++) e->sleep->restless[gr_cell_node(e, ghost->lane, i)] = 1;
        }
}

/* ---- Fluidity ---- */

/* See struct gr_fluidity_ranks: the values of cells, and whether they are dense. */
static int exchange_fluidity(void *context, double *values, uint8_t *dense)
{
    struct gr_engine *e = context;
    struct gr_ranks *ranks = e->ranks;
    const int64_t size = dense ? 2 : 1, bytes = size * (int64_t)sizeof *values;
    int error = GR_OK;
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        const struct gr_peer *peer = &ranks->peer[p];
        error = gr_ranks_reserve(ranks, p, peer->n_own * bytes, peer->n_ghost * bytes);
        double *const out = (double *)(void *)peer->out;
        for (int64_t k = 0; k < peer->n_own && !error; k++) {
            const int32_t place = e->mesh.place[peer->own[k].lane];
            out[size * k] = values[place];
            if (dense) out[size * k + 1] = dense[place];
        }
    }
    if (!error) error = gr_ranks_exchange(e);
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        const struct gr_peer *peer = &ranks->peer[p];
        const double *const in = (const double *)(const void *)peer->in;
        for (int64_t k = 0; k < peer->n_ghost; k++) {
            const int32_t place = e->mesh.place[peer->ghost[k].lane];
            values[place] = in[size * k];
            if (dense) dense[place] = in[size * k + 1] > 0;
        }
    }
    return error;
}

static int sum_fluidity(void *context, struct gr_exact *sum) { return gr_ranks_combine(context, GR_OK, sum, 1, NULL, 0); }

int gr_ghosts_share_fluidity(struct gr_engine *e)
{
    struct gr_fluidity_ranks *shared = &e->ranks->fluidity;
    const struct gr_pages *pages = &e->nonlocal.fluidity->pages;
    shared->context = e;
    shared->exchange = exchange_fluidity;
    shared->sum = sum_fluidity;
    GR_RESIZE(shared->foreign, pages->n_chunks + 1);
    for (int64_t c = 0; c < pages->n_chunks; c++) {
        const int64_t run = pages->number[pages->chunk_first[c]] % e->nonlocal.fluidity->box_pages / GR_CHUNK_PAGES;
        shared->foreign[c] = e->ranks->owner[run] != e->ranks->transport.rank;
    }
    e->nonlocal.fluidity->ranks = shared;
    return GR_OK;
}
