/* Momentum balance of GR_LANES nodes at once, before walls. */
#include "mpm/grid.h"

/* Motion of the nodes of a group from their sums, with gravity g. Nodes with hardly any mass are at rest; a NaN passes, and is
 * found at the points. */
GR_INLINE void move_group(const int dim, const int damps, const struct gr_engine *e, const double g[3], const double *sums,
                          struct gr_node_motion *motion)
{
    const vd cutoff = v_set(e->config.mass_cutoff), keep = v_set(e->keep_velocity), dt = v_set(e->dt), zero = v_zero();
    for (int lane = 0; lane < GR_LANES; lane += GR_W) {
        const vd m = v_load(sums + GR_SUM_MASS * GR_LANES + lane);
        const vm empty = v_ge(cutoff, m);
        vd damping = zero;
        if (damps) {
            const vd share = v_set(e->config.damping_rate * e->dt) * v_load(sums + GR_SUM_DAMPED(dim) * GR_LANES + lane) / m;
            damping = v_select(empty, zero, keep * v_min(share, v_set(1.0)));
        }
        v_store(motion->damping + lane, damping);
        for (int d = 0; d < dim; d++) {
            const vd v = v_load(sums + (GR_SUM_MOMENTUM + d) * GR_LANES + lane) / m;
            const vd a = v_load(sums + (GR_SUM_FORCE(dim) + d) * GR_LANES + lane) / m + v_set(g[d]);
            v_store(motion->v[d] + lane, v_select(empty, zero, v));
            v_store(motion->next[d] + lane, v_select(empty, zero, v + dt * a));
        }
    }
}
