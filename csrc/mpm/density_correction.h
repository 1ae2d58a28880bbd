/* The correction of the density that points with a smoothed and with a cell-averaged one have in common: averaging,
 * relaxation to the nodal density, particle shifting. */
#ifndef GR_MPM_DENSITY_CORRECTION_H
#define GR_MPM_DENSITY_CORRECTION_H

#include "mpm/shape.h"

#define NO_DENSITY 1e3 /* |ln(rho/rho_c)| beyond which a density is none: looked at as a point that leaves */

/* Shear rate of the flow, sqrt(2 D':D') + |tr D|, from L dt; the measure by which the averaging is driven. */
GR_INLINE vd kinematic_rate(const int dim, const vd *L)
{
    vd trace = v_zero(), square = v_zero();
    for (int i = 0; i < dim; i++) {
        trace = trace + L[i * dim + i];
        square = v_fma(v_set(2.0) * L[i * dim + i], L[i * dim + i], square);
        for (int j = 0; j < i; j++) {
            const vd shear = L[i * dim + j] + L[j * dim + i];
            square = v_fma(shear, shear, square);
        }
    }
    square = v_fnma(v_set(2.0 / 3.0) * trace, trace, square);
    return v_sqrt(v_max(square, v_zero())) + v_abs(trace);
}

/* What an averaging of the log-density c over steps of the length dt moves it to the mean by:
 *   eta = r/(1 + r),  r = dt (dd c_w/dx + ds gdot/max(0, c)),
 * with max(0, c) taken into both for the points that bear nothing. Strain makes the residual_force that is averaged,
 * ds of it for each c: a heap at rest, where there is none, keeps the density it has come to. */
GR_INLINE vd averaged_part(const struct gr_engine *e, double dt, vd strain, vd c)
{
    const struct gr_density_numbers *q = &e->config.density;
    const vd pressed = v_max(c, v_zero()), fast = v_set(dt * q->diffusion * e->config.wave_speed * e->inv_dx);
    const vd r = v_fma(fast, pressed, v_set(q->strain_diffusion) * strain);
    return r / (pressed + r + v_set(1e-300));
}

/* What a strain over the time dt pulls a log-density to the geometric one by, over a gap:
 *   clip(kappa strain gap, limit dt) + min(1, kappa_c strain) max(0, gap - noise).
 * A gap may be noise of the places of the points, and is closed no faster than the limit; points more crowded than
 * noise makes them are driven apart faster, and without one. */
GR_INLINE vd relax_to_nodal_density(const struct gr_density_numbers *q, double dt, vd strain, vd gap)
{
    const vd crowd = v_max(gap - v_set(q->dead_band), v_zero()), limit = v_set(q->relaxation_limit * dt);
    const vd apart = v_min(v_set(q->compression_rate) * strain, v_set(1.0)), closed = v_set(q->relaxation) * strain * gap;
    return v_fma(apart, crowd, v_max(v_min(closed, limit), -limit));
}

/* Towards a wall the shift dies out over the cell at the wall, as the flow does: else it would carry points,
 * which the wall only stops by the velocity of its nodes, through a wall inside the grid. */
GR_INLINE void hold_at_walls(const int dim, const struct gr_cell *cell, const vd xi[3], vd delta[3])
{
    for (int d = 0; d < dim; d++) {
        const int walls = cell->flags / GR_CELL_WALL >> 2 * d & 3;
        if (walls & 1) delta[d] = v_max(delta[d], delta[d] * xi[d]);
        if (walls & 2) delta[d] = v_min(delta[d], delta[d] * (v_set(1.0) - xi[d]));
    }
}

#endif
