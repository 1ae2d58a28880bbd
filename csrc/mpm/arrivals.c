/* Points that pass from one rank to another (arrivals.h). */
#include "mpm/arrivals.h"

#include <stdlib.h>
#include <string.h>

#include "core/memory.h"
#include "mpm/migrate.h"

/* A point on its way: the place of the cell that it left in their order, its id, then its record. */
struct traveller {
    int64_t from, id;
};

static int64_t bytes_of_traveller(const struct gr_engine *e)
{
    return (int64_t)sizeof(struct traveller) + e->points.n_components * (int64_t)sizeof(double);
}

static int64_t cell_left(const struct gr_engine *e, const struct gr_migrant *migrant)
{
    return gr_order_of_cell(e, &e->mesh.cell[migrant->cell]);
}

/* The owner of the new cell of a point, or this rank for one that has left the domain. */
static int rank_of(const struct gr_engine *e, const struct gr_migrant *migrant, const double *record)
{
    int32_t at[3] = {0};
    if (migrant->to >= 0) return gr_owner(e->ranks, e->mesh.cell[migrant->to].at);
    if (migrant->to != GR_TO_NO_CELL) return e->ranks->transport.rank;
    for (int d = 0; d < e->config.dim; d++) at[d] = (int32_t)gr_locate(&e->axis[d], e->inv_dx, record[d]);
    return gr_owner(e->ranks, at);
}

static int find_peer(const struct gr_ranks *ranks, int rank)
{
    int p = 0;
    while (ranks->peer[p].rank != rank) p++; /* neighbours of own cells belong to peers */
    return p;
}

/* Pack the points of a list that go to others. Returned: 0 or GR_ERR_MEMORY. */
static int pack_list(struct gr_engine *e, struct gr_migrants *list, int64_t *homeless)
{
    struct gr_ranks *ranks = e->ranks;
    const int64_t bytes = bytes_of_traveller(e);
    for (int64_t k = 0; k < list->count; k++) {
        struct gr_migrant *migrant = &list->from[k];
        const double *record = list->record + k * e->points.n_components;
        const int rank = rank_of(e, migrant, record);
        if (rank == ranks->transport.rank) continue;
        const int p = find_peer(ranks, rank);
        struct gr_peer *peer = &ranks->peer[p];
        if (gr_ranks_reserve(ranks, p, (peer->n_leaving + 1) * bytes, 0)) return GR_ERR_MEMORY;
        const struct traveller traveller = {cell_left(e, migrant), list->id[k]};
        char *const at = peer->out + peer->n_leaving++ * bytes;
        memcpy(at, &traveller, sizeof traveller);
        memcpy(at + sizeof traveller, record, (size_t)bytes - sizeof traveller);
        *homeless -= migrant->to == GR_TO_NO_CELL;
        migrant->to = GR_TO_NOWHERE;
        e->points.n--;
    }
    return GR_OK;
}

/* ---- Arrivals ---- */

static int reserve_arrivals(struct gr_engine *e, int64_t n)
{
    struct gr_ranks *ranks = e->ranks;
    if (n <= ranks->arrival_capacity) return GR_OK;
    const int64_t capacity = n + n / 2 + 64;
    ranks->arrival_capacity = 0;
    GR_RESIZE(ranks->arrival, capacity);
    GR_RESIZE(ranks->record, capacity * e->points.n_components);
    GR_RESIZE(ranks->id, capacity);
    GR_RESIZE(ranks->order, 2 * capacity);
    ranks->arrival_capacity = capacity;
    return GR_OK;
}

static int compare_pairs(const void *a, const void *b)
{
    const int64_t *x = a, *y = b;
    return x[0] != y[0] ? (x[0] > y[0]) - (x[0] < y[0]) : (x[1] > y[1]) - (x[1] < y[1]);
}

/* The message that holds arrival number k of all. */
static const char *arrival_at(const struct gr_engine *e, int64_t k)
{
    const struct gr_peer *peer = e->ranks->peer;
    while (k >= peer->n_arriving) k -= peer++->n_arriving;
    return peer->in + k * bytes_of_traveller(e);
}

/* Put the arrivals into the order of the cells that they left; those of a cell come from one rank, in their order. */
static void unpack_arrivals(struct gr_engine *e, int64_t *homeless)
{
    struct gr_ranks *ranks = e->ranks;
    const int n_components = e->points.n_components;
    struct traveller traveller;
    for (int64_t k = 0; k < ranks->n_arrivals; k++) {
        memcpy(&traveller, arrival_at(e, k), sizeof traveller);
        ranks->order[2 * k] = traveller.from;
        ranks->order[2 * k + 1] = k;
    }
    if (ranks->n_arrivals) qsort(ranks->order, (size_t)ranks->n_arrivals, 2 * sizeof *ranks->order, compare_pairs);
    for (int64_t k = 0; k < ranks->n_arrivals; k++) {
        const char *at = arrival_at(e, ranks->order[2 * k + 1]);
        double *record = ranks->record + k * n_components;
        memcpy(&traveller, at, sizeof traveller);
        memcpy(record, at + sizeof traveller, sizeof *record * (size_t)n_components);
        ranks->id[k] = traveller.id;
        ranks->arrival[k] = (struct gr_migrant){traveller.from, 0, gr_find_cell(e, record)};
        *homeless += ranks->arrival[k].to == GR_TO_NO_CELL;
        e->points.n++;
    }
}

/* The points [begin, end) of a list. */
static struct gr_migrants part_of(const struct gr_engine *e, const struct gr_migrants *list, int64_t begin, int64_t end)
{
    return (struct gr_migrants){.from = list->from + begin,
                                .record = list->record + begin * e->points.n_components,
                                .id = list->id + begin,
                                .count = end - begin,
                                .lowest = list->lowest,
                                .highest = list->highest};
}

/* Divide the lists and the arrivals into parts in the order of cells.
 * Returned: their number. */
static int merge(const struct gr_engine *e, const struct gr_migrants *list, int lists)
{
    struct gr_ranks *ranks = e->ranks;
    const int64_t n = ranks->n_arrivals;
    const struct gr_migrants arrivals = {
        .from = ranks->arrival, .record = ranks->record, .id = ranks->id, .lowest = 0, .highest = INT64_MAX};
    int parts = 0;
    int64_t a = 0;
    for (int l = 0; l < lists; l++)
        for (int64_t k = 0; k < list[l].count;) {
            int64_t end = a;
            const int64_t from = cell_left(e, &list[l].from[k]);
            while (end < n && arrivals.from[end].cell < from) end++;
            if (end > a) ranks->part[parts++] = part_of(e, &arrivals, a, end);
            a = end;
            end = k + 1;
            while (end < list[l].count && (a == n || cell_left(e, &list[l].from[end]) < arrivals.from[a].cell)) end++;
            ranks->part[parts++] = part_of(e, &list[l], k, end);
            k = end;
        }
    if (a < n) ranks->part[parts++] = part_of(e, &arrivals, a, n);
    return parts;
}

static int reserve_parts(struct gr_ranks *ranks, int64_t n)
{
    if (n <= ranks->part_capacity) return GR_OK;
    GR_RESIZE(ranks->part, 2 * n);
    ranks->part_capacity = 2 * n;
    return GR_OK;
}

int gr_ranks_pass_points(struct gr_engine *e, struct gr_migrants *list, int lists, int64_t *homeless, int *parts)
{
    struct gr_ranks *ranks = e->ranks;
    const int64_t bytes = bytes_of_traveller(e);
    int error = GR_OK, all = 0;
    for (int p = 0; p < ranks->n_peers; p++) ranks->peer[p].n_leaving = 0;
    for (int l = 0; l < lists && !error; l++) error = pack_list(e, &list[l], homeless);
    if (!error) error = gr_ranks_exchange_counts(e);
    ranks->n_arrivals = 0;
    for (int p = 0; p < ranks->n_peers && !error; p++) {
        const struct gr_peer *peer = &ranks->peer[p];
        error = gr_ranks_reserve(ranks, p, peer->n_leaving * bytes, peer->n_arriving * bytes);
        ranks->n_arrivals += peer->n_arriving;
        all += peer->n_leaving || peer->n_arriving;
    }
    if (!error) error = reserve_arrivals(e, ranks->n_arrivals);
    if (!error) error = reserve_parts(ranks, 2 * ranks->n_arrivals + lists + 1);
    if (!error && all) error = gr_ranks_exchange(e);
    if (error) return error;
    unpack_arrivals(e, homeless);
    *parts = merge(e, list, lists);
    return GR_OK;
}

/* ---- Points that wait ---- */

int gr_ranks_reserve_staged(struct gr_engine *e, int64_t n)
{
    struct gr_ranks *ranks = e->ranks;
    if (n <= ranks->staged_capacity) return GR_OK;
    const int64_t capacity = 2 * n;
    ranks->staged_capacity = 0;
    GR_RESIZE(ranks->staged, capacity * e->points.n_components);
    GR_RESIZE(ranks->staged_id, capacity);
    ranks->staged_capacity = capacity;
    return GR_OK;
}

void gr_ranks_stage(struct gr_engine *e, int64_t k, const double *record, int64_t id)
{
    struct gr_ranks *ranks = e->ranks;
    memcpy(ranks->staged + k * e->points.n_components, record, sizeof *record * (size_t)e->points.n_components);
    ranks->staged_id[k] = id;
}

int gr_ranks_make_pending(struct gr_engine *e, int64_t n)
{
    const int64_t before = e->migration.n_pending;
    if (!n) return GR_OK;
    if (gr_reserve_pending(e, before + n)) return GR_ERR_MEMORY;
    memcpy(e->migration.pending + before * e->points.n_components, e->ranks->staged,
           sizeof(double) * (size_t)(n * e->points.n_components));
    memcpy(e->migration.pending_id + before, e->ranks->staged_id, sizeof(int64_t) * (size_t)n);
    e->migration.n_pending += n;
    return GR_OK;
}
