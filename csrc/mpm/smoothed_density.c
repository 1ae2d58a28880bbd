/* The nodal part of the smoothed density: gap, mean quadrature weight and residual force, from adjacent nodes. */
#include "mpm/smoothed_density.h"

#include "mpm/open_volume.h"
#include "mpm/sleep.h"
#include "mpm/walls.h"

/* Smallest gap of a node inside the material: that at the filling fraction 0.6. */
#define LEAST_GAP -0.5

/* Smallest open volume of a node near a body, over dx^dim, whose residual force is balanced. */
#define LEAST_BALANCED 0.02

/* Share of the residual force that a node on an inner wall line takes part with along the normal of that line. The
 * functions are only C0 there, and their slopes large: the largest eigenvalue of the descent on the sum of E^2 is 3.6 in
 * place of 1.5, so that with a weight_correction above 0.55 the weights would grow. With this share it is 1.8, and 1.9
 * where two lines are close (tests/verification/test_layers_at_rest.py). */
#define LINE_SHARE 0.25

/* Differences in node index to the adjacent nodes on both sides along each axis, and to the node itself. Beyond an end
 * there is no node, and the difference is 0.
 * Returned: bit d is set if the node lies at an end along axis d; and, in `lines`, if it lies on a grid line there, as
 * nodes of splines do on inner walls. */
GR_INLINE int around(const int dim, const struct gr_engine *e, int64_t id, int64_t step[3][3], int *lines)
{
    int64_t rest = id, stride = 1;
    int ends = 0;
    *lines = 0;
    for (int d = 0; d < dim; d++) {
        const int64_t m = e->axis[d].n_nodes, at = rest % m;
        *lines |= (e->axis[d].node_position[at] == floor(e->axis[d].node_position[at])) << d;
        for (int side = 0; side < 3; side++) {
            const int64_t next = at + side - 1;
            const int beyond = !e->axis[d].periodic && (next < 0 || next >= m);
            const int64_t inside = next < 0 ? next + m : next < m ? next : next - m;
            step[d][side] = beyond ? 0 : (inside - at) * stride;
            ends |= beyond << d;
        }
        rest /= m;
        stride *= m;
    }
    return ends;
}

/* A field of the nodes that belongs to an averaging of the density. */
static double *density_field(const struct gr_engine *e, int field)
{
    return gr_node_field(e, GR_NODE_DENSITY(e->config.dim) + field);
}

/* A node and those about it. Entry a + 3 b + 9 c is the node a - 1, b - 1 and c - 1 further along x, y and z; c = 1 in 2D. */
enum { STENCIL = 27, OWN = 13 };
struct stencil {
    int64_t id;            /* index of the node in the whole grid */
    int64_t step[3][3];    /* differences of that index to the nodes about it, along each axis */
    int64_t node[STENCIL]; /* -1 where the node is not active */
};

/* Loops over the entries. */
#define GR_EACH_ABOUT(dim, a, b, c)                                 \
    for (int c = (dim) == 3 ? 0 : 1; c < ((dim) == 3 ? 3 : 2); c++) \
        for (int b = 0; b < 3; b++)                                 \
            for (int a = 0; a < 3; a++)

/* Gap of an entry; -INFINITY if it is not active. What the entry holds is this node, or that of another node: those of a row
 * follow each other, so that mostly the next one is it. */
GR_INLINE double gap_at(const int dim, const struct gr_engine *e, struct stencil *about, int a, int b, int c)
{
    const int64_t at = about->id + about->step[0][a] + about->step[1][b] + (dim == 3 ? about->step[2][c] : 0);
    int64_t *const entry = &about->node[a + 3 * b + 9 * c], n = *entry;
    if (n < 0 || e->mesh.node_id[n] != at) {
        n++;
        if (n >= e->mesh.n_nodes || e->mesh.node_id[n] != at) n = (int64_t)gr_table_get(&e->mesh.node_of, at) - 1;
        *entry = n;
    }
    return n < 0 ? -INFINITY : density_field(e, GR_NODE_OWN_GAP)[n];
}

/* True if the node and its face neighbours are full enough to lie inside the material. */
GR_INLINE int is_inside(const int dim, const struct gr_engine *e, struct stencil *about)
{
    int inside = gap_at(dim, e, about, 1, 1, 1) > LEAST_GAP;
    for (int side = 0; inside && side < 3; side += 2) inside = gap_at(dim, e, about, side, 1, 1) > LEAST_GAP;
    for (int side = 0; inside && side < 3; side += 2) inside = gap_at(dim, e, about, 1, side, 1) > LEAST_GAP;
    for (int side = 0; dim == 3 && inside && side < 3; side += 2) inside = gap_at(dim, e, about, 1, 1, side) > LEAST_GAP;
    return inside;
}

/* Mean gap about a node inside the material, with the weights 1/4, 1/2, 1/4 along each axis. A node that is not full
 * counts with the gap of the node itself. The gap of a single node has a noise of 0.03 to 0.04 with 4 points per cell,
 * this mean one of 0.008. */
GR_INLINE double mean_gap(const int dim, const struct gr_engine *e, struct stencil *about)
{
    const double own = density_field(e, GR_NODE_OWN_GAP)[about->node[OWN]];
    double sum = 0, weights = 0;
    GR_EACH_ABOUT(dim, a, b, c)
    {
        const double share = (a == 1 ? 0.5 : 0.25) * (b == 1 ? 0.5 : 0.25) * (dim == 2 ? 1.0 : c == 1 ? 0.5 : 0.25);
        const double gap = gap_at(dim, e, about, a, b, c);
        const int64_t n = about->node[a + 3 * b + 9 * c];
        const double weight = share * (!e->open ? 1 : n < 0 ? 0 : e->mesh.node_volume[n]);
        sum += weight * (gap > LEAST_GAP && gap < GR_CLOSED_GAP ? gap : own), weights += weight;
    }
    return e->open ? sum / weights : sum;
}

/* Over-compression at a node in a body: the mean of that of the nodes about it that are open, so that it has no slope
 * across the surface and points do not shift into the body. */
static double excess_about(const int dim, const struct gr_engine *e, struct stencil *about)
{
    double sum = 0, count = 0;
    GR_EACH_ABOUT(dim, a, b, c)
    {
        const double gap = gap_at(dim, e, about, a, b, c);
        if (!(gap > LEAST_GAP && gap < GR_CLOSED_GAP)) continue;
        sum += density_field(e, GR_NODE_EXCESS)[about->node[a + 3 * b + 9 * c]], count++;
    }
    return count > 0 ? sum / count : 0;
}

GR_INLINE void surroundings(const int dim, struct gr_engine *e, int64_t first, int64_t last)
{
    struct stencil about;
    for (int k = 0; k < STENCIL; k++) about.node[k] = -1;
    for (int64_t n = first; n < last; n++) {
        if (gr_group_rests(e, n - n % GR_LANES)) {
            n += GR_LANES - 1 - n % GR_LANES;
            continue;
        }
        const int64_t id = about.id = e->mesh.node_id[n];
        int lines;
        const int ends = around(dim, e, id, about.step, &lines), inside = is_inside(dim, e, &about);
        const int held = ends | gr_wall_now(e, e->mesh.node_code[n])->fixed;
        const int64_t cut = gr_open_place(e->open, id);
        const int closed = !(density_field(e, GR_NODE_OWN_GAP)[n] < GR_CLOSED_GAP);
        if (closed && e->open) density_field(e, GR_NODE_EXCESS)[n] = excess_about(dim, e, &about);
        density_field(e, GR_NODE_GAP)[n] = inside && !closed ? mean_gap(dim, e, &about) : 0;
        if (inside && !closed) /* subtract the mean weight with which volumes m/rho fill the volume of the node */
            density_field(e, GR_NODE_WEIGHT)[n] += 1 - exp(-(density_field(e, GR_NODE_OWN_GAP)[n] + e->servo_strain));
        const int kept = inside && (cut < 0 || e->mesh.node_volume[n] > LEAST_BALANCED);
        for (int d = 0; d < dim; d++) {
            if (cut >= 0) density_field(e, GR_NODE_RESIDUAL + d)[n] += e->open->slope[cut * dim + d];
            if (!kept || held >> d & 1) density_field(e, GR_NODE_RESIDUAL + d)[n] = 0;
            if (lines >> d & 1) density_field(e, GR_NODE_RESIDUAL + d)[n] *= LINE_SHARE;
        }
    }
}

void gr_grid_surroundings(struct gr_engine *e, int64_t first, int64_t last)
{
    if (e->config.dim == 2)
        surroundings(2, e, first, last);
    else
        surroundings(3, e, first, last);
}
