#include "mpm/grid.h"

#include <math.h>

#include "mpm/migrate.h"

/* Rooms of nodes, of dx^dim, that are round-off. */
#define NO_VOLUME 1e-12

/* Gaps 2 (phi - 1)/(phi + 1) - cbar, of a node that is empty and of one that is .6 full. */
#define EMPTY_GAP -2.0
#define LEAST_GAP -0.5

/* What a wall leaves of the velocity `free` that the node would have had.
 * The impulse of a fixed component does not enter the increment that points receive: v is set to zero
 * with v', so that the wall neither pushes nor drags them; Coulomb friction is a force and does. */
static void apply_wall(const struct gr_wall *wall, int dim, double *v, double *next)
{
    double friction = 0;
    if (wall->normal >= 0) {
        const double into = next[wall->normal] * -wall->side; /* velocity that the wall takes away */
        const double taken = wall->side ? into : fabs(next[wall->normal]);
        double sliding = 0;
        for (int d = 0; d < dim; d++)
            if (d != wall->normal) sliding += next[d] * next[d];
        sliding = sqrt(sliding);
        if (taken > 0 && sliding > 0) friction = fmin(1.0, wall->friction * taken / sliding);
    }
    for (int d = 0; d < dim; d++) {
        if (wall->fixed >> d & 1)
            v[d] = next[d] = 0;
        else if (wall->normal >= 0)
            next[d] -= friction * next[d];
    }
}

/* The sums of node n over its cells, in the order of cells. They lie far separated, and those of a later node are asked for: in
 * space, where they fill no cache, the processor waited a fifth of the step for them. */
static inline __attribute__((always_inline)) void sum_over_cells(const int K, const int rows, const struct gr_engine *e,
                                                                 int64_t n, double *sum)
{
    enum { AHEAD = 4 };
    const int64_t *source = e->mesh.node_source + n * K, ahead = n + AHEAD < e->mesh.n_nodes ? AHEAD * K : 0;
    for (int q = 0; q < rows; q++) sum[q] = 0;
    for (int i = 0; i < K; i++) {
        const double *part = e->sums + source[i], *later = e->sums + source[ahead + i];
        __builtin_prefetch(later), __builtin_prefetch(later + rows - 1);
        for (int q = 0; q < rows; q++) sum[q] += part[q];
    }
}

/* Copies of a node on two sides of a thin body that are not separated there move as one: by the sums of both. */
static inline __attribute__((always_inline)) void join_duplicate(const int K, const int rows, const struct gr_engine *e,
                                                                 int64_t n, double *sum)
{
    double other[GR_NODE_SUMS(3, 1)];
    if (e->mesh.duplicate[n] < 0 || e->mesh.separated[n]) return;
    sum_over_cells(K, rows, e, e->mesh.duplicate[n], other);
    for (int q = 0; q < rows; q++) sum[q] += other[q];
}

void gr_grid_masses(struct gr_engine *e, int64_t first, int64_t last)
{
    for (int64_t n = first; n < last; n++) {
        double m = 0;
        for (int i = 0; i < e->K; i++) m += e->sums[e->mesh.node_source[n * e->K + i]];
        e->node_mass[n] = m;
    }
}

static inline __attribute__((always_inline)) void grid_nodes(const int dim, const int K, const int smoothed,
                                                             struct gr_engine *e, int64_t first, int64_t last,
                                                             const double g[3])
{
    const double dt = e->dt, cutoff = e->config.mass_cutoff, keep = e->keep_velocity;
    const double cell_mass = e->config.rho_c * pow(e->config.dx, dim);
    for (int64_t n = first; n < last; n++) {
        double sum[GR_NODE_SUMS(3, 1)], v[3], next[3];
        double *out = e->node_data + n * e->node_stride;
        sum_over_cells(K, GR_NODE_SUMS(dim, smoothed), e, n, sum);
        e->node_mass[n] = sum[0];
        if (e->n_thin) join_duplicate(K, GR_NODE_SUMS(dim, smoothed), e, n, sum);
        const double m = sum[0];
        if (!(m > cutoff) && m == m) { /* NaN goes on, to be found at the points */
            for (int q = 0; q < GR_NODE_FIELDS(dim, smoothed); q++) out[q] = 0;
            if (smoothed) out[3 * dim + 4] = EMPTY_GAP;
            for (int d = 0; d < dim; d++) e->node_v[n * dim + d] = 0;
            continue;
        }
        for (int d = 0; d < dim; d++) {
            v[d] = sum[1 + d] / m;
            next[d] = v[d] + dt * (sum[1 + dim + d] / m + g[d]);
        }
        if (e->mesh.node_code[n]) apply_wall(gr_wall_now(e, e->mesh.node_code[n]), dim, v, next);
        for (int d = 0; d < dim; d++) {
            out[d] = next[d];
            out[dim + d] = keep * (next[d] - v[d]) + (1 - keep) * next[d];
            e->node_v[n * dim + d] = v[d];
        }
        if (e->config.xpic_order > 0) /* first pass: m v, and the increment */
            for (int d = 0; d < dim; d++) out[dim + d] = next[d] - v[d] + e->config.xpic_order * v[d];
        if (smoothed) {
            const double room = e->mesh.node_volume[n]; /* none within a solid, which a point may have entered */
            const double phi = room > NO_VOLUME ? m / (cell_mass * room) : 0;
            double *mean = out + 2 * dim;
            mean[1] = sum[2 + 2 * dim] > 0 ? sum[3 + 2 * dim] / sum[2 + 2 * dim] : 0;
            mean[2] = fmax(phi - 1, 0);
            mean[3] = sum[1 + 2 * dim] > 0 ? sum[2 + 2 * dim] / sum[1 + 2 * dim] - 1 : 0;
            for (int d = 0; d < dim; d++) mean[4 + d] = sum[4 + 2 * dim + d] / cell_mass;
            mean[4 + dim] = 2 * (phi - 1) / (phi + 1) - mean[1]; /* of ln phi to 4 % where half full */
        }
    }
}

void gr_grid_nodes(struct gr_engine *e, int64_t first, int64_t last, const double g[3])
{
    const int averages = gr_averages(e, e->step);
#define GR_GRID(d, k, q) \
    if (e->config.dim == d && e->K == k && averages == q) grid_nodes(d, k, q, e, first, last, g);
    GR_GRID(2, 4, 0)
    GR_GRID(2, 9, 0)
    GR_GRID(2, 9, 1)
    GR_GRID(3, 8, 0)
    GR_GRID(3, 27, 0)
    GR_GRID(3, 27, 1)
#undef GR_GRID
}

/* Steps in node ids to the nodes on both sides of a node along each axis, and to itself; beyond an end there is none,
 * and the step is 0. Returned: whether the node lies at an end along axis d, as bits. */
static int around(const struct gr_engine *e, int64_t id, int64_t step[3][3])
{
    int64_t rest = id, stride = 1;
    int ends = 0;
    for (int d = 0; d < e->config.dim; d++) {
        const int64_t m = e->axis[d].n_nodes, at = rest % m;
        for (int side = 0; side < 3; side++) {
            const int64_t next = at + side - 1;
            const int beyond = !e->axis[d].periodic && (next < 0 || next >= m);
            step[d][side] = beyond ? 0 : ((next + m) % m - at) * stride;
            ends |= beyond << d;
        }
        rest /= m;
        stride *= m;
    }
    return ends;
}

static double gap_of(const struct gr_engine *e, int64_t id)
{
    const int64_t n = (int64_t)gr_table_get(&e->mesh.node_of, id) - 1;
    return n < 0 ? -INFINITY : e->node_data[n * e->node_stride + 3 * e->config.dim + 4];
}

/* Whether the node and those next to it are full enough to lie inside the material. */
static int is_inside(const struct gr_engine *e, int64_t id, const int64_t step[3][3])
{
    int inside = gap_of(e, id) > LEAST_GAP;
    for (int d = 0; d < e->config.dim; d++)
        for (int side = 0; inside && side < 3; side += 2) inside = gap_of(e, id + step[d][side]) > LEAST_GAP;
    return inside;
}

/* The mean of the gaps about a node inside the material, 1/4, 1/2, 1/4 along each axis; one that is not full counts as
 * the node's own. That of a single node is noise of .03 to .04 with 4 points per cell, this one of .008. */
static double mean_gap(const struct gr_engine *e, int64_t id, const int64_t step[3][3])
{
    const int dim = e->config.dim;
    const double own = gap_of(e, id);
    double sum = 0;
    for (int c = 0; c < (dim == 3 ? 3 : 1); c++)
        for (int b = 0; b < 3; b++)
            for (int a = 0; a < 3; a++) {
                const double share = (a == 1 ? 0.5 : 0.25) * (b == 1 ? 0.5 : 0.25) * (dim == 2 ? 1.0 : c == 1 ? 0.5 : 0.25);
                const double gap = gap_of(e, id + step[0][a] + step[1][b] + (dim == 3 ? step[2][c] : 0));
                sum += share * (gap > LEAST_GAP ? gap : own);
            }
    return sum;
}

void gr_grid_surroundings(struct gr_engine *e, int64_t first, int64_t last)
{
    const int dim = e->config.dim;
    for (int64_t n = first; n < last; n++) {
        double *mean = e->node_data + n * e->node_stride + 2 * dim, *uneven = mean + 4;
        const int64_t id = e->mesh.node_id[n];
        int64_t step[3][3];
        const int ends = around(e, id, step), inside = is_inside(e, id, step);
        const int held = ends | gr_wall_now(e, e->mesh.node_code[n])->fixed;
        mean[0] = inside ? mean_gap(e, id, step) : 0;
        if (inside) mean[3] += 1 - exp(-mean[4 + dim]); /* the mean weight of volumes m/rho that fill the room */
        for (int d = 0; d < dim; d++)
            if (!inside || held >> d & 1) uneven[d] = 0;
    }
}

void gr_grid_smooth(struct gr_engine *e, int64_t first, int64_t last, int pass)
{
    const int dim = e->config.dim, K = e->K, order = e->config.xpic_order;
    double share = pass % 2 ? 1 : -1;
    for (int r = 1; r <= pass; r++) share = share * (order - r + 1) / r;
    for (int64_t n = first; n < last; n++) {
        double sum[3] = {0};
        for (int i = 0; i < K; i++) {
            const double *part = e->sums + e->mesh.node_source[n * K + i];
            for (int d = 0; d < dim; d++) sum[d] += part[1 + d];
        }
        const double m = e->node_mass[n];
        const struct gr_wall *wall = gr_wall_now(e, e->mesh.node_code[n]);
        for (int d = 0; d < dim; d++) {
            const double v = m > e->config.mass_cutoff && !(wall->fixed >> d & 1) ? sum[d] / m : 0;
            e->node_v[n * dim + d] = v;
            if (m > e->config.mass_cutoff) e->node_data[n * e->node_stride + dim + d] += share * v;
        }
    }
}
