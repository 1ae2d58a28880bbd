/* A team of threads that shares the chunks of a stage.
 *
 * One thread, the leader, runs the program of a time step. It hands out the chunks of each stage, and the helpers take
 * chunks as the leader does. A stage ends when its chunks are done, not when all threads have arrived: a thread that the
 * operating system has put aside between two chunks delays nobody. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#define GR_MAX_THREADS 1024

struct gr_team;

/* Do one chunk of a stage, as thread t of the team. Chunks are done in any order, so that the result must not depend on
 * it, nor on t. */
typedef void gr_chunk_work(void *context, int64_t chunk, int t);

/* Run a program as the leader of a team of so many threads, or of fewer if the system refuses some.
 * Returned: the number of threads that the team had. */
int gr_team_lead(int threads, void (*program)(void *context, struct gr_team *team), void *context);

/* Do all chunks of a stage, called by the leader. NULL stands for a team of one. */
void gr_team_run(struct gr_team *team, gr_chunk_work *work, void *context, int64_t n_chunks);

int gr_team_threads(const struct gr_team *team);

/* Number of chunks into which to divide a stage of n items: several for each thread, so that none waits long for the
 * last one. */
static inline int64_t gr_chunks(const struct gr_team *team, int64_t n)
{
    enum { PER_THREAD = 4 };
    const int threads = gr_team_threads(team);
    const int64_t chunks = threads == 1 ? 1 : PER_THREAD * threads;
    return n < chunks ? n : chunks;
}

/* Largest number that gr_chunks returns. */
#define GR_MAX_CHUNKS (4 * GR_MAX_THREADS)

/* The items [first, last) of chunk c of `chunks`. */
static inline void gr_share(int64_t n, int64_t c, int64_t chunks, int64_t *first, int64_t *last)
{
    *first = n * c / chunks;
    *last = n * (c + 1) / chunks;
}

/* Define pass(w): a stage of w->chunks chunks by w->team, in which each chunk has its share [first, last) of n items. What
 * follows is the body, in which `chunk` is the number of the chunk; n may use w. */
#define GR_SHARED(pass, type, n, w)                                                 \
    static void pass##_share(type *w, int64_t first, int64_t last, int64_t chunk);  \
    static void pass##_chunk(void *context, int64_t chunk, int t)                   \
    {                                                                               \
        type *w = context;                                                          \
        int64_t first, last;                                                        \
        (void)t;                                                                    \
        gr_share(n, chunk, w->chunks, &first, &last);                               \
        pass##_share(w, first, last, chunk);                                        \
    }                                                                               \
    static void pass(type *w) { gr_team_run(w->team, pass##_chunk, w, w->chunks); } \
    static void pass##_share(type *w, int64_t first, int64_t last, int64_t chunk)
