/* Hypoelasticity with mu(I) flow that dilates (dilatant.h); stress-free when disconnected. */
#ifdef GR_LIST_LAWS
GR_LAW(dilatant_mu_I)
#else
#include "law/dilatant.h"
#include "law/trial.h"

enum {
    P_DILATANT_K,
    P_DILATANT_G,
    P_DILATANT_MU_S,
    P_DILATANT_MU_2,
    P_DILATANT_XI,
    P_DILATANCY,
    P_PHI_C,
    P_PHI_FAST,
    P_CSL_SLOPE,
    P_CSL_EXPONENT
};

/* The numbers of a flow where the critical packing is that of the line at the trial pressure; returns it. */
static inline vd gr_dilatant_on_line(const double *q, vd trial_p, struct gr_dilatant_numbers *n)
{
    const vd m = v_set(q[P_DILATANCY]), p = v_max(v_set(1e-6), trial_p);
    const struct gr_critical critical = gr_critical_at(p, q[P_PHI_C], q[P_CSL_SLOPE], q[P_CSL_EXPONENT]);
    n->loosens = m * (critical.packing - v_set(q[P_PHI_FAST]));
    n->rise = v_set(q[P_DILATANT_MU_2] - q[P_DILATANT_MU_S]) + n->loosens;
    n->yields = m * critical.rise * n->K_xi_dt / v_sqrt(p);
    return critical.packing;
}

GR_INLINE void law_dilatant_mu_I(const int dim, const struct gr_law_call *call)
{
    const double *q = call->parameter, loosens = q[P_DILATANCY] * (q[P_PHI_C] - q[P_PHI_FAST]),
                 xi_dt = q[P_DILATANT_XI] * call->dt;
    const int line = q[P_CSL_SLOPE] > 0;
    struct gr_dilatant_numbers n = {.rise = v_set(q[P_DILATANT_MU_2] - q[P_DILATANT_MU_S] + loosens),
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
            const vd critical = line ? gr_dilatant_on_line(q, trial_p, &n) : phi_c;
            const vd tau = v_sqrt(gr_tau_squared(dim, &t)), psi = m * (phi_c / bulking - critical), friction = mu_s + psi;
            const vm flows = m_and(dense, v_gt(tau, v_max(zero, friction) * trial_p));
            if (m_bits(flows)) {
                const struct gr_dilatant_flow flow = line ? gr_flow_dilatant(1, &n, tau, trial_p, psi, friction, flows)
                                                          : gr_flow_dilatant(0, &n, tau, trial_p, psi, friction, flows);
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
                .parameter = {
                    GR_MU_I_PARAMETERS,
                    {"dilatancy", "1", "tangent of the dilation angle per packing fraction"},
                    {"phi_c", "1", "packing fraction of slow flow that goes on"},
                    {"phi_fast", "1", "that of fast flow, I much larger than I0"},
                    {"csl_slope", "1", "fall of the critical void ratio from no pressure to that of the atmosphere"},
                    {"csl_exponent", "1", "power of the pressure with which it falls"}})
#endif
