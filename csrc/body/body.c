/* Geometry and motion of rigid bodies, and the contact rule (body.h). */
#include "body/body.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "core/piecewise.h"

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

void gr_rotation_matrix(const double o[4], double matrix[9])
{
    const double w = o[0], x = o[1], y = o[2], z = o[3];
    const double m[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                         2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                         2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    memcpy(matrix, m, sizeof m);
}

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

double gr_part_distance(const struct gr_part *part, const double x[3], double normal[3])
{
    const double *r = part->rotation, *size = part->size;
    double y[3], local[3], face[3][3] = {{0}}, distance;
    for (int d = 0; d < 3; d++)
        y[d] = r[d] * (x[0] - part->center[0]) + r[3 + d] * (x[1] - part->center[1]) + r[6 + d] * (x[2] - part->center[2]);
    if (part->kind == GR_PART_HALF_SPACE) {
        local[0] = local[1] = 0, local[2] = 1;
        distance = y[2];
    } else if (part->kind == GR_PART_SAMPLED) {
        distance = gr_samples_distance(&part->samples, y, local);
    } else if (part->kind == GR_PART_HEIGHT_MAP) {
        distance = gr_height_map_distance(&part->map, y, local);
    } else if (part->kind == GR_PART_CYLINDER) {
        const double radius = sqrt(y[0] * y[0] + y[1] * y[1]);
        const double beyond[2] = {radius - size[0], fabs(y[2]) - size[1]};
        face[0][0] = radius > 0 ? y[0] / radius : 1;
        face[0][1] = radius > 0 ? y[1] / radius : 0;
        face[1][2] = y[2] < 0 ? -1 : 1;
        distance = corner_distance(2, beyond, face, local);
    } else {
        double beyond[3];
        for (int d = 0; d < 3; d++) {
            beyond[d] = fabs(y[d]) - size[d];
            face[d][d] = y[d] < 0 ? -1 : 1;
        }
        distance = corner_distance(3, beyond, face, local);
    }
    const double sign = part->inside ? -1 : 1;
    for (int d = 0; d < 3; d++) normal[d] = sign * dot(r + 3 * d, local);
    return sign * distance;
}

/* True if a place at the distances `inset` within n pairs of faces of half lengths size is near an edge: near two of them. */
static int is_near_two(int n, const double inset[], const double size[], double near)
{
    int faces = 0;
    for (int d = 0; d < n; d++) faces += inset[d] < fmin(near, 0.5 * size[d]);
    return faces > 1;
}

int gr_part_edge_near(const struct gr_part *part, const double x[3], double near)
{
    const double *r = part->rotation, *size = part->size;
    double y[3], inset[3];
    for (int d = 0; d < 3; d++)
        y[d] = r[d] * (x[0] - part->center[0]) + r[3 + d] * (x[1] - part->center[1]) + r[6 + d] * (x[2] - part->center[2]);
    if (part->kind == GR_PART_HALF_SPACE || part->inside) return 0;
    if (part->kind == GR_PART_SAMPLED) return gr_samples_edge_near(&part->samples, y, near);
    if (part->kind == GR_PART_HEIGHT_MAP) return gr_height_map_edge_near(&part->map, y, near);
    if (part->kind == GR_PART_CYLINDER) {
        inset[0] = size[0] - sqrt(y[0] * y[0] + y[1] * y[1]), inset[1] = size[1] - fabs(y[2]);
        return is_near_two(2, inset, size, near);
    }
    for (int d = 0; d < 3; d++) inset[d] = size[d] - fabs(y[d]);
    return is_near_two(3, inset, size, near);
}

int gr_union_edge_near(const struct gr_part *parts, int n, const double x[3], double near)
{
    double nearest = INFINITY, normal[3];
    int part = 0;
    for (int k = 0; k < n; k++) {
        const double distance = gr_part_distance(parts + k, x, normal);
        if (!(distance < nearest)) continue;
        nearest = distance;
        part = k;
    }
    return gr_part_edge_near(parts + part, x, near);
}

double gr_union_distance(const struct gr_part *parts, int n, const double x[3], double normal[3])
{
    double nearest = gr_part_distance(parts, x, normal);
    for (int k = 1; k < n; k++) {
        double other[3];
        const double distance = gr_part_distance(parts + k, x, other);
        if (!(distance < nearest)) continue;
        nearest = distance;
        memcpy(normal, other, sizeof other);
    }
    return nearest;
}

double gr_part_bound(const struct gr_part *part, int dim)
{
    if (part->inside || part->kind == GR_PART_HALF_SPACE || part->kind == GR_PART_HEIGHT_MAP) return INFINITY;
    double square = part->size[0] * part->size[0];
    const int sizes = part->kind == GR_PART_CYLINDER ? dim - 1 : dim;
    for (int k = 1; k < sizes; k++) square += part->size[k] * part->size[k];
    return sqrt(dot(part->center, part->center)) + sqrt(square);
}

/* Speed of a material point of the body; r is in body coordinates. */
static double speed_at(const double rotation[9], const double r[3], const double v[3], const double w[3])
{
    double a[3], u[3];
    for (int d = 0; d < 3; d++) a[d] = rotation[3 * d] * r[0] + rotation[3 * d + 1] * r[1] + rotation[3 * d + 2] * r[2];
    u[0] = v[0] + w[1] * a[2] - w[2] * a[1];
    u[1] = v[1] + w[2] * a[0] - w[0] * a[2];
    u[2] = v[2] + w[0] * a[1] - w[1] * a[0];
    return sqrt(dot(u, u));
}

/* The speed is a convex function of position: its maximum over a box is at a corner, and a cylinder lies in a box. */
double gr_largest_speed(const struct gr_body *body, const struct gr_part *parts, const double orientation[4],
                        const double v[3], const double omega[3], double far)
{
    double rotation[9], fastest = 0;
    gr_rotation_matrix(orientation, rotation);
    if (!(body->bound < far)) return sqrt(dot(v, v)) + sqrt(dot(omega, omega)) * far;
    for (int k = 0; k < body->n_parts; k++) {
        const struct gr_part *part = parts + k;
        const int cylinder = part->kind == GR_PART_CYLINDER;
        const double size[3] = {part->size[0], part->size[cylinder ? 0 : 1], part->size[cylinder ? 1 : 2]};
        for (int corner = 0; corner < 8; corner++) {
            double r[3] = {part->center[0], part->center[1], part->center[2]};
            for (int j = 0; j < 3; j++)
                for (int d = 0; isfinite(size[j]) && d < 3; d++)
                    r[d] += (corner >> j & 1 ? size[j] : -size[j]) * part->rotation[3 * d + j];
            fastest = fmax(fastest, speed_at(rotation, r, v, omega));
        }
    }
    return fastest;
}

void gr_motion_at(const struct gr_body *body, double t, double out[6])
{
    gr_piecewise(6, body->n_motion, body->motion, 7, body->motion + 1, 7, t, out);
}

void gr_motion_mean(const struct gr_body *body, double begin, double length, double out[6])
{
    const double end = begin + length;
    double from = begin;
    memset(out, 0, 6 * sizeof(double));
    for (int k = 0; k <= body->n_motion && from < end; k++) { /* the interval that ends with row k */
        const double to = k < body->n_motion ? fmin(body->motion[7 * k], end) : end;
        double middle[6];
        if (!(to > from)) continue;
        gr_motion_at(body, from + (to - from) / 2, middle); /* linear in this interval: the mean */
        for (int c = 0; c < 6; c++) out[c] += (to - from) / length * middle[c];
        from = to;
    }
}

void gr_turn(const double o[4], const double omega[3], double dt, double out[4])
{
    const double rate = sqrt(dot(omega, omega)), half = rate * dt / 2;
    const double share = rate > 0 ? sin(half) / rate : 0;
    const double w = cos(half), x = share * omega[0], y = share * omega[1], z = share * omega[2];
    const double turned[4] = {w * o[0] - x * o[1] - y * o[2] - z * o[3], w * o[1] + x * o[0] + y * o[3] - z * o[2],
                              w * o[2] - x * o[3] + y * o[0] + z * o[1], w * o[3] + x * o[2] - y * o[1] + z * o[0]};
    double norm = 0;
    for (int k = 0; k < 4; k++) norm += turned[k] * turned[k];
    for (int k = 0; k < 4; k++) out[k] = turned[k] / sqrt(norm);
}

int gr_contact(const struct gr_body *body, const double n[3], const double surface[3], double v[3])
{
    double u[3], keep = 0;
    for (int d = 0; d < 3; d++) u[d] = v[d] - surface[d];
    if (body->contact != GR_CONTACT_STICKY) {
        const double into = dot(u, n);
        if (body->contact == GR_CONTACT_SEPARATING && !(into < 0)) return 0;
        for (int d = 0; d < 3; d++) u[d] -= into * n[d];
        const double sliding = sqrt(dot(u, u)), lost = body->friction * fabs(into);
        keep = lost < sliding ? 1 - lost / sliding : body->friction > 0 ? 0 : 1;
    }
    for (int d = 0; d < 3; d++) v[d] = surface[d] + keep * u[d];
    return keep > 0 ? 1 : 2;
}
