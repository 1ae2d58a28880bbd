/* The grid stage: nodes gather the sums of their cells and move. */
#ifndef GR_MPM_GRID_H
#define GR_MPM_GRID_H

#include "mpm/engine.h"

/* The masses of nodes alone, to node_mass, where the forces need them (mpm/cell_averaged.inl). */
void gr_grid_masses(struct gr_engine *e, int64_t first, int64_t last);

/* Momentum balance on the nodes [first, last) with gravity g:
 *   v = p/m,  v' = v + dt (f/m + g), walls;  w = f (v' - v) + (1 - f) v'   (Dunatunga & Kamrin 2015, eq. 3.5-3.8).
 * v', w and what the averaging of the density needs go to node_data; m to node_mass; v to node_v. */
void gr_grid_nodes(struct gr_engine *e, int64_t first, int64_t last, const double g[3]);

/* XPIC: take pass r of order m from the sums of kernels->smooth and add its share to w.
 *   w = v' - v + sum_r (-1)^(r+1) binomial(m, r) (S+ S)^(r-1) v   (Hammerquist & Nairn 2017). */
void gr_grid_smooth(struct gr_engine *e, int64_t first, int64_t last, int pass);

#endif
