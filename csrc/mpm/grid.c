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
enum further { MOTION_ALONE, WITH_DAMPING, WITH_DENSITY };

/* Number of sums of motion of a node. */
GR_INLINE int motion_sums(const int dim, const enum further further)
{
    return GR_SUM_DAMPED(dim) + (further == WITH_DAMPING);
}

/* The sums of a block of nodes, in rows of GR_SUM_ROW: a node has motion_sums, or GR_NODE_SUMS and, with several materials,
 * GR_VOLUME_SUMS. */
struct block {
    _Alignas(64) double sums[(GR_NODE_SUMS(3) + GR_VOLUME_SUMS) * GR_SUM_ROW];
};

/* Sum number `sum` of a block. */
GR_INLINE double *row_of(struct block *block, int sum) { return block->sums + sum * GR_SUM_ROW + GR_SUM_PAD; }

/* The node that moves as one with node n, as its duplicate for the other side of a thin body from which it is not
 * separated; -1 if there is none. */
GR_INLINE int64_t joined_with(const struct gr_engine *e, int64_t n)
{
    return e->bodies.n_thin && e->mesh.duplicate[n] >= 0 && !e->mesh.separated[n] ? e->mesh.duplicate[n] : -1;
}

/* Add the sums of motion of the nodes to which the nodes [first, last) of a block are joined. */
static __attribute__((noinline)) void add_joined(const struct gr_engine *e, const struct gr_kernels *kernels, int64_t first,
                                                 int64_t last, struct block *block)
{
    struct block others;
    const int n_sums = GR_SUM_DAMPED(e->config.dim);
    for (int64_t n = first, end; n < last; n = end) {
        const int64_t other = joined_with(e, n);
        for (end = n + 1; other >= 0 && end < last && joined_with(e, end) == other + end - n;) end++;
        if (other < 0) continue;
        kernels->sum_nodes(e, GR_SUMS_OF_MOTION, 0, n_sums, other, other + end - n, row_of(&others, 0));
        for (int q = 0; q < n_sums; q++)
            for (int64_t i = 0; i < end - n; i++) row_of(block, q)[n - first + i] += row_of(&others, q)[i];
    }
}

/* The end of the block that begins with node n: at most GR_SUM_BLOCK nodes, in groups that do not rest; or of a group that
 * does. */
static int64_t end_of_block(const struct gr_engine *e, int64_t n, int64_t last)
{
    int64_t end = n + GR_LANES;
    while (!gr_group_rests(e, n) && end < last && end - n < GR_SUM_BLOCK && !gr_group_rests(e, end)) end += GR_LANES;
    return end < last ? end : last;
}

void gr_grid_masses(struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int64_t last)
{
    struct block block;
    for (int64_t n = first, end; n < last; n = end) {
        end = end_of_block(e, n, last);
        if (gr_group_rests(e, n)) continue;
        kernels->sum_nodes(e, GR_SUMS_OF_MOTION, GR_SUM_MASS, 1, n, end, row_of(&block, 0));
        memcpy(e->nodes.mass + n, row_of(&block, 0), sizeof(double) * (size_t)(end - n));
        if (!e->nodes.filled) continue;
        kernels->sum_nodes(e, GR_SUMS_OF_VOLUME, GR_SUM_VOLUME, 1, n, end, row_of(&block, 0));
        memcpy(e->nodes.filled + n, row_of(&block, 0), sizeof(double) * (size_t)(end - n));
    }
}

void gr_sum_node(const struct gr_engine *e, const struct gr_kernels *kernels, int64_t n, double *sums)
{
    struct block block;
    kernels->sum_nodes(e, GR_SUMS_OF_MOTION, 0, GR_SUM_DAMPED(e->config.dim), n, n + 1, row_of(&block, 0));
    for (int q = 0; q < GR_SUM_DAMPED(e->config.dim); q++) sums[q] = row_of(&block, q)[0];
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
    const double radius = e->mesh.node_radius ? e->mesh.node_radius[n] : 1;
    return e->bodies.open && e->mesh.node_volume[n] < GR_LEAST_OPEN * radius &&
           gr_open_place(e->bodies.open, e->mesh.node_id[n]) >= 0;
}

/* Part of the volume of a node that must be of material that is averaged, for a residual force that its weights are to
 * balance: next to an elastic body it is the force of a surface. */
#define LEAST_AVERAGED 0.99

/* With several materials neighbours have the pressure in common instead of the log-density. `sums` are those of the nodes
 * from `first` on. */
static __attribute__((noinline)) void describe_mixture(const int dim, struct gr_engine *e, int64_t first, int lanes,
                                                       const double *sums)
{
    const double *const of_density = sums + GR_SUM_DENSITY(dim) * GR_SUM_ROW, *const volumes =
                                                                                  sums + GR_NODE_SUMS(dim) * GR_SUM_ROW;
    const int log_density = GR_NODE_DENSITY(dim) + GR_NODE_LOG_DENSITY, residual = GR_NODE_DENSITY(dim) + GR_NODE_RESIDUAL;
    for (int l = 0; l < lanes; l++) {
        const double weighted = of_density[GR_SUM_WEIGHTED * GR_SUM_ROW + l];
        if (is_empty(e, sums[GR_SUM_MASS * GR_SUM_ROW + l])) continue;
        gr_node_field(e, log_density)[first + l] = weighted > 0 ? volumes[GR_SUM_PRESSURE * GR_SUM_ROW + l] / weighted : 0;
        if (of_density[GR_SUM_CONNECTED * GR_SUM_ROW + l] < LEAST_AVERAGED * volumes[GR_SUM_VOLUME * GR_SUM_ROW + l])
            for (int d = 0; d < dim; d++) gr_node_field(e, residual + d)[first + l] = 0;
    }
}

/* Store the fields of an averaging at the nodes of a group, from their sums. */
GR_INLINE void store_density(const int dim, struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int lanes,
                             const double *sums)
{
    const int several = e->own_volumes;
    kernels->describe_nodes(e, first, lanes, sums,
                            sums + (several ? GR_NODE_SUMS(dim) + GR_SUM_VOLUME : GR_SUM_MASS) * GR_SUM_ROW);
    if (several) describe_mixture(dim, e, first, lanes, sums);
    for (int64_t n = first; e->bodies.open && n < first + lanes; n++)
        if (is_closed(e, n)) {
            gr_node_field(e, GR_NODE_DENSITY(dim) + GR_NODE_OWN_GAP(dim))[n] = GR_CLOSED_GAP;
            gr_node_field(e, GR_NODE_DENSITY(dim) + GR_NODE_EXCESS)[n] = 0;
        }
}

/* The sums of the nodes [first, last), a block. */
GR_INLINE void sum_block_of_nodes(const int dim, const enum further further, struct gr_engine *e,
                                  const struct gr_kernels *kernels, int64_t first, int64_t last, struct block *block)
{
    const int averages = further == WITH_DENSITY;
    kernels->sum_nodes(e, GR_SUMS_OF_MOTION, 0, motion_sums(dim, further), first, last, row_of(block, 0));
    if (averages)
        kernels->sum_nodes(e, GR_SUMS_OF_DENSITY, 0, GR_DENSITY_SUMS(dim), first, last, row_of(block, GR_SUM_DENSITY(dim)));
    if (averages && e->own_volumes)
        kernels->sum_nodes(e, GR_SUMS_OF_VOLUME, 0, GR_VOLUME_SUMS, first, last, row_of(block, GR_NODE_SUMS(dim)));
    memcpy(e->nodes.mass + first, row_of(block, GR_SUM_MASS), sizeof(double) * (size_t)(last - first));
    if (e->bodies.n_thin) add_joined(e, kernels, first, last, block);
}

/* The grid stage for the nodes [first, last), a block. */
GR_INLINE void grid_block(const int dim, const enum further further, struct gr_engine *e, const struct gr_kernels *kernels,
                          int64_t first, int64_t last, const double g[3])
{
    const int damps = further == WITH_DAMPING;
    struct block block;
    _Alignas(64) struct gr_node_motion motion;
    sum_block_of_nodes(dim, further, e, kernels, first, last, &block);
    for (int64_t n = first; n < last; n += GR_LANES) {
        const int lanes = last - n < GR_LANES ? (int)(last - n) : GR_LANES;
        const double *const sums = row_of(&block, 0) + (n - first);
        kernels->move_nodes(e, damps, g, sums, lanes, &motion);
        for (int l = 0; l < lanes; l++)
            if (e->mesh.node_code[n + l] || e->watch) apply_wall(e, n, l, sums[GR_SUM_MASS * GR_SUM_ROW + l], &motion);
        kernels->store_nodes(e, damps, n, lanes, &motion);
        for (int l = 0; e->nodes.v && l < lanes; l++)
            for (int d = 0; d < dim; d++) e->nodes.v[(n + l) * dim + d] = motion.v[d][l];
        if (further == WITH_DENSITY) store_density(dim, e, kernels, n, lanes, sums);
    }
}

/* The same for nodes that begin with a whole group, block by block; groups that rest are left out. */
GR_INLINE void grid_nodes(const int dim, const enum further further, struct gr_engine *e, const struct gr_kernels *kernels,
                          int64_t first, int64_t last, const double g[3])
{
    for (int64_t n = first, end; n < last; n = end) {
        end = end_of_block(e, n, last);
        if (gr_group_rests(e, n)) continue;
        grid_block(dim, further, e, kernels, n, end, g);
    }
}

void gr_grid_nodes(struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int64_t last, const double g[3])
{
    const enum further further = e->config.cell_averaged         ? WITH_DAMPING
                                 : gr_averages(e, e->clock.step) ? WITH_DENSITY
                                                                 : MOTION_ALONE;
#define GR_GRID(d, q) \
    if (e->config.dim == d && further == q) grid_nodes(d, q, e, kernels, first, last, g);
    GR_GRID(2, MOTION_ALONE)
    GR_GRID(2, WITH_DAMPING)
    GR_GRID(2, WITH_DENSITY)
    GR_GRID(3, MOTION_ALONE)
    GR_GRID(3, WITH_DAMPING)
    GR_GRID(3, WITH_DENSITY)
#undef GR_GRID
}

void gr_grid_without_walls(const struct gr_engine *e, const struct gr_kernels *kernels, int64_t n, const double g[3],
                           double v[3], double next[3])
{
    const int dim = e->config.dim;
    const int64_t other = joined_with(e, n);
    double sum[GR_SUM_DAMPED(3)], others[GR_SUM_DAMPED(3)] = {0};
    gr_sum_node(e, kernels, n, sum);
    if (other >= 0) gr_sum_node(e, kernels, other, others);
    for (int q = 0; q < GR_SUM_DAMPED(dim); q++) sum[q] += others[q];
    const double m = sum[GR_SUM_MASS];
    for (int d = 0; d < dim; d++) {
        v[d] = sum[GR_SUM_MOMENTUM + d] / m;
        next[d] = v[d] + e->clock.dt * (sum[GR_SUM_FORCE(dim) + d] / m + g[d]);
    }
}

void gr_grid_smooth(struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int64_t last, int pass)
{
    const int dim = e->config.dim, order = e->config.xpic_order;
    struct block block;
    double share = pass % 2 ? 1 : -1;
    for (int r = 1; r <= pass; r++) share = share * (order - r + 1) / r;
    double rest = share, later = share; /* momentum on a wall from this pass and the later ones */
    for (int r = pass + 1; r <= order; r++) later *= -(double)(order - r + 1) / r, rest += later;
    for (int64_t n = first; n < last; n++) {
        const int64_t i = (n - first) % GR_SUM_BLOCK, left = last - n;
        double after[3] = {0};
        if (!i)
            kernels->sum_nodes(e, GR_SUMS_OF_MOTION, GR_SUM_MOMENTUM, dim, n,
                               n + (left < GR_SUM_BLOCK ? left : GR_SUM_BLOCK), row_of(&block, 0));
        const double m = e->nodes.mass[n];
        for (int d = 0; d < dim; d++) after[d] = gr_node_field(e, GR_NODE_VELOCITY + d)[n];
        const int held = gr_holds(gr_wall_now(e, e->mesh.node_code[n]), dim, after);
        for (int d = 0; d < dim; d++) {
            const double sum = row_of(&block, d)[i], v = m > e->config.mass_cutoff && !(held >> d & 1) ? sum / m : 0;
            e->nodes.v[n * dim + d] = v;
            if (e->watch && held >> d & 1) e->watch->node[n * dim + d] += rest * sum;
            if (m > e->config.mass_cutoff) gr_node_field(e, GR_NODE_UPDATE(dim) + d)[n] += share * v;
        }
    }
}
