/* The grid stage: sum over the cells of each node, then update the nodal velocities. */
#pragma once

#include "mpm/engine.h"

/* Blocks of nodes whose sums are worked out together, in rows of GR_SUM_ROW: space for runs that reach beyond the block on
 * either side. */
enum { GR_SUM_BLOCK = GR_SIZE(128, 1), GR_SUM_PAD = GR_SIZE(GR_LANES, 0), GR_SUM_ROW = GR_SUM_BLOCK + 2 * GR_SUM_PAD };

/* Motion of the nodes of a group: v, and the velocity `next` after the step, m/s; and the share of the difference to the
 * velocity of a node that its points lose, its mass-weighted mean over them times the largest damping of the step. */
struct gr_node_motion {
    double v[3][GR_LANES], next[3][GR_LANES], damping[GR_LANES];
};

/* Sums of motion of a node (enum gr_node_sum, GR_SUM_DAMPED of them). */
void gr_sum_node(const struct gr_engine *e, const struct gr_kernels *kernels, int64_t n, double *sums);

/* Compute only the masses of the nodes, and the volumes of their points, to node_mass and node_filled, where the forces depend
 * on them (mpm/cell_averaged.inl). */
void gr_grid_masses(struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int64_t last);

/* Momentum balance on the nodes [first, last), which begin with a whole group, with gravity g (Dunatunga & Kamrin 2015,
 * eq. 3.5-3.8):
 *
 *   v = p/m,  v' = v + dt (f/m + g), walls;  w = f (v' - v) + (1 - f) v'.
 *
 * In w, f is the share of the old velocity that a point keeps. v', w and the fields of the averaging of the density go to
 * node_data, m to node_mass and v to node_v. */
void gr_grid_nodes(struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int64_t last, const double g[3]);

/* Velocities v and v' of a node with mass as they would be without walls, from the same sums. */
void gr_grid_without_walls(const struct gr_engine *e, const struct gr_kernels *kernels, int64_t n, const double g[3],
                           double v[3], double next[3]);

/* Share of their velocity that the points keep of node n in this step, after the grid stage. */
static inline double gr_kept_at(const struct gr_engine *e, int64_t n)
{
    return e->keep_velocity - (e->config.cell_averaged ? gr_node_field(e, GR_NODE_DAMPING(e->config.dim))[n] : 0);
}

/* XPIC: add pass r of order m to w, from the sums of kernels->smooth:
 *
 *   w = v' - v + sum_r (-1)^(r+1) binomial(m, r) (S+ S)^(r-1) v   (Hammerquist & Nairn 2017). */
void gr_grid_smooth(struct gr_engine *e, const struct gr_kernels *kernels, int64_t first, int64_t last, int pass);
