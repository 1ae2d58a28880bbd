/* A team of threads: a barrier at which they wait for each other, and the division of work among them. */
#pragma once

#include <sched.h>
#include <stdatomic.h>
#include <stdint.h>

#define GR_MAX_THREADS 64

struct gr_barrier {
    int threads;
    atomic_int arrived, round;
};

/* Wait until all threads of the team have arrived. The barrier of OpenMP spins for milliseconds; on a busy machine it
 * takes this time from the very thread that it waits for. This one spins briefly and then yields the processor. */
static inline void gr_wait(struct gr_barrier *barrier)
{
    enum { SPINS = 2000 };
    if (barrier->threads == 1) return;
    const int round = atomic_load_explicit(&barrier->round, memory_order_acquire);
    if (atomic_fetch_add_explicit(&barrier->arrived, 1, memory_order_acq_rel) == barrier->threads - 1) {
        atomic_store_explicit(&barrier->arrived, 0, memory_order_relaxed);
        atomic_store_explicit(&barrier->round, round + 1, memory_order_release);
        return;
    }
    for (int spins = 0; atomic_load_explicit(&barrier->round, memory_order_acquire) == round; spins++)
        if (spins > SPINS) sched_yield();
}

/* Compute the range [first, last) of n items that thread t of `threads` works on. */
static inline void gr_share(int64_t n, int t, int threads, int64_t *first, int64_t *last)
{
    *first = n * t / threads;
    *last = n * (t + 1) / threads;
}

/* Let a team of at most `threads` threads, and GR_MAX_THREADS, do `work`, each with its number t in the team, from 0 on. */
void gr_run_team(struct gr_barrier *barrier, int threads, void (*work)(void *data, int t), void *data);
