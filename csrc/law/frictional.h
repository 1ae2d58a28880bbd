/* The hypoelastic frictional laws: elastic below yield. Above it mu(I) flows (flow_rules.h), while Drucker-Prager
 * returns to tau = min(tau_trial, mu p). Disconnected material is stress-free. */
#pragma once

#include "law/flow_rules.h"
#include "law/trial.h"

/* Update of both laws: rate = 1 for mu(I), 0 for Drucker-Prager. Parameters: K, G, mu_s (or mu) and, for mu(I), mu_2,
 * xi. */
static inline void gr_frictional(const int dim, const int rate, const struct gr_law_call *call)
{
    const double *q = call->parameter;
    const vd K = v_set(q[0]), G = v_set(q[1]), mu_s = v_set(q[2]), zero = v_zero(), one = v_set(1.0);
    const struct gr_flow_numbers flow =
        rate ? gr_flow_numbers_of(q[2], q[3], q[4] * q[1] * call->dt) : (struct gr_flow_numbers){0};
    const vd to_rate = v_set(1.0 / (q[1] * call->dt));
    for (int64_t k = 0; k < call->n_blocks; k++) {
        const int64_t at = call->slot[k];
        struct gr_stress t = gr_trial(dim, call->gradient + k * dim * dim * GR_W, call, at, K, G);
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
                vd share = S0 / trial;
                if (rate) share = gr_flow_mu_I(&flow, trial, p, S0);
                scale = v_select(flows, share, scale);
                gamma = v_keep(flows, v_fnma(scale, trial, trial) * to_rate);
                if (call->g) fluidity = v_keep(flows, gamma * p / (scale * trial)); /* g = gdot/mu */
            }
            for (int i = 0; i < 3; i++) v_store(call->stress[i] + at, v_keep(dense, v_fma(scale, t.s[i], -p)));
            for (int i = 3; i < GR_STRESSES(dim); i++) v_store(call->stress[i] + at, v_keep(dense, scale * t.s[i]));
        }
        if (call->shear_rate) v_store(call->shear_rate + at, gamma);
        if (call->g) v_store(call->g + at, fluidity);
    }
}
