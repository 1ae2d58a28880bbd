/* Where the threads of a team wait for each other. */
#ifndef GR_CORE_BARRIER_H
#define GR_CORE_BARRIER_H

#include <sched.h>
#include <stdatomic.h>

#define GR_MAX_THREADS 64

struct gr_barrier {
    int threads;
    atomic_int arrived, round;
};

/* Wait for the team. The wait of OpenMP spins for milliseconds, which on a busy machine is the time that the
 * thread waited for lacks; this one spins briefly and then gives the processor away. */
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

/* The part [first, last) of n things that thread t of so many does. */
static inline void gr_share(int64_t n, int t, int threads, int64_t *first, int64_t *last)
{
    *first = n * t / threads;
    *last = n * (t + 1) / threads;
}

#endif
