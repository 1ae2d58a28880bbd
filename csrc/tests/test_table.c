/* Tests of core/table.c: against a plain array, after clearing, and without memory. */
#include "core/table.h"

#include <string.h>

#include "core/error.h"
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
