/* Tests of core/table.c: against a plain array, after clearing, and without memory. */
#include "core/table.h"

#include <string.h>

#include "core/error.h"
#include "mpm/fill_table.h"
#include "tests/check.h"
#include "tests/faults.h"
#include "tests/scene.h"

enum { MOST = 1000 };

TEST(as_a_plain_array)
{
    static int32_t plain[MOST];
    for (int64_t n = 1; n <= MOST; n += 111) {
        struct gr_table t;
        CHECK(gr_table_new(&t, n) == GR_OK);
        scene_seed((unsigned)n);
        for (int round = 0; round < 3; round++) {
            memset(plain, 0, sizeof plain);
            for (int k = 0; k < 40; k++) {
                const int64_t i = (int64_t)scene_random(0, (double)n);
                plain[i] = k % 5 ? k : 0;
                CHECK(gr_table_set(&t, i, plain[i]) == GR_OK);
            }
            for (int64_t i = 0; i < n; i++) CHECK(gr_table_get(&t, i) == plain[i]);
            gr_table_clear(&t);
            for (int64_t i = 0; i < n; i++) CHECK(gr_table_get(&t, i) == 0);
        }
        gr_table_free(&t);
    }
}

/* A failure leaves the table unchanged. Setting entries again where some were set before needs no memory. */
TEST(without_memory)
{
    for (long n = 1;; n++) {
        struct gr_table t;
        faults_at(n);
        int error = gr_table_new(&t, MOST);
        for (int64_t i = 0; !error && i < MOST; i++) error = gr_table_set(&t, i, 1);
        const int hit = faults_end();
        for (int64_t i = 0; !error && i < MOST; i++) CHECK(gr_table_get(&t, i) == 1);
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        gr_table_clear(&t);
        faults_at(1);
        if (!error) CHECK(gr_table_set(&t, 5, 3) == GR_OK);
        CHECK(!faults_end());
        gr_table_free(&t);
        if (!hit) break;
    }
}

struct filling {
    int64_t n, index[MOST];
    struct gr_table *t;
    struct gr_engine *e;
};

static void fill(void *context, struct gr_team *team)
{
    static int32_t plain[MOST];
    const struct filling *filling = context;
    memset(plain, 0, sizeof plain);
    for (int64_t k = filling->n; k-- > 0;) plain[filling->index[k]] = (int32_t)(k + 1);
    for (int64_t chunks = 1; chunks < 40; chunks += 6) {
        CHECK(gr_fill_table(filling->e, filling->t, filling->index, NULL, filling->n, team, chunks) == GR_OK);
        int wrong = 0;
        for (int64_t i = 0; i < MOST; i++) wrong += gr_table_get(filling->t, i) != plain[i];
        CHECK(!wrong);
    }
}

/* Ascending indices, some of them twice: of equal ones the least number counts. */
TEST(filled_by_a_team)
{
    static struct gr_engine e; /* of processors */
    struct gr_table t;
    CHECK(gr_table_new(&t, MOST) == GR_OK);
    CHECK(gr_table_set(&t, MOST - 1, 7) == GR_OK); /* is forgotten */
    for (int threads = 1; threads <= 3; threads++)
        for (int dense = 0; dense < 3; dense++) {
            struct filling filling = {.t = &t, .e = &e};
            for (int64_t i = 0; i < MOST - 1; i++)
                for (int copy = 0; copy < 2 && filling.n < MOST; copy++)
                    if (scene_random(0, 1) < 0.2 * dense) filling.index[filling.n++] = i;
            gr_team_lead(threads, fill, &filling);
        }
    faults_at(1);
    const int64_t index = 5;
    CHECK(gr_fill_table(&e, &t, &index, NULL, 1, NULL, 1) == GR_ERR_MEMORY);
    CHECK(faults_end() && gr_table_get(&t, index) == 0);
    gr_table_free(&t);
}
