/* The density correction, as far as the smoothed and the cell-averaged density share it: averaging, relaxation to the
 * nodal density, particle shifting. */
#pragma once

#include "mpm/shape.h"

/* Bound of |ln(rho/rho_c)|. A point beyond it is checked like one that leaves its cell. */
#define NO_DENSITY 1e3

/* Rate sqrt(tr(L L)/2), from L dt, at which a flow goes on stretching the same lines: e in an extension at the rate e,
 * and zero in simple shear at any angle to the grid and in rotation (Okubo 1970; Weiss 1991). */
GR_INLINE vd lasting_rate(const int dim, const vd *L)
{
    vd sum = v_zero();
    for (int i = 0; i < dim; i++)
        for (int j = 0; j < dim; j++) sum = v_fma(L[i * dim + j], L[j * dim + i], sum);
    return v_sqrt(v_max(v_set(0.5) * sum, v_zero()));
}

/* Rate of deformation sqrt(2 D':D') + |tr D| from L dt, with D' the deviator of D. It drives the averaging. In 2D L[4] is the
 * component out of the plane. */
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
    if (dim == 2) {
        trace = trace + L[4];
        square = v_fma(v_set(2.0) * L[4], L[4], square);
    }
    square = v_fnma(v_set(2.0 / 3.0) * trace, trace, square);
    return v_sqrt(v_max(square, v_zero())) + v_abs(trace);
}

/* Share eta of the difference to the mean that an averaging of the log-density c removes, for a time dt:
 *
 *   eta = r/(1 + r),  r = dt (dd c_w/dx + ds gdot/max(0, c)).
 *
 * Here c is that over the one at which the law separates. Numerator and denominator are multiplied by max(0, c), so that
 * nothing is divided by zero for stress-free points.
 * Strain produces the noise that is averaged, and the term with ds ties the averaging to it: a heap at rest keeps its
 * density. */
GR_INLINE vd averaged_share(const struct gr_engine *e, double dt, vd strain, vd c)
{
    const struct gr_density_numbers *q = &e->config.density;
    const vd pressed = v_max(c, v_zero()), fast = v_set(dt * q->diffusion * e->config.wave_speed * e->inv_dx);
    const vd r = v_fma(fast, pressed, v_set(q->strain_diffusion) * strain);
    return r / (pressed + r + v_set(GR_NOTHING));
}

/* Change of the log-density by relaxation to the nodal density, for a strain during the time dt and the gap between the
 * two:
 *
 *   clip(kappa strain gap, limit dt) + min(1, kappa_c strain) max(0, gap - dead_band).
 *
 * Part of the gap is noise from the positions of the points. It is therefore closed no faster than the limit. Material
 * compressed beyond this noise is over-compressed: it relaxes faster and without a limit. */
GR_INLINE vd relax_to_nodal_density(const struct gr_density_numbers *q, double dt, vd strain, vd gap)
{
    const vd excess = v_max(gap - v_set(q->dead_band), v_zero()), limit = v_set(q->relaxation_limit * dt);
    const vd share = v_min(v_set(q->compression_rate) * strain, v_set(1.0)), closed = v_set(q->relaxation) * strain * gap;
    return v_fma(share, excess, v_max(v_min(closed, limit), -limit));
}

/* Rise from 0 at `low` to 1 at `high`. */
GR_INLINE vd between(double low, double high, vd x) { return v_clamp((x - v_set(low)) * v_set(1 / (high - low)), 0.0, 1.0); }

/* Flags of GR_W cells that concern the shift of their points. */
struct gr_wall_cells {
    vm shifts;     /* their points may shift */
    vm wall[3][2]; /* a wall stands at the low or the high face */
    int any;       /* at some face of some cell */
};

GR_INLINE void gr_wall_cells_of(const int dim, const struct gr_engine *e, int64_t first, struct gr_wall_cells *walls)
{
    double shifts[GR_W], wall[3][2][GR_W];
    walls->any = 0;
    for (int l = 0; l < GR_W; l++) {
        const int flags = e->mesh.cell[first + l].flags;
        shifts[l] = !(flags & GR_CELL_NO_SHIFTING);
        walls->any |= flags >= GR_CELL_WALL;
        for (int k = 0; k < 2 * dim; k++) wall[k / 2][k % 2][l] = flags / GR_CELL_WALL >> k & 1;
    }
    walls->shifts = v_gt(v_load(shifts), v_zero());
    for (int k = 0; walls->any && k < 2 * dim; k++) walls->wall[k / 2][k % 2] = v_gt(v_load(wall[k / 2][k % 2]), v_zero());
}

/* In a cell at a wall, reduce a shift towards the wall linearly to zero on the wall, as the flow does. A wall inside
 * the grid stops points only by the velocity of its nodes; an unreduced shift would carry them through. */
GR_INLINE void hold_at_walls(const int dim, const struct gr_wall_cells *walls, const vd xi[3], vd delta[3])
{
    for (int d = 0; d < dim; d++) {
        delta[d] = v_select(walls->wall[d][0], v_max(delta[d], delta[d] * xi[d]), delta[d]);
        delta[d] = v_select(walls->wall[d][1], v_min(delta[d], delta[d] * (v_set(1.0) - xi[d])), delta[d]);
    }
}
