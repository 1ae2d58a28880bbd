/* Exact distances from the triangles of a surface (triangles.h). */
#include "body/triangles.h"

#include <math.h>

#include "body/vector.h"
#include "core/memory.h"

/* Triangles of a leaf, and levels of the tree at most. */
enum { LEAF = 4, DEEPEST = 64 };

/* A triangle whose sine of the angle at a vertex is less than this has no direction of its own. */
#define FLAT 1e-10

int gr_nearest_on_triangle(const double v[3][3], const double x[3], double nearest[3])
{
    double ab[3], ac[3], at[3][3], d[3][2];
    for (int k = 0; k < 3; k++) ab[k] = v[1][k] - v[0][k], ac[k] = v[2][k] - v[0][k];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) at[i][k] = x[k] - v[i][k];
        d[i][0] = gr_dot(ab, at[i]), d[i][1] = gr_dot(ac, at[i]);
    }
    const double area[3] = {d[1][0] * d[2][1] - d[2][0] * d[1][1], d[2][0] * d[0][1] - d[0][0] * d[2][1],
                            d[0][0] * d[1][1] - d[1][0] * d[0][1]}; /* opposite of vertices 0, 1, 2 */
    double s = 0, t = 0;                                            /* nearest = v0 + s ab + t ac */
    int part = GR_ON_FACE;
    if (d[0][0] <= 0 && d[0][1] <= 0) {
        part = GR_ON_VERTEX;
    } else if (d[1][0] >= 0 && d[1][1] <= d[1][0]) {
        part = GR_ON_VERTEX + 1, s = 1;
    } else if (d[2][1] >= 0 && d[2][0] <= d[2][1]) {
        part = GR_ON_VERTEX + 2, t = 1;
    } else if (area[2] <= 0 && d[0][0] >= 0 && d[1][0] <= 0) {
        part = GR_ON_EDGE, s = d[0][0] / (d[0][0] - d[1][0]);
    } else if (area[1] <= 0 && d[0][1] >= 0 && d[2][1] <= 0) {
        part = GR_ON_EDGE + 2, t = d[0][1] / (d[0][1] - d[2][1]);
    } else if (area[0] <= 0 && d[1][1] >= d[1][0] && d[2][0] >= d[2][1]) {
        const double from = d[1][1] - d[1][0], to = d[2][0] - d[2][1];
        part = GR_ON_EDGE + 1, t = from / (from + to), s = 1 - t;
    } else {
        const double all = area[0] + area[1] + area[2];
        s = area[1] / all, t = area[2] / all;
    }
    for (int k = 0; k < 3; k++)
        nearest[k] = part == GR_ON_EDGE + 1 ? v[1][k] + t * (v[2][k] - v[1][k]) : v[0][k] + s * ab[k] + t * ac[k];
    if (part == GR_ON_VERTEX + 1 || part == GR_ON_VERTEX + 2)
        for (int k = 0; k < 3; k++) nearest[k] = v[part - GR_ON_VERTEX][k];
    return part;
}

static void corners(const struct gr_triangles *t, int64_t f, double v[3][3])
{
    for (int i = 0; i < 3; i++) memcpy(v[i], t->vertex + 3 * (int64_t)t->face[3 * f + i], sizeof v[i]);
}

/* Unit normal of a triangle; 0 for one that is flat. */
static void face_normal(const double v[3][3], double n[3])
{
    double ab[3], ac[3];
    for (int k = 0; k < 3; k++) ab[k] = v[1][k] - v[0][k], ac[k] = v[2][k] - v[0][k];
    gr_cross(ab, ac, n);
    const double length = sqrt(gr_dot(n, n));
    const int flat = !(length > FLAT * sqrt(gr_dot(ab, ab) * gr_dot(ac, ac)));
    for (int k = 0; k < 3; k++) n[k] = flat ? 0 : n[k] / length;
}

static void add_normals(struct gr_triangles *t)
{
    for (int64_t f = 0; f < t->n_faces; f++) {
        double v[3][3], n[3], turned[3];
        corners(t, f, v);
        face_normal(v, n);
        for (int i = 0; i < 3; i++) {
            double one[3], two[3];
            for (int k = 0; k < 3; k++) one[k] = v[(i + 1) % 3][k] - v[i][k], two[k] = v[(i + 2) % 3][k] - v[i][k];
            gr_cross(one, two, turned);
            const double angle = atan2(sqrt(gr_dot(turned, turned)), gr_dot(one, two));
            double *sum = t->normal + 3 * (int64_t)t->face[3 * f + i];
            for (int k = 0; k < 3; k++) sum[k] += angle * n[k];
        }
    }
}

/* The normal of a triangle, for a flat one that of its vertices. */
static void add_face(const struct gr_triangles *t, int64_t f, double n[3])
{
    double v[3][3], own[3];
    corners(t, f, v);
    face_normal(v, own);
    if (gr_dot(own, own) > 0) {
        for (int k = 0; k < 3; k++) n[k] += own[k];
        return;
    }
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) n[k] += t->normal[3 * (int64_t)t->face[3 * f + i] + k];
}

/* A sum of normals whose direction is that of the normal at a part of a triangle. */
static void normal_at(const struct gr_triangles *t, int64_t f, int part, double n[3])
{
    n[0] = n[1] = n[2] = 0;
    if (part >= GR_ON_VERTEX && part < GR_ON_EDGE) {
        memcpy(n, t->normal + 3 * (int64_t)t->face[3 * f + part - GR_ON_VERTEX], 3 * sizeof(double));
        return;
    }
    add_face(t, f, n);
    if (part >= GR_ON_EDGE) add_face(t, t->neighbour[3 * f + part - GR_ON_EDGE], n);
}

/* A triangle by its middle, while they are put in order. */
struct middle {
    float at[3];
    int32_t face;
};

/* Reorder n middles so that number k along an axis is at its place, none after it lower and none before it higher. */
static void split(struct middle *m, int64_t n, int64_t k, int axis)
{
    int64_t low = 0, high = n - 1;
    while (low < high) {
        const float pivot = m[low + (high - low) / 2].at[axis];
        int64_t i = low, j = high;
        while (i <= j) {
            while (m[i].at[axis] < pivot) i++;
            while (m[j].at[axis] > pivot) j--;
            if (i > j) break;
            const struct middle swapped = m[i];
            m[i++] = m[j], m[j--] = swapped;
        }
        if (k <= j)
            high = j;
        else if (k >= i)
            low = i;
        else
            return;
    }
}

/* First triangle of a leaf, in the order of the tree. */
static int64_t first_of(const struct gr_triangles *t, int64_t leaf) { return leaf * t->n_faces / t->n_leaves; }

/* Put the triangles of leaves [from, to) in order: halves along the longest side of their box, and so on. */
static void put_in_order(const struct gr_triangles *t, struct middle *m, int64_t from, int64_t to)
{
    const int64_t first = first_of(t, from), end = first_of(t, to), half = from + (to - from) / 2;
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    int axis = 0;
    if (to - from < 2) return;
    for (int64_t f = first; f < end; f++)
        for (int k = 0; k < 3; k++) low[k] = fminf(low[k], m[f].at[k]), high[k] = fmaxf(high[k], m[f].at[k]);
    for (int k = 1; k < 3; k++)
        if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    split(m + first, end - first, first_of(t, half) - first, axis);
    put_in_order(t, m, from, half);
    put_in_order(t, m, half, to);
}

/* Axes of a box: the first along a sum of normals, so that the box of a nearly flat part is flat. */
static void set_axes(const double normal[3], double axis[3][3])
{
    const double length = sqrt(gr_dot(normal, normal));
    double unit[3] = {0, 0, 1}, along = 0;
    for (int k = 0; k < 3 && length > 0; k++) unit[k] = normal[k] / length;
    const int least = fabs(unit[0]) < fabs(unit[1])   ? (fabs(unit[0]) < fabs(unit[2]) ? 0 : 2)
                      : fabs(unit[1]) < fabs(unit[2]) ? 1
                                                      : 2;
    for (int k = 0; k < 3; k++) axis[1][k] = (k == least) - unit[least] * unit[k];
    along = sqrt(gr_dot(axis[1], axis[1]));
    for (int k = 0; k < 3; k++) axis[0][k] = unit[k], axis[1][k] /= along;
    gr_cross(axis[0], axis[1], axis[2]);
}

static void include(struct gr_triangle_box *box, const double x[3])
{
    for (int k = 0; k < 3; k++) {
        const double at = gr_dot(box->axis[k], x);
        box->low[k] = fmin(box->low[k], at), box->high[k] = fmax(box->high[k], at);
    }
}

/* Sums of the normals of what the nodes hold are kept in the first axis until the axes are set. */
static void sum_normals(struct gr_triangles *t)
{
    for (int64_t f = 0, leaf = 0; f < t->n_faces; f++) {
        double v[3][3], ab[3], ac[3], n[3];
        corners(t, t->order[f], v);
        for (int k = 0; k < 3; k++) ab[k] = v[1][k] - v[0][k], ac[k] = v[2][k] - v[0][k];
        gr_cross(ab, ac, n);
        while (f >= first_of(t, leaf + 1)) leaf++;
        for (int k = 0; k < 3; k++) t->box[t->n_leaves + leaf].axis[0][k] += n[k];
    }
    for (int64_t node = t->n_leaves - 1; node > 0; node--)
        for (int k = 0; k < 3; k++) t->box[node].axis[0][k] = t->box[2 * node].axis[0][k] + t->box[2 * node + 1].axis[0][k];
}

static void build_tree(struct gr_triangles *t)
{
    sum_normals(t);
    for (int64_t node = 2 * t->n_leaves - 1; node > 0; node--) {
        struct gr_triangle_box *box = &t->box[node];
        const double normal[3] = {box->axis[0][0], box->axis[0][1], box->axis[0][2]};
        set_axes(normal, box->axis);
        for (int k = 0; k < 3; k++) box->low[k] = INFINITY, box->high[k] = -INFINITY;
        const int64_t leaf = node - t->n_leaves;
        for (int64_t f = leaf < 0 ? 0 : first_of(t, leaf); leaf >= 0 && f < first_of(t, leaf + 1); f++)
            for (int i = 0; i < 3; i++) include(box, t->corner + 9 * f + 3 * i);
        for (int corner = 0; node < t->n_leaves && corner < 16; corner++) {
            const struct gr_triangle_box *child = &t->box[2 * node + (corner >> 3)];
            double x[3] = {0};
            for (int k = 0; k < 3; k++)
                for (int d = 0; d < 3; d++) x[d] += (corner >> k & 1 ? child->high : child->low)[k] * child->axis[k][d];
            if (child->low[0] <= child->high[0]) include(box, x);
        }
    }
}

int gr_triangles_new(struct gr_triangles **out, const struct gr_triangles *tables)
{
    struct gr_triangles *t = malloc(sizeof *t);
    *out = t;
    if (!t) return GR_ERR_MEMORY;
    *t = *tables;
    t->n_leaves = 1;
    while (t->n_leaves * LEAF < t->n_faces) t->n_leaves *= 2;
    t->box = calloc((size_t)t->n_leaves, 2 * sizeof *t->box);
    t->order = malloc(sizeof *t->order * (size_t)t->n_faces);
    t->corner = malloc(sizeof *t->corner * 9 * (size_t)t->n_faces);
    struct middle *middle = malloc(sizeof *middle * (size_t)t->n_faces);
    t->normal = t->neighbour ? calloc((size_t)t->n_vertices, 3 * sizeof *t->normal) : NULL;
    if (!t->box || !t->order || !t->corner || !middle || (t->neighbour && !t->normal)) {
        free(middle);
        gr_triangles_free(t);
        *out = NULL;
        return GR_ERR_MEMORY;
    }
    for (int64_t f = 0; f < t->n_faces; f++) {
        double v[3][3];
        corners(t, f, v);
        for (int k = 0; k < 3; k++) middle[f].at[k] = (float)((v[0][k] + v[1][k] + v[2][k]) / 3);
        middle[f].face = (int32_t)f;
    }
    put_in_order(t, middle, 0, t->n_leaves);
    for (int64_t f = 0; f < t->n_faces; f++) {
        t->order[f] = middle[f].face;
        corners(t, t->order[f], (double(*)[3])(t->corner + 9 * f));
    }
    free(middle);
    build_tree(t);
    if (t->normal) add_normals(t);
    return GR_OK;
}

void gr_triangles_free(struct gr_triangles *t)
{
    if (!t) return;
    free(t->box);
    free(t->order);
    free(t->corner);
    free(t->normal);
    free(t);
}

/* Squared distance of x from a box; infinite for an empty one. */
static double from_box(const struct gr_triangle_box *box, const double x[3])
{
    double square = 0;
    for (int k = 0; k < 3; k++) {
        const double at = gr_dot(box->axis[k], x), below = box->low[k] - at, above = at - box->high[k];
        const double off = below > above ? below : above;
        if (off > 0) square += off * off;
    }
    return square;
}

/* What is nearest so far. */
struct nearest {
    double square, at[3];
    int64_t place; /* of the triangle, in the order of the tree */
    int part;
};

static void try_face(const struct gr_triangles *t, int64_t place, const double x[3], struct nearest *best)
{
    double at[3], square = 0;
    const int part = gr_nearest_on_triangle((const double(*)[3])(t->corner + 9 * place), x, at);
    for (int k = 0; k < 3; k++) square += (x[k] - at[k]) * (x[k] - at[k]);
    /* equal distances: the first, so that the guess decides nothing */
    if (square > best->square || (square == best->square && place > best->place)) return;
    best->square = square, best->place = place, best->part = part;
    memcpy(best->at, at, sizeof at);
}

double gr_triangles_distance(const struct gr_triangles *t, const double x[3], int64_t *guess)
{
    struct nearest best = {.square = INFINITY, .place = t->n_faces};
    int64_t waiting[DEEPEST], node = 1;
    double bound[DEEPEST], n[3], sign = 0;
    int count = 0;
    try_face(t, *guess, x, &best);
    for (;;) {
        if (node >= t->n_leaves) {
            const int64_t end = first_of(t, node - t->n_leaves + 1);
            for (int64_t f = first_of(t, node - t->n_leaves); f < end; f++) try_face(t, f, x, &best);
        } else {
            const double low = from_box(&t->box[2 * node], x), high = from_box(&t->box[2 * node + 1], x);
            const int nearer = high < low;
            const double near = nearer ? high : low, far = nearer ? low : high;
            if (far <= best.square) waiting[count] = 2 * node + 1 - nearer, bound[count++] = far;
            if (near <= best.square) {
                node = 2 * node + nearer;
                continue;
            }
        }
        while (count && bound[count - 1] > best.square) count--;
        if (!count) break;
        node = waiting[--count];
    }
    *guess = best.place;
    if (!t->neighbour) return sqrt(best.square);
    normal_at(t, t->order[best.place], best.part, n);
    for (int k = 0; k < 3; k++) sign += n[k] * (x[k] - best.at[k]);
    return sign < 0 ? -sqrt(best.square) : sqrt(best.square);
}
