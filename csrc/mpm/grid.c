/* The grid stage: nodal sums and the momentum balance (grid.h). */
#include "mpm/grid.h"
#include "mpm/open_volume.h"

#include <math.h>
#include <string.h>

#include "core/simd.h"
#include "kernels.h"
#include "mpm/sleep.h"
#include "mpm/smoothed_density.h"
#include "mpm/wall_impulse.h"
#include "mpm/walls.h"

/* Fields of nodes in addition to their motion: the damping of averaged cells, or the sums of a step that averages the
 * density. */
enum further { NOTHING, DAMPING, DENSITY };

/* Number of the sums of a node. */
GR_INLINE int rows_of(const int dim, const enum further further)
{
    return further == DENSITY ? GR_NODE_SUMS(dim) : GR_SUM_DAMPED(dim) + (further == DAMPING);
}

/* The node that moves as one with node n, as its duplicate for the other side of a thin body from which it is not
 * separated; -1 if there is none. */
GR_INLINE int64_t joined_with(const struct gr_engine *e, int64_t n)
{
    return e->bodies.n_thin && e->mesh.duplicate[n] >= 0 && !e->mesh.separated[n] ? e->mesh.duplicate[n] : -1;
}

/* Add the sums of the nodes to which the nodes of a group are joined. */
static __attribute__((noinline)) void add_joined(const int dim, const enum further further, const struct gr_engine *e,
                                                 const struct gr_kernels *kernels, int64_t first, int lanes, double *sums)
{
    double others[GR_NODE_SUMS(3) * GR_LANES];
    for (int l = 0; l < lanes; l++) {
        const int64_t other = joined_with(e, first + l);
        if (other < 0) continue;
        kernels->sum_nodes(e, other / GR_LANES, further == DAMPING, further == DENSITY, others);
        for (int q = 0; q < rows_of(dim, further); q++) sums[q * GR_LANES + l] += others[q * GR_LANES + other % GR_LANES];
    }
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
        e->nodes.mass[n] = m;
    }
}

/* True if a node has so little mass that it is at rest. A NaN has mass: it is detected at the points. */
static inline int is_empty(const struct gr_engine *e, double m) { return m <= e->config.mass_cutoff; }

/* Note the impulse on the wall of node `lane` of the group from `first` on (wall_impulse.h), which changed the velocities in
 * `motion` to v and `next`. Not inline: the loop over nodes is for those who do not ask. */
static __attribute__((noinline)) void note_impulse(struct gr_engine *e, int64_t first, int lane, double keep,
                                                   const struct gr_node_motion *motion, const double *v, const double *next)
{
    const double m = e->nodes.mass[first + lane]; /* without the mass of a duplicate */
    double *impulse = e->watch->node + (first + lane) * e->config.dim;
    for (int d = 0; d < e->config.dim; d++)
        impulse[d] = m * ((motion->next[d][lane] - next[d]) - keep * (motion->v[d][lane] - v[d]));
}

/* Apply the wall of node `lane` of the group from `first` on. */
static void apply_wall(struct gr_engine *e, int64_t first, int lane, double m, struct gr_node_motion *motion)
{
    const int dim = e->config.dim;
    const double keep = e->keep_velocity - motion->damping[lane];
    double v[3], next[3];
    if (is_empty(e, m)) {
        if (e->watch) memset(e->watch->node + (first + lane) * dim, 0, sizeof(double) * (size_t)dim);
        return;
    }
    for (int d = 0; d < dim; d++) v[d] = motion->v[d][lane], next[d] = motion->next[d][lane];
    gr_apply_wall(gr_wall_now(e, e->mesh.node_code[first + lane]), dim, keep, v, next);
    if (e->watch) note_impulse(e, first, lane, keep, motion, v, next);
    for (int d = 0; d < dim; d++) motion->v[d][lane] = v[d], motion->next[d][lane] = next[d];
}

/* True if a body leaves hardly any volume to a node. */
GR_INLINE int is_closed(const struct gr_engine *e, int64_t n)
{
    return e->bodies.open && e->mesh.node_volume[n] < GR_LEAST_OPEN &&
           gr_open_place(e->bodies.open, e->mesh.node_id[n]) >= 0;
}

/* Part of the volume of a node that must be of material that is averaged, for a residual force that its weights are to
 * balance: next to an elastic body it is the force of a surface. */
#define LEAST_AVERAGED 0.99

/* With several materials, the additional sums of an averaging (enum gr_volume_sum), for the nodes of a group. */
static __attribute__((noinline)) void sum_mixture(const struct gr_engine *e, const struct gr_kernels *kernels, int64_t first,
                                                  int lanes, double *volumes)
{
    double others[GR_VOLUME_SUMS * GR_LANES];
    kernels->sum_volumes(e, first / GR_LANES, volumes);
    for (int l = 0; l < lanes; l++) {
        const int64_t other = joined_with(e, first + l);
        if (other < 0) continue;
        kernels->sum_volumes(e, other / GR_LANES, others);
        for (int q = 0; q < GR_VOLUME_SUMS; q++) volumes[q * GR_LANES + l] += others[q * GR_LANES + other % GR_LANES];
    }
}

/* With several materials neighbours have the pressure in common instead of the log-density. */
static __attribute__((noinline)) void describe_mixture(const int dim, struct gr_engine *e, int64_t first, int lanes,
                                                       const double *sums, const double *volumes)
{
    const double *of_density = sums + GR_SUM_DENSITY(dim) * GR_LANES;
    const int log_density = GR_NODE_DENSITY(dim) + GR_NODE_LOG_DENSITY, residual = GR_NODE_DENSITY(dim) + GR_NODE_RESIDUAL;
    for (int l = 0; l < lanes; l++) {
        const double weighted = of_density[GR_SUM_WEIGHTED * GR_LANES + l];
        if (is_empty(e, sums[GR_SUM_MASS * GR_LANES + l])) continue;
        gr_node_field(e, log_density)[first + l] = weighted > 0 ? volumes[GR_SUM_PRESSURE * GR_LANES + l] / weighted : 0;
        if (of_density[GR_SUM_CONNECTED * GR_LANES + l] < LEAST_AVERAGED * volumes[GR_SUM_VOLUME * GR_LANES + l])
            for (int d = 0; d < dim; d++) gr_node_field(e, residual + d)[first + l] = 0;
    }
}

/* Store the fields of an averaging at the nodes of a group, from their sums. */
GR_INLINE void store_density(const int dim, struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int lanes,
                             const double *sums)
{
    const int several = e->config.n_materials > 1;
    _Alignas(64) double volumes[GR_VOLUME_SUMS * GR_LANES];
    if (several) sum_mixture(e, kernels, first, lanes, volumes);
    kernels->describe_nodes(e, first, sums, several ? volumes + GR_SUM_VOLUME * GR_LANES : sums + GR_SUM_MASS * GR_LANES);
    if (several) describe_mixture(dim, e, first, lanes, sums, volumes);
    for (int64_t n = first; e->bodies.open && n < first + lanes; n++)
        if (is_closed(e, n)) {
            gr_node_field(e, GR_NODE_DENSITY(dim) + GR_NODE_OWN_GAP(dim))[n] = GR_CLOSED_GAP;
            gr_node_field(e, GR_NODE_DENSITY(dim) + GR_NODE_EXCESS)[n] = 0;
        }
}

/* The grid stage for the nodes [first, last). */
GR_INLINE void grid_nodes(const int dim, const enum further further, struct gr_engine *e, const struct gr_kernels *kernels,
                          int64_t first, int64_t last, const double g[3])
{
    const int damps = further == DAMPING, averages = further == DENSITY;
    _Alignas(64) double sums[GR_NODE_SUMS(3) * GR_LANES];
    _Alignas(64) struct gr_node_motion motion;
    for (int64_t n = first; n < last; n += GR_LANES) {
        const int lanes = last - n < GR_LANES ? (int)(last - n) : GR_LANES;
        if (gr_group_rests(e, n)) continue;
        kernels->sum_nodes(e, n / GR_LANES, damps, averages, sums);
        memcpy(e->nodes.mass + n, sums + GR_SUM_MASS * GR_LANES, GR_LANES * sizeof *sums);
        if (e->bodies.n_thin) add_joined(dim, further, e, kernels, n, lanes, sums);
        kernels->move_nodes(e, damps, g, sums, &motion);
        for (int l = 0; l < lanes; l++)
            if (e->mesh.node_code[n + l] || e->watch) apply_wall(e, n, l, sums[GR_SUM_MASS * GR_LANES + l], &motion);
        kernels->store_nodes(e, damps, n, &motion);
        for (int l = 0; e->nodes.v && l < lanes; l++)
            for (int d = 0; d < dim; d++) e->nodes.v[(n + l) * dim + d] = motion.v[d][l];
        if (averages) store_density(dim, e, kernels, n, lanes, sums);
    }
}

void gr_grid_nodes(struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int64_t last, const double g[3])
{
    const enum further further = e->config.cell_averaged ? DAMPING : gr_averages(e, e->clock.step) ? DENSITY : NOTHING;
#define GR_GRID(d, q) \
    if (e->config.dim == d && further == q) grid_nodes(d, q, e, kernels, first, last, g);
    GR_GRID(2, NOTHING)
    GR_GRID(2, DAMPING)
    GR_GRID(2, DENSITY)
    GR_GRID(3, NOTHING)
    GR_GRID(3, DAMPING)
    GR_GRID(3, DENSITY)
#undef GR_GRID
}

void gr_grid_without_walls(const struct gr_engine *e, int64_t n, const double g[3], double v[3], double next[3])
{
    const int dim = e->config.dim;
    const int64_t nodes[2] = {n, joined_with(e, n)};
    double sum[GR_SUM_DAMPED(3)] = {0};
    for (int k = 0; k < 2 && nodes[k] >= 0; k++)
        for (int i = 0; i < e->K; i++)
            for (int q = 0; q < GR_SUM_DAMPED(dim); q++)
                sum[q] += gr_sum_at(e, e->mesh.node_source[nodes[k] * e->K + i] + q * GR_LANES);
    const double m = sum[GR_SUM_MASS];
    for (int d = 0; d < dim; d++) {
        v[d] = sum[GR_SUM_MOMENTUM + d] / m;
        next[d] = v[d] + e->clock.dt * (sum[GR_SUM_FORCE(dim) + d] / m + g[d]);
    }
}

void gr_grid_smooth(struct gr_engine *e, int64_t first, int64_t last, int pass)
{
    const int dim = e->config.dim, K = e->K, order = e->config.xpic_order;
    double share = pass % 2 ? 1 : -1;
    for (int r = 1; r <= pass; r++) share = share * (order - r + 1) / r;
    double rest = share, later = share; /* momentum on a wall from this pass and the later ones */
    for (int r = pass + 1; r <= order; r++) later *= -(double)(order - r + 1) / r, rest += later;
    for (int64_t n = first; n < last; n++) {
        double sum[3] = {0}, after[3] = {0};
        for (int i = 0; i < K; i++) {
            const double *part = gr_sums(e) + e->mesh.node_source[n * K + i];
            for (int d = 0; d < dim; d++) sum[d] += part[(GR_SUM_MOMENTUM + d) * GR_LANES];
        }
        const double m = e->nodes.mass[n];
        for (int d = 0; d < dim; d++) after[d] = gr_node_field(e, GR_NODE_VELOCITY + d)[n];
        const int held = gr_holds(gr_wall_now(e, e->mesh.node_code[n]), dim, after);
        for (int d = 0; d < dim; d++) {
            const double v = m > e->config.mass_cutoff && !(held >> d & 1) ? sum[d] / m : 0;
            e->nodes.v[n * dim + d] = v;
            if (e->watch && held >> d & 1) e->watch->node[n * dim + d] += rest * sum[d];
            if (m > e->config.mass_cutoff) gr_node_field(e, GR_NODE_UPDATE(dim) + d)[n] += share * v;
        }
    }
}
