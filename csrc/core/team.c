/* A team of threads that shares the chunks of a stage (team.h). */
#include "core/team.h"

#ifdef _OPENMP

#include <omp.h>
#include <pthread.h>
#include <stdatomic.h>
#include <time.h>

#define CACHE_LINE 64

/* The chunks of a stage that one thread takes first, so that in each stage it works on much the same part of memory.
 * When it has none left it takes those of others. */
struct share {
    _Alignas(CACHE_LINE) _Atomic uint64_t ticket; /* number of the stage, upper half; chunks not taken, lower half */
};

struct gr_team {
    int threads;
    /* The stage. Written when no chunk of the last one is left to take; what a thread reads is of the stage of a ticket
     * if the ticket has not changed meanwhile. */
    _Atomic(gr_chunk_work *) work;
    _Atomic(void *) context;
    _Atomic int64_t n_chunks;
    struct share share[GR_MAX_THREADS];
    _Alignas(CACHE_LINE) _Atomic int64_t unfinished; /* chunks */
    _Alignas(CACHE_LINE) _Atomic uint32_t stage;     /* its number; it changes when there is work */
    _Atomic int closed, sleepers, leader_sleeps;
    pthread_mutex_t mutex; /* for sleep only */
    pthread_cond_t work_came, work_done;
};

int gr_team_threads(const struct gr_team *team) { return team ? team->threads : 1; }

/* Until when leaders work alone, in nanoseconds, because other programs need the processors. It belongs to the machine,
 * not to one team: runs that are short learn it from each other. */
static _Atomic int64_t alone_until;

static int64_t nanoseconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static inline void pause_briefly(void)
{
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    __asm__ volatile("yield");
#endif
}

/* Spin until a condition holds, but not for long: somebody else may need the processor. The number of turns is an
 * estimate, to cover the work between two stages that the leader does alone. */
#define SPIN_UNTIL(condition)                                            \
    do {                                                                 \
        enum { SPINS = 2000 };                                           \
        for (int n = 0; n < SPINS && !(condition); n++) pause_briefly(); \
    } while (0)

/* Take one chunk of the share of thread `owner` and do it. Returned: 0 if there is none. */
static int take_chunk(struct gr_team *team, int owner, int t)
{
    _Atomic uint64_t *ticket = &team->share[owner].ticket;
    uint64_t seen = atomic_load(ticket);
    while ((uint32_t)seen) {
        gr_chunk_work *work = atomic_load(&team->work);
        void *context = atomic_load(&team->context);
        int64_t first, last;
        gr_share(atomic_load(&team->n_chunks), owner, team->threads, &first, &last);
        if (!atomic_compare_exchange_weak(ticket, &seen, seen - 1)) continue;
        work(context, last - (uint32_t)seen, t);
        if (atomic_fetch_sub(&team->unfinished, 1) > 1 || !atomic_load(&team->leader_sleeps)) return 1;
        pthread_mutex_lock(&team->mutex);
        pthread_cond_signal(&team->work_done);
        pthread_mutex_unlock(&team->mutex);
        return 1;
    }
    return 0;
}

static void take_chunks(struct gr_team *team, int t)
{
    for (int k = 0; k < team->threads; k++)
        while (take_chunk(team, (t + k) % team->threads, t)) continue;
}

/* Let the helpers know that `stage` or `closed` has changed. */
static void call_helpers(struct gr_team *team)
{
    atomic_fetch_add(&team->stage, 1);
    if (!atomic_load(&team->sleepers)) return;
    pthread_mutex_lock(&team->mutex);
    pthread_cond_broadcast(&team->work_came);
    pthread_mutex_unlock(&team->mutex);
}

/* Sleep until the stage that began at `start` is done. What remains are chunks that others have taken, each a part of
 * what the leader did meanwhile: if they take longer than that, the operating system has put their thread aside for
 * another program. Then the leader works alone for RETREAT times as long, so that beside other programs a team loses at
 * most 1/RETREAT of the time of one thread. */
static void wait_for_others(struct gr_team *team, int64_t start)
{
    enum { RETREAT = 10 };
    const int64_t asleep = nanoseconds();
    pthread_mutex_lock(&team->mutex);
    atomic_store(&team->leader_sleeps, 1);
    while (atomic_load(&team->unfinished)) pthread_cond_wait(&team->work_done, &team->mutex);
    atomic_store(&team->leader_sleeps, 0);
    pthread_mutex_unlock(&team->mutex);
    const int64_t now = nanoseconds(), lost = now - asleep;
    if (lost > asleep - start) atomic_store(&alone_until, now + RETREAT * lost);
}

void gr_team_run(struct gr_team *team, gr_chunk_work *work, void *context, int64_t n_chunks)
{
    const int64_t start = gr_team_threads(team) > 1 && n_chunks > 1 ? nanoseconds() : 0;
    if (!start || start < atomic_load(&alone_until)) {
        for (int64_t c = 0; c < n_chunks; c++) work(context, c, 0);
        return;
    }
    atomic_store(&team->unfinished, n_chunks);
    atomic_store(&team->work, work);
    atomic_store(&team->context, context);
    atomic_store(&team->n_chunks, n_chunks);
    const uint64_t number = (uint64_t)atomic_load(&team->stage) + 1;
    for (int t = 0; t < team->threads; t++) {
        int64_t first, last;
        gr_share(n_chunks, t, team->threads, &first, &last);
        atomic_store(&team->share[t].ticket, number << 32 | (uint64_t)(last - first));
    }
    call_helpers(team);
    take_chunks(team, 0);
    SPIN_UNTIL(!atomic_load(&team->unfinished));
    if (atomic_load(&team->unfinished)) wait_for_others(team, start);
}

static void help(struct gr_team *team, int t)
{
    for (;;) {
        const uint32_t stage = atomic_load(&team->stage);
        if (atomic_load(&team->closed)) return;
        take_chunks(team, t);
        SPIN_UNTIL(atomic_load(&team->stage) != stage);
        if (atomic_load(&team->stage) != stage) continue;
        pthread_mutex_lock(&team->mutex);
        atomic_fetch_add(&team->sleepers, 1);
        while (atomic_load(&team->stage) == stage) pthread_cond_wait(&team->work_came, &team->mutex);
        atomic_fetch_sub(&team->sleepers, 1);
        pthread_mutex_unlock(&team->mutex);
    }
}

void gr_team_lead(int threads, void (*program)(void *context, struct gr_team *team), void *context)
{
    struct gr_team team = {.threads = threads < GR_MAX_THREADS ? threads : GR_MAX_THREADS,
                           .mutex = PTHREAD_MUTEX_INITIALIZER,
                           .work_came = PTHREAD_COND_INITIALIZER,
                           .work_done = PTHREAD_COND_INITIALIZER};
    if (threads == 1) {
        program(context, NULL);
        return;
    }
#pragma omp parallel num_threads(team.threads)
    {
        const int t = omp_get_thread_num();
        if (t) {
            help(&team, t);
        } else {
            program(context, &team);
            atomic_store(&team.closed, 1);
            call_helpers(&team);
        }
    }
    pthread_cond_destroy(&team.work_came);
    pthread_cond_destroy(&team.work_done);
    pthread_mutex_destroy(&team.mutex);
}

#else

int gr_team_threads(const struct gr_team *team) { return (void)team, 1; }

void gr_team_run(struct gr_team *team, gr_chunk_work *work, void *context, int64_t n_chunks)
{
    (void)team;
    for (int64_t c = 0; c < n_chunks; c++) work(context, c, 0);
}

void gr_team_lead(int threads, void (*program)(void *context, struct gr_team *team), void *context)
{
    (void)threads;
    program(context, NULL);
}

#endif
