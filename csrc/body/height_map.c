/* Distance from the surface of a height map (height_map.h). */
#include "body/height_map.h"

#include <math.h>
#include <string.h>

#include "body/triangles.h"
#include "body/vector.h"
#include "core/index.h"

/* Levels of ranges at most, and boxes that wait: three for each level. */
enum { MOST_LEVELS = 48, WAITING = 3 * MOST_LEVELS };

/* Tangent of the angle, 0.35, by which the surface bends down at an edge. A ball of the radius of a cell, whose surface is
 * smooth, bends by 0.25 in a quarter of a cell. */
#define EDGE_BEND 0.36502849483824646

/* Cells within the distance of the surface above or below a point that are tried without a search. */
enum { MOST_TRIED = 64 };

/* Steps from post to post that judge the bend, in the distance within which an edge is near: a quarter of 0.35 cells. */
#define STEPS_NEAR 1.4

int64_t gr_height_map_ranges(const int64_t n[2])
{
    int64_t x = (n[0] - 2) / GR_TILE + 1, y = (n[1] - 2) / GR_TILE + 1, sum = x * y;
    while (x > 1 || y > 1) {
        x = (x + 1) / 2, y = (y + 1) / 2;
        sum += x * y;
    }
    return sum;
}

/* fmin and fmax of the library are calls. */
static inline double lesser(double a, double b) { return a < b ? a : b; }
static inline double greater(double a, double b) { return a > b ? a : b; }

static double height(const struct gr_height_map *map, int64_t i, int64_t j)
{
    const int64_t at = j * map->stride + i;
    return map->height ? map->height[at] : (double)map->height_float[at];
}

static void post(const struct gr_height_map *map, int64_t i, int64_t j, double out[3])
{
    out[0] = map->low[0] + (double)i * map->spacing[0];
    out[1] = map->low[1] + (double)j * map->spacing[1];
    out[2] = height(map, i, j);
}

/* The nearest element so far: the squared distance, the distance along `normal`, which is of a triangle if its inside is
 * nearest. */
struct nearest {
    double square, at[3], normal[3];
    int on_face;
};

static void triangle(const struct gr_height_map *map, int64_t i, int64_t j, int upper, double v[3][3])
{
    post(map, i, j, v[0]);
    post(map, i + 1, j + upper, v[1]);
    post(map, i + 1 - upper, j + 1, v[2]);
    if (!upper) post(map, i + 1, j + 1, v[2]);
}

static void up_normal(const double v[3][3], double n[3])
{
    double ab[3], ac[3];
    for (int k = 0; k < 3; k++) ab[k] = v[1][k] - v[0][k], ac[k] = v[2][k] - v[0][k];
    gr_cross(ab, ac, n);
    const double length = sqrt(gr_dot(n, n));
    for (int k = 0; k < 3; k++) n[k] /= length;
}

/* Try the two triangles between four posts, split from the first to the last. */
static void try_cell(const struct gr_height_map *map, int64_t i, int64_t j, const double x[3], struct nearest *best)
{
    for (int upper = 0; upper < 2; upper++) {
        double v[3][3], at[3], square = 0;
        triangle(map, i, j, upper, v);
        const int part = gr_nearest_on_triangle((const double(*)[3])v, x, at);
        for (int k = 0; k < 3; k++) square += (x[k] - at[k]) * (x[k] - at[k]);
        if (!(square < best->square)) continue;
        best->square = square;
        best->on_face = part == GR_ON_FACE;
        memcpy(best->at, at, sizeof at);
        up_normal((const double(*)[3])v, best->normal);
    }
}

static int64_t cell_of(const struct gr_height_map *map, int axis, double place)
{
    return gr_index((place - map->low[axis]) / map->spacing[axis], 0, map->n[axis] - 2);
}

static double square_off(double low, double high, double x)
{
    const double off = greater(greater(low - x, x - high), 0);
    return off * off;
}

/* Squared distance of x from the box of the cells [i0, i1) x [j0, j1) with a range of heights. */
static double from_cells(const struct gr_height_map *map, const int64_t from[2], const int64_t to[2], const double range[2],
                         const double x[3])
{
    double square = square_off(range[0], range[1], x[2]);
    for (int d = 0; d < 2; d++)
        square +=
            square_off(map->low[d] + (double)from[d] * map->spacing[d], map->low[d] + (double)to[d] * map->spacing[d], x[d]);
    return square;
}

/* The cells, low to high, in which something nearer than the best may lie, by position.
 * Returned: their number. */
static int64_t cells_within(const struct gr_height_map *map, const double x[3], const struct nearest *best, int64_t low[2],
                            int64_t high[2])
{
    const double reach = sqrt(best->square);
    for (int d = 0; d < 2; d++) low[d] = cell_of(map, d, x[d] - reach), high[d] = cell_of(map, d, x[d] + reach);
    return (high[0] - low[0] + 1) * (high[1] - low[1] + 1);
}

/* Try the cells from low to high that are not farther than the best. */
static void try_cells(const struct gr_height_map *map, const int64_t low[2], const int64_t high[2], const double x[3],
                      struct nearest *best)
{
    for (int64_t j = low[1]; j <= high[1]; j++)
        for (int64_t i = low[0]; i <= high[0]; i++) {
            const double a = height(map, i, j), b = height(map, i + 1, j), c = height(map, i, j + 1),
                         d = height(map, i + 1, j + 1);
            const double range[2] = {lesser(lesser(a, b), lesser(c, d)), greater(greater(a, b), greater(c, d))};
            const int64_t from[2] = {i, j}, to[2] = {i + 1, j + 1};
            if (from_cells(map, from, to, range, x) < best->square) try_cell(map, i, j, x, best);
        }
}

/* The same for the cells of a tile. */
static void try_tile(const struct gr_height_map *map, const int64_t tile[2], const double x[3], struct nearest *best)
{
    int64_t low[2], high[2];
    cells_within(map, x, best, low, high);
    for (int d = 0; d < 2; d++) {
        const int64_t first = GR_TILE * tile[d], last = first + GR_TILE - 1;
        if (low[d] < first) low[d] = first;
        if (high[d] > last) high[d] = last;
    }
    try_cells(map, low, high, x, best);
}

struct box {
    int level;
    int64_t at[2];
    double square;
};

/* The levels of the ranges: number of boxes along each axis, and the first of them. Returned: how many. */
static int levels_of(const struct gr_height_map *map, int64_t size[MOST_LEVELS][2], int64_t first[MOST_LEVELS])
{
    int n = 0;
    int64_t sum = 0;
    for (int d = 0; d < 2; d++) size[0][d] = (map->n[d] - 2) / GR_TILE + 1;
    for (;; n++) {
        first[n] = sum;
        sum += size[n][0] * size[n][1];
        if (size[n][0] == 1 && size[n][1] == 1) return n + 1;
        for (int d = 0; d < 2; d++) size[n + 1][d] = (size[n][d] + 1) / 2;
    }
}

static double from_box(const struct gr_height_map *map, const int64_t size[2], int64_t first, struct box *box,
                       const double x[3])
{
    int64_t from[2], to[2];
    for (int d = 0; d < 2; d++) {
        from[d] = box->at[d] * GR_TILE << box->level;
        to[d] = (box->at[d] + 1) * GR_TILE << box->level;
        if (to[d] > map->n[d] - 1) to[d] = map->n[d] - 1;
    }
    return from_cells(map, from, to, map->range + 2 * (first + box->at[1] * size[0] + box->at[0]), x);
}

/* Search from the largest box down, the nearer ones first. */
static void search(const struct gr_height_map *map, const double x[3], struct nearest *best)
{
    int64_t size[MOST_LEVELS][2], first[MOST_LEVELS];
    struct box waiting[WAITING + 1];
    const int levels = levels_of(map, size, first);
    int count = 1;
    waiting[0] = (struct box){.level = levels - 1};
    while (count) {
        const struct box box = waiting[--count];
        if (!(box.square < best->square)) continue;
        if (box.level == 0) {
            try_tile(map, box.at, x, best);
            continue;
        }
        const int begin = count;
        for (int child = 0; child < 4; child++) {
            const int level = box.level - 1;
            struct box part = {.level = level, .at = {2 * box.at[0] + (child & 1), 2 * box.at[1] + (child >> 1)}};
            if (part.at[0] >= size[level][0] || part.at[1] >= size[level][1]) continue;
            part.square = from_box(map, size[level], first[level], &part, x);
            if (!(part.square < best->square)) continue;
            int place = count++;
            for (; place > begin && waiting[place - 1].square < part.square; place--) waiting[place] = waiting[place - 1];
            waiting[place] = part;
        }
    }
}

/* Height of the surface at x, and the triangle there. */
static double height_at(const struct gr_height_map *map, const double x[3], int64_t cell[2], double n[3])
{
    double v[3][3], share[2], high = 0;
    for (int d = 0; d < 2; d++) {
        cell[d] = cell_of(map, d, x[d]);
        share[d] = (x[d] - map->low[d]) / map->spacing[d] - (double)cell[d];
    }
    triangle(map, cell[0], cell[1], share[1] > share[0], v);
    up_normal((const double(*)[3])v, n);
    for (int d = 0; d < 2; d++) high += n[d] * (v[0][d] - x[d]);
    return v[0][2] + high / n[2];
}

double gr_height_map_distance(const struct gr_height_map *map, const double x[3], double normal[3])
{
    struct nearest best = {.square = INFINITY};
    double place[3] = {0, 0, x[2]}, n[3];
    int64_t cell[2], low[2], high[2];
    for (int d = 0; d < 2; d++)
        place[d] = greater(map->low[d], lesser(x[d], map->low[d] + map->spacing[d] * (double)(map->n[d] - 1)));
    const double sign = place[2] < height_at(map, place, cell, n) ? -1 : 1;
    try_cell(map, cell[0], cell[1], place, &best);
    if (cells_within(map, place, &best, low, high) <= MOST_TRIED)
        try_cells(map, low, high, place, &best);
    else
        search(map, place, &best);
    const double distance = sqrt(best.square);
    double along = 0;
    for (int k = 0; k < 3; k++) along += best.normal[k] * (place[k] - best.at[k]);
    if (best.on_face || !(distance > 0)) { /* without the rounding of a small difference */
        memcpy(normal, best.normal, sizeof best.normal);
        return sign * fabs(along);
    }
    for (int k = 0; k < 3; k++) normal[k] = sign * (place[k] - best.at[k]) / distance;
    return sign * distance;
}

/* Edges at a post: whether the surface bends by more than an edge does along an axis, over `step` posts on either side. */
static int bends(const struct gr_height_map *map, const int64_t at[2], int axis, int64_t step)
{
    int64_t before[2] = {at[0], at[1]}, after[2] = {at[0], at[1]};
    before[axis] -= step, after[axis] += step;
    if (before[axis] < 0 || after[axis] >= map->n[axis]) return 0;
    const double here = height(map, at[0], at[1]), length = (double)step * map->spacing[axis];
    const double rise = (here - height(map, before[0], before[1])) / length;
    const double fall = (here - height(map, after[0], after[1])) / length;
    /* the tangent of the sum of two angles; where rise fall > 1 the sum is beyond a right angle, on the side of both */
    const double sum = rise + fall, least = EDGE_BEND * (1 - rise * fall);
    return sum > 0 && sum > least ? 1 : sum < 0 && -sum > least ? 2 : 0;
}

int gr_height_map_edges(const struct gr_height_map *map, const double x[3], double near)
{
    int64_t low[2], high[2], step[2], at[2];
    int edges = 0;
    for (int d = 0; d < 2; d++) {
        step[d] = gr_index(rint(near / (STEPS_NEAR * map->spacing[d])), 1, map->n[d]);
        low[d] = cell_of(map, d, x[d] - near);
        high[d] = cell_of(map, d, x[d] + near) + 1;
    }
    for (at[1] = low[1]; at[1] <= high[1]; at[1] += step[1])
        for (at[0] = low[0]; at[0] <= high[0]; at[0] += step[0])
            for (int d = 0; d < 2; d++) edges |= bends(map, at, d, step[d]);
    return edges;
}
