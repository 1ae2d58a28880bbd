/* Signed distances of the shapes that bodies are made of (body.h). */
#include "body/body.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "body/chain.h"

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Signed distance of a point, from its signed distance `beyond` each of n pairs of parallel faces with the outward
 * normals `face`. */
static double corner_distance(int n, const double beyond[], double (*face)[3], double normal[3])
{
    int farthest = 0;
    double square = 0;
    for (int k = 0; k < n; k++) {
        if (beyond[k] > beyond[farthest]) farthest = k;
        if (beyond[k] > 0) square += beyond[k] * beyond[k];
    }
    if (!(beyond[farthest] > 0)) {
        memcpy(normal, face[farthest], 3 * sizeof(double));
        return beyond[farthest];
    }
    const double distance = sqrt(square);
    for (int d = 0; d < 3; d++) {
        normal[d] = 0;
        for (int k = 0; k < n; k++)
            if (beyond[k] > 0) normal[d] += beyond[k] / distance * face[k][d];
    }
    return distance;
}

/* Position in the axes of a part. */
static void in_part(const struct gr_part *part, const double x[3], double y[3])
{
    const double *r = part->rotation;
    for (int d = 0; d < 3; d++)
        y[d] = r[d] * (x[0] - part->center[0]) + r[3 + d] * (x[1] - part->center[1]) + r[6 + d] * (x[2] - part->center[2]);
}

static double from_axis(const double y[3]) { return sqrt(y[0] * y[0] + y[1] * y[1]); }

static double prism_distance(const struct gr_part *part, const double y[3], double normal[3])
{
    double face[2][3] = {{0}, {0, 0, y[2] < 0 ? -1 : 1}};
    const double beyond[2] = {gr_chain_distance(&part->chain, y, face[0]) - part->size[1], fabs(y[2]) - part->size[0]};
    return corner_distance(2, beyond, face, normal);
}

static double capsule_distance(const struct gr_part *part, const double y[3], double normal[3])
{
    const double *size = part->size, rest = y[2] - fmax(-size[1], fmin(y[2], size[1]));
    const double arm = sqrt(y[0] * y[0] + y[1] * y[1] + rest * rest), per_arm = arm > 0 ? 1 / arm : 0;
    normal[0] = arm > 0 ? y[0] * per_arm : 1, normal[1] = y[1] * per_arm, normal[2] = rest * per_arm;
    return arm - size[0];
}

/* Of a torus or a revolved chain: in the half-plane of the distance from the axis and the position along it. */
static double revolved_distance(const struct gr_part *part, const double y[3], double normal[3])
{
    const double radius = from_axis(y), per_radius = radius > 0 ? 1 / radius : 0;
    double n[2], distance;
    if (part->kind == GR_PART_REVOLVED) {
        distance = gr_chain_distance(&part->chain, (double[]){radius, y[2]}, n) - part->size[1];
    } else {
        const double off = radius - part->size[0], arm = sqrt(off * off + y[2] * y[2]), per_arm = arm > 0 ? 1 / arm : 0;
        distance = arm - part->size[1];
        n[0] = arm > 0 ? off * per_arm : 1, n[1] = y[2] * per_arm;
    }
    normal[0] = radius > 0 ? n[0] * y[0] * per_radius : n[0];
    normal[1] = n[0] * y[1] * per_radius;
    normal[2] = n[1];
    return distance;
}

static double box_distance(const struct gr_part *part, const double y[3], double normal[3])
{
    double beyond[3], face[3][3] = {{0}};
    for (int d = 0; d < 3; d++) {
        beyond[d] = fabs(y[d]) - part->size[d];
        face[d][d] = y[d] < 0 ? -1 : 1;
    }
    return corner_distance(3, beyond, face, normal);
}

static double cylinder_distance(const struct gr_part *part, const double y[3], double normal[3])
{
    const double radius = from_axis(y), beyond[2] = {radius - part->size[0], fabs(y[2]) - part->size[1]};
    double face[2][3] = {{radius > 0 ? y[0] / radius : 1, radius > 0 ? y[1] / radius : 0, 0}, {0, 0, y[2] < 0 ? -1 : 1}};
    return corner_distance(2, beyond, face, normal);
}

double gr_part_distance(const struct gr_part *part, const double x[3], double normal[3])
{
    const double *r = part->rotation;
    double y[3], local[3] = {0, 0, 1}, distance;
    in_part(part, x, y);
    switch (part->kind) {
    case GR_PART_HALF_SPACE:
        distance = y[2];
        break;
    case GR_PART_BOX:
        distance = box_distance(part, y, local);
        break;
    case GR_PART_CYLINDER:
        distance = cylinder_distance(part, y, local);
        break;
    case GR_PART_SAMPLED:
        distance = gr_samples_distance(&part->samples, y, local);
        break;
    case GR_PART_HEIGHT_MAP:
        distance = gr_height_map_distance(&part->map, y, local);
        break;
    case GR_PART_CAPSULE:
        distance = capsule_distance(part, y, local);
        break;
    case GR_PART_POLYGON:
        distance = prism_distance(part, y, local);
        break;
    default:
        distance = revolved_distance(part, y, local);
    }
    const double sign = part->inside ? -1 : 1;
    for (int d = 0; d < 3; d++) normal[d] = sign * dot(r + 3 * d, local);
    return sign * distance;
}

/* The edge of a point at the distances `inset` within n pairs of faces of half lengths size: near two of them. */
static int edge_of_two(int n, const double inset[], const double size[], double near)
{
    int faces = 0;
    double depth = INFINITY;
    for (int d = 0; d < n; d++) depth = fmin(depth, inset[d]);
    depth = fmax(depth, 0);
    for (int d = 0; d < n; d++) faces += inset[d] < fmin(near, 0.5 * size[d]) + depth;
    return faces > 1 ? GR_EDGE_CONVEX : 0;
}

/* Edges of a chain, or of the wall along it, which is round at its ends: sharp if it is thinner than twice `near`. */
static int chain_edges(const struct gr_part *part, const double p[2], double near)
{
    const int edges = gr_chain_edges(&part->chain, p, near);
    if (part->chain.closed || !edges) return edges;
    return GR_EDGE_CONCAVE | (part->size[1] < near ? GR_EDGE_CONVEX : 0);
}

static int shape_edges(const struct gr_part *part, const double y[3], double near)
{
    const double *size = part->size;
    double inset[3], n[2];
    switch (part->kind) {
    case GR_PART_SAMPLED:
        return gr_samples_edges(&part->samples, y, near);
    case GR_PART_HEIGHT_MAP:
        return gr_height_map_edges(&part->map, y, near);
    case GR_PART_CYLINDER:
        inset[0] = size[0] - from_axis(y), inset[1] = size[1] - fabs(y[2]);
        return edge_of_two(2, inset, size, near);
    case GR_PART_BOX:
        for (int d = 0; d < 3; d++) inset[d] = size[d] - fabs(y[d]);
        return edge_of_two(3, inset, size, near);
    case GR_PART_POLYGON: {
        inset[0] = size[1] - gr_chain_distance(&part->chain, y, n), inset[1] = size[0] - fabs(y[2]);
        const int ends = edge_of_two(2, inset, (double[]){INFINITY, size[0]}, near);
        return inset[0] > inset[1] ? ends : ends | chain_edges(part, y, near);
    }
    case GR_PART_REVOLVED:
        return chain_edges(part, (double[]){from_axis(y), y[2]}, near);
    default:
        return 0;
    }
}

int gr_part_edges(const struct gr_part *part, const double x[3], double near)
{
    double y[3];
    in_part(part, x, y);
    const int edges = shape_edges(part, y, near);
    return part->inside ? gr_edges_inverted(edges) : edges;
}

double gr_part_cover(const struct gr_part *part, double half[3])
{
    const double *size = part->size;
    memset(half, 0, 3 * sizeof(double));
    switch (part->kind) {
    case GR_PART_CYLINDER:
        half[0] = half[1] = size[0], half[2] = size[1];
        return 0;
    case GR_PART_CAPSULE:
        half[2] = size[1];
        return size[0];
    case GR_PART_TORUS:
        half[0] = half[1] = size[0];
        return size[1];
    case GR_PART_POLYGON:
    case GR_PART_REVOLVED:
        for (int k = 0; k < 2 * part->chain.n; k++) half[k % 2] = fmax(half[k % 2], fabs(part->chain.vertex[k]));
        half[2] = part->kind == GR_PART_REVOLVED ? half[1] : size[0];
        if (part->kind == GR_PART_REVOLVED) half[1] = half[0];
        return size[1];
    default:
        memcpy(half, size, 3 * sizeof(double));
        return 0;
    }
}
