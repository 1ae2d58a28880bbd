/* Tests of core/map.h: values of classes, and without memory. */
#include "core/map.h"

#include "tests/check.h"
#include "tests/faults.h"

/* The columns 0 | 1 | 2 to 5 and the rows 0 to 2 | 3, the classes of which count down. */
static const int32_t columns[] = {0, 1, 2, 2, 2, 2}, rows[] = {1, 1, 1, 0};
static const uint8_t values[] = {1, 2, 3, 4, 5, 6};

static struct gr_map made(void)
{
    return (struct gr_map){.n_index = {6, 4, 1}, .n_classes = {3, 2, 1}, .class_of = {columns, rows, NULL}, .value = values};
}

TEST(values_of_classes)
{
    struct gr_map m = made();
    CHECK(gr_map_own(&m) == GR_OK);
    CHECK(m.value != values && m.class_of[0] != columns && m.class_of[1] != rows && !m.class_of[2]);
    for (int32_t y = 0; y < 4; y++)
        for (int32_t x = 0; x < 6; x++) CHECK(gr_map_get(&m, (int32_t[3]){x, y, 0}) == (y < 3 ? 4 : 1) + (x < 2 ? x : 2));
    gr_map_free(&m);
}

TEST(without_values_all_are_zero)
{
    struct gr_map m = {.n_index = {6, 4, 1}, .n_classes = {6, 4, 1}};
    CHECK(gr_map_own(&m) == GR_OK && gr_map_get(&m, (int32_t[3]){5, 3, 0}) == 0);
    gr_map_free(&m);
}

TEST(without_memory)
{
    for (long n = 1;; n++) {
        struct gr_map m = made();
        faults_at(n);
        const int error = gr_map_own(&m);
        const int hit = faults_end();
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        gr_map_free(&m); /* arrays that were not copied are not freed */
        if (!hit) break;
    }
}
