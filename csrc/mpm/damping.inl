/* Damping of slow plastic flow in averaged cells (granular/mpm/damping.py): points lose a share of the difference between
 * their velocity and the velocity of the grid, which is noise of the sampling. */
#include "mpm/contribution.h"

/* Share of the largest damping for points with the plastic shear rate `flow` and the log-density c = p/K, in the slots from
 * `at` on: 1 - gdot/(r sqrt(c)) in slow flow, gdot < r sqrt(c), and none without flow. */
GR_INLINE vd damped_share(const struct gr_engine *e, vd flow, vd c, int64_t at)
{
    const vd most = gr_of_material(e, GR_MATERIAL_SLOW, at) * c; /* of its square */
    const vm damped = m_and(v_gt(flow, v_zero()), v_gt(most, flow * flow));
    if (!m_bits(damped)) return v_zero();
    const vd share = v_set(1.0) - flow / v_sqrt(v_max(most, v_set(GR_NOTHING)));
    return v_keep(damped, share);
}

/* Damping of the points of GR_W cells: shares b_i of the difference to the velocity of a node that they lose. */
struct damping {
    int any;          /* in some cell */
    vm damped, alike; /* cells in which some are not zero; in which all are the same */
    int all_alike;
    vd share[GR_MAX_NODES];
};

/* The same for the shares that are set. */
GR_INLINE void damping_of_cells(const int K, struct damping *damping)
{
    vd least = damping->share[0], most = least;
    for (int i = 1; i < K; i++) {
        least = v_min(least, damping->share[i]);
        most = v_max(most, damping->share[i]);
    }
    damping->damped = v_gt(most, v_zero());
    damping->any = m_bits(damping->damped) != 0;
    damping->alike = v_ge(least, most);
    damping->all_alike = m_bits(damping->alike) == GR_ALL_LANES;
}

/* Damp the points in the slots from `at` on by the shares b_i of the nodes, all at once so that momentum is conserved:
 *
 *   v <- v - sum S_i b_i (v + C (x_i - x)),   v and C as carried to the grid.
 *
 * The update w has the velocities v_i^n of the nodes that take their place (grid.c). For linear fields the two are
 * equal. Where all b_i are alike, sum S_i (x_i - x) = 0. */
GR_INLINE void damp(const int dim, const int basis, const struct gr_engine *e, const struct gr_frame *frame,
                    const struct gr_shape *s, const struct damping *damping, int64_t at, vd *v)
{
    vd moment[3][3], first[3], b = damping->share[0];
    if (!damping->all_alike) {
        for (int d = 0; d < dim; d++)
            for (int a = 0; a < gr_nodes_1d(basis); a++) moment[d][a] = s->w[d][a] * (frame->position[d][a] - s->xi[d]);
        b = v_select(damping->alike, b, gr_interpolate(dim, basis, 1, damping->share, s, (const vd(*)[3])moment, first));
    }
    for (int d = 0; d < dim; d++) {
        vd lost = b * component(e, GR_FIELD_v, d, at);
        for (int j = 0; !damping->all_alike && j < dim; j++) {
            const vd more = v_fma(v_set(e->config.dx) * component(e, GR_FIELD_affine, d * dim + j, at), first[j], lost);
            lost = v_select(damping->alike, lost, more);
        }
        v[d] = v_select(damping->damped, v[d] - lost, v[d]);
    }
}
