/* Free rotation of a rigid body (turning.h). */
#include "body/turning.h"

#include <string.h>

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Principal axes of inertia in the axes of the scene; axis[k] is a unit vector. */
static void principal_axes(const struct gr_body *body, const double orientation[4], double axis[3][3])
{
    double q[9];
    gr_rotation_matrix(orientation, q);
    for (int k = 0; k < 3; k++)
        for (int d = 0; d < 3; d++) {
            axis[k][d] = 0;
            for (int c = 0; c < 3; c++) axis[k][d] += q[3 * d + c] * body->principal[3 * c + k];
        }
}

void gr_inverse_inertia(const struct gr_body *body, int dim, const double orientation[4], double inverse[9])
{
    double axis[3][3];
    memset(inverse, 0, 9 * sizeof(double));
    principal_axes(body, orientation, axis);
    for (int a = dim == 2 ? 2 : 0; a < 3; a++)
        for (int b = dim == 2 ? 2 : 0; b < 3; b++)
            for (int k = 0; k < 3; k++) inverse[3 * a + b] += axis[k][a] * axis[k][b] / body->inertia[k];
}

void gr_spin_up(const double inverse[9], const double arm[3], const double impulse[3], double change[3])
{
    const double torque[3] = {arm[1] * impulse[2] - arm[2] * impulse[1], arm[2] * impulse[0] - arm[0] * impulse[2],
                              arm[0] * impulse[1] - arm[1] * impulse[0]};
    for (int d = 0; d < 3; d++) change[d] = dot(inverse + 3 * d, torque);
}

void gr_turn_freely(const struct gr_body *body, double dt, double orientation[4], double omega[3])
{
    static const int order[5] = {0, 1, 2, 1, 0};
    double axis[3][3], momentum[3] = {0};
    principal_axes(body, orientation, axis);
    for (int k = 0; k < 3; k++)
        for (int d = 0; d < 3; d++) momentum[d] += body->inertia[k] * dot(axis[k], omega) * axis[k][d];
    for (int part = 0; part < 5; part++) {
        const int k = order[part];
        double rate[3];
        for (int d = 0; d < 3; d++) rate[d] = dot(momentum, axis[k]) / body->inertia[k] * axis[k][d];
        gr_turn(orientation, rate, k == 2 ? dt : dt / 2, orientation);
        principal_axes(body, orientation, axis);
    }
    memset(omega, 0, 3 * sizeof(double));
    for (int k = 0; k < 3; k++)
        for (int d = 0; d < 3; d++) omega[d] += dot(momentum, axis[k]) / body->inertia[k] * axis[k][d];
}
