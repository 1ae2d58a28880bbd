/* Bodies of several parts: unions, intersections and other operations on signed distances (body.h). */
#include <math.h>
#include <string.h>

#include "body/body.h"

static int is_operation(const struct gr_part *part) { return part->kind >= GR_PART_UNION; }

/* Number of results that a part takes. */
static int operands(const struct gr_part *part)
{
    if (!is_operation(part)) return 0;
    return part->kind == GR_PART_UNION || part->kind == GR_PART_INTERSECTION ? part->operands : 1;
}

int gr_parts_lack_operands(const struct gr_part *parts, int n)
{
    int results = 0;
    for (int k = 0; k < n; k++) {
        const int taken = operands(parts + k);
        if (taken > results || (is_operation(parts + k) && taken < 1)) return 1;
        results += 1 - taken;
    }
    return 0;
}

int gr_part_is_whole(const struct gr_part *parts, int n, int k)
{
    int wanted = 0; /* by the operations behind */
    for (int j = n - 1; j > k; j--) wanted += operands(parts + j) - (wanted > 0);
    return wanted == 0;
}

struct result {
    double distance, normal[3];
    int edges;
};

static void invert(struct result *r)
{
    r->distance = -r->distance;
    for (int d = 0; d < 3; d++) r->normal[d] = -r->normal[d];
    r->edges = gr_edges_inverted(r->edges);
}

/* The least (sign = -1) or greatest of n distances. An edge is nearer than `near` along the surface if the other surface
 * is, taken for a plane: the distances differ by less than the sine of the angle between them. */
static inline struct result extreme(const struct result *r, int n, double sign, double near)
{
    int best = 0, edge = 0;
    for (int k = 1; k < n; k++)
        if (sign * r[k].distance > sign * r[best].distance) best = k;
    for (int k = 0; near >= 0 && k < n; k++) {
        const double *a = r[best].normal, *b = r[k].normal, cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        const double sine = sqrt(fmax(1 - cosine * cosine, 0));
        edge |= k != best && fabs(r[best].distance - r[k].distance) < near * sine;
    }
    struct result out = r[best];
    if (edge) out.edges |= sign > 0 ? GR_EDGE_CONVEX : GR_EDGE_CONCAVE;
    return out;
}

/* The result of an operation on the last results. Convex edges of shapes become round where a surface moves outwards. */
static inline struct result operate(const struct gr_part *part, const struct result *last, double near)
{
    const int n = part->operands, of_shape = !is_operation(part - 1);
    const double size = part->size[0];
    struct result out = *last;
    switch (part->kind) {
    case GR_PART_UNION:
        return extreme(last - n + 1, n, -1, near);
    case GR_PART_INTERSECTION:
        return extreme(last - n + 1, n, 1, near);
    case GR_PART_OFFSET:
        out.distance -= size;
        if (of_shape && size >= near) out.edges &= ~GR_EDGE_CONVEX;
        return out;
    default: /* a shell, between the surface and that at twice its half thickness */
        if (out.distance < size) {
            invert(&out);
            return out;
        }
        out.distance -= 2 * size;
        if (of_shape && 2 * size >= near) out.edges &= ~GR_EDGE_CONVEX;
        return out;
    }
}

/* Distance, normal and edges of a body; edges only if `near` is not negative. */
__attribute__((noinline)) static struct result evaluate(const struct gr_part *parts, int n, const double x[3], double near)
{
    struct result result[GR_MAX_PARTS];
    int count = 0;
    for (int k = 0; k < n; k++) {
        struct result *out = &result[count];
        if (is_operation(parts + k)) {
            out -= operands(parts + k);
            *out = operate(parts + k, &result[count - 1], near);
            if (parts[k].inside) invert(out);
            count = (int)(out - result) + 1;
            continue;
        }
        out->distance = gr_part_distance(parts + k, x, out->normal);
        out->edges = near >= 0 ? gr_part_edges(parts + k, x, near) : 0;
        count++;
    }
    return count == 1 ? result[0] : extreme(result, count, -1, near);
}

static int has_operations(const struct gr_part *parts, int n)
{
    for (int k = 1; k < n; k++)
        if (is_operation(parts + k)) return 1;
    return 0;
}

/* Distance and normal of the union of n shapes. Bodies without operations are the most frequent. */
static double nearest(const struct gr_part *parts, int n, const double x[3], double normal[3], int *part)
{
    double least = gr_part_distance(parts, x, normal);
    *part = 0;
    for (int k = 1; k < n; k++) {
        double other[3];
        const double distance = gr_part_distance(parts + k, x, other);
        if (!(distance < least)) continue;
        least = distance;
        *part = k;
        memcpy(normal, other, sizeof other);
    }
    return least;
}

double gr_union_distance(const struct gr_part *parts, int n, const double x[3], double normal[3])
{
    int part;
    if (!has_operations(parts, n)) return nearest(parts, n, x, normal, &part);
    const struct result out = evaluate(parts, n, x, -1);
    memcpy(normal, out.normal, sizeof out.normal);
    return out.distance;
}

int gr_union_edge_near(const struct gr_part *parts, int n, const double x[3], double near)
{
    double normal[3];
    int part;
    if (has_operations(parts, n)) return evaluate(parts, n, x, near).edges & GR_EDGE_CONVEX;
    nearest(parts, n, x, normal, &part);
    return gr_part_edges(parts + part, x, near) & GR_EDGE_CONVEX;
}

/* Bounds of a convex function in a solid and in the rest. */
struct bounds {
    double solid, rest;
};

/* Bound in a body of a convex function which grows by `growth` a metre at most, from its bounds in boxes. */
static double bound(const struct gr_part *parts, int n, double growth,
                    double (*in_box)(const struct gr_part *, const void *), const void *context)
{
    struct bounds stack[GR_MAX_PARTS];
    double largest = 0;
    int count = 0;
    for (int k = 0; k < n; k++) {
        const struct gr_part *part = parts + k;
        struct bounds out = {INFINITY, INFINITY};
        if (!is_operation(part) && part->kind != GR_PART_HALF_SPACE && part->kind != GR_PART_HEIGHT_MAP)
            out.solid = in_box(part, context);
        if (is_operation(part)) {
            const double size = part->size[0];
            out = stack[--count];
            for (int j = 1; j < operands(part); j++) {
                const struct bounds other = stack[--count];
                const int both = part->kind == GR_PART_UNION;
                out.solid = both ? fmax(out.solid, other.solid) : fmin(out.solid, other.solid);
                out.rest = both ? fmin(out.rest, other.rest) : fmax(out.rest, other.rest);
            }
            if (part->kind == GR_PART_OFFSET) out.solid += growth * size;
            if (part->kind == GR_PART_SHELL) out = (struct bounds){fmin(out.solid + 2 * growth * size, out.rest), INFINITY};
        }
        if (part->inside) out = (struct bounds){out.rest, out.solid};
        stack[count++] = out;
    }
    for (int k = 0; k < count; k++) largest = fmax(largest, stack[k].solid);
    return largest;
}

static double radius_of(const struct gr_part *part, const void *context)
{
    const int dim = *(const int *)context;
    const int round = part->kind != GR_PART_BOX && part->kind != GR_PART_SAMPLED && part->kind != GR_PART_POLYGON;
    const double *c = part->center;
    double half[3];
    const double beyond = gr_part_cover(part, half);
    double square = half[0] * half[0];
    if (!round) square += half[1] * half[1];
    if (dim == 3 || isfinite(half[2])) square += half[2] * half[2];
    return sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) + sqrt(square) + beyond;
}

double gr_union_bound(const struct gr_part *parts, int n, int dim) { return bound(parts, n, 1, radius_of, &dim); }

/* Motion of a body at one time. */
struct moving {
    double rotation[9];
    const double *v, *omega;
};

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double length(const double a[3]) { return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]); }

static void turned(const double rotation[9], const double r[3], double out[3])
{
    for (int d = 0; d < 3; d++) out[d] = rotation[3 * d] * r[0] + rotation[3 * d + 1] * r[1] + rotation[3 * d + 2] * r[2];
}

/* Largest speed in the box about a part, which is at a corner. An endless part has none unless it turns about itself. */
static double speed_of(const struct gr_part *part, const void *context)
{
    const struct moving *m = context;
    double half[3], fastest = 0;
    const double beyond = gr_part_cover(part, half);
    for (int j = 0; j < 3; j++) {
        const double axis[3] = {part->rotation[j], part->rotation[3 + j], part->rotation[6 + j]};
        double at[3], u[3];
        if (isfinite(half[j])) continue;
        turned(m->rotation, axis, at);
        cross(m->omega, at, u);
        if (length(u) > 0) return INFINITY;
        half[j] = 0;
    }
    for (int corner = 0; corner < 8; corner++) {
        double r[3] = {part->center[0], part->center[1], part->center[2]}, at[3], u[3];
        for (int j = 0; j < 3; j++)
            for (int d = 0; d < 3; d++) r[d] += (corner >> j & 1 ? half[j] : -half[j]) * part->rotation[3 * d + j];
        turned(m->rotation, r, at);
        for (int d = 0; d < 3; d++) {
            const int p = (d + 1) % 3, q = (d + 2) % 3;
            u[d] = m->v[d] + m->omega[p] * at[q] - m->omega[q] * at[p];
        }
        fastest = fmax(fastest, length(u));
    }
    return fastest + length(m->omega) * beyond;
}

double gr_largest_speed(const struct gr_body *body, const struct gr_part *parts, const double orientation[4],
                        const double v[3], const double omega[3], double far)
{
    struct moving m = {.v = v, .omega = omega};
    gr_rotation_matrix(orientation, m.rotation);
    if (!(body->bound < far)) return length(v) + length(omega) * far;
    return bound(parts, body->n_parts, length(omega), speed_of, &m);
}

/* True if two vectors have one direction, or opposite ones, or one is zero; to the round-off of many steps. */
static int are_parallel(const double a[3], const double b[3])
{
    double cross = 0, aa = 0, bb = 0;
    for (int d = 0; d < 3; d++) {
        const double c = a[(d + 1) % 3] * b[(d + 2) % 3] - a[(d + 2) % 3] * b[(d + 1) % 3];
        cross += c * c, aa += a[d] * a[d], bb += b[d] * b[d];
    }
    return cross <= 1e-18 * aa * bb;
}

int gr_union_is_round(const struct gr_part *parts, int n, const double axis[3])
{
    for (int k = 0; k < n; k++) {
        const double *r = parts[k].rotation, of_part[3] = {r[2], r[5], r[8]};
        const int kind = parts[k].kind;
        const int round =
            kind == GR_PART_CYLINDER || kind == GR_PART_CAPSULE || kind == GR_PART_TORUS || kind == GR_PART_REVOLVED;
        if (is_operation(parts + k)) continue;
        if (!round || !are_parallel(of_part, axis) || !are_parallel(parts[k].center, axis)) return 0;
    }
    return 1;
}
