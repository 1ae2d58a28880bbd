/* Local flow rules, mu(I) and its linearisation: the shear stress after a step, as a share of the trial stress.
 *
 * The plastic shear rate gdot depends only on the local stress. A step is implicit in the stress,
 *
 *   tau_trial - tau = G dt gdot,  S0 = mu_s p,  S2 = mu_2 p,  alpha = xi G dt sqrt(p),  xi = I0/(d sqrt(rho_s)).
 *
 * For mu = mu_s + (mu_2 - mu_s)/(1 + I0/I), gdot = xi sqrt(p) (tau - S0)/(S2 - tau) (Dunatunga & Kamrin 2015, eq.
 * 2.13):
 *
 *   tau = 2H/(B + sqrt(B^2 - 4H)),  B = S2 + tau_trial + alpha,  H = S2 tau_trial + S0 alpha  (eq. 3.11-3.15).
 *
 * The discriminant is computed as a sum of terms that are not negative, (tau_trial - S2 + alpha)^2 + 4 alpha (S2 - S0).
 * For mu = mu_s + (mu_2 - mu_s) I/I0, gdot = xi sqrt(p) (tau - S0)/(S2 - S0) (Haeri & Skonieczny 2021, eq. 5):
 *
 *   tau = (tau_trial + beta S0)/(1 + beta),  beta = alpha/(S2 - S0). */
#pragma once

#include "core/simd.h"

struct gr_flow_numbers {
    vd mu_2, alpha_1, four_dmu, beta_1; /* alpha_1 = xi G dt, beta_1 = alpha_1/(mu_2 - mu_s) */
};

static inline struct gr_flow_numbers gr_flow_numbers_of(double mu_s, double mu_2, double alpha_1)
{
    return (struct gr_flow_numbers){.mu_2 = v_set(mu_2),
                                    .alpha_1 = v_set(alpha_1),
                                    .four_dmu = v_set(4.0 * (mu_2 - mu_s)),
                                    .beta_1 = v_set(alpha_1 / (mu_2 - mu_s))};
}

/* tau/tau_trial of mu(I).
 * Given: trial > S0 = mu_s p, p > 0. */
static inline vd gr_flow_mu_I(const struct gr_flow_numbers *n, vd trial, vd p, vd S0)
{
    const vd S2 = n->mu_2 * p, alpha = n->alpha_1 * v_sqrt(p), d = (trial - S2) + alpha;
    const vd H = v_fma(S2, trial, S0 * alpha), B = S2 + trial + alpha;
    return (H + H) / ((B + v_sqrt(v_fma(d, d, n->four_dmu * (alpha * p)))) * trial);
}

/* The same for the linear mu(I). */
static inline vd gr_flow_linear_mu_I(const struct gr_flow_numbers *n, vd trial, vd p, vd S0)
{
    const vd root = v_sqrt(p);
    return v_fma(n->beta_1, S0, trial * root) / ((root + n->beta_1) * trial);
}
