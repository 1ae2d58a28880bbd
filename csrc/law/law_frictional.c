/* The trans-phase mu(I) law: elastic below yield, mu(I) flow above it, stress-free when disconnected.
 *
 * The implicit return of the equivalent shear stress solves (Dunatunga & Kamrin 2015, eq. 3.11-3.15)
 *     tau^2 - B tau + H = 0,  B = S2 + tau_tr + alpha,  H = S2 tau_tr + S0 alpha,
 *     S0 = mu_s p,  S2 = mu_2 p,  alpha = xi G dt sqrt(p),
 * by its smaller root 2H/(B + sqrt(B^2 - 4H)). The discriminant is written as the sum of non-negative
 * terms (tau_tr - S2 + alpha)^2 + 4 alpha (S2 - S0), so that nothing cancels.
 * Drucker-Prager is the same return with tau = min(tau_tr, mu p). */
#include "law/trial.h"

/* What both frictional laws share; rate = 1 for mu(I), 0 for Drucker-Prager. */
static inline void law_frictional(const int dim, const int rate, const struct gr_law_call *call)
{
    const double *q = call->parameter;
    const vd K = v_set(q[0]), G = v_set(q[1]), mu_s = v_set(q[2]), zero = v_zero(), one = v_set(1.0);
    const vd mu_2 = v_set(rate ? q[3] : q[2]), alpha_1 = v_set(rate ? q[4] * q[1] * call->dt : 0.0);
    const vd four_dmu = v_set(rate ? 4.0 * (q[3] - q[2]) : 0.0), to_rate = v_set(1.0 / (q[1] * call->dt));
    for (int64_t k = 0; k < call->n_blocks; k++) {
        const int64_t at = call->slot[k];
        struct gr_stress t = gr_trial(dim, call->gradient + k * dim * dim * GR_W, call, at, K, G, one);
        const vd c = v_load(call->log_density + at);
        vd p = gr_split(&t), gamma = zero, fluidity = zero;
        if (call->pressure_from_density) p = K * c;
        const vm dense = m_and(v_ge(c, zero), v_gt(p, zero));
        if (!m_bits(dense)) {
            for (int i = 0; i < GR_STRESSES(dim); i++) v_store(call->stress[i] + at, zero);
        } else {
            p = v_keep(dense, p);
            const vd tau2 = gr_tau_squared(dim, &t), S0 = mu_s * p;
            const vm flows = m_and(dense, v_gt(tau2, S0 * S0));
            vd scale = v_keep(dense, one);
            if (m_bits(flows)) {
                const vd trial = v_sqrt_fast(tau2);
                vd above = S0, below = one; /* tau = above/below: one division for tau/trial */
                if (rate) {
                    const vd S2 = mu_2 * p, alpha = alpha_1 * v_sqrt_fast(p), d = (trial - S2) + alpha;
                    const vd H = v_fma(S2, trial, S0 * alpha), B = S2 + trial + alpha;
                    above = H + H, below = B + v_sqrt_fast(v_fma(d, d, four_dmu * (alpha * p)));
                }
                scale = v_select(flows, above / (below * trial), scale);
                gamma = v_keep(flows, v_fnma(scale, trial, trial) * to_rate);
                if (call->g) fluidity = v_keep(flows, gamma * p / (scale * trial)); /* gdot/mu */
            }
            for (int i = 0; i < 3; i++) v_store(call->stress[i] + at, v_keep(dense, v_fma(scale, t.s[i], -p)));
            for (int i = 3; i < GR_STRESSES(dim); i++) v_store(call->stress[i] + at, v_keep(dense, scale * t.s[i]));
        }
        if (call->shear_rate) v_store(call->shear_rate + at, gamma);
        if (call->g) v_store(call->g + at, fluidity);
    }
}

static inline void law_mu_i(const int dim, const struct gr_law_call *call) { law_frictional(dim, 1, call); }
static inline void law_drucker_prager(const int dim, const struct gr_law_call *call) { law_frictional(dim, 0, call); }
