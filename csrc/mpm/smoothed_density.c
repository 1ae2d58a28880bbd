/* The nodal part of the smoothed density: gap, mean quadrature weight and residual force, from adjacent nodes. */
#include "mpm/smoothed_density.h"

#include "mpm/open_volume.h"
#include "mpm/sleep.h"
#include "mpm/walls.h"

/* Smallest open volume of a node near a body, over dx^dim, whose residual force is balanced. */
#define LEAST_BALANCED 0.02

/* Share of the residual force that a node on an inner wall line takes part with along the normal of that line. The functions
 * are only C0 there, and their slopes large: the largest eigenvalue of the descent on the sum of E^2 is 3.6 instead of 1.5,
 * so that with a weight_correction above 0.55 the weights would grow. With this share it is 1.8, and 1.9 where two lines are
 * close (tests/density/test_verification_layers_at_rest.py). */
#define LINE_SHARE 0.25

/* A field of the nodes that belongs to an averaging of the density. */
static double *density_field(const struct gr_engine *e, int field)
{
    return gr_node_field(e, GR_NODE_DENSITY(e->config.dim) + field);
}

/* Over-compression at a node in a body: the mean over the open nodes about it, so that it has no slope across the surface
 * and points do not shift into the body. */
static double excess_about(const struct gr_engine *e, int64_t n)
{
    const int dim = e->config.dim;
    const int32_t *about = gr_about_node(e, n);
    double sum = 0, count = 0;
    for (int k = 0; k < gr_about(dim); k++) {
        const int32_t other = about[k * GR_LANES];
        const double gap = density_field(e, GR_NODE_OWN_GAP(dim))[other];
        if (!(gap > GR_LEAST_GAP && gap < GR_CLOSED_GAP)) continue;
        sum += density_field(e, GR_NODE_EXCESS)[other], count++;
    }
    return count > 0 ? sum / count : 0;
}

/* Complete the fields of a node, of which the mean gap is known. */
static void complete(const int dim, struct gr_engine *e, int64_t n, int inside)
{
    enum { AXES = 7 };
    const int held = (e->mesh.node_at[n] & AXES) | gr_wall_now(e, e->mesh.node_code[n])->fixed,
              lines = e->mesh.node_at[n] >> 3;
    const int64_t cut = gr_open_place(e->bodies.open, e->mesh.node_id[n]);
    const double gap = density_field(e, GR_NODE_OWN_GAP(dim))[n];
    const int closed = !(gap < GR_CLOSED_GAP);
    if (closed) density_field(e, GR_NODE_GAP)[n] = 0;
    if (closed && e->bodies.open) density_field(e, GR_NODE_EXCESS)[n] = excess_about(e, n);
    const double radius = e->mesh.node_radius ? e->mesh.node_radius[n] : 1;
    const int balanced = inside && (cut < 0 || e->mesh.node_volume[n] > LEAST_BALANCED * radius);
    for (int d = 0; d < dim; d++) {
        double *residual = density_field(e, GR_NODE_RESIDUAL + d) + n;
        if (cut >= 0) *residual += e->bodies.open->slope[cut * dim + d] / radius;
        if (!balanced || held >> d & 1) *residual = 0;
        if (lines >> d & 1) *residual *= LINE_SHARE;
    }
}

void gr_grid_surroundings(struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int64_t last)
{
    for (int64_t n = first; n < last; n += GR_LANES) {
        if (gr_group_rests(e, n)) continue;
        const int lanes = last - n < GR_LANES ? (int)(last - n) : GR_LANES;
        const unsigned inside = kernels->mean_gaps(e, n, lanes);
        for (int l = 0; l < lanes; l++) complete(e->config.dim, e, n + l, inside >> l & 1u);
    }
}
