/* Ranks: agreement between them, and their messages (ranks.h). */
#include <string.h>
#include <time.h>

#include "core/memory.h"
#include "mpm/ranks.h"

/* ---- Agreement ---- */

int gr_ranks_agree(struct gr_engine *e, int error, int64_t *flags, int n)
{
    enum { MOST_FLAGS = 4 };
    struct gr_ranks *ranks = e->ranks;
    int64_t all[2 + MOST_FLAGS] = {error && error != GR_ERR_CAPACITY, error == GR_ERR_CAPACITY};
    if (ranks->transport.size == 1) return error;
    for (int k = 0; k < n; k++) all[2 + k] = flags[k];
    if (ranks->failed || ranks->transport.sum(ranks->transport.context, all, 2 + n)) {
        ranks->failed = 1;
        return error && error != GR_ERR_CAPACITY ? error : GR_ERR_TRANSPORT;
    }
    for (int k = 0; k < n; k++) flags[k] = all[2 + k];
    if (error && error != GR_ERR_CAPACITY) return error;
    return all[0] ? GR_ERR_ELSEWHERE : all[1] ? GR_ERR_CAPACITY : GR_OK;
}

int gr_ranks_add_up(struct gr_ranks *ranks, int64_t *number, int64_t n)
{
    if (!ranks->failed) ranks->failed = ranks->transport.sum(ranks->transport.context, number, n) != 0;
    return ranks->failed ? GR_ERR_TRANSPORT : GR_OK;
}

static int reserve_numbers(struct gr_ranks *ranks, int sums)
{
    if (sums <= ranks->number_capacity) return GR_OK;
    GR_RESIZE(ranks->number, sums * GR_EXACT_NUMBERS);
    ranks->number_capacity = sums;
    return GR_OK;
}

int gr_ranks_combine(struct gr_engine *e, int error, struct gr_exact *sum, int n, double *largest, int m)
{
    struct gr_ranks *ranks = e->ranks;
    const size_t bytes = sizeof *sum * (size_t)n;
    error = gr_ranks_agree(e, error || reserve_numbers(ranks, n) == GR_OK ? error : GR_ERR_MEMORY, NULL, 0);
    if (error || ranks->transport.size == 1) return error;
    for (int k = 0; k < n; k++) gr_exact_carry(&sum[k]);
    memcpy(ranks->number, sum, bytes);
    ranks->failed = ranks->transport.sum(ranks->transport.context, ranks->number, (int64_t)n * GR_EXACT_NUMBERS) != 0;
    if (m && !ranks->failed) ranks->failed = ranks->transport.largest(ranks->transport.context, largest, m) != 0;
    memcpy(sum, ranks->number, bytes);
    return ranks->failed ? GR_ERR_TRANSPORT : GR_OK;
}

void gr_ranks_find_largest(const struct gr_engine *e, double *number)
{
    struct gr_ranks *ranks = e->ranks;
    if (ranks->transport.size == 1 || ranks->failed) return;
    ranks->failed = ranks->transport.largest(ranks->transport.context, number, 1) != 0;
}

/* ---- Messages ---- */

double gr_ranks_clock(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int gr_ranks_reserve(struct gr_ranks *ranks, int k, int64_t out_bytes, int64_t in_bytes)
{
    struct gr_peer *peer = &ranks->peer[k];
    if (out_bytes > peer->out_capacity) {
        GR_RESIZE(peer->out, out_bytes + out_bytes / 4);
        peer->out_capacity = out_bytes + out_bytes / 4;
    }
    if (in_bytes > peer->in_capacity) {
        GR_RESIZE(peer->in, in_bytes + in_bytes / 4);
        peer->in_capacity = in_bytes + in_bytes / 4;
    }
    ranks->message[k] = (struct gr_message){peer->rank, out_bytes, in_bytes, peer->out, peer->in};
    return GR_OK;
}

int gr_ranks_send(struct gr_ranks *ranks, const struct gr_message *message, int n)
{
    const double begin = gr_ranks_clock();
    if (!n) return GR_OK;
    if (!ranks->failed) ranks->failed = ranks->transport.exchange(ranks->transport.context, message, n);
    ranks->seconds_waiting += gr_ranks_clock() - begin;
    for (int k = 0; k < n; k++) ranks->sent_bytes += message[k].out_bytes;
    return ranks->failed ? GR_ERR_TRANSPORT : GR_OK;
}

int gr_ranks_exchange(struct gr_engine *e) { return gr_ranks_send(e->ranks, e->ranks->message, e->ranks->n_peers); }

int gr_ranks_exchange_counts(struct gr_engine *e)
{
    struct gr_ranks *ranks = e->ranks;
    for (int k = 0; k < ranks->n_peers; k++) {
        struct gr_peer *peer = &ranks->peer[k];
        const int64_t size = sizeof peer->n_leaving;
        ranks->message[k] = (struct gr_message){peer->rank, size, size, &peer->n_leaving, &peer->n_arriving};
    }
    int error = gr_ranks_exchange(e);
    for (int k = 0; k < ranks->n_peers && !error; k++) /* a count beyond all sense: messages are confused */
        if (ranks->peer[k].n_arriving < 0 || ranks->peer[k].n_arriving > INT32_MAX) error = GR_ERR_TRANSPORT;
    return error;
}
