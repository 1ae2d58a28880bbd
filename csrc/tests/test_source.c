/* Memory by source: blocks are from the one that the thread uses, grow there, and are given back to it. */
#include "core/memory.h"

#include <stdint.h>

#include "tests/check.h"

static long held, refused;

static void *take(size_t bytes)
{
    if (refused) return NULL;
    held++;
    return malloc(bytes);
}

static void give(void *block)
{
    held--;
    free(block);
}

static const struct gr_source source = {take, give};

TEST(blocks_stay_with_their_source)
{
    gr_use_source(&source);
    int *counted = gr_malloc(4 * sizeof *counted);
    char *zeros = gr_calloc(3, 5);
    gr_use_source(NULL);
    int *plain = gr_malloc(sizeof *plain);
    CHECK(held == 2 && counted && zeros && plain);
    for (int k = 0; k < 15; k++) CHECK(!zeros[k]);
    for (int k = 0; k < 4; k++) counted[k] = k;
    counted = gr_realloc(counted, 1000 * sizeof *counted);
    for (int k = 0; k < 4; k++) CHECK(counted[k] == k);
    CHECK(held == 2);
    gr_use_source(&source);
    plain = gr_realloc(plain, 100 * sizeof *plain);
    CHECK(held == 2); /* it grows where it is from */
    gr_use_source(NULL);
    gr_free(counted), gr_free(zeros), gr_free(plain), gr_free(NULL);
    CHECK(held == 0);
}

TEST(without_memory_blocks_remain)
{
    gr_use_source(&source);
    int *block = gr_malloc(sizeof *block);
    *block = 7;
    refused = 1;
    CHECK(!gr_malloc(1) && !gr_calloc(1, 1) && !gr_realloc(block, 100) && *block == 7);
    refused = 0;
    gr_use_source(NULL);
    gr_free(block);
    CHECK(held == 0);
}

TEST(sizes_that_overflow_are_refused)
{
    void *block = gr_malloc(1);
    CHECK(!gr_malloc(SIZE_MAX) && !gr_calloc(SIZE_MAX / 2, 3) && !gr_calloc(SIZE_MAX, 1) &&
          !gr_realloc(block, SIZE_MAX - 1));
    gr_free(block);
}
