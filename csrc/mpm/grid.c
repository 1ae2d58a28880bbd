/* The grid stage: nodal sums and the momentum balance (grid.h). */
#include "mpm/open_volume.h"
#include "mpm/grid.h"

#include <math.h>
#include <string.h>

#include "core/simd.h"
#include "kernels.h"
#include "mpm/sleep.h"
#include "mpm/smoothed_density.h"
#include "mpm/wall_impulse.h"
#include "mpm/walls.h"

enum { AVERAGED = 2 }; /* `smoothed` is 1 if the density is smoothed, AVERAGED in a step that averages it */

/* Number of the sums of a node. */
GR_INLINE int rows_of(const int dim, const int smoothed)
{
    return smoothed == AVERAGED ? GR_NODE_SUMS(dim) : GR_SUM_DAMPED(dim) + smoothed;
}

/* The node that moves as one with node n, as its duplicate for the other side of a thin body from which it is not
 * separated; -1 if there is none. */
GR_INLINE int64_t joined_with(const struct gr_engine *e, int64_t n)
{
    return e->n_thin && e->mesh.duplicate[n] >= 0 && !e->mesh.separated[n] ? e->mesh.duplicate[n] : -1;
}

/* Add the sums of another node. */
GR_INLINE void add_node(const int dim, const int smoothed, const struct gr_engine *e, const struct gr_kernels *kernels,
                        int64_t n, double *sum)
{
    double sums[GR_NODE_SUMS(3) * GR_LANES];
    kernels->sum_nodes(e, n / GR_LANES, smoothed > 0, smoothed == AVERAGED, sums);
    for (int q = 0; q < rows_of(dim, smoothed); q++) sum[q] += sums[q * GR_LANES + n % GR_LANES];
}

void gr_grid_masses(struct gr_engine *e, int64_t first, int64_t last)
{
    for (int64_t n = first; n < last; n++) {
        if (gr_group_rests(e, n - n % GR_LANES)) {
            n += GR_LANES - 1 - n % GR_LANES;
            continue;
        }
        double m = 0;
        for (int i = 0; i < e->K; i++) m += gr_sums(e)[e->mesh.node_source[n * e->K + i]];
        e->node_mass[n] = m;
    }
}

/* Apply the wall of a node, and note the impulse on it (wall_impulse.h); v and next are NULL where there is no mass. Not
 * inline: the loop over nodes is for those who do not ask. */
static __attribute__((noinline)) void note_impulse(struct gr_engine *e, int64_t n, double *v, double *next)
{
    const int dim = e->config.dim;
    const double m = e->node_mass[n]; /* its own, that of a duplicate not included */
    const double kept =
        e->keep_velocity - (e->config.smoothed || e->config.cell_averaged ? gr_node_field(e, GR_NODE_DAMPING(dim))[n] : 0);
    double *impulse = e->watch->node + n * dim, before[3], free[3];
    memset(impulse, 0, sizeof(double) * (size_t)dim);
    if (!v || !e->mesh.node_code[n]) return;
    memcpy(before, v, sizeof(double) * (size_t)dim);
    memcpy(free, next, sizeof(double) * (size_t)dim);
    gr_apply_wall(gr_wall_now(e, e->mesh.node_code[n]), dim, v, next);
    for (int d = 0; d < dim; d++) impulse[d] = m * ((free[d] - next[d]) - kept * (before[d] - v[d]));
}

/* Share of the difference to the velocity of a node that points lose: its mass-weighted mean over the points times the
 * largest damping of the step. */
GR_INLINE double damping_of_node(const int dim, const struct gr_engine *e, const double *sum, double m)
{
    const double share = e->config.damping_rate * e->dt * sum[GR_SUM_DAMPED(dim)] / m;
    return e->keep_velocity * (share < 1 ? share : 1);
}

/* True if a body leaves hardly any volume to a node. */
GR_INLINE int is_closed(const struct gr_engine *e, int64_t n)
{
    return e->open && e->mesh.node_volume[n] < GR_LEAST_OPEN && gr_open_place(e->open, e->mesh.node_id[n]) >= 0;
}

/* Part of the volume of a node that must be of material that is averaged, for a residual force that its weights are to balance:
 * beside an elastic body it is that of a surface. */
#define LEAST_AVERAGED 0.99

/* The fields of an averaging at node n with several materials (engine.h, enum gr_volume_sum): neighbours have the pressure in
 * common, and the volume is that of all points. */
static __attribute__((noinline)) void describe_mixture(const int dim, const struct gr_engine *e,
                                                       const struct gr_kernels *kernels, int64_t n, const double *sum,
                                                       double *out)
{
    double sums[GR_VOLUME_SUMS * GR_LANES], filled = 0, pressure = 0, *field = out + GR_NODE_DENSITY(dim);
    const int64_t nodes[2] = {n, joined_with(e, n)};
    for (int k = 0; k < 2 && nodes[k] >= 0; k++) {
        kernels->sum_volumes(e, nodes[k] / GR_LANES, sums);
        filled += sums[GR_SUM_VOLUME * GR_LANES + nodes[k] % GR_LANES];
        pressure += sums[GR_SUM_PRESSURE * GR_LANES + nodes[k] % GR_LANES];
    }
    gr_describe_density(dim, sum, filled, e->cell_mass, e->mesh.node_volume[n], e->servo_strain, out);
    const double *of_density = sum + GR_SUM_DENSITY(dim);
    field[GR_NODE_LOG_DENSITY] = of_density[GR_SUM_WEIGHTED] > 0 ? pressure / of_density[GR_SUM_WEIGHTED] : 0;
    for (int d = 0; d < dim; d++)
        if (of_density[GR_SUM_CONNECTED] < LEAST_AVERAGED * filled) field[GR_NODE_RESIDUAL + d] = 0;
}

/* The grid stage for some nodes. */
GR_INLINE void grid_nodes(const int dim, const int smoothed, struct gr_engine *e, const struct gr_kernels *kernels,
                          int64_t first, int64_t last, const double g[3])
{
    const int averages = smoothed == AVERAGED, fields = GR_NODE_FIELDS(dim, averages) + (smoothed == 1);
    const double dt = e->dt, cutoff = e->config.mass_cutoff, keep = e->keep_velocity;
    double sums[GR_NODE_SUMS(3) * GR_LANES];
    for (int64_t n = first; n < last; n++) {
        double sum[GR_NODE_SUMS(3)], v[3], next[3], out[GR_NODE_FIELDS(3, 1)];
        if (gr_group_rests(e, n - n % GR_LANES)) {
            n += GR_LANES - 1 - n % GR_LANES;
            continue;
        }
        if (n == first || n % GR_LANES == 0) kernels->sum_nodes(e, n / GR_LANES, smoothed > 0, averages, sums);
        for (int q = 0; q < rows_of(dim, smoothed); q++) sum[q] = sums[q * GR_LANES + n % GR_LANES];
        e->node_mass[n] = sum[GR_SUM_MASS];
        if (joined_with(e, n) >= 0) add_node(dim, smoothed, e, kernels, joined_with(e, n), sum);
        const double m = sum[GR_SUM_MASS];
        if (!(m > cutoff) && m == m) { /* a NaN passes, and is found at the points */
            for (int q = 0; q < fields; q++) out[q] = 0;
            if (averages) out[GR_NODE_DENSITY(dim) + GR_NODE_OWN_GAP] = is_closed(e, n) ? GR_CLOSED_GAP : GR_EMPTY_GAP;
            for (int d = 0; d < dim; d++) e->node_v[n * dim + d] = 0;
            if (e->watch) note_impulse(e, n, 0, 0);
            for (int q = 0; q < fields; q++) gr_node_field(e, q)[n] = out[q];
            continue;
        }
        const double damping = smoothed ? damping_of_node(dim, e, sum, m) : 0, kept = keep - damping;
        if (smoothed) gr_node_field(e, GR_NODE_DAMPING(dim))[n] = out[GR_NODE_DAMPING(dim)] = damping;
        for (int d = 0; d < dim; d++) {
            v[d] = sum[GR_SUM_MOMENTUM + d] / m;
            next[d] = v[d] + dt * (sum[GR_SUM_FORCE(dim) + d] / m + g[d]);
        }
        if (__builtin_expect(e->watch != 0, 0))
            note_impulse(e, n, v, next);
        else if (e->mesh.node_code[n])
            gr_apply_wall(gr_wall_now(e, e->mesh.node_code[n]), dim, v, next);
        for (int d = 0; d < dim; d++) {
            out[GR_NODE_VELOCITY + d] = next[d];
            out[GR_NODE_UPDATE(dim) + d] = kept * (next[d] - v[d]) + (1 - kept) * next[d];
            e->node_v[n * dim + d] = v[d];
        }
        if (e->config.xpic_order > 0) /* XPIC, pass r = 1: the increment plus order times v */
            for (int d = 0; d < dim; d++) out[GR_NODE_UPDATE(dim) + d] = next[d] - v[d] + e->config.xpic_order * v[d];
        if (averages) {
            out[GR_NODE_DENSITY(dim) + GR_NODE_GAP] = 0; /* until gr_grid_surroundings */
            if (e->config.n_materials > 1)
                describe_mixture(dim, e, kernels, n, sum, out);
            else
                gr_describe_density(dim, sum, m, e->cell_mass, e->mesh.node_volume[n], e->servo_strain, out);
        }
        if (averages && is_closed(e, n)) {
            out[GR_NODE_DENSITY(dim) + GR_NODE_OWN_GAP] = GR_CLOSED_GAP;
            out[GR_NODE_DENSITY(dim) + GR_NODE_EXCESS] = 0;
        }
        for (int q = 0; q < fields; q++) gr_node_field(e, q)[n] = out[q];
    }
}

void gr_grid_nodes(struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int64_t last, const double g[3])
{
    const int smoothed = (e->config.smoothed || e->config.cell_averaged) + gr_averages(e, e->step);
#define GR_GRID(d, q) \
    if (e->config.dim == d && smoothed == q) grid_nodes(d, q, e, kernels, first, last, g);
    GR_GRID(2, 0)
    GR_GRID(2, 1)
    GR_GRID(2, AVERAGED)
    GR_GRID(3, 0)
    GR_GRID(3, 1)
    GR_GRID(3, AVERAGED)
#undef GR_GRID
}

void gr_grid_without_walls(const struct gr_engine *e, int64_t n, const double g[3], double next[3])
{
    const int dim = e->config.dim;
    const int64_t nodes[2] = {n, joined_with(e, n)};
    double sum[GR_SUM_DAMPED(3)] = {0};
    for (int k = 0; k < 2 && nodes[k] >= 0; k++)
        for (int i = 0; i < e->K; i++)
            for (int q = 0; q < GR_SUM_DAMPED(dim); q++)
                sum[q] += gr_sum_at(e, e->mesh.node_source[nodes[k] * e->K + i] + q * GR_LANES);
    const double m = sum[GR_SUM_MASS];
    for (int d = 0; d < dim; d++) next[d] = sum[GR_SUM_MOMENTUM + d] / m + e->dt * (sum[GR_SUM_FORCE(dim) + d] / m + g[d]);
}

void gr_grid_smooth(struct gr_engine *e, int64_t first, int64_t last, int pass)
{
    const int dim = e->config.dim, K = e->K, order = e->config.xpic_order;
    double share = pass % 2 ? 1 : -1;
    for (int r = 1; r <= pass; r++) share = share * (order - r + 1) / r;
    double rest = share, later = share; /* what this pass and the later ones would have added of what a wall takes here */
    for (int r = pass + 1; r <= order; r++) later *= -(double)(order - r + 1) / r, rest += later;
    for (int64_t n = first; n < last; n++) {
        double sum[3] = {0};
        for (int i = 0; i < K; i++) {
            const double *part = gr_sums(e) + e->mesh.node_source[n * K + i];
            for (int d = 0; d < dim; d++) sum[d] += part[(GR_SUM_MOMENTUM + d) * GR_LANES];
        }
        const double m = e->node_mass[n];
        const struct gr_wall *wall = gr_wall_now(e, e->mesh.node_code[n]);
        for (int d = 0; d < dim; d++) {
            const double v = m > e->config.mass_cutoff && !(wall->fixed >> d & 1) ? sum[d] / m : 0;
            e->node_v[n * dim + d] = v;
            if (e->watch && wall->fixed >> d & 1) e->watch->node[n * dim + d] += rest * sum[d];
            if (m > e->config.mass_cutoff) gr_node_field(e, GR_NODE_UPDATE(dim) + d)[n] += share * v;
        }
    }
}
