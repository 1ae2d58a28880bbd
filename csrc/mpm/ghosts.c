/* Ghost cells (ghosts.h). */
#include "mpm/ghosts.h"

#include <string.h>

#include "core/memory.h"
#include "mpm/cell_sums.h"
#include "mpm/sleep.h"

/* ---- Lists ---- */

static struct gr_peer *peer_of(struct gr_ranks *ranks, int rank)
{
    for (int p = 0; p < ranks->n_peers; p++)
        if (ranks->peer[p].rank == rank) return &ranks->peer[p];
    return NULL; /* not of a cell in the mesh */
}

static int append(struct gr_shared_cell **list, int64_t *n, int64_t *capacity, int64_t lane)
{
    if (*n == *capacity) {
        const int64_t more = 2 * *capacity + 64;
        GR_RESIZE(*list, more);
        *capacity = more;
    }
    (*list)[(*n)++] = (struct gr_shared_cell){lane, 0};
    return GR_OK;
}

/* Local nodes of a cell that are nodes of cells of a rank, or of cells within a distance of such; bit i is local node i. */
static uint32_t nodes_for(const struct gr_engine *e, const int32_t at[3], int user, int distance)
{
    const int k = e->K / e->n_rows;
    uint32_t nodes = 0;
    for (int i = 0; i < e->K; i++) {
        const int local[3] = {i % k, i / k % k, i / (k * k)};
        int64_t low[3] = {0}, high[3] = {0};
        int rank[GR_MOST_NEAR], needed = 0;
        for (int d = 0; d < e->config.dim; d++) {
            low[d] = at[d] + local[d] - (k - 1) - distance;
            high[d] = at[d] + local[d] + distance;
        }
        const int n = gr_ranks_in(e, low, high, rank, 0);
        for (int r = 0; r < n; r++) needed |= rank[r] == user;
        nodes |= (uint32_t)needed << i;
    }
    return nodes;
}

/* ---- Sums that are sent ---- */

/* The lane of the cell `by` cells further along the first axis, in the same layer; -1 if it is not active. */
static int64_t lane_along(const struct gr_engine *e, int64_t lane, int by)
{
    const struct gr_mesh *mesh = &e->mesh;
    const struct gr_cell *cell = &mesh->cell[lane];
    const int step = by < 0 ? -1 : 1;
    for (int64_t c = lane; c != lane + by;) {
        c += step;
        if (c < 0 || c >= mesh->n_cells || (lane < mesh->n_front) != (c < mesh->n_front)) return -1;
        const int32_t *const at = mesh->cell[c].at;
        if (at[1] != cell->at[1] || at[2] != cell->at[2]) return -1;
        if (at[0] == cell->at[0] + by) return c;
    }
    return by ? -1 : lane;
}

/* Where a lane has what it gives to node number a of its rows. */
static void set_piece(const struct gr_engine *e, int64_t lane, int a, int piece, struct gr_shared_sum *sum)
{
    const int joins = e->mesh.tile_joins[lane / GR_LANES] != 0;
    sum->at[piece] = a ? gr_end_of_run(e, lane) : e->mesh.tile_block[lane / GR_LANES] + lane % GR_LANES;
    sum->kind[piece] = !a ? GR_OF_LANES : a == 1 ? (joins ? GR_TAIL_1 : GR_SECOND) : joins ? GR_TAIL_3 : GR_THIRD;
}

/* The sum over a row of cells for a node: its cells have it as node 0, 1 and 2 of the row. */
static struct gr_shared_sum sum_of_row(const struct gr_engine *e, const int64_t lane[3])
{
    struct gr_shared_sum sum = {{0}, {0}, 0};
    const int first_joins = lane[0] >= 0 && gr_joins(e, lane[0]), second_joins = lane[1] >= 0 && gr_joins(e, lane[1]);
    if (lane[0] >= 0) set_piece(e, lane[0], 0, 0, &sum);
    if (lane[1] >= 0 && !first_joins) set_piece(e, lane[1], 1, 1, &sum);
    if (lane[2] < 0 || (first_joins && second_joins)) return sum;
    if (second_joins) {
        sum.at[2] = gr_end_of_run(e, lane[1]);
        sum.kind[2] = GR_TAIL_2;
    } else {
        set_piece(e, lane[2], 2, 2, &sum);
    }
    return sum;
}

/* Find what is sent for local node i of a cell, or where it goes if it comes. The sum of a row of cells of one rank counts for
 * the first of them that is active.
 * Returned: whether there is anything. */
static int find_sum(const struct gr_engine *e, int64_t lane, int i, int comes, struct gr_shared_sum *sum)
{
    const int k = e->K / e->n_rows, a = i % k, mixed = gr_node_is_mixed(e, e->mesh.cell[lane].at, a);
    int64_t of[3] = {-1, -1, -1};
    for (int j = 0; j < k && !mixed; j++) {
        of[j] = lane_along(e, lane, a - j);
        if (j < a && of[j] >= 0) return 0;
    }
    *sum = (struct gr_shared_sum){{0}, {0}, 0};
    if (mixed || comes)
        set_piece(e, lane, a, 0, sum);
    else
        *sum = sum_of_row(e, of);
    sum->row = (uint8_t)(i / k);
    return 1;
}

static int append_sum(struct gr_shared_sums *sums, struct gr_shared_sum sum)
{
    if (sums->n == sums->capacity) {
        const int64_t more = 2 * sums->capacity + 256;
        GR_RESIZE(sums->sum, more);
        sums->capacity = more;
    }
    sums->sum[sums->n++] = sum;
    return GR_OK;
}

/* The local nodes of a cell whose sums a rank needs: in each step, and in one that averages the density. */
static void find_nodes(const struct gr_engine *e, const int32_t at[3], int rank, uint32_t nodes[2])
{
    const int motion = e->config.n_bodies && gr_ranks_near_body(e, at, 0) ? GR_REACH_OF_BODIES : 0;
    const int averages = e->config.smoothed && !motion ? GR_REACH_OF_AVERAGES : motion;
    nodes[0] = nodes_for(e, at, rank, motion);
    nodes[1] = averages > motion ? nodes_for(e, at, rank, averages) : nodes[0];
}

/* List the sums of own cells that are sent to a rank, or of ghosts that come from there: first those that it needs in each
 * step. */
static int list_sums(const struct gr_engine *e, const struct gr_shared_cell *cell, int64_t n, int user, int comes,
                     struct gr_shared_sums *sums)
{
    struct gr_shared_sum sum;
    sums->n = 0;
    for (int more = 0; more < 2; more++) {
        for (int64_t c = 0; c < n; c++) {
            uint32_t nodes[2];
            find_nodes(e, e->mesh.cell[cell[c].lane].at, user, nodes);
            for (int i = 0; i < e->K; i++) {
                if (!((more ? nodes[1] & ~nodes[0] : nodes[0]) >> i & 1)) continue;
                if (find_sum(e, cell[c].lane, i, comes, &sum) && append_sum(sums, sum)) return GR_ERR_MEMORY;
            }
        }
        if (!more) sums->of_motion = sums->n;
    }
    return GR_OK;
}

static int list_cells(struct gr_engine *e)
{
    struct gr_ranks *ranks = e->ranks;
    const int me = ranks->transport.rank;
    int rank[GR_MOST_NEAR], error = GR_OK;
    for (int p = 0; p < ranks->n_peers; p++) ranks->peer[p].n_own = ranks->peer[p].n_ghost = 0;
    for (int64_t c = 0; c < e->mesh.n_cells && !error; c++) {
        if (ranks->sharing[c] == GR_ALONE) continue;
        const int near = gr_ranks_having(e, e->mesh.cell[c].at, rank);
        const int is_here = rank[0] == me;
        for (int k = is_here; k < (is_here ? near : 1) && !error; k++) {
            struct gr_peer *peer = peer_of(ranks, rank[k]);
            error = is_here ? append(&peer->own, &peer->n_own, &peer->own_capacity, c)
                            : append(&peer->ghost, &peer->n_ghost, &peer->ghost_capacity, c);
        }
    }
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        struct gr_peer *peer = &ranks->peer[p];
        error = list_sums(e, peer->own, peer->n_own, peer->rank, 0, &peer->leaving);
        if (!error) error = list_sums(e, peer->ghost, peer->n_ghost, me, 1, &peer->arriving);
    }
    return error;
}

/* Compare how much is sent with how much the others expect. */
static int agree_on_counts(struct gr_engine *e)
{
    struct gr_ranks *ranks = e->ranks;
    for (int p = 0; p < ranks->n_peers; p++) ranks->peer[p].n_leaving = ranks->peer[p].n_own;
    int error = gr_ranks_exchange_counts(e);
    for (int p = 0; p < ranks->n_peers && !error; p++)
        if (ranks->peer[p].n_arriving != ranks->peer[p].n_ghost) error = GR_ERR_TRANSPORT;
    for (int p = 0; p < ranks->n_peers; p++) ranks->peer[p].n_leaving = ranks->peer[p].leaving.n;
    if (!error) error = gr_ranks_exchange_counts(e);
    for (int p = 0; p < ranks->n_peers && !error; p++)
        if (ranks->peer[p].n_arriving != ranks->peer[p].arriving.n) error = GR_ERR_TRANSPORT;
    return error;
}

int gr_ghosts_list(struct gr_engine *e)
{
    const int error = gr_ranks_agree(e, list_cells(e), NULL, 0);
    return error ? error : agree_on_counts(e);
}

/* ---- Messages ---- */

enum { MOST_SPANS = 3, MOST_ROWS = 9 };

/* What is sent: of each cell averages, and its filling if `wide`; then of each node the sums [begin, begin + n) of each span. */
struct content {
    struct span {
        enum gr_group_of_sums group;
        int begin, n;
        struct gr_sums_of_row row[MOST_ROWS];
    } span[MOST_SPANS];
    int n_spans, numbers; /* of each node */
    int wide;             /* whether nodes next to those of the other rank count, too; and the filling of the cell */
    int averages;         /* numbers of enum gr_average */
    int64_t of_cell;      /* bytes */
};

static void add_span(const struct gr_engine *e, enum gr_group_of_sums group, int begin, int end, struct content *content)
{
    struct span *span = &content->span[content->n_spans++];
    *span = (struct span){.group = group, .begin = begin, .n = end - begin};
    for (int row = 0; row < e->n_rows; row++) span->row[row] = gr_sums_of_row(e->K / e->n_rows, e, group, row, begin);
    content->numbers += end - begin;
}

static void find_content(const struct gr_engine *e, unsigned parts, struct content *content)
{
    const int force = GR_SUM_FORCE(e->config.dim), all = e->sums.rows[GR_SUMS_OF_MOTION].width;
    const int begin = parts & GR_GHOST_MOMENTUM ? 0 : force, end = parts & GR_GHOST_FORCE ? all : force;
    content->n_spans = content->numbers = 0;
    content->wide = (parts & GR_GHOST_DENSITY) != 0;
    content->averages = parts & GR_GHOST_AVERAGES ? gr_averages_of_cell(&e->config) : 0;
    content->of_cell = content->averages * (int64_t)sizeof(double) + (int64_t)gr_bytes_of_sums(e, content->wide);
    add_span(e, GR_SUMS_OF_MOTION, begin, end, content);
    if (e->config.cell_averaged && e->own_volumes && parts & GR_GHOST_MOMENTUM)
        add_span(e, GR_SUMS_OF_VOLUME, 0, e->sums.rows[GR_SUMS_OF_VOLUME].width, content);
    if (!content->wide) return;
    add_span(e, GR_SUMS_OF_DENSITY, 0, e->sums.rows[GR_SUMS_OF_DENSITY].width, content);
    if (e->own_volumes) add_span(e, GR_SUMS_OF_VOLUME, 0, e->sums.rows[GR_SUMS_OF_VOLUME].width, content);
}

/* A message to be written, or one to be read: the numbers of all cells, then those of all nodes. */
struct halo {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks, n_cells, n;
    const struct content *content;
    const struct gr_shared_cell *cell;
    const struct gr_shared_sum *sum;
    char *message;
    int into; /* whether sums are written from the message */
};

/* Copy a number to a message, or from it. */
#define GR_COPY(at, size)                                                                         \
    do {                                                                                          \
        memcpy(halo->into ? (char *)(at) : message, halo->into ? message : (char *)(at), (size)); \
        message += (size);                                                                        \
    } while (0)

GR_SHARED(copy_cells, struct halo, h->n_cells, h)
{
    struct gr_engine *e = h->e;
    const struct halo *const halo = h;
    const size_t size = gr_bytes_of_sums(e, 1);
    char *message = h->message + first * h->content->of_cell;
    (void)chunk;
    for (int64_t c = first; c < last; c++) {
        const int64_t lane = h->cell[c].lane;
        double *const average = e->sums.average + lane;
        const int64_t filled = e->mesh.tile_block[lane / GR_LANES] + e->sums.of_cells + GR_CELL_FILLED * GR_LANES;
        for (int q = 0; q < h->content->averages; q++) GR_COPY(average + q * e->mesh.cell_capacity, sizeof *average);
        if (h->content->wide) GR_COPY((char *)e->sums.data + (size_t)(filled + lane % GR_LANES) * size, size);
    }
}

/* Define copy(): copy the sums [first, last), which are of a type. */
#define GR_COPY_SUMS(copy, type)                                                                                       \
    static void copy(const struct halo *h, int64_t first, int64_t last)                                                \
    {                                                                                                                  \
        type *const sums = h->e->sums.data;                                                                            \
        type *message = (type *)(void *)(h->message + h->n_cells * h->content->of_cell) + first * h->content->numbers; \
        for (const struct gr_shared_sum *sum = h->sum + first; sum < h->sum + last; sum++)                             \
            for (int g = 0; g < h->content->n_spans; g++) {                                                            \
                const struct span *span = &h->content->span[g];                                                        \
                const struct gr_sums_of_row *of = &span->row[sum->row];                                                \
                type *at[3];                                                                                           \
                int apart[3];                                                                                          \
                for (int j = 0; j < 3; j++) {                                                                          \
                    at[j] = sums + sum->at[j] + of->begin[sum->kind[j]];                                               \
                    apart[j] = of->apart[sum->kind[j]];                                                                \
                }                                                                                                      \
                if (h->into)                                                                                           \
                    for (int q = 0; q < span->n; q++, at[0] += apart[0]) *at[0] = *message++;                          \
                else                                                                                                   \
                    for (int q = 0; q < span->n; q++) {                                                                \
                        *message++ = (*at[0] + *at[1]) + *at[2];                                                       \
                        at[0] += apart[0], at[1] += apart[1], at[2] += apart[2];                                       \
                    }                                                                                                  \
            }                                                                                                          \
    }

GR_COPY_SUMS(copy_singles, float)
GR_COPY_SUMS(copy_doubles, double)

GR_SHARED(copy_sums, struct halo, h->n, h)
{
    (void)chunk;
    if (h->e->config.single)
        copy_singles(h, first, last);
    else
        copy_doubles(h, first, last);
}

/* Number of the sums that are sent. */
static int64_t count(const struct gr_shared_sums *sums, const struct content *content)
{
    return content->wide ? sums->n : sums->of_motion;
}

static int64_t bytes_of(const struct gr_engine *e, const struct content *content, int64_t cells, int64_t sums)
{
    return cells * content->of_cell + (int64_t)gr_bytes_of_sums(e, sums * content->numbers);
}

/* Write the message to a peer, or read the one from it. */
static void copy_message(struct halo *halo, const struct gr_peer *peer, int into)
{
    enum { FEW_SUMS = 1024 }; /* an estimate: fewer are copied sooner than a team is called */
    const struct gr_shared_sums *sums = into ? &peer->arriving : &peer->leaving;
    halo->into = into;
    halo->n_cells = into ? peer->n_ghost : peer->n_own;
    halo->cell = into ? peer->ghost : peer->own;
    halo->n = count(sums, halo->content);
    halo->sum = sums->sum;
    halo->message = into ? peer->in : peer->out;
    halo->chunks = halo->n > FEW_SUMS ? gr_chunks(halo->team, halo->n) : 1;
    if (halo->content->of_cell) copy_cells(halo);
    copy_sums(halo);
}

int gr_ghosts_exchange(struct gr_engine *e, unsigned parts, struct gr_team *team)
{
    struct gr_ranks *ranks = e->ranks;
    struct content content; /* not cleared, as it is long */
    struct halo halo = {.e = e, .team = team, .content = &content};
    const double begin = gr_ranks_clock(), waiting = ranks->seconds_waiting;
    int error = GR_OK;
    find_content(e, parts, &content);
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        struct gr_peer *peer = &ranks->peer[p];
        error = gr_ranks_reserve(ranks, p, bytes_of(e, &content, peer->n_own, count(&peer->leaving, &content)),
                                 bytes_of(e, &content, peer->n_ghost, count(&peer->arriving, &content)));
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
