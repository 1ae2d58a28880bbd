/* Tests of body/height_map.c and body/samples.c: distances and edges by hand. */
#include "body/height_map.h"
#include "body/samples.h"

#include <math.h>

#include "tests/check.h"

enum { N = 65 };

static double heights[N * N], range[2 * 128];

/* A map of 64 cells of 0.01 m with the heights f(x). */
static struct gr_height_map map_of(double (*f)(double x))
{
    struct gr_height_map map = {.n = {N, N}, .stride = N, .spacing = {0.01, 0.01}, .height = heights, .range = range};
    for (int k = 0; k < N * N; k++) heights[k] = f(0.01 * (k % N));
    for (int k = 0; k < 128; k++) range[2 * k] = -10, range[2 * k + 1] = 10; /* bounds that exclude nothing above */
    return map;
}

static double ridge(double x) { return -fabs(x - 0.32); }
static double trough(double x) { return fabs(x - 0.32); }
static double hill(double x) { return -2 * (x - 0.32) * (x - 0.32); } /* radius 0.25 m */
static double rounded(double x)
{
    return fabs(x - 0.32) < 0.02 ? -20 * (x - 0.32) * (x - 0.32) : 0.008 - 0.8 * fabs(x - 0.32);
}

TEST(distances_from_a_ridge)
{
    const struct gr_height_map map = map_of(ridge);
    const int64_t n[2] = {N, N}, small[2] = {2, 10};
    double normal[3];
    CHECK(gr_height_map_ranges(n) == 64 + 16 + 4 + 1);
    CHECK(gr_height_map_ranges(small) == 2 + 1);
    CHECK_NEAR(gr_height_map_distance(&map, (double[]){0.32, 0.3, 0.1}, normal), 0.1, 1e-15);
    CHECK_NEAR(normal[2], 1, 1e-15);
    CHECK_NEAR(gr_height_map_distance(&map, (double[]){0.32, 0.3, -0.1}, normal), -0.1 * sqrt(0.5), 1e-15);
    CHECK_NEAR(gr_height_map_distance(&map, (double[]){0.2, 0.3, 0}, normal), 0.12 * sqrt(0.5), 1e-15);
    CHECK_NEAR(normal[0], -sqrt(0.5), 1e-12);
}

TEST(edges_of_a_map)
{
    struct gr_height_map map = map_of(ridge);
    const double at[3] = {0.30, 0.3, 0}, off[3] = {0.2, 0.3, 0};
    CHECK(gr_height_map_edges(&map, at, 0.0205) == 1);
    CHECK(!gr_height_map_edges(&map, off, 0.02));
    map = map_of(trough);
    CHECK(gr_height_map_edges(&map, at, 0.05) == 2);
    map = map_of(hill);
    CHECK(!gr_height_map_edges(&map, at, 0.08)); /* 0.35 cells of a radius of 1.1 cells */
    map = map_of(rounded);
    CHECK(gr_height_map_edges(&map, at, 0.07)); /* posts finer than the edge do not make it smooth */
}

TEST(samples_and_their_edges)
{
    static float coarse[8], fine[GR_CUBE_SIZE];
    static uint8_t sharp[GR_CUBE_SIZE];
    int32_t block[1] = {0};
    const struct gr_samples s = {.low = {-4, -4, -4},
                                 .spacing = 1,
                                 .n = {1, 1, 1},
                                 .coarse = coarse,
                                 .block = block,
                                 .n_blocks = 1,
                                 .fine = fine,
                                 .sharp = sharp};
    double normal[3];
    for (int k = 0; k < GR_CUBE_SIZE; k++) fine[k] = (float)(k % GR_CUBE_SIDE) - 5; /* x - 1 */
    for (int k = 0; k < 8; k++) coarse[k] = k % 2 ? 3 : -5;
    sharp[GR_CUBE_SIDE * GR_CUBE_SIDE * 4 + GR_CUBE_SIDE * 4 + 4] = 1; /* at 0 */
    CHECK_NEAR(gr_samples_distance(&s, (double[]){2.5, 1, 1}, normal), 1.5, 1e-12);
    CHECK_NEAR(normal[0], 1, 1e-12);
    CHECK_NEAR(gr_samples_distance(&s, (double[]){8, 0, 3}, normal), 5, 1e-12); /* sqrt(4^2 + 3^2), of 7 */
    CHECK(gr_samples_edges(&s, (double[]){1.5, 0, 0}, 0.6));
    CHECK(!gr_samples_edges(&s, (double[]){1.5, 0, 0}, 0.4));
    block[0] = -1;
    CHECK_NEAR(gr_samples_distance(&s, (double[]){-3.5, 0, 0}, normal), -6, 1e-12); /* no less than the band */
    block[0] = 7;                                                                   /* there is no such block */
    CHECK_NEAR(gr_samples_distance(&s, (double[]){-3.5, 0, 0}, normal), -6, 1e-12);
}
