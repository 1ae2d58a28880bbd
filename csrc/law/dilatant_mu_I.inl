/* Hypoelasticity with mu(I) flow that dilates (dilatant.h); stress-free when disconnected. */
#ifdef GR_LIST_LAWS
GR_LAW(dilatant_mu_I)
#else
#include "law/dilatant.h"
#include "law/trial.h"

enum { P_DILATANT_K, P_DILATANT_G, P_DILATANT_MU_S, P_DILATANT_MU_2, P_DILATANT_XI, P_DILATANCY, P_PHI_C, P_PHI_FAST };

GR_INLINE void law_dilatant_mu_I(const int dim, const struct gr_law_call *call)
{
    const double *q = call->parameter, loosens = q[P_DILATANCY] * (q[P_PHI_C] - q[P_PHI_FAST]),
                 xi_dt = q[P_DILATANT_XI] * call->dt;
    const struct gr_dilatant_numbers n = {.rise = v_set(q[P_DILATANT_MU_2] - q[P_DILATANT_MU_S] + loosens),
                                          .loosens = v_set(loosens),
                                          .xi_dt = v_set(xi_dt),
                                          .G_xi_dt = v_set(xi_dt * q[P_DILATANT_G]),
                                          .K_xi_dt = v_set(xi_dt * q[P_DILATANT_K])};
    const vd K = v_set(q[P_DILATANT_K]), G = v_set(q[P_DILATANT_G]), mu_s = v_set(q[P_DILATANT_MU_S]), zero = v_zero();
    const vd m = v_set(q[P_DILATANCY]), phi_c = v_set(q[P_PHI_C]), one = v_set(1.0), to_rate = v_set(1.0 / call->dt);
    for (int64_t k = 0; k < call->n_blocks; k++) {
        const int64_t at = call->slot[k];
        struct gr_stress t = gr_trial(dim, call, k, K, G);
        vd c = v_load(call->log_density + at), bulking = v_load(call->bulking + at), gamma = zero, scale = one;
        (void)gr_split(&t);
        const vd trial_p = K * c;
        const vm dense = v_gt(trial_p, zero);
        if (m_bits(dense)) {
            const vd tau = v_sqrt(gr_tau_squared(dim, &t)), psi = m * (phi_c / bulking - phi_c), friction = mu_s + psi;
            const vm flows = m_and(dense, v_gt(tau, v_max(zero, friction) * trial_p));
            if (m_bits(flows)) {
                const struct gr_dilatant_flow flow = gr_flow_dilatant(&n, tau, trial_p, psi, friction, flows);
                scale = v_select(flows, v_min(one, flow.tau / tau), one);
                gamma = v_keep(flows, flow.gamma);
                c = v_select(flows, v_max(zero, c + flow.dilation), c);
                bulking = v_select(flows, bulking * v_exp(v_clamp(flow.dilation, -1.0, 1.0)), bulking);
            }
        }
        gr_loosen(v_ge(zero, trial_p), &c, &bulking);
        const vd p = K * c;
        for (int i = 0; i < 3; i++) v_store(call->stress[i] + at, v_keep(dense, v_fma(scale, t.s[i], -p)));
        for (int i = 3; i < GR_STRESSES(dim); i++) v_store(call->stress[i] + at, v_keep(dense, scale * t.s[i]));
        v_store(call->log_density + at, c);
        v_store(call->bulking + at, bulking);
        if (call->shear_rate) v_store(call->shear_rate + at, gamma * to_rate);
    }
}

GR_DESCRIBE_LAW(dilatant_mu_I,
                .doc = "mu(I) rheology that dilates towards a packing of the rate, stress-free when disconnected",
                .dilates = 1,
                .parameter = {GR_MU_I_PARAMETERS,
                              {"dilatancy", "1", "tangent of the dilation angle per packing fraction"},
                              {"phi_c", "1", "packing fraction of slow flow that goes on"},
                              {"phi_fast", "1", "that of fast flow, I much larger than I0"}})
#endif
