/* The motion of a group of nodes at once, GR_LANES of them or fewer, and the fields of an averaging of the density. The last
 * vector of a group may have lanes beyond the last node, whose entries nothing reads. */
#include "mpm/grid.h"
#include "mpm/smoothed_density.h"

/* Motion of the first `lanes` nodes of a group from their sums, with gravity g. Nodes with hardly any mass are at rest; a NaN
 * passes, and is detected at the points. */
GR_INLINE void move_group(const int dim, const int damps, const struct gr_engine *e, const double g[3], const double *sums,
                          int lanes, struct gr_node_motion *motion)
{
    const vd cutoff = v_set(e->config.mass_cutoff), keep = v_set(e->keep_velocity), dt = v_set(e->clock.dt), zero = v_zero();
    for (int lane = 0; lane < lanes; lane += GR_W) {
        const vd m = v_load(sums + GR_SUM_MASS * GR_SUM_ROW + lane);
        const vm empty = v_ge(cutoff, m);
        vd damping = zero;
        if (damps) {
            const vd share = v_set(e->config.largest.damping_rate * e->clock.dt) *
                             v_load(sums + GR_SUM_DAMPED(dim) * GR_SUM_ROW + lane) / m;
            damping = v_select(empty, zero, keep * v_min(share, v_set(1.0)));
        }
        v_store(motion->damping + lane, damping);
        for (int d = 0; d < dim; d++) {
            const vd v = v_load(sums + (GR_SUM_MOMENTUM + d) * GR_SUM_ROW + lane) / m;
            const vd a = v_load(sums + (GR_SUM_FORCE(dim) + d) * GR_SUM_ROW + lane) / m + v_set(g[d]);
            v_store(motion->v[d] + lane, v_select(empty, zero, v));
            v_store(motion->next[d] + lane, v_select(empty, zero, v + dt * a));
        }
    }
}

/* Store the motion of so many nodes from `first` on for the points: v', and the update w. */
GR_INLINE void store_group(const int dim, const int damps, struct gr_engine *e, int64_t first, int lanes,
                           const struct gr_node_motion *motion)
{
    const vd order = v_set(e->config.xpic_order);
    for (int lane = 0; lane < lanes; lane += GR_W) {
        const int64_t n = first + lane;
        const vd damping = v_load(motion->damping + lane), keep = v_set(e->keep_velocity) - damping;
        if (damps) v_store(gr_node_field(e, GR_NODE_DAMPING(dim)) + n, damping);
        for (int d = 0; d < dim; d++) {
            const vd v = v_load(motion->v[d] + lane), next = v_load(motion->next[d] + lane);
            vd update = keep * (next - v) + (v_set(1.0) - keep) * next;
            if (e->config.xpic_order > 0) update = next - v + order * v; /* its pass r = 1 */
            v_store(gr_node_field(e, GR_NODE_VELOCITY + d) + n, next);
            v_store(gr_node_field(e, GR_NODE_UPDATE(dim) + d) + n, update);
        }
    }
}

/* Mean radius of the nodes from `first` on, in cells; 1 unless the plane is axisymmetric. */
GR_INLINE vd radius_of_nodes(const struct gr_engine *e, int64_t first)
{
    return e->mesh.node_radius ? v_load(e->mesh.node_radius + first) : v_set(1.0);
}

/* Store the fields of an averaging at the nodes from `first` on, except for those from the nodes around
 * (smoothed_density.h).
 * Given: their sums, and the volume of their points, as a mass of the first material. */
GR_INLINE void describe_group(const int dim, struct gr_engine *e, int64_t first, int lanes, const double *sums,
                              const double *filled)
{
    const vd zero = v_zero(), one = v_set(1.0), two = v_set(2.0), cell_mass = v_set(e->cell_mass);
    for (int lane = 0; lane < lanes; lane += GR_W) {
        const double *sum = sums + GR_SUM_DENSITY(dim) * GR_SUM_ROW + lane;
        const vm empty = v_ge(v_set(e->config.mass_cutoff), v_load(sums + GR_SUM_MASS * GR_SUM_ROW + lane));
        const vd volume = v_load(e->mesh.node_volume + first + lane), m = v_load(filled + lane);
        const vd phi = v_keep(v_gt(volume, v_set(GR_NO_VOLUME)), m / (cell_mass * volume)); /* 0 in solid cells */
        const vd connected = v_load(sum + GR_SUM_CONNECTED * GR_SUM_ROW),
                 weighted = v_load(sum + GR_SUM_WEIGHTED * GR_SUM_ROW);
        const vd c = v_keep(v_gt(weighted, zero), v_load(sum + GR_SUM_LOG_DENSITY * GR_SUM_ROW) / weighted);
        vd field[GR_NODE_OWN_GAP(3) + 1];
        field[GR_NODE_GAP] = zero; /* until gr_grid_surroundings */
        field[GR_NODE_LOG_DENSITY] = c;
        field[GR_NODE_EXCESS] = v_max(phi - one, zero);
        field[GR_NODE_WEIGHT] = v_keep(v_gt(connected, zero), weighted / connected - one);
        /* ln phi to 4 % at phi = 1/2, less c */
        field[GR_NODE_OWN_GAP(dim)] = two * (phi - one) / (phi + one) - c - v_set(e->servo_strain);
        for (int d = 0; d < dim; d++)
            field[GR_NODE_RESIDUAL + d] =
                v_load(sum + (GR_SUM_RESIDUAL + d) * GR_SUM_ROW) / (cell_mass * radius_of_nodes(e, first + lane));
        for (int q = 0; q <= GR_NODE_OWN_GAP(dim); q++) {
            const vd of_empty = q == GR_NODE_OWN_GAP(dim) ? v_set(GR_EMPTY_GAP) : zero;
            v_store(gr_node_field(e, GR_NODE_DENSITY(dim) + q) + first + lane, v_select(empty, of_empty, field[q]));
        }
    }
}

/* The values of a field at the indices `at` of GR_W nodes. */
GR_INLINE vd of_places(const double *field, const int32_t *at)
{
    double each[GR_W];
    for (int l = 0; l < GR_W; l++) each[l] = field[at[l]];
    return v_load(each);
}

/* Store the mean gap about the nodes from `first` on that are inside the material, which they and their face neighbours
 * fill, and 0 at others. The weights are 1/4, 1/2, 1/4 along each axis, times the radius of rings; a node that is not full counts with the gap of
 * the node itself. The gap of a single node has a noise of 0.03 to 0.04 with 4 points per cell, this mean one of 0.008.
 * Returned: a bit for each node that is inside. */
GR_INLINE unsigned mean_gaps_of_group(const int dim, struct gr_engine *e, int64_t first, int lanes)
{
    const int n = gr_about(dim), middle = n / 2;
    const double *gap = gr_node_field(e, GR_NODE_DENSITY(dim) + GR_NODE_OWN_GAP(dim));
    const double *const by_volume = e->bodies.open ? e->mesh.node_volume : e->mesh.node_radius;
    const vd least = v_set(GR_LEAST_GAP), closed = v_set(GR_CLOSED_GAP);
    unsigned inside = 0;
    for (int lane = 0; lane < lanes; lane += GR_W) {
        const int32_t *about = gr_about_node(e, first + lane);
        vd gaps[27], sum = v_zero(), weights = v_zero();
        for (int k = 0; k < n; k++) gaps[k] = of_places(gap, about + k * GR_LANES);
        vm full = v_gt(gaps[middle], least);
        for (int d = 0, apart = 1; d < dim; d++, apart *= 3)
            full = m_and(full, m_and(v_gt(gaps[middle - apart], least), v_gt(gaps[middle + apart], least)));
        for (int k = 0; k < n; k++) {
            const double share = (k % 3 == 1 ? 0.5 : 0.25) * (k / 3 % 3 == 1 ? 0.5 : 0.25);
            vd weight = v_set(dim == 2 ? share : share * (k / 9 == 1 ? 0.5 : 0.25));
            if (by_volume) {
                weight = weight * of_places(by_volume, about + k * GR_LANES);
                weights = weights + weight;
            }
            const vm counts = m_and(v_gt(gaps[k], least), v_gt(closed, gaps[k]));
            sum = sum + weight * v_select(counts, gaps[k], gaps[middle]);
        }
        if (by_volume) sum = sum / weights;
        v_store(gr_node_field(e, GR_NODE_DENSITY(dim) + GR_NODE_GAP) + first + lane, v_keep(full, sum));
        /* subtract the mean weight with which volumes m/rho fill the volume of the node */
        double *const weight = gr_node_field(e, GR_NODE_DENSITY(dim) + GR_NODE_WEIGHT) + first + lane;
        const vd fills = v_set(1.0) - v_exp(-(gaps[middle] + v_set(e->servo_strain)));
        v_store(weight, v_load(weight) + v_keep(m_and(full, v_gt(closed, gaps[middle])), fills));
        inside |= m_bits(full) << lane;
    }
    return inside;
}
