/* Free rotation of a rigid body about its position, which is its centre of mass. In 2D only the moment about z counts. */
#pragma once

#include "body/body.h"

/* Inverse of the tensor of inertia in the axes of the scene, row-major, 1/(kg m^2); in 2D its zz component alone. */
void gr_inverse_inertia(const struct gr_body *body, int dim, const double orientation[4], double inverse[9]);

/* Change of the angular velocity by an impulse that acts at `arm` from the position. */
void gr_spin_up(const double inverse[9], const double arm[3], const double impulse[3], double change[3]);

/* Rotate a body without torque for dt. The angular momentum L in the axes of the scene is conserved exactly: the step is a
 * symmetric product of rotations about the principal axes, each by the rate L_k/I_k that it leaves unchanged, and so
 * time-reversible and symplectic, of second order (Dullweber, Leimkuhler & McLachlan 1997, J. Chem. Phys. 107, 5840).
 * Given: orientation, angular velocity at its beginning. Changed: both, to those at its end. */
void gr_turn_freely(const struct gr_body *body, double dt, double orientation[4], double omega[3]);
