/* The partially regularised mu(I) of Barker & Gray 2017 (J. Fluid Mech. 828, 5-32): the friction after a step, as a share
 * of the trial friction. With x = I/I0, k = mu_inf I0 and the lower end x1 of the range where mu(I) is well posed,
 *
 *   mu = (mu_s + mu_2 x + k x^2)/(1 + x)       for x > x1,
 *   x  = x1 exp(alpha/mu_1^2 - alpha/mu^2)     below, which is mu = sqrt(alpha/ln(A/I)); mu_1 = mu(x1).
 *
 * A step is implicit in the stress. With m = tau_trial/p, B = xi G dt/sqrt(p) and xi = I0/(d sqrt(rho_s)) it is
 *
 *   mu + B x = m.
 *
 * Above x1 it is a quadratic, (B + k) x^2 + (B + mu_2 - m) x - (m - mu_s) = 0, whose discriminant is a sum of terms that
 * are not negative. Below, mu + B x(mu) is increasing in mu, and convex for mu^2 <= 2 alpha/3: Newton's method from
 * min(m, mu_1), where it is at least m, falls to the root and does not pass it. */
#pragma once

#include "core/simd.h"

#define GR_LARGEST_RATIO GR_PRECISION(1e60, 1e15) /* of m and B, so that their squares are finite */
#define GR_NEWTON_STEPS 200 /* a bound: while B x exceeds m a step reduces it by e or more, as ln x is concave in mu */
/* Relative size of a last step: the next would be below round-off, as steps fall by squares. */
#define GR_NEWTON_LAST GR_PRECISION(1e-10, 1e-4)
#define GR_SMALLEST_POWER GR_PRECISION(-700, -80) /* of e; v_exp */

struct gr_regularised_numbers {
    vd mu_s, mu_2, k, alpha, x1, mu_1, power_1, B_1; /* power_1 = alpha/mu_1^2, B_1 = xi G dt */
};

static inline struct gr_regularised_numbers gr_regularised_numbers_of(double mu_s, double mu_2, double B_1, double k,
                                                                      double alpha, double x1)
{
    const double mu_1 = (mu_s + x1 * (mu_2 + k * x1)) / (1 + x1);
    return (struct gr_regularised_numbers){.mu_s = v_set(mu_s),
                                           .mu_2 = v_set(mu_2),
                                           .k = v_set(k),
                                           .alpha = v_set(alpha),
                                           .x1 = v_set(x1),
                                           .mu_1 = v_set(mu_1),
                                           .power_1 = v_set(alpha / (mu_1 * mu_1)),
                                           .B_1 = v_set(B_1)};
}

/* Friction above x1. */
static inline vd gr_fast_friction(const struct gr_regularised_numbers *n, vd m, vd B)
{
    const vd zero = v_zero(), a = B + n->k, b = B + n->mu_2 - m, c = m - n->mu_s;
    const vd root = v_sqrt(v_fma(b, b, v_set(4.0) * (a * c)));
    const vd x = v_select(v_gt(b, zero), (c + c) / (b + root), (root - b) / (a + a));
    return v_fma(v_fma(n->k, x, n->mu_2), x, n->mu_s) / (v_set(1.0) + x);
}

/* Friction below x1 in the lanes of `wanted`, else undefined. A lane stops by itself: its result does not depend on other
 * lanes. */
static inline vd gr_creep_friction(const struct gr_regularised_numbers *n, vd m, vd B, vm wanted)
{
    vd mu = v_min(n->mu_1, m);
    const vd one = v_set(1.0), Bx1 = B * n->x1;
    for (int k = 0; k < GR_NEWTON_STEPS && m_bits(wanted); k++) {
        const vd inverse = one / mu, power = n->alpha * inverse * inverse;
        const vd Bx = Bx1 * v_exp(v_max(v_set(GR_SMALLEST_POWER), v_min(v_zero(), n->power_1 - power)));
        const vd slope = v_fma(Bx, (power + power) * inverse, one);
        const vd step = v_keep(wanted, v_max(v_zero(), (mu + Bx - m) / slope));
        mu = mu - step;
        wanted = m_and(wanted, v_gt(step, v_set(GR_NEWTON_LAST) * mu));
    }
    return mu;
}

/* tau/tau_trial.
 * Given: trial > 0, p > 0 in the lanes of `flows`; others are undefined. */
static inline vd gr_flow_regularised(const struct gr_regularised_numbers *n, vd trial, vd p, vm flows)
{
    const vd ratio = trial / p, most = v_set(GR_LARGEST_RATIO);
    const vd m = v_min(most, ratio), B = v_min(most, n->B_1 / v_sqrt(p));
    const vm creeps = m_and(flows, v_ge(n->mu_1, v_fnma(B, n->x1, m)));
    const vd fast = gr_fast_friction(n, m, B);
    const vd mu = m_bits(creeps) ? v_select(creeps, gr_creep_friction(n, m, B, creeps), fast) : fast;
    return v_min(v_set(1.0), mu / ratio);
}
