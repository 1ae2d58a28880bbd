/* Tests of core/team.c: threads that share the chunks of a stage. */
#include "core/team.h"

#include <stdatomic.h>
#include <unistd.h>

#include "tests/check.h"
#include "tests/faults.h"

enum { CHUNKS = 37, THREADS = 3, MANY = 8 };

struct counts {
    _Atomic int done[CHUNKS], by[MANY];
    _Atomic int delayed; /* helpers that have slept */
    int stages;
};

static void clear(struct counts *counts)
{
    for (int c = 0; c < CHUNKS; c++) atomic_store(&counts->done[c], 0);
    for (int t = 0; t < MANY; t++) atomic_store(&counts->by[t], 0);
}

static void count(void *context, int64_t chunk, int t)
{
    struct counts *counts = context;
    atomic_fetch_add(&counts->done[chunk], 1);
    atomic_fetch_add(&counts->by[t], 1);
}

static void check_each_once(struct counts *counts)
{
    int wrong = 0;
    for (int c = 0; c < CHUNKS; c++) wrong += atomic_load(&counts->done[c]) != 1;
    CHECK(!wrong);
}

/* Stages of every length, one behind the other. */
static void many_stages(void *context, struct gr_team *team)
{
    struct counts *counts = context;
    for (int stage = 0; stage < 3000; stage++) {
        const int64_t chunks = stage % (CHUNKS + 1);
        clear(counts);
        gr_team_run(team, count, counts, chunks);
        int wrong = 0;
        for (int c = 0; c < CHUNKS; c++) wrong += atomic_load(&counts->done[c]) != (c < chunks);
        CHECK(!wrong);
    }
}

TEST(each_chunk_is_done_once)
{
    for (int threads = 1; threads <= THREADS; threads++) {
        struct counts counts = {0};
        CHECK(gr_team_lead(threads, many_stages, &counts) == threads);
    }
}

/* As `count`, but a helper sleeps in its first chunk, like a thread that another program has put aside. */
static void count_late(void *context, int64_t chunk, int t)
{
    struct counts *counts = context;
    if (t && !atomic_fetch_add(&counts->delayed, 1)) usleep(300000);
    if (!t) usleep(500); /* so that the helpers come to their share */
    count(context, chunk, t);
}

static void stages_after_a_delay(void *context, struct gr_team *team)
{
    struct counts *counts = context;
    while (!atomic_load(&counts->delayed) && counts->stages++ < 1000) {
        clear(counts);
        gr_team_run(team, count_late, counts, CHUNKS);
    }
    check_each_once(counts);
    if (!atomic_load(&counts->delayed)) return; /* no helper: a machine that is very busy */
    int by_helpers = 0;
    for (int stage = 0; stage < 100; stage++) {
        clear(counts);
        gr_team_run(team, count, counts, CHUNKS);
        check_each_once(counts);
        by_helpers += CHUNKS - atomic_load(&counts->by[0]);
    }
    CHECK(by_helpers == 0);
}

/* A leader that had to wait for a thread that was put aside does the next stages alone. */
TEST(after_a_delay_the_leader_works_alone)
{
    struct counts counts = {0};
    gr_team_lead(THREADS, stages_after_a_delay, &counts);
}

static void one_stage(void *context, struct gr_team *team)
{
    struct counts *counts = context;
    clear(counts);
    gr_team_run(team, count, counts, CHUNKS);
    check_each_once(counts);
}

/* Threads that the system refuses are missing in the team, and nothing else. Helpers stay for the next team. */
TEST(without_the_threads_that_are_refused)
{
    struct counts counts = {0};
    const int before = gr_team_lead(THREADS, one_stage, &counts);
    CHECK(before == THREADS);
    for (int new = 0; new <= 2; new ++) {
        faults_allow_threads(new ? 1 : 0);
        CHECK(gr_team_lead(MANY, one_stage, &counts) == before + new);
        CHECK(gr_team_lead(THREADS, one_stage, &counts) == THREADS);
    }
    faults_allow_threads(-1);
    CHECK(gr_team_lead(MANY, many_stages, &counts) == MANY);
}
