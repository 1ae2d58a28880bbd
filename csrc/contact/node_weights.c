/* The nodes on which a contact point acts (node_weights.h). */
#include "contact/node_weights.h"

#include <float.h>

#include "mpm/shape.h"
#include "mpm/walls.h"

/* Of the shape functions of the nodes about a contact point at least this part has mass. */
#define LEAST_SUM 0.2

/* The weight of a node at a contact point is its shape function, or m_i/(LIGHT M) if that is less, with the mean mass M =
 * sum N_i m_i at the contact point: a light node would take up the impulse alone. As the weight goes to zero with the
 * mass, nothing jumps when rows of points leave a node. Measured with beds at rest and boxes that carry one
 * (benchmark bodies): with less, the force on a moving box along the grid has larger spikes, with more, the first row
 * of a bed at rest has more pressure. */
#define LIGHT 0.15

/* Variance of the distances of nodes from the surface, in cells^2, below which they are the same but for round-off. */
#define ONE_DISTANCE 1e-9

/* Roundings of a coordinate by which a point may be off the end of the domain that it lies on, as in
 * granular/model/grid.py. */
#define ROUNDINGS 64

/* Where walls hold more than the rest of the mobility of a contact point, they act there, and not the body. */
#define LEAST_MOBILE 0.1

/* The node of the mesh with this index in the whole grid on a side of thin bodies, -1 if it is not active. Of two
 * duplicates that are not separated the one in front. */
static int64_t node_on_side(const struct gr_engine *e, int64_t id, int side)
{
    const int64_t n = (int64_t)gr_table_get(&e->mesh.node_of, id) - 1;
    if (n < 0 || !e->bodies.n_thin || e->mesh.duplicate[n] < 0) return n;
    return side < 0 && e->mesh.separated[n] ? e->mesh.duplicate[n] : n;
}

/* The nodes of the mesh about a point in the cell `at`, -1 for those that are not active. */
static void nodes_of(const struct gr_engine *e, const int32_t at[3], int side, int64_t node[GR_MAX_NODES])
{
    const int k = gr_nodes_1d(e->config.basis);
    const int64_t c = e->bodies.n_thin ? -1 : (int64_t)gr_table_get(&e->mesh.cell_of, gr_cell_id(e, at)) - 1;
    for (int i = 0; c >= 0 && i < e->K; i++) node[i] = gr_cell_node(e, c, i);
    if (c >= 0) return;
    for (int i = 0; i < e->K; i++) {
        const int part[3] = {i % k, i / k % k, i / (k * k)};
        int64_t id = 0;
        for (int d = e->config.dim - 1; d >= 0; d--) id = id * e->axis[d].n_nodes + e->axis[d].cell[at[d]].node[part[d]];
        node[i] = node_on_side(e, id, side);
    }
}

double gr_contact_mass(const struct gr_engine *e, int64_t n)
{
    const int joined = e->bodies.n_thin && e->mesh.duplicate[n] >= 0 && !e->mesh.separated[n];
    return e->nodes.mass[n] + (joined ? e->nodes.mass[e->mesh.duplicate[n]] : 0);
}

/* Shape functions at x, the indices of its cell, and the distances of the nodes from x along the normal, in cells.
 * Returned: their number; 0 if x lies outside of the domain. */
static int shapes_at(const struct gr_engine *e, const double x[3], const double normal[3], double weight[GR_MAX_NODES],
                     double above[GR_MAX_NODES], int32_t in[3])
{
    const int dim = e->config.dim, basis = e->config.basis, k = gr_nodes_1d(basis);
    double w[3][3] = {{0}, {0}, {1}}, up[3][3] = {{0}};
    for (int d = 0; d < dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        double place = x[d] - axis->origin;
        if (axis->periodic) place -= axis->length * floor(place / axis->length);
        int64_t at = gr_locate(axis, e->inv_dx, axis->origin + place);
        if (at < 0 || at >= axis->n_cells) {
            const double slack = fmax(1e-9 * e->config.dx, ROUNDINGS * DBL_EPSILON * (fabs(axis->origin) + axis->length));
            if (!axis->periodic && fabs(place - 0.5 * axis->length) > 0.5 * axis->length + slack) return 0;
            at = at < 0 ? 0 : axis->n_cells - 1;
        }
        const struct gr_axis_cell *cell = &axis->cell[at];
        vd value[3], slope[3];
        in[d] = (int32_t)at;
        const struct gr_knots knots = gr_knots_of(cell);
        const double xi = (axis->origin + place - cell->edge) * e->inv_dx;
        gr_shape_1d(basis, &knots, e->config.lambda, v_set(xi), value, slope);
        for (int a = 0; a < k; a++) w[d][a] = value[a][0], up[d][a] = (cell->position[a] - xi) * normal[d];
    }
    for (int c = 0, i = 0; i < e->K; c++)
        for (int b = 0; b < k; b++)
            for (int a = 0; a < k; a++, i++) {
                weight[i] = w[2][c] * w[1][b] * w[0][a];
                above[i] = up[2][c] + up[1][b] + up[0][a];
            }
    return e->K;
}

/* Change the weights of n nodes, of the sum 1, so that they act at the surface: as nodes within the body are lighter, they
 * would act above it, and a flow that sticks to an inclined base would be 1 % slow. A weight w becomes w (1 - q (z - zbar))
 * with the distance z of its node above the surface, so that sum w = 1 and sum w z = 0, or as near 0 as changes by a half
 * at most allow. Nodes at one distance, as linear functions may leave, cannot act elsewhere. */
static void put_on_surface(int n, double *weight, const double *above)
{
    double mean = 0, variance = 0, farthest = 0;
    for (int i = 0; i < n; i++) mean += weight[i] * above[i];
    for (int i = 0; i < n; i++) {
        variance += weight[i] * (above[i] - mean) * (above[i] - mean);
        farthest = fmax(farthest, fabs(above[i] - mean));
    }
    if (!(variance > ONE_DISTANCE)) return;
    const double slope = mean / fmax(variance, 2 * fabs(mean) * farthest);
    for (int i = 0; i < n; i++) weight[i] *= 1 - slope * (above[i] - mean);
}

int gr_weigh_nodes(const struct gr_engine *e, const double x[3], int side, double least_filling,
                   struct gr_contact_point *contact)
{
    int32_t in[3] = {0};
    double sum = 0, mass = 0, radius = 0, along[3] = {0}, unheld = 0, of_node[GR_MAX_NODES], above[GR_MAX_NODES];
    const int dim = e->config.dim, n = shapes_at(e, x, contact->normal, contact->weight, above, in);
    const struct gr_body *body = &e->config.bodies[contact->body];
    int64_t node[GR_MAX_NODES];
    int used = 0, reduced = 0;
    if (n) nodes_of(e, in, side, node);
    for (int i = 0; i < n; i++) {
        of_node[i] = contact->weight[i] > 0 && node[i] >= 0 ? gr_contact_mass(e, node[i]) : 0;
        mass += contact->weight[i] * of_node[i];
        if (e->mesh.node_radius && node[i] >= 0) radius += contact->weight[i] * e->mesh.node_radius[node[i]];
    }
    for (int i = 0; i < n; i++) {
        if (!(of_node[i] > e->config.mass_cutoff)) of_node[i] = 0;
        const double most = of_node[i] / (LIGHT * mass), weight = most < contact->weight[i] ? most : contact->weight[i];
        reduced |= weight < contact->weight[i];
        if (!(weight > 0)) continue;
        sum += weight;
        above[used] = above[i], of_node[used] = of_node[i];
        contact->node[used] = (int32_t)node[i], contact->weight[used++] = weight;
    }
    if (!(sum > LEAST_SUM) || !(mass * e->mass_scale > least_filling * (e->mesh.node_radius ? radius : 1))) return 0;
    const double per_sum = 1 / sum;
    double whole = 0; /* of the nodes that no wall holds */
    contact->n_nodes = used;
    for (int i = 0; i < used; i++) contact->weight[i] *= per_sum;
    if (reduced) put_on_surface(used, contact->weight, above);
    for (int i = 0; i < used; i++) {
        const double weight = contact->weight[i], mobility = weight * weight * (1 / of_node[i]);
        const int held = gr_wall_now(e, e->mesh.node_code[contact->node[i]])->fixed;
        unheld += mobility;
        if (!held) whole += mobility;
        for (int d = 0; held && d < dim; d++)
            if (!(held >> d & 1)) along[d] += mobility;
    }
    contact->normal_mobility = contact->mobility = 0;
    for (int d = 0; d < dim; d++) {
        const double all = whole + along[d] + (body->free >> d & 1 ? 1 / body->mass : 0);
        contact->normal_mobility += contact->normal[d] * contact->normal[d] * all;
        contact->mobility = fmax(contact->mobility, all);
    }
    return contact->normal_mobility > LEAST_MOBILE * unheld;
}
