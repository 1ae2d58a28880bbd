/* Exact distances from the triangles of a surface (triangles.h). */
#include "body/triangles.h"

#include <math.h>

#include "body/vector.h"
#include "core/memory.h"

/* Triangles of a leaf, and levels of the tree at most. */
enum { LEAF = 4, DEEPEST = 64 };

/* Distance in radii from which a node is a dipole. With 2 the winding numbers of closed surfaces err by less than 0.1, as
 * measured (tests/shapes/test_verification_mesh_solids.py); a sign needs 0.5. */
#define FAR 2.0

/* Share of a distance that is free of the surface for certain, whatever the rounding. */
#define CLEAR 0.999999

#define TWO_PI 6.283185307179586

/* A part of a length or an area; 0 of none, as in triangles with equal vertices. */
static double share_of(double part, double whole) { return whole > 0 ? part / whole : 0; }

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
        part = GR_ON_EDGE, s = share_of(d[0][0], d[0][0] - d[1][0]);
    } else if (area[1] <= 0 && d[0][1] >= 0 && d[2][1] <= 0) {
        part = GR_ON_EDGE + 2, t = share_of(d[0][1], d[0][1] - d[2][1]);
    } else if (area[0] <= 0 && d[1][1] >= d[1][0] && d[2][0] >= d[2][1]) {
        const double from = d[1][1] - d[1][0], to = d[2][0] - d[2][1];
        part = GR_ON_EDGE + 1, t = share_of(from, from + to), s = 1 - t;
    } else {
        const double all = area[0] + area[1] + area[2];
        s = share_of(area[1], all), t = share_of(area[2], all);
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

/* Twice the area of a triangle times its unit normal. */
static void twice_area(const double v[3][3], double n[3])
{
    double ab[3], ac[3];
    for (int k = 0; k < 3; k++) ab[k] = v[1][k] - v[0][k], ac[k] = v[2][k] - v[0][k];
    gr_cross(ab, ac, n);
}

/* A triangle by its middle, while they are put in order. */
struct middle {
    float at[3];
    int32_t face;
};

/* Reorder n middles so that number k along an axis is in order: none after it lower, none before it higher. */
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

static const double *corner_of(const struct gr_triangles *t, int64_t place) { return t->corner + 9 * place; }

/* Dipoles of leaves from their triangles, of the others from their children; `at` is a sum over areas until the end. */
static void sum_areas(struct gr_triangles *t, double *size)
{
    for (int64_t f = 0, leaf = 0; f < t->n_faces; f++) {
        const double *v = corner_of(t, f);
        double n[3];
        twice_area((const double(*)[3])v, n);
        const double area = 0.5 * sqrt(gr_dot(n, n));
        while (f >= first_of(t, leaf + 1)) leaf++;
        struct gr_dipole *dipole = &t->dipole[t->n_leaves + leaf];
        for (int k = 0; k < 3; k++) {
            dipole->area[k] += 0.5 * n[k];
            dipole->at[k] += area * (v[k] + v[3 + k] + v[6 + k]) / 3;
        }
        size[t->n_leaves + leaf] += area;
    }
    for (int64_t node = t->n_leaves - 1; node > 0; node--) {
        for (int64_t child = 2 * node; child < 2 * node + 2; child++) {
            for (int k = 0; k < 3; k++) {
                t->dipole[node].area[k] += t->dipole[child].area[k];
                t->dipole[node].at[k] += t->dipole[child].at[k];
            }
            size[node] += size[child];
        }
    }
}

/* Corner 0 to 7 of a box. */
static void corner_of_box(const struct gr_triangle_box *box, int corner, double x[3])
{
    x[0] = x[1] = x[2] = 0;
    for (int k = 0; k < 3; k++)
        for (int d = 0; d < 3; d++) x[d] += (corner >> k & 1 ? box->high : box->low)[k] * box->axis[k][d];
}

/* Place and radius of a dipole in a box that is not empty. */
static void place_dipole(struct gr_dipole *dipole, const struct gr_triangle_box *box, double size)
{
    double x[8][3], middle[3] = {0}, square = 0;
    for (int corner = 0; corner < 8; corner++) {
        corner_of_box(box, corner, x[corner]);
        for (int k = 0; k < 3; k++) middle[k] += x[corner][k] / 8;
    }
    for (int k = 0; k < 3; k++) dipole->at[k] = size > 0 ? dipole->at[k] / size : middle[k];
    for (int corner = 0; corner < 8; corner++) {
        double off[3];
        for (int k = 0; k < 3; k++) off[k] = x[corner][k] - dipole->at[k];
        square = fmax(square, gr_dot(off, off));
    }
    dipole->radius = sqrt(square);
}

static void build_tree(struct gr_triangles *t, double *size)
{
    sum_areas(t, size);
    for (int64_t node = 2 * t->n_leaves - 1; node > 0; node--) {
        struct gr_triangle_box *box = &t->box[node];
        set_axes(t->dipole[node].area, box->axis);
        for (int k = 0; k < 3; k++) box->low[k] = INFINITY, box->high[k] = -INFINITY;
        const int64_t leaf = node - t->n_leaves;
        for (int64_t f = leaf < 0 ? 0 : first_of(t, leaf); leaf >= 0 && f < first_of(t, leaf + 1); f++)
            for (int i = 0; i < 3; i++) include(box, corner_of(t, f) + 3 * i);
        for (int corner = 0; node < t->n_leaves && corner < 16; corner++) {
            const struct gr_triangle_box *child = &t->box[2 * node + (corner >> 3)];
            double x[3];
            corner_of_box(child, corner & 7, x);
            if (child->low[0] <= child->high[0]) include(box, x);
        }
        if (box->low[0] <= box->high[0]) place_dipole(&t->dipole[node], box, size[node]);
    }
}

int gr_triangles_new(struct gr_triangles **out, const struct gr_triangles *tables)
{
    struct gr_triangles *t = gr_malloc(sizeof *t);
    *out = t;
    if (!t) return GR_ERR_MEMORY;
    *t = *tables;
    t->n_leaves = 1;
    while (t->n_leaves * LEAF < t->n_faces) t->n_leaves *= 2;
    t->box = gr_calloc((size_t)t->n_leaves, 2 * sizeof *t->box);
    t->dipole = gr_calloc((size_t)t->n_leaves, 2 * sizeof *t->dipole);
    t->corner = gr_malloc(sizeof *t->corner * 9 * (size_t)t->n_faces);
    double *size = gr_calloc((size_t)t->n_leaves, 2 * sizeof *size);
    struct middle *middle = gr_malloc(sizeof *middle * (size_t)t->n_faces);
    const int made = t->box && t->dipole && t->corner && size && middle;
    for (int64_t f = 0; made && f < t->n_faces; f++) {
        double v[3][3];
        corners(t, f, v);
        for (int k = 0; k < 3; k++) middle[f].at[k] = (float)((v[0][k] + v[1][k] + v[2][k]) / 3);
        middle[f].face = (int32_t)f;
    }
    if (made) put_in_order(t, middle, 0, t->n_leaves);
    for (int64_t f = 0; made && f < t->n_faces; f++) corners(t, middle[f].face, (double(*)[3])(t->corner + 9 * f));
    if (made) build_tree(t, size);
    gr_free(middle);
    gr_free(size);
    if (made) return GR_OK;
    gr_triangles_free(t);
    *out = NULL;
    return GR_ERR_MEMORY;
}

void gr_triangles_free(struct gr_triangles *t)
{
    if (!t) return;
    gr_free(t->box);
    gr_free(t->dipole);
    gr_free(t->corner);
    gr_free(t);
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

/* The nearest triangle so far. */
struct nearest {
    double square;
    int64_t place; /* of the triangle, in the order of the tree */
};

static void try_face(const struct gr_triangles *t, int64_t place, const double x[3], struct nearest *best)
{
    double at[3], square = 0;
    gr_nearest_on_triangle((const double(*)[3])corner_of(t, place), x, at);
    for (int k = 0; k < 3; k++) square += (x[k] - at[k]) * (x[k] - at[k]);
    /* equal distances: the first, so that the guess decides nothing */
    if (square > best->square || (square == best->square && place > best->place)) return;
    best->square = square, best->place = place;
}

double gr_triangles_distance(const struct gr_triangles *t, const double x[3], int64_t *guess)
{
    struct nearest best = {.square = INFINITY, .place = t->n_faces};
    int64_t waiting[DEEPEST], node = 1;
    double bound[DEEPEST];
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
    return sqrt(best.square);
}

int gr_triangles_clear(const struct gr_triangles *t, const double x[3], double radius)
{
    int64_t waiting[DEEPEST];
    int count = 0;
    const double square = radius * radius;
    struct nearest best = {.square = INFINITY, .place = t->n_faces};
    waiting[count++] = 1;
    while (count) {
        const int64_t node = waiting[--count];
        if (from_box(&t->box[node], x) >= square) continue;
        if (node < t->n_leaves) {
            const int nearer = from_box(&t->box[2 * node + 1], x) < from_box(&t->box[2 * node], x);
            waiting[count++] = 2 * node + 1 - nearer, waiting[count++] = 2 * node + nearer;
            continue;
        }
        const int64_t end = first_of(t, node - t->n_leaves + 1);
        for (int64_t f = first_of(t, node - t->n_leaves); f < end; f++) try_face(t, f, x, &best);
        if (best.square < square) return 0;
    }
    return 1;
}

/* Solid angle of a triangle from x over 4 pi, positive from behind (van Oosterom & Strackee 1983, IEEE Trans. Biomed.
 * Eng. 30). */
static double solid_angle(const double *v, const double x[3])
{
    double to[3][3], across[3], length[3];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) to[i][k] = v[3 * i + k] - x[k];
        length[i] = sqrt(gr_dot(to[i], to[i]));
    }
    gr_cross(to[1], to[2], across);
    double below = length[0] * length[1] * length[2];
    for (int i = 0; i < 3; i++) below += gr_dot(to[i], to[(i + 1) % 3]) * length[(i + 2) % 3];
    return atan2(gr_dot(to[0], across), below) / TWO_PI;
}

double gr_triangles_winding(const struct gr_triangles *t, const double x[3])
{
    int64_t waiting[DEEPEST];
    int count = 0;
    double winding = 0;
    waiting[count++] = 1;
    while (count) {
        const int64_t node = waiting[--count];
        const struct gr_dipole *dipole = &t->dipole[node];
        double off[3];
        for (int k = 0; k < 3; k++) off[k] = dipole->at[k] - x[k];
        const double square = gr_dot(off, off);
        if (square > FAR * FAR * dipole->radius * dipole->radius) {
            winding += gr_dot(dipole->area, off) / (2 * TWO_PI * square * sqrt(square));
        } else if (node < t->n_leaves) {
            waiting[count++] = 2 * node + 1, waiting[count++] = 2 * node;
        } else {
            const int64_t end = first_of(t, node - t->n_leaves + 1);
            for (int64_t f = first_of(t, node - t->n_leaves); f < end; f++) winding += solid_angle(corner_of(t, f), x);
        }
    }
    return winding;
}

void gr_triangles_distances(const struct gr_triangles *t, int64_t n, const double *x, int closed, double *distance)
{
    int64_t guess = 0;
    for (int64_t k = 0; k < n; k++) {
        const double far = gr_triangles_distance(t, x + 3 * k, &guess);
        int inside = 0;
        if (closed && k) {
            double way[3];
            for (int d = 0; d < 3; d++) way[d] = x[3 * k + d] - x[3 * (k - 1) + d];
            inside = distance[k - 1] < 0;
            /* where no surface is between a point and the one before, the sign is the same */
            const double clear = fmax(far, fabs(distance[k - 1])) * CLEAR;
            if (gr_dot(way, way) >= clear * clear) inside = gr_triangles_winding(t, x + 3 * k) > 0.5;
        } else if (closed) {
            inside = gr_triangles_winding(t, x) > 0.5;
        }
        distance[k] = inside ? -far : far;
    }
}
