/* A team of threads that shares the chunks of a stage (team.h). */
#include "core/team.h"

#include <pthread.h>
#include <stdatomic.h>
#include <time.h>

#define CACHE_LINE 64

/* The chunks of a stage that one thread takes first, so that in each stage it works on much the same part of memory. When
 * it has none left it takes chunks of others. */
struct share {
    _Alignas(CACHE_LINE) _Atomic uint64_t ticket; /* number of the stage, upper half; chunks not taken, lower half */
};

struct gr_team {
    int threads;
    /* The stage. Written when no chunk of the last one is left to take; a thread has read the stage of a ticket if the
     * ticket has not changed meanwhile. */
    _Atomic(gr_chunk_work *) work;
    _Atomic(void *) context;
    _Atomic int64_t n_chunks;
    struct share share[GR_MAX_THREADS];
    _Alignas(CACHE_LINE) _Atomic int64_t unfinished; /* chunks */
    _Alignas(CACHE_LINE) _Atomic uint32_t stage;     /* its number; it changes when there is work */
    _Atomic int closed, sleepers, leader_sleeps;
    _Atomic int present;   /* helpers that have not left the team */
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

/* Spin until a condition holds, but not for long: somebody else may need the processor. The numbers of turns are estimates,
 * to cover the work between two stages that the leader does alone, and the work of the program between two calls of the
 * core. */
enum { TO_NEXT_STAGE = 2000, TO_NEXT_TEAM = 20000 };
#define SPIN_UNTIL(condition, turns)                                       \
    do {                                                                   \
        for (int n = 0; n < (turns) && !(condition); n++) pause_briefly(); \
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

/* Sleep until the stage that began at `start` is done. The remaining chunks are being done by others, each a part of the
 * work of the leader meanwhile: if they take longer than that, the operating system has put their thread aside for another
 * program. Then the leader works alone for RETREAT times as long, so that next to other programs a team loses at most
 * 1/RETREAT of the time of one thread. */
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
    SPIN_UNTIL(!atomic_load(&team->unfinished), TO_NEXT_STAGE);
    if (atomic_load(&team->unfinished)) wait_for_others(team, start);
}

static void help(struct gr_team *team, int t)
{
    for (;;) {
        const uint32_t stage = atomic_load(&team->stage);
        if (atomic_load(&team->closed)) return;
        take_chunks(team, t);
        SPIN_UNTIL(atomic_load(&team->stage) != stage, TO_NEXT_STAGE);
        if (atomic_load(&team->stage) != stage) continue;
        pthread_mutex_lock(&team->mutex);
        atomic_fetch_add(&team->sleepers, 1);
        while (atomic_load(&team->stage) == stage) pthread_cond_wait(&team->work_came, &team->mutex);
        atomic_fetch_sub(&team->sleepers, 1);
        pthread_mutex_unlock(&team->mutex);
    }
}

/* ---- the helpers of the process, which go from one team to the next: to begin a thread takes longer than a step of a small
 * scene ---- */

struct helper {
    _Atomic(struct gr_team *) team; /* that calls it; NULL when it has come, or need not come any more */
    int t;                          /* its number in the team */
    struct helper *next;            /* in the list of a team, or of those that are idle */
    pthread_cond_t called;
};

static struct {
    pthread_once_t once;
    pthread_mutex_t mutex;
    pthread_cond_t left; /* the last helper has left a team */
    _Atomic int waiting; /* leaders, for that */
    int n_helpers;
    struct helper helper[GR_MAX_THREADS], *idle;
} pool = {.once = PTHREAD_ONCE_INIT, .mutex = PTHREAD_MUTEX_INITIALIZER, .left = PTHREAD_COND_INITIALIZER};

/* A forked child has none of the threads of its parent: it begins without helpers. */
static void lose_helpers(void)
{
    pool.mutex = (pthread_mutex_t)PTHREAD_MUTEX_INITIALIZER;
    pool.left = (pthread_cond_t)PTHREAD_COND_INITIALIZER;
    atomic_store(&pool.waiting, 0);
    pool.n_helpers = 0;
    pool.idle = NULL;
}

static void prepare_for_forks(void) { (void)pthread_atfork(NULL, NULL, lose_helpers); }

/* Leave a team, which its leader may end at once. */
static void leave(struct gr_team *team)
{
    if (atomic_fetch_sub(&team->present, 1) > 1 || !atomic_load(&pool.waiting)) return;
    pthread_mutex_lock(&pool.mutex);
    pthread_cond_broadcast(&pool.left);
    pthread_mutex_unlock(&pool.mutex);
}

static void *serve(void *argument)
{
    struct helper *helper = argument;
    for (;;) {
        SPIN_UNTIL(atomic_load(&helper->team), TO_NEXT_TEAM);
        if (!atomic_load(&helper->team)) {
            pthread_mutex_lock(&pool.mutex);
            while (!atomic_load(&helper->team)) pthread_cond_wait(&helper->called, &pool.mutex);
            pthread_mutex_unlock(&pool.mutex);
        }
        struct gr_team *team = atomic_exchange(&helper->team, NULL);
        if (!team) continue;
        help(team, helper->t);
        leave(team);
    }
    return NULL;
}

/* Take an idle helper, or begin another one. Returned: NULL if the system gives no more threads. */
static struct helper *take_helper(void)
{
    pthread_t thread;
    struct helper *helper = pool.idle;
    if (helper) {
        pool.idle = helper->next;
        return helper;
    }
    if (pool.n_helpers == GR_MAX_THREADS) return NULL;
    helper = &pool.helper[pool.n_helpers];
    atomic_store(&helper->team, NULL);
    helper->called = (pthread_cond_t)PTHREAD_COND_INITIALIZER;
    if (pthread_create(&thread, NULL, serve, helper)) return NULL;
    pthread_detach(thread);
    pool.n_helpers++;
    return helper;
}

/* Give a team as many threads, or those that there are. Returned: its helpers. */
static struct helper *call_together(struct gr_team *team, int threads)
{
    struct helper *helper, *called = NULL;
    pthread_once(&pool.once, prepare_for_forks);
    pthread_mutex_lock(&pool.mutex);
    for (; team->threads < threads && (helper = take_helper()); called = helper) {
        helper->next = called;
        helper->t = team->threads++;
    }
    atomic_store(&team->present, team->threads - 1);
    for (helper = called; helper; helper = helper->next) { /* a helper reads members that do not change any more */
        atomic_store(&helper->team, team);
        pthread_cond_signal(&helper->called);
    }
    pthread_mutex_unlock(&pool.mutex);
    return called;
}

/* End a team: wait for the helpers that have come; the others need not come, if a processor was not free for them. */
static void dismiss(struct gr_team *team, struct helper *called)
{
    struct helper *last = called;
    atomic_store(&team->closed, 1);
    call_helpers(team);
    for (struct helper *helper = called; helper; last = helper, helper = helper->next)
        if (atomic_exchange(&helper->team, NULL)) atomic_fetch_sub(&team->present, 1);
    SPIN_UNTIL(!atomic_load(&team->present), TO_NEXT_STAGE);
    pthread_mutex_lock(&pool.mutex);
    atomic_fetch_add(&pool.waiting, 1);
    while (atomic_load(&team->present)) pthread_cond_wait(&pool.left, &pool.mutex);
    atomic_fetch_sub(&pool.waiting, 1);
    last->next = pool.idle;
    pool.idle = called;
    pthread_mutex_unlock(&pool.mutex);
}

int gr_team_lead(int threads, void (*program)(void *context, struct gr_team *team), void *context)
{
    struct gr_team team = {.threads = 1,
                           .mutex = PTHREAD_MUTEX_INITIALIZER,
                           .work_came = PTHREAD_COND_INITIALIZER,
                           .work_done = PTHREAD_COND_INITIALIZER};
    struct helper *called = threads > 1 ? call_together(&team, threads < GR_MAX_THREADS ? threads : GR_MAX_THREADS) : NULL;
    program(context, called ? &team : NULL);
    if (called) dismiss(&team, called);
    pthread_cond_destroy(&team.work_came);
    pthread_cond_destroy(&team.work_done);
    pthread_mutex_destroy(&team.mutex);
    return team.threads;
}
