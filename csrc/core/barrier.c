/* Teams of threads (barrier.h). */
#include "core/barrier.h"

#ifdef _OPENMP
#include <omp.h>
#endif

void gr_run_team(struct gr_barrier *barrier, int threads, void (*work)(void *data, int t), void *data)
{
    barrier->threads = 1;
#ifdef _OPENMP
#pragma omp parallel num_threads(threads > GR_MAX_THREADS ? GR_MAX_THREADS : threads) if (threads > 1)
    {
#pragma omp single
        barrier->threads = omp_get_num_threads();
        work(data, omp_get_thread_num());
    }
#else
    (void)threads;
    work(data, 0);
#endif
}
