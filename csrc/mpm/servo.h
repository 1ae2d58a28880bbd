/* A wall that keeps a pressure.
 *
 * Nearly incompressible material that is closed in leaves its mean pressure K ln(rho/rho_c) to errors of the volume of
 * 1e-3. A wall that can move makes it a boundary condition: it moves until the force on it is the pressure P times its
 * area A. It moves by an elastic strain, far less than a cell, and its nodes stay where they are. Its motion by u,
 * outwards, is a uniform change s = u/H of the volume of the connected material, with H the height of the domain:
 *
 *   s += dt (F/A - P)/(K T),   c -= change of s,   gap = ln phi - s - c,
 *
 * with F the force of the material on the wall, the mean over the steps since the wall moved last, and T = 8 dx/c_w. At rest
 * F/A tends to P as exp(-t/T). The filling fraction phi of nodes and cells is for the volume before the motion, so that the
 * gap to which the density relaxes (density_correction.h) is for the present volume of the material. A servo that changed
 * nothing but c would work against this relaxation for ever.
 *
 * The wall moves in the steps that average the density, and waits while no material fills half of its nodes. Its state
 * is among the numbers of the wall (wall_impulse.h). */
#pragma once

#include "mpm/engine.h"

struct gr_servo {
    int wall, axis, side; /* index of the wall; its axis; 1 at the upper end of the domain, -1 at the lower */
    double pressure;      /* P, Pa */
    double area;          /* m, m^2 in 3D */
    double height;        /* H, m */
    double rate;          /* 1/(K T), 1/(Pa s) */
    double limit;         /* largest strain to either side, 1 */
    double full_mass;     /* of the nodes of the wall at rho_c, kg */
    double mass;          /* of these nodes now, kg */
};

/* Strain s of the domain by the motion of the wall before this step; 0 without a wall that keeps a pressure. */
double gr_servo_strain(const struct gr_engine *e);

/* Move the wall by the force on it in this step, and set e->servo_shift, the change of the log-density of the points. */
void gr_move_servo(struct gr_engine *e);
