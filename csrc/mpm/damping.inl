/* Damping of slow plastic flow (granular/mpm/damping.py): points lose a share of the difference between their velocity and
 * that of the grid. */
#include "mpm/contribution.h"

/* Share of the largest damping for points with the plastic shear rate `flow` and the log-density c. Short waves of plastic
 * flow are damped where the law is ill posed:
 *
 *   (1 - gdot/(r sqrt(c))) q c/(q c + gdot),   c = p/K,
 *
 * gdot = r sqrt(c) where the law becomes well posed, and gdot = q c where waves of viscous flow grow as fast as those of
 * elastic material (granular/mpm/damping.py). */
GR_INLINE vd damped_share(const struct gr_engine *e, vd flow, vd c)
{
    const vd most = v_set(e->config.ill_posed_rate * e->config.ill_posed_rate) * c; /* of its square */
    const vm damped = m_and(v_gt(flow, v_zero()), v_gt(most, flow * flow));
    if (!m_bits(damped)) return v_zero();
    const vd part = v_set(1.0) - flow / v_sqrt(v_max(most, v_set(1e-300))), elastic = v_set(e->config.crossover_rate) * c;
    return v_keep(damped, part * elastic / (elastic + flow));
}

enum { NO_NODES, SOME_NODES, ALL_NODES_ALIKE };

/* Damping of the points of a cell: shares b_i of the difference to the velocity of a node that they lose. */
struct damping {
    int of;
    double share[GR_MAX_NODES];
};

GR_INLINE void damping_of_cell(const int dim, const int basis, const struct gr_engine *e, int64_t index,
                               struct damping *damping)
{
    const int K = gr_power(gr_nodes_1d(basis), dim);
    int alike = 1;
    for (int i = 0; i < K; i++) {
        damping->share[i] = e->node_data[e->mesh.cell_node[index * K + i] * (int64_t)e->node_stride + GR_NODE_DAMPING(dim)];
        alike &= damping->share[i] == damping->share[0];
    }
    damping->of = !alike ? SOME_NODES : damping->share[0] > 0 ? ALL_NODES_ALIKE : NO_NODES;
}

/* Damp a block of points by the shares b_i of its nodes, all at once so that momentum is conserved:
 *
 *   v <- v - sum S_i b_i (v + C (x_i - x)),   v and C those that were carried to the grid.
 *
 * The update w has the velocities v_i^n of the nodes that take their place (grid.c). For linear fields the two are
 * equal. */
GR_INLINE void damp(const int dim, const int basis, const struct gr_engine *e, const struct gr_frame *frame,
                    const struct gr_shape *s, const struct damping *damping, int64_t at, vd *v)
{
    vd moment[3][3], first[3];
    if (damping->of == ALL_NODES_ALIKE) { /* sum S_i (x_i - x) = 0 */
        for (int d = 0; d < dim; d++) v[d] = v_fnma(v_set(damping->share[0]), component(e, GR_FIELD_v, d, at), v[d]);
        return;
    }
    for (int d = 0; d < dim; d++)
        for (int a = 0; a < gr_nodes_1d(basis); a++)
            moment[d][a] = s->w[d][a] * (v_set(frame->axis[d]->position[a]) - s->xi[d]);
    const vd b = gr_interpolate(dim, basis, 1, damping->share, 1, s, (const vd(*)[3])moment, first);
    for (int d = 0; d < dim; d++) {
        vd lost = b * component(e, GR_FIELD_v, d, at);
        for (int j = 0; j < dim; j++)
            lost = v_fma(v_set(e->config.dx) * component(e, GR_FIELD_affine, d * dim + j, at), first[j], lost);
        v[d] = v[d] - lost;
    }
}
