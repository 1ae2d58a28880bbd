/* Tests of gpu/blocks.c: blocks are in the list while they are in use, and then kept for others. */
#include "gpu/blocks.h"

#include <stdint.h>
#include <stdlib.h>

#include "tests/check.h"

static long held, refused;

static void *raw(size_t bytes)
{
    if (refused) return NULL;
    held++;
    return malloc(bytes);
}

static void drop(void *block)
{
    held--;
    free(block);
}

static const struct gr_pool pool = {raw, drop}, other = {raw, drop};

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
