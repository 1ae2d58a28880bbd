/* The parameters and choices of a scheme. Each is declared here and nowhere else: the structs below, the Python classes
 * with their checks and docstrings (granular/mpm/schemes.py) and the scaling of scenes are generated from these lists.
 *
 * X(name, default, range, unit, description). Ranges: "[low, high]", where a round bracket excludes the end; "integer"
 * before the range for whole numbers. GR_NONE: None in Python. */
#pragma once

#include <math.h>

#define GR_NONE ((double)NAN)

/* Velocity transfers between the grid and the points. X(name) */
#define GR_TRANSFERS(X) X(flip) X(apic) X(tpic) X(xpic)

/* Densities: methods to follow the density of the points. X(name) */
#define GR_DENSITIES(X) X(particle) X(smoothed) X(cell_averaged)

#define GR_SCHEME(X)                                                                                                  \
    X(flip_decay, 0, "[0, inf)", "1/s",                                                                               \
      "Rate at which the difference between the velocities of a point and the grid decays under FLIP: "               \
      "f = exp(-flip_decay dt) of it survives a step. A rate, so that the result does not depend on the step.")       \
    X(tpic_decay, GR_NONE, "[0, inf)", "1",                                                                           \
      "Under TPIC the velocity is v_pic + f (v + dv - v_pic) with f = exp(-rate dt), rate = tpic_decay c_w/dx. By "   \
      "default 0.2 with a cell-averaged density, else 0.03.")                                                         \
    X(tpic_least_decay, 0, "[0, inf)", "1",                                                                           \
      "Least rate of this decay over sqrt(g/dx), g the largest gravity. 6 keeps the velocities of the points of a "   \
      "cell alike in slow flow of soft grains, whose waves are slow; it damps the free fall of streams, too.")        \
    X(xpic_order, 2, "integer [1, 5]", "1", "Order of the XPIC filter; 1 is PIC.")                                    \
    X(cfl, 0.5, "(0, 1]", "1",                                                                                        \
      "Time step over dx/(c_w + largest speed); a simulation refuses more than the limit of the basis and dimension " \
      "(`granular.mpm.limits.COURANT_LIMIT`).")                                                                       \
    X(dt, GR_NONE, "(0, inf)", "s", "Fixed time step; None for the one that cfl gives.")                              \
    X(mass_cutoff, 1e-14, "[0, 0.01]", "1",                                                                           \
      "Nodes with less than this share of the mean mass of a point are left out. A cutoff is for round-off only: a "  \
      "tenth of a point changes a run-out by a fifth.")                                                               \
    X(sleep_speed, 0, "[0, inf)", "m/s",                                                                              \
      "Cells in which no point has been faster for 512 steps are not computed until one of their nodes would move "   \
      "faster. 0 to compute all. Not for nonlocal laws, xpic and walls that keep a pressure.")                        \
    X(shear_strain, 0, "integer [0, 1]", "1",                                                                         \
      "1 to sum up the plastic shear strain of each point since the start, as the field `shear_strain`.")

/* Parameters of the diffusion of the fluidity of a nonlocal law. */
#define GR_FLUIDITY_SCHEME(X)                                                                                           \
    X(substeps, 1, "integer [1, 100000]", "1",                                                                          \
      "Substeps of the law in a time step, each with its diffusion, at a velocity gradient that is held. The implicit " \
      "method is balanced with the law, so that a steady flow does not depend on them; more resolve what changes "      \
      "within t0.")                                                                                                     \
    X(tolerance, 1e-4, "(0, 1)", "1",                                                                                   \
      "Of the conjugate gradients, residual over the first one: such a part of the change by diffusion in a step may "  \
      "be wrong.")                                                                                                      \
    X(initial, GR_NONE, "[0, inf)", "1/s",                                                                              \
      "Fluidity of all points at the start. None for a local phase: the law of `MuI` for 10 t0, then "                  \
      "g = shear_rate/mu. Where g is 0 everywhere it stays 0 up to a friction close to mu_2.")                          \
    X(floor, 0, "[0, inf)", "1/s",                                                                                      \
      "Fluidity below which no cell falls by decay, so that what came to rest can flow again.")                         \
    X(pressure_averaging, GR_NONE, "[0, 1]", "1",                                                                       \
      "Depth in cells, to either side of a point, over which the term with 1/sqrt(p) has its mean, as under the "       \
      "largest component of gravity alone; surface cells feel it most. None for the depth that a point stands for: "    \
      "half a cell with linear shape functions, under which a cell has one pressure, and half the spacing of the "      \
      "points with splines. 0 for the value at p: thin layers then flow too fast, by 9 % at twice the height at which " \
      "they stop and 10 cells high.")

/* Parameters of the densities. X(name, default of smoothed, of cell_averaged, of particle, range, unit, description); a
 * density whose default is GR_NONE does not have the parameter. In the formulas c = ln(rho/rho_c), c_w is the speed of
 * compression waves, dx the cell size, and phi_i = m_i/(V_i rho_c) the filling fraction of a node: its mass over that
 * of its volume at rho_c. gdot is the plastic shear rate; for stress-free points, and with cell averages, it is the
 * shear rate of L plus abs(tr L). */
#define GR_DENSITY_SCHEME(X)                                                                                             \
    X(separation_strain, 0.02, 0.02, 0.02, "[0, inf)", "1",                                                              \
      "Points with c below -separation_strain are disconnected: they take no part in the averaging of the density.")     \
    X(diffusion, 0, 0.5, GR_NONE, "[0, inf)", "1",                                                                       \
      "dd: c relaxes towards the mean of its neighbours, extrapolated linearly so that a hydrostatic gradient is "       \
      "untouched, at the rate dd c_w/dx + ds gdot/c.")                                                                   \
    X(strain_diffusion, 20, 0, GR_NONE, "[0, inf)", "1",                                                                 \
      "ds, see diffusion. Strain makes the noise that is averaged, and a strain of c/ds averages it: the rest is a "     \
      "share of c for any stiffness, and a heap at rest keeps the density it has come to.")                              \
    X(relaxation, 0.3, 0.7, GR_NONE, "[0, inf)", "1",                                                                    \
      "kappa: c relaxes to the nodal density at the rate kappa gdot d, d the gap ln phi - c of the nodes inside the "    \
      "material, averaged over those around each, or of a cell that is averaged. Bound to plastic flow, it leaves "      \
      "heaps at rest and elastic waves alone.")                                                                          \
    X(relaxation_limit, 1, 0.5, GR_NONE, "[0, inf)", "1",                                                                \
      "eps: the rate of relaxation is eps g/c_w at most, with the largest gravity g of the scene: across a cell such a " \
      "source of pressure accelerates by about a share eps of g. Without it the noise of phi drowns the small "          \
      "compressions of stiff materials.")                                                                                \
    X(dead_band, 0.03, 0.1, GR_NONE, "[0, inf)", "1", "Gap d that may be noise of the positions of the points.")         \
    X(compression_rate, 3, 0.7, GR_NONE, "[0, inf)", "1",                                                                \
      "kappa_c: over-compressed material, with a gap beyond the dead band, relaxes at the rate kappa_c gdot "            \
      "(d - dead_band) without a limit, as material that converges on an outlet must.")                                  \
    X(shifting, 8, 2, GR_NONE, "[0, inf)", "1",                                                                          \
      "beta of particle shifting: points move by -beta gdot dt dx^2 sum_i max(0, phi_i - 1) grad S_i. With a smoothed "  \
      "density they take the velocity of where they come to; in cells that are averaged phi_i - 1 is replaced by "       \
      "(phi_i - 1) V_i/dx^dim and they keep theirs. Besides, they leave cells for neighbours with fewer points, at the " \
      "same beta times the difference of the filling fractions, as fast as the flow stretches along the axis.")          \
    X(shifting_limit, 0.05, 0.05, GR_NONE, "[0, 0.5]", "1", "Largest shift in a step, in cells.")                        \
    X(shifting_outlet_cells, 3, 3, GR_NONE, "integer [0, 1000]", "1",                                                    \
      "No shifting nearer than this to an opening, in cells: it would jam the outlet.")                                  \
    X(averaging_time, 2, GR_NONE, GR_NONE, "[0, inf)", "1",                                                              \
      "Time between two averagings of the density in dx/c_w, in whole steps and at least one; the steps between cost "   \
      "no more than plain ones. A time and not a number of steps, so that the result does not depend on the step.")      \
    X(weight_correction, 0.7, GR_NONE, GR_NONE, "[0, 1]", "1",                                                           \
      "Quadrature weight correction. The residual force E_i = sum_p q_p V_p grad S_i is the force of a uniform "         \
      "pressure on a node inside the material; an averaging takes this part of it away by the weights q_p of the "       \
      "points in the force, q_p += -weight_correction sum_i grad S_i . E_i in lengths of cells. The local mean of "      \
      "q_p is held at exp(c)/phi, so that the weighted volumes fill the volume they have. 0 for no weights.")            \
    X(weight_correction_limit, 0.5, GR_NONE, GR_NONE, "[0, 0.8]", "1",                                                   \
      "Largest abs(q_p - 1): a point of more weight is as much stiffer.")                                                \
    X(weight_correction_decay, 0.005, GR_NONE, GR_NONE, "[0, 1]", "1",                                                   \
      "Part of q_p - 1 that a point loses in an averaging: it forgets where it has been.")                               \
    X(flutter_damping, 0.04, GR_NONE, GR_NONE, "[0, 1]", "1",                                                            \
      "X: in slow plastic flow the unsteady part of the shear rate meets the viscosity X rho_c c_w h, with the depth "   \
      "h = p/max(rho_c g, |grad p|). Pressure makes strength but flow makes no pressure, so that waves of a whole "      \
      "layer grow close to yield; without damping layers flow at slopes below their angle of repose. Steady flow is "    \
      "not damped, nor is flow so fast that it turns stress back to its own direction before a wave can use it. "        \
      "0 for none.")                                                                                                     \
    X(slow_decay, GR_NONE, 3, GR_NONE, "[0, inf)", "1",                                                                  \
      "Rate, over c_w/dx, at which the velocity of points that flow slowly relaxes to that of the grid, added to "       \
      "tpic_decay: all of it where I/I0 is 0, none from slow_inertial_number on. Differences between the points of a "   \
      "cell, which share their stress, are noise there. 0 for none.")                                                    \
    X(slow_inertial_number, GR_NONE, 0.3, GR_NONE, "(0, inf)", "1",                                                      \
      "I/I0 from which flow is not slow. Laws without a rate are slow throughout.")

#define GR_X(name, value, range, unit, doc) double name;
struct gr_scheme_numbers {
    GR_SCHEME(GR_X)
};
#undef GR_X

#define GR_X(name, smoothed, averaged, particle, range, unit, doc) double name;
struct gr_density_numbers {
    GR_DENSITY_SCHEME(GR_X)
};
#undef GR_X

#define GR_X(name) GR_TRANSFER_##name,
enum gr_transfer { GR_TRANSFERS(GR_X) GR_TRANSFER_COUNT };
#undef GR_X

#define GR_X(name) GR_DENSITY_##name,
enum gr_density { GR_DENSITIES(GR_X) GR_DENSITY_COUNT };
#undef GR_X
