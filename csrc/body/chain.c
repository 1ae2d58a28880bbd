/* Signed distance from chains of straight segments (chain.h). */
#include "body/chain.h"

#include <math.h>

#include "body/body.h"

/* Sines of smaller turns are round-off: the two segments lie on one line. */
#define STRAIGHT 1e-9

/* The point of a chain that is nearest to another point: on a segment, or at the vertex before or behind it. */
struct place {
    int segment, vertex; /* vertex: -1 on the segment */
};

static const double *vertex(const struct gr_chain *c, int k) { return c->vertex + 2 * (k < c->n ? k : k - c->n); }

static int is_on_axis(const struct gr_chain *c, const double *a, const double *b)
{
    return c->revolved && a[0] == 0 && b[0] == 0;
}

/* Squares of distances are compared as fractions, num/den, without a division. */
static struct place nearest(const struct gr_chain *c, const double p[2])
{
    const double *a = vertex(c, c->closed ? c->n - 1 : 0);
    struct place best = {0, 0};
    double least = INFINITY, over = 1;
    for (int k = c->closed ? 0 : 1; k < c->n; k++) { /* the segment from a to the vertex k */
        const double *b = c->vertex + 2 * k, *from = a;
        const double e[2] = {b[0] - a[0], b[1] - a[1]}, w[2] = {p[0] - a[0], p[1] - a[1]};
        const double u[2] = {p[0] - b[0], p[1] - b[1]}, across = e[0] * w[1] - e[1] * w[0];
        const double along = w[0] * e[0] + w[1] * e[1], whole = e[0] * e[0] + e[1] * e[1];
        const double from_end = along > 0 ? u[0] * u[0] + u[1] * u[1] : w[0] * w[0] + w[1] * w[1];
        const int within = along > 0 && along < whole;
        const double num = within ? across * across : from_end, den = within ? whole : 1;
        a = b;
        if (!(num * over < least * den) || is_on_axis(c, from, b)) continue;
        least = num, over = den;
        best.segment = k ? k - 1 : c->n - 1;
        best.vertex = within ? -1 : along > 0 ? k : best.segment;
    }
    return best;
}

static double length(const double a[2]) { return sqrt(a[0] * a[0] + a[1] * a[1]); }

/* The segments before and after a vertex, as vectors. On the axis the chain goes on as its mirror image, at an open end
 * straight on. */
static void segments_at(const struct gr_chain *c, int k, double before[2], double after[2])
{
    const double *at = vertex(c, k), *from = vertex(c, k + c->n - 1), *to = vertex(c, k + 1);
    const int has_before = (c->closed || k % c->n > 0) && !is_on_axis(c, from, at);
    const int has_after = (c->closed || k % c->n < c->n - 1) && !is_on_axis(c, at, to);
    const int mirrored = c->revolved && at[0] == 0;
    before[0] = after[0] = 1, before[1] = after[1] = 0;
    for (int d = 0; d < 2; d++) {
        if (has_before) before[d] = at[d] - from[d];
        if (has_after) after[d] = to[d] - at[d];
    }
    if (!has_before) before[0] = after[0], before[1] = mirrored ? -after[1] : after[1];
    if (!has_after) after[0] = before[0], after[1] = mirrored ? -before[1] : before[1];
}

double gr_chain_distance(const struct gr_chain *c, const double p[2], double normal[2])
{
    const struct place place = nearest(c, p);
    const double *at = vertex(c, place.vertex < 0 ? place.segment : place.vertex);
    const double out[2] = {p[0] - at[0], p[1] - at[1]};
    if (place.vertex < 0) {
        const double *b = vertex(c, place.segment + 1), e[2] = {b[0] - at[0], b[1] - at[1]};
        const double per_length = 1 / length(e), right = (out[0] * e[1] - out[1] * e[0]) * per_length;
        const double sign = !c->closed && right < 0 ? -1 : 1;
        normal[0] = sign * per_length * e[1], normal[1] = -sign * per_length * e[0];
        return sign * right;
    }
    double before[2], after[2]; /* the sign is that of the sum of the two unit normals */
    segments_at(c, place.vertex, before, after);
    const double first = length(before), second = length(after), distance = length(out);
    const double mean[2] = {before[1] * second + after[1] * first, -before[0] * second - after[0] * first};
    const double sign = c->closed && mean[0] * out[0] + mean[1] * out[1] < 0 ? -1 : 1;
    const double *along = distance > 0 ? out : mean, norm = distance > 0 ? distance : length(mean);
    normal[0] = norm > 0 ? (distance > 0 ? sign : 1) * along[0] / norm : 1;
    normal[1] = norm > 0 ? (distance > 0 ? sign : 1) * along[1] / norm : 0;
    return sign * distance;
}

static int edges_at(const struct gr_chain *c, int k)
{
    double before[2], after[2];
    if (!c->closed && k % (c->n - 1) == 0 && !(c->revolved && vertex(c, k)[0] == 0)) return GR_EDGE_CONVEX;
    segments_at(c, k, before, after);
    const double turn = before[0] * after[1] - before[1] * after[0], least = STRAIGHT * length(before) * length(after);
    if (turn > least) return GR_EDGE_CONVEX;
    return turn < -least ? GR_EDGE_CONCAVE : 0;
}

int gr_chain_edges(const struct gr_chain *c, const double p[2], double near)
{
    const struct place place = nearest(c, p);
    const double *a = vertex(c, place.segment), *b = vertex(c, place.segment + 1);
    const double e[2] = {b[0] - a[0], b[1] - a[1]}, w[2] = {p[0] - a[0], p[1] - a[1]}, whole = length(e);
    const double along = (w[0] * e[0] + w[1] * e[1]) / whole, across = (w[0] * e[1] - w[1] * e[0]) / whole;
    const double reach = fmin(near, 0.25 * whole) + (place.vertex < 0 ? fabs(across) : 0);
    int edges = place.vertex < 0 ? 0 : edges_at(c, place.vertex);
    if (!(along > reach)) edges |= edges_at(c, place.segment);
    if (!(whole - along > reach)) edges |= edges_at(c, place.segment + 1);
    return edges;
}
