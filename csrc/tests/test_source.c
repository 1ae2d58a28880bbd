/* Memory by source: blocks are from the one that the thread uses, grow there, and are given back to it. Those of a device are in
 * a list while they are in use, and then kept for others. */
#include "core/memory.h"

#include <stdint.h>

#include "gpu/blocks.h"
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

/* ---- Blocks of a device ---- */

static const struct gr_pool pool = {take, give}, other = {take, give};

TEST(blocks_are_kept_for_others)
{
    char *large = gr_take_block(&pool, 100000), *block = gr_take_block(&pool, 10000);
    CHECK(held == 2 && gr_in_block(large) && gr_in_block(block + 9999));
    gr_give_block(&pool, block);
    CHECK(held == 2 && !gr_in_block(block));
    char *larger = gr_take_block(&pool, 10100), *small = gr_take_block(&pool, 100), *others = gr_take_block(&other, 10000);
    CHECK(larger == block && held == 4); /* not for what is much smaller, nor for another pool */
    gr_give_block(&pool, larger), gr_give_block(&pool, small), gr_give_block(&other, others);
    CHECK(held == 4);
    gr_give_block(&pool, large);
    CHECK(held == 0); /* none is in use */
}

TEST(most_of_what_is_kept_is_dropped)
{
    char *large = gr_take_block(&pool, 1000000), *block[100];
    for (int k = 0; k < 100; k++) block[k] = gr_take_block(&pool, 1000);
    for (int k = 0; k < 100; k++) gr_give_block(&pool, block[k]);
    CHECK(held == 65); /* the list is full */
    char *half = gr_take_block(&pool, 500000);
    CHECK(held == 66);
    gr_give_block(&pool, half); /* more than a quarter of what is in use */
    CHECK(held == 1);
    gr_give_block(&pool, large);
    CHECK(held == 0);
}

TEST(what_is_kept_is_dropped_for_want_of_memory)
{
    char *large = gr_take_block(&pool, 100000), *block = gr_take_block(&pool, 1000);
    gr_give_block(&pool, block);
    refused = 1;
    CHECK(held == 2 && !gr_take_block(&pool, 5000) && held == 1);
    refused = 0;
    CHECK(!gr_take_block(&pool, SIZE_MAX) && !gr_take_block(&pool, SIZE_MAX - 100));
    gr_give_block(&pool, large);
    CHECK(held == 0);
}
