/* Friction that depends on the plastic strain (Klar et al. 2016, ACM Trans. Graph. 35, Drucker-Prager elastoplasticity
 * for sand animation, section 7.3). With q, the norm of the plastic strain summed over the steps,
 *
 *   phi = h0 + (h1 q - h3) exp(-h2 q),   tau <= mu p,  mu = 2 sqrt(3) sin(phi)/(3 - sin(phi)),
 *
 * the cone through triaxial compression at the friction angle phi; tau = |s|/sqrt(2). The flow of a step uses the
 * friction at its beginning and adds |increment of plastic strain| = gdot dt/sqrt(2) to q. */
#pragma once

#include "core/simd.h"

#define GR_DEGREE 0.017453292519943295 /* pi/180 */

/* sin(x) for 0 <= x <= pi/2 to 3e-16, by its power series up to x^19. */
static inline vd gr_sine(vd x)
{
    static const double factor[] = {-1.0 / (18 * 19), -1.0 / (16 * 17), -1.0 / (14 * 15), -1.0 / (12 * 13), -1.0 / (10 * 11),
                                    -1.0 / (8 * 9),   -1.0 / (6 * 7),   -1.0 / (4 * 5),   -1.0 / (2 * 3)};
    const vd square = x * x;
    vd sum = v_set(1.0);
    for (int k = 0; k < 9; k++) sum = v_fma(v_set(factor[k]) * square, sum, v_set(1.0));
    return x * sum;
}

/* Friction coefficient at the plastic strain q.
 * Given: h = (h0, h1, h2, h3) with h0, h1, h3 in degrees; q >= 0.
 * Returned: mu. */
static inline vd gr_hardened_friction(const double h[4], vd q)
{
    const vd decay = v_exp(v_max(v_set(-700.0), v_set(-h[2]) * q));
    const vd phi = v_fma(v_fma(v_set(h[1]), q, v_set(-h[3])), decay, v_set(h[0]));
    const vd sine = gr_sine(v_clamp(v_set(GR_DEGREE) * phi, 0.0, 90 * GR_DEGREE));
    return v_set(3.4641016151377544) * sine / (v_set(3.0) - sine);
}
