/* What bodies take of the volume of the nodes near their surface (open_volume.h). */
#include "mpm/open_volume.h"

#include <math.h>
#include <stdlib.h>

#include "core/memory.h"
#include "mpm/pose.h"
#include "mpm/solid_cells.h"
#include "mpm/thin_bodies.h"

/* Cells deeper in a body than this, in cells, have no node that material reaches: it is never deeper than a quarter. */
#define DEEP 4.0

/* Subdivisions of a cut cell along each axis. */
enum { PARTS_2D = 8, PARTS_3D = 4, MOST_PARTS = 8 };

int gr_open_volume_new(struct gr_engine *e, int64_t n_cells, int64_t n_nodes)
{
    e->bodies.open = gr_calloc(1, sizeof *e->bodies.open);
    if (!e->bodies.open) return GR_ERR_MEMORY;
    return gr_table_new(&e->bodies.open->place, n_nodes) || gr_table_new(&e->bodies.open->part_of, n_cells) ? GR_ERR_MEMORY
                                                                                                            : GR_OK;
}

void gr_open_volume_free(struct gr_open_volume *open)
{
    if (!open) return;
    gr_table_free(&open->place);
    gr_table_free(&open->part_of);
    gr_free(open->part);
    gr_free(open->solid);
    gr_free(open->slope);
    gr_free(open->id);
    gr_free(open);
}

/* Signed distance from the nearest body, and its normal. */
static double distance(const struct gr_engine *e, const struct gr_pose *pose, const double x[3], double normal[3])
{
    double nearest = INFINITY;
    for (int b = 0; b < e->config.n_bodies; b++) {
        double arm[3], n[3];
        const double phi = gr_pose_distance(e, &pose[b], x, arm, n);
        if (!(phi < nearest)) continue;
        nearest = phi;
        memcpy(normal, n, sizeof n);
    }
    return nearest;
}

/* Place of a node, a new one if it has none; -1 without memory. */
static int64_t place_of(struct gr_engine *e, int64_t id)
{
    struct gr_open_volume *open = e->bodies.open;
    const int dim = e->config.dim;
    int64_t k = gr_open_place(open, id);
    if (k >= 0) return k;
    if (open->n == open->capacity) {
        const int64_t n = 2 * open->capacity + 256;
        void *solid = gr_realloc(open->solid, sizeof(double) * (size_t)n);
        if (solid) open->solid = solid;
        void *slope = gr_realloc(open->slope, sizeof(double) * (size_t)(n * dim));
        if (slope) open->slope = slope;
        void *ids = gr_realloc(open->id, sizeof(int64_t) * (size_t)n);
        if (ids) open->id = ids;
        if (!solid || !slope || !ids) return -1;
        open->capacity = n;
    }
    k = open->n++;
    open->id[k] = id;
    open->solid[k] = 0;
    for (int d = 0; d < dim; d++) open->slope[k * dim + d] = 0;
    return gr_table_set(&open->place, id, (int32_t)(k + 1)) ? -1 : k;
}

/* Solid share of each part of a cell; the normal is n where the distance is linear. */
static void solid_parts(const struct gr_engine *e, const struct gr_pose *pose, const int32_t at[3], int parts, double *share)
{
    const int dim = e->config.dim, parts_z = dim == 3 ? parts : 1;
    const double size = e->config.dx / parts;
    for (int k = 0; k < parts_z; k++)
        for (int j = 0; j < parts; j++)
            for (int i = 0; i < parts; i++) {
                const double part[3] = {i + 0.5, j + 0.5, k + 0.5};
                double x[3] = {0}, n[3] = {0}, width = 0;
                for (int d = 0; d < dim; d++) x[d] = e->axis[d].cell[at[d]].edge + part[d] * size;
                const double phi = distance(e, pose, x, n);
                for (int d = 0; d < dim; d++) width += fabs(n[d]);
                *share++ = fmax(0, fmin(1, 0.5 - phi / (size * width)));
            }
}

/* Keep the open part of a cell, from the solid shares of n equal parts of it. */
static int keep_open_part(struct gr_engine *e, const int32_t at[3], int n, const double *share)
{
    struct gr_open_volume *open = e->bodies.open;
    struct gr_open_part sum = {0};
    if (open->n_parts == open->part_capacity) {
        GR_RESIZE(open->part, 2 * open->part_capacity + 64);
        open->part_capacity = 2 * open->part_capacity + 64;
    }
    const double radius = e->axis[0].cell[at[0]].radius;
    for (int p = 0; p < (e->config.dim == 2 ? n * n : n * n * n); p++) {
        const int of[3] = {p % n, p / n % n, p / (n * n)};
        const double ring = e->config.axisymmetric ? 1 + ((of[0] + 0.5) / n - 0.5) / radius : 1;
        sum.volume += (1 - share[p]) * ring;
        for (int d = 0; d < 3; d++) sum.centre[d] += (1 - share[p]) * ring * (of[d] + 0.5) / n;
    }
    for (int d = 0; d < 3; d++) sum.centre[d] = sum.volume > 0 ? sum.centre[d] / sum.volume : 0.5;
    sum.volume /= pow(n, e->config.dim);
    open->part[open->n_parts++] = sum;
    return gr_table_set(&open->part_of, gr_cell_id(e, at), (int32_t)open->n_parts);
}

/* c0 x + c1 x^2/2 + c2 x^3/3, the integral of a function along an axis. */
static double antiderivative(const double *c, double x) { return x * (c[0] + x * (c[1] / 2 + x * c[2] / 3)); }

/* c0 x^2/2 + c1 x^3/3 + c2 x^4/4, that of the function times x. */
static double moment(const double *c, double x) { return x * x * (c[0] / 2 + x * (c[1] / 3 + x * c[2] / 4)); }

/* Integrals over a part of a cell of the shape functions of one axis, and of their derivatives; over rings, from the radius
 * r of the edge of the cell on in cells, of the functions times the radius, N r and (N r)'. */
static void integrate_1d(const struct gr_axis_cell *cell, int nodes, double from, double to, const double *r,
                         double value[3], double slope[3])
{
    for (int a = 0; a < nodes; a++) {
        const double *c = cell->coefficient[a];
        value[a] = antiderivative(c, to) - antiderivative(c, from);
        slope[a] = to * (c[1] + to * c[2]) - from * (c[1] + from * c[2]);
        if (!r) continue;
        const double plane = value[a];
        value[a] = *r * plane + moment(c, to) - moment(c, from);
        slope[a] = (*r + to) * (c[0] + to * (c[1] + to * c[2])) - (*r + from) * (c[0] + from * (c[1] + from * c[2]));
    }
}

/* Add the solid part of a cell to its nodes. A cell that is `whole` in the solid is one part. */
static int add_cell(struct gr_engine *e, const struct gr_pose *pose, const int32_t at[3], int whole)
{
    const int dim = e->config.dim, k = gr_basis_nodes_1d(e->config.basis);
    const int parts = whole ? 1 : dim == 2 ? PARTS_2D : PARTS_3D;
    double share[MOST_PARTS * MOST_PARTS], value[3][MOST_PARTS][3], slope[3][MOST_PARTS][3]; /* 8^2 = 4^3 */
    double solid[GR_MAX_NODES] = {0}, gradient[GR_MAX_NODES][3] = {{0}};
    solid_parts(e, pose, at, parts, share);
    if (keep_open_part(e, at, parts, share)) return GR_ERR_MEMORY;
    const double r = e->axis[0].cell[at[0]].radius - 0.5;
    for (int d = 0; d < dim; d++)
        for (int p = 0; p < parts; p++)
            integrate_1d(&e->axis[d].cell[at[d]], k, (double)p / parts, (p + 1.0) / parts,
                         e->config.axisymmetric && !d ? &r : 0, value[d][p], slope[d][p]);
    for (int p = 0; p < (dim == 2 ? parts * parts : parts * parts * parts); p++) {
        const int of[3] = {p % parts, p / parts % parts, p / (parts * parts)};
        for (int i = 0; share[p] > 0 && i < e->K; i++) {
            const int node[3] = {i % k, i / k % k, i / (k * k)};
            double product = share[p];
            for (int d = 0; d < dim; d++) product *= value[d][of[d]][node[d]];
            solid[i] += product;
            for (int d = 0; d < dim; d++) {
                double part = share[p];
                for (int j = 0; j < dim; j++) part *= j == d ? slope[j][of[j]][node[j]] : value[j][of[j]][node[j]];
                gradient[i][d] += part;
            }
        }
    }
    for (int i = 0; i < e->K; i++) {
        const int node[3] = {i % k, i / k % k, i / (k * k)};
        int64_t id = 0;
        for (int d = dim - 1; d >= 0; d--) id = id * e->axis[d].n_nodes + e->axis[d].cell[at[d]].node[node[d]];
        const int64_t place = place_of(e, id);
        if (place < 0) return GR_ERR_MEMORY;
        e->bodies.open->solid[place] += solid[i];
        for (int d = 0; d < dim; d++) e->bodies.open->slope[place * dim + d] += gradient[i][d];
    }
    return GR_OK;
}

/* Add the solid cells of a box of n cells from `at` on: by halves, leaving out those without a surface near. */
static int add_box(struct gr_engine *e, const struct gr_pose *pose, const int32_t at[3], const int32_t n[3])
{
    const double dx = e->config.dx;
    double x[3] = {0}, normal[3], square = 0;
    int longest = 0;
    for (int d = 0; d < e->config.dim; d++) {
        x[d] = e->axis[d].cell[at[d]].edge + 0.5 * n[d] * dx;
        square += 0.25 * n[d] * n[d];
        if (n[d] > n[longest]) longest = d;
    }
    const double phi = distance(e, pose, x, normal), radius = sqrt(square) * dx;
    if (phi > radius || phi < -radius - DEEP * dx) return GR_OK;
    if (n[longest] == 1) return add_cell(e, pose, at, phi < -radius);
    int32_t low[3], high[3], first[3];
    memcpy(low, n, sizeof low), memcpy(high, n, sizeof high), memcpy(first, at, sizeof first);
    low[longest] = n[longest] / 2;
    high[longest] = n[longest] - low[longest];
    first[longest] += low[longest];
    return add_box(e, pose, at, low) || add_box(e, pose, first, high) ? GR_ERR_MEMORY : GR_OK;
}

/* Set the volumes of the nodes near the surfaces that are in the mesh: without what bodies take of them, or with it. */
static void set_volumes(struct gr_engine *e, int without)
{
    const struct gr_open_volume *open = e->bodies.open;
    for (int64_t k = 0; k < open->n; k++) {
        const int64_t n = (int64_t)gr_table_get(&e->mesh.node_of, open->id[k]) - 1;
        if (n < 0) continue;
        const double volume = gr_node_volume(e, open->id[k]);
        e->mesh.node_volume[n] = without ? fmax(volume - open->solid[k], 0) : volume;
    }
}

int gr_open_volumes(struct gr_engine *e, int follow)
{
    struct gr_open_volume *open = e->bodies.open;
    struct gr_pose pose[GR_MAX_BODIES];
    const int32_t first[3] = {0};
    int32_t all[3] = {1, 1, 1};
    for (int b = 0; b < e->config.n_bodies; b++) {
        if (follow && gr_follow_body(e, b, 0)) open->known = 0;
        gr_pose_at(e, b, e->bodies.split[b].x, e->bodies.split[b].orientation, &pose[b]);
    }
    if (open->known && follow) return GR_OK;
    if (!open->known) {
        set_volumes(e, 0);
        gr_table_clear(&open->place);
        gr_table_clear(&open->part_of);
        open->n = open->n_parts = 0;
        for (int d = 0; d < e->config.dim; d++) all[d] = e->axis[d].n_cells;
        if (add_box(e, pose, first, all)) return GR_ERR_MEMORY;
        open->known = 1;
    }
    set_volumes(e, 1);
    return GR_OK;
}
