/* Ghost cells (ghosts.h). */
#include "mpm/ghosts.h"

#include <string.h>

#include "core/memory.h"

/* ---- Lists ---- */

static struct gr_peer *peer_of(struct gr_ranks *ranks, int rank)
{
    for (int p = 0; p < ranks->n_peers; p++)
        if (ranks->peer[p].rank == rank) return &ranks->peer[p];
    return NULL; /* not of a cell in the mesh */
}

static int append(int64_t **list, int64_t *n, int64_t *capacity, int64_t lane)
{
    if (*n == *capacity) {
        const int64_t more = 2 * *capacity + 64;
        GR_RESIZE(*list, more);
        *capacity = more;
    }
    (*list)[(*n)++] = lane;
    return GR_OK;
}

static int list_cells(struct gr_engine *e)
{
    struct gr_ranks *ranks = e->ranks;
    int rank[GR_MOST_NEAR], error = GR_OK;
    for (int p = 0; p < ranks->n_peers; p++) ranks->peer[p].n_own = ranks->peer[p].n_ghost = 0;
    for (int64_t c = 0; c < e->mesh.n_cells && !error; c++) {
        if (ranks->sharing[c] == GR_ALONE) continue;
        const int near = gr_ranks_near(e, e->mesh.cell[c].at, ranks->reach, rank);
        const int is_here = rank[0] == ranks->transport.rank;
        for (int k = is_here; k < (is_here ? near : 1) && !error; k++) {
            struct gr_peer *peer = peer_of(ranks, rank[k]);
            error = is_here ? append(&peer->own, &peer->n_own, &peer->own_capacity, c)
                            : append(&peer->ghost, &peer->n_ghost, &peer->ghost_capacity, c);
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

/* Where the numbers of a cell are in the block of its tile, in vectors of GR_LANES. */
struct places {
    int n;
    int32_t vector[(9 * (GR_NODE_SUMS(3) + GR_VOLUME_SUMS + 1)) * 3 + GR_CELL_AVERAGED_SUMS(3) + 8];
};

/* Add the sums [begin, end) of the nodes of a group. */
static void add_sums(const struct gr_engine *e, enum gr_group_of_sums group, int begin, int end, struct places *places)
{
    const struct gr_rows *rows = &e->sums.rows[group];
    const int k = e->K / e->n_rows, all = e->n_rows * rows->width;
    const int first[3] = {rows->main / GR_LANES, (e->sums.of_lanes + rows->apart) / GR_LANES,
                          (e->sums.of_lanes + rows->apart) / GR_LANES + all};
    for (int a = 0; a < k; a++)
        for (int row = 0; row < e->n_rows; row++)
            for (int sum = begin; sum < end; sum++) places->vector[places->n++] = first[a] + row * rows->width + sum;
}

static void find_places(const struct gr_engine *e, unsigned parts, struct places *places)
{
    const int dim = e->config.dim, force = GR_SUM_FORCE(dim);
    places->n = 0;
    if (parts & GR_GHOST_MOMENTUM) add_sums(e, GR_SUMS_OF_MOTION, 0, force, places);
    if (parts & GR_GHOST_FORCE) add_sums(e, GR_SUMS_OF_MOTION, force, e->sums.rows[GR_SUMS_OF_MOTION].width, places);
    if (!(parts & GR_GHOST_DENSITY)) return;
    places->vector[places->n++] = e->sums.of_cells / GR_LANES + GR_CELL_FILLED;
    add_sums(e, GR_SUMS_OF_DENSITY, 0, e->sums.rows[GR_SUMS_OF_DENSITY].width, places);
    if (e->config.n_materials > 1) add_sums(e, GR_SUMS_OF_VOLUME, 0, e->sums.rows[GR_SUMS_OF_VOLUME].width, places);
}

/* A message to be written, or one to be read. */
struct halo {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks;
    struct gr_peer *peer;
    const struct places *places;
    int averages, into; /* numbers of enum gr_average of a cell; whether cells are written from the message */
    int64_t cell_bytes;
};

/* Copy the numbers of a cell to its message, or back. */
static inline __attribute__((always_inline)) void copy_sums(const size_t size, const struct halo *halo, int64_t lane,
                                                            char *message)
{
    char *const block =
        (char *)halo->e->sums.data + ((size_t)halo->e->mesh.tile_block[lane / GR_LANES] + (size_t)(lane % GR_LANES)) * size;
    for (int v = 0; v < halo->places->n; v++) {
        char *const at = block + (size_t)halo->places->vector[v] * GR_LANES * size;
        memcpy(halo->into ? at : message + (size_t)v * size, halo->into ? message + (size_t)v * size : at, size);
    }
}

GR_SHARED(copy_cells, struct halo, (h->into ? h->peer->n_ghost : h->peer->n_own), h)
{
    const struct gr_engine *e = h->e;
    const int64_t *const lanes = h->into ? h->peer->ghost : h->peer->own;
    (void)chunk;
    for (int64_t k = first; k < last; k++) {
        char *const message = (h->into ? h->peer->in : h->peer->out) + k * h->cell_bytes;
        double average[GR_AVERAGE_AT + 6];
        const size_t bytes = sizeof *average * (size_t)h->averages;
        if (e->config.single)
            copy_sums(sizeof(float), h, lanes[k], message + bytes);
        else
            copy_sums(sizeof(double), h, lanes[k], message + bytes);
        if (h->into) memcpy(average, message, bytes);
        for (int q = 0; q < h->averages; q++) {
            double *const at = e->sums.average + q * e->mesh.cell_capacity + lanes[k];
            if (h->into)
                *at = average[q];
            else
                average[q] = *at;
        }
        if (!h->into) memcpy(message, average, bytes);
    }
}

int gr_ghosts_exchange(struct gr_engine *e, unsigned parts, struct gr_team *team)
{
    enum { FEW_CELLS = 256 }; /* an estimate: fewer are copied sooner than a team is called */
    struct gr_ranks *ranks = e->ranks;
    struct places places;
    find_places(e, parts, &places);
    struct halo halo = {.e = e, .team = team, .places = &places};
    halo.averages = parts & GR_GHOST_AVERAGES ? gr_averages_of_cell(&e->config) : 0;
    const double begin = gr_ranks_clock(), waiting = ranks->seconds_waiting;
    halo.cell_bytes = (int64_t)gr_bytes_of_sums(e, places.n) + (int64_t)sizeof(double) * halo.averages;
    int error = GR_OK;
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        halo.peer = &ranks->peer[p];
        halo.chunks = halo.peer->n_own > FEW_CELLS ? gr_chunks(team, halo.peer->n_own) : 1;
        error = gr_ranks_reserve(ranks, p, halo.peer->n_own * halo.cell_bytes, halo.peer->n_ghost * halo.cell_bytes);
        if (!error) copy_cells(&halo);
    }
    if (!error) error = gr_ranks_exchange(e);
    halo.into = 1;
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        halo.peer = &ranks->peer[p];
        halo.chunks = halo.peer->n_ghost > FEW_CELLS ? gr_chunks(team, halo.peer->n_ghost) : 1;
        copy_cells(&halo);
    }
    ranks->seconds_copying += gr_ranks_clock() - begin - (ranks->seconds_waiting - waiting);
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
            const int32_t place = e->mesh.place[peer->own[k]];
            out[size * k] = values[place];
            if (dense) out[size * k + 1] = dense[place];
        }
    }
    if (!error) error = gr_ranks_exchange(e);
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        const struct gr_peer *peer = &ranks->peer[p];
        const double *const in = (const double *)(const void *)peer->in;
        for (int64_t k = 0; k < peer->n_ghost; k++) {
            const int32_t place = e->mesh.place[peer->ghost[k]];
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
        const int64_t run = pages->number[pages->chunk_first[c]] / GR_CHUNK_PAGES;
        shared->foreign[c] = e->ranks->owner[run] != e->ranks->transport.rank;
    }
    e->nonlocal.fluidity->ranks = shared;
    return GR_OK;
}
