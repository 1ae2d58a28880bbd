/* The hypoelastic frictional laws: elastic below yield. Above it mu(I) flows (flow_rules.h), while Drucker-Prager
 * returns to tau = min(tau_trial, mu p), and the regularised mu(I) flows at any shear stress (regularised_flow.h).
 * Disconnected material is stress-free.
 *
 * With cohesion c (Drucker & Prager 1952; with mu(I) as in Gans et al. 2023, J. Fluid Mech. 959, A41)
 *
 *   tau <= c + mu p,   in flow tau = c + mu(I) p for p > 0.
 *
 * I has no meaning in tension. The part of mu(I) that depends on the rate vanishes with p, and for p <= 0 the friction is
 * mu_s at every rate: tau = c + mu_s p. The cone ends at p = -c/mu_s, and the tensile strength p_t <= c/mu_s cuts it off.
 *
 * Material separates where p <= -p_t or ln(rho/rho_c) < -p_t/K. It then is stress-free until its density is rho_c again:
 * its grains touch, and it coheres as before. With c = p_t = 0 this is the rule without cohesion. */
#pragma once

#include "law/flow_rules.h"
#include "law/regularised_flow.h"
#include "law/trial.h"

/* Pressure that counts as none, Pa: the square of a single-precision number beyond it is not zero. */
#define GR_LEAST_BORNE GR_PRECISION(0.0, 1e-12)

enum gr_rate { GR_RATE_INDEPENDENT, GR_MU_I, GR_REGULARISED }; /* how friction depends on the rate */

struct gr_cohesion {
    vd cohesion, tensile_strength, loosest; /* Pa; Pa; log-density at which material separates */
};

/* The yield stress of a block, in parts: what does not depend on the rate, and the friction of p > 0. */
struct gr_yield {
    vd base, friction; /* Pa */
    vd pressed;        /* max(0, p) */
};

GR_INLINE struct gr_yield gr_yield_of(const int cohesive, const struct gr_cohesion *n, vd mu_s, vd p)
{
    const vd zero = v_zero();
    if (!cohesive) return (struct gr_yield){.base = zero, .friction = mu_s * p, .pressed = p};
    const vd pressed = v_max(zero, p);
    return (struct gr_yield){
        .base = v_max(zero, v_fma(mu_s, v_min(zero, p), n->cohesion)), .friction = mu_s * pressed, .pressed = pressed};
}

/* Points of a block that bear stress, at the pressure p and the log-density c. With cohesion, `separated` is updated. */
GR_INLINE vm gr_bears_stress(const int cohesive, const struct gr_cohesion *n, vd c, vd p, gr_real *separated)
{
    const vd zero = v_zero();
    if (!cohesive) return m_and(v_ge(c, zero), v_gt(p, v_set(GR_LEAST_BORNE)));
    const vd one = v_set(1.0), before = separated ? v_load(separated) : zero;
    const vd apart = v_select(v_ge(c, zero), zero, before);
    const vm holds = m_and(v_ge(c, n->loosest), v_gt(p + n->tensile_strength, zero));
    const vd after = v_select(holds, apart, one);
    if (separated) v_store(separated, after);
    return v_ge(zero, after);
}

/* Indices of the parameters of these laws: common to all; of mu(I); of the regularised law. The cohesion and the tensile
 * strength come after the parameters of Drucker-Prager, or of mu(I); the regularised law has none. */
enum { P_K, P_G, P_MU_S, P_AFTER_DRUCKER_PRAGER };
enum { P_MU_2 = P_AFTER_DRUCKER_PRAGER, P_XI, P_AFTER_MU_I };
enum { P_I0 = P_AFTER_MU_I, P_MU_INF, P_ALPHA, P_I1 };

/* Update of these laws; `rate` is an enum gr_rate. */
GR_INLINE void frictional_blocks(const int dim, const int rate, const int cohesive, const struct gr_law_call *call)
{
    const double *q = call->parameter, *of_cohesion = q + (rate ? P_AFTER_MU_I : P_AFTER_DRUCKER_PRAGER);
    const vd K = v_set(q[P_K]), G = v_set(q[P_G]), mu_s = v_set(rate == GR_REGULARISED ? 0.0 : q[P_MU_S]), zero = v_zero(),
             one = v_set(1.0);
    const double xi_G_dt = rate ? q[P_XI] * q[P_G] * call->dt : 0;
    struct gr_flow_numbers flow = {0};
    struct gr_regularised_numbers regularised = {0};
    if (rate == GR_MU_I) flow = gr_flow_numbers_of(q[P_MU_S], q[P_MU_2], xi_G_dt);
    if (rate == GR_REGULARISED)
        regularised =
            gr_regularised_numbers_of(q[P_MU_S], q[P_MU_2], xi_G_dt, q[P_MU_INF] * q[P_I0], q[P_ALPHA], q[P_I1] / q[P_I0]);
    struct gr_cohesion cohesion = {zero, zero, zero};
    if (cohesive)
        cohesion = (struct gr_cohesion){v_set(of_cohesion[0]), v_set(of_cohesion[1]), v_set(-of_cohesion[1] / q[P_K])};
    const vd to_rate = v_set(1.0 / (q[P_G] * call->dt));
    for (int64_t k = 0; k < call->n_blocks; k++) {
        const int64_t at = call->slot[k];
        struct gr_stress t = gr_trial(dim, call, k, K, G);
        const vd c = v_load(call->log_density + at);
        vd p = gr_split(&t), gamma = zero, fluidity = zero;
        if (call->pressure_from_density) p = K * c;
        const vm dense = gr_bears_stress(cohesive, &cohesion, c, p, call->separated ? call->separated + at : 0);
        if (!m_bits(dense)) {
            for (int i = 0; i < GR_STRESSES(dim); i++) v_store(call->stress[i] + at, zero);
        } else {
            p = v_keep(dense, p);
            const struct gr_yield yield = gr_yield_of(cohesive, &cohesion, mu_s, p);
            const vd tau2 = gr_tau_squared(dim, &t);
            vd S0 = yield.friction;
            if (cohesive) S0 = S0 + yield.base;
            const vm flows = m_and(dense, v_gt(tau2, S0 * S0));
            vd scale = v_keep(dense, one);
            if (m_bits(flows)) {
                const vd trial = v_sqrt(tau2);
                vd over = trial, share = S0 / trial;
                if (cohesive) over = over - yield.base;
                if (rate == GR_REGULARISED) share = gr_flow_regularised(&regularised, trial, p, flows);
                if (rate == GR_MU_I) share = gr_flow_mu_I(&flow, over, yield.pressed, yield.friction);
                if (rate == GR_MU_I && cohesive) share = v_fma(share, over, yield.base) / trial;
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

/* A material without cohesion does not pay for it. */
GR_INLINE void gr_frictional(const int dim, const int rate, const struct gr_law_call *call, double cohesion)
{
    if (cohesion > 0)
        frictional_blocks(dim, rate, 1, call);
    else
        frictional_blocks(dim, rate, 0, call);
}
