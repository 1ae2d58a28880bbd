/* Signed distance from chains of straight segments (chain.h). */
#include "body/chain.h"

#include <math.h>

#include "body/body.h"

/* Sines of smaller turns are round-off: the two segments lie on one line. */
#define STRAIGHT 1e-9

/* The place of a chain that is nearest to a point. */
struct place {
    int segment;
    double share;  /* of the segment before it, 0 to 1 */
    double out[2]; /* from there to the point */
    double square; /* of the distance */
};

static const double *vertex(const struct gr_chain *c, int k) { return c->vertex + 2 * (k < c->n ? k : k - c->n); }

static int is_on_axis(const struct gr_chain *c, const double *a, const double *b)
{
    return c->revolved && a[0] == 0 && b[0] == 0;
}

static struct place nearest(const struct gr_chain *c, const double p[2])
{
    struct place best = {.square = INFINITY};
    const int last = c->closed ? 0 : 1;
    const double *a = vertex(c, c->closed ? c->n - 1 : 0);
    for (int k = last; k < c->n; k++) { /* the segment from a to the vertex k */
        const double *b = c->vertex + 2 * k, e[2] = {b[0] - a[0], b[1] - a[1]}, w[2] = {p[0] - a[0], p[1] - a[1]};
        const double along = (w[0] * e[0] + w[1] * e[1]) / (e[0] * e[0] + e[1] * e[1]);
        const double share = along > 0 ? (along < 1 ? along : 1) : 0;
        const double out[2] = {w[0] - share * e[0], w[1] - share * e[1]}, square = out[0] * out[0] + out[1] * out[1];
        if (square < best.square && !is_on_axis(c, a, b))
            best = (struct place){k ? k - 1 : c->n - 1, share, {out[0], out[1]}, square};
        a = b;
    }
    return best;
}

static void direction(const double *a, const double *b, double out[2])
{
    const double x = b[0] - a[0], y = b[1] - a[1], length = sqrt(x * x + y * y);
    out[0] = x / length, out[1] = y / length;
}

/* Directions of the segments before and after a vertex. On the axis the chain goes on as its mirror image, at an open end
 * straight on. */
static void directions_at(const struct gr_chain *c, int k, double before[2], double after[2])
{
    const double *at = vertex(c, k), *from = vertex(c, k + c->n - 1), *to = vertex(c, k + 1);
    const int has_before = (c->closed || k % c->n > 0) && !is_on_axis(c, from, at);
    const int has_after = (c->closed || k % c->n < c->n - 1) && !is_on_axis(c, at, to);
    const int mirrored = c->revolved && at[0] == 0;
    before[0] = after[0] = 1, before[1] = after[1] = 0;
    if (has_before) direction(from, at, before);
    if (has_after) direction(at, to, after);
    if (!has_before) before[0] = after[0], before[1] = mirrored ? -after[1] : after[1];
    if (!has_after) after[0] = before[0], after[1] = mirrored ? -before[1] : before[1];
}

double gr_chain_distance(const struct gr_chain *c, const double p[2], double normal[2])
{
    const struct place place = nearest(c, p);
    if (place.share > 0 && place.share < 1) {
        double along[2];
        direction(vertex(c, place.segment), vertex(c, place.segment + 1), along);
        const double right = place.out[0] * along[1] - place.out[1] * along[0];
        const double sign = !c->closed && right < 0 ? -1 : 1;
        normal[0] = sign * along[1], normal[1] = -sign * along[0];
        return sign * right;
    }
    double before[2], after[2];
    directions_at(c, place.segment + (place.share > 0), before, after);
    const double mean[2] = {before[1] + after[1], -before[0] - after[0]}, distance = sqrt(place.square);
    const double sign = c->closed && mean[0] * place.out[0] + mean[1] * place.out[1] < 0 ? -1 : 1;
    if (distance > 0) {
        for (int d = 0; d < 2; d++) normal[d] = sign * place.out[d] / distance;
    } else {
        const double length = sqrt(mean[0] * mean[0] + mean[1] * mean[1]);
        normal[0] = length > 0 ? mean[0] / length : 1, normal[1] = length > 0 ? mean[1] / length : 0;
    }
    return sign * distance;
}

static int edges_at(const struct gr_chain *c, int k)
{
    double before[2], after[2];
    if (!c->closed && k % (c->n - 1) == 0 && !(c->revolved && vertex(c, k)[0] == 0)) return GR_EDGE_CONVEX;
    directions_at(c, k, before, after);
    const double turn = before[0] * after[1] - before[1] * after[0];
    if (turn > STRAIGHT) return GR_EDGE_CONVEX;
    return turn < -STRAIGHT ? GR_EDGE_CONCAVE : 0;
}

int gr_chain_edges(const struct gr_chain *c, const double p[2], double near)
{
    const struct place place = nearest(c, p);
    const double *a = vertex(c, place.segment), *b = vertex(c, place.segment + 1);
    const double length = sqrt((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1]));
    const double reach = fmin(near, 0.25 * length) + sqrt(place.square);
    int edges = 0;
    if (!(place.share * length > reach)) edges |= edges_at(c, place.segment);
    if (!((1 - place.share) * length > reach)) edges |= edges_at(c, place.segment + 1);
    return edges;
}
