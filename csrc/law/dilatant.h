/* Granular flow that changes its volume: mu(I) with a packing fraction of its own at each point.
 *
 * A point has the packing fraction phi at which it would be free of stress; its elastic log-density c is counted from
 * there, and p = K c. In flow, with the plastic shear gamma and s = I/(I + I0),
 *
 *   psi = m (phi - phi_c) + m (phi_c - phi_fast) s = m (phi - phi_eq(I)),   phi_eq = phi_c - (phi_c - phi_fast) s,
 *   d ln phi = -psi dgamma,   tau = (mu(I) + psi) p,   mu = mu_s + (mu_2 - mu_s) s,
 *
 * the dilatancy of Roux & Radjai 1998 with the equilibrium packing of Pouliquen, Cassar, Jop, Forterre & Nicolas 2006 (J.
 * Stat. Mech. P07020), which is linear in I where I is small, and Taylor's stress-dilatancy as in Pailha & Pouliquen 2009 (J.
 * Fluid Mech. 633): dissipation is mu(I) p gdot. The bulking of a point is phi_c/phi, and c grows by psi dgamma as the
 * material it belongs to dilates at its volume.
 *
 * A step is implicit in tau, p and I. With x = I/I0, q = sqrt(p), dgamma = xi dt x q and xi = I0/(d sqrt(rho_s))
 *
 *   q^2 = K c + K xi dt x psi(x) q,   tau_trial - G xi dt x q - (mu + psi)(x) q^2 = 0,
 *
 * with phi in psi from the beginning of the step, since it changes over a shear of 1/m. The first equation gives q(x), so
 * that the second is one equation for x, which falls to a single root unless loose material liquefies: there it may stay
 * positive, and q goes to zero. Newton's method within an interval that holds the root.
 *
 * With a critical-state line (Li & Wang 1998, J. Geotech. Geoenviron. Eng. 124, 1215) phi_c depends on the pressure:
 *
 *   1/phi_c(p) = 1/phi_c(0) - slope (p/p_a)^exponent,   phi_c(p) <= GR_DENSEST_CRITICAL.
 *
 * A step has phi_c of the trial pressure P = K c, and the fall of psi with the pressure that dilation adds, K psi dgamma, to
 * the first order: psi -> psi/(1 + b K dgamma) with b = m dphi_c/dp at P, and dgamma = xi dt x sqrt(P) in it. With phi_c(P)
 * alone the pressure of stiff dense material that is held in overshoots and rings where b K dgamma > 2. */
#pragma once

#include "core/simd.h"

#define GR_DILATANT_STEPS 100      /* a bound: four are usual, more where x has to be doubled for want of a root */
#define GR_DILATANT_LAST 1e-6      /* relative size of a last step: the error that it leaves is of the order of its square */
#define GR_DILATANT_UNBOUNDED 1e30 /* end of the interval before one is found */

#define GR_ATMOSPHERE 101325.0  /* p_a, Pa */
#define GR_DENSEST_CRITICAL 0.8 /* the largest packing of a fill: a line that goes on would leave no pores at 10 MPa */

struct gr_dilatant_numbers {
    vd rise, loosens;           /* of mu + psi, and of psi, from s = 0 to s = 1 */
    vd xi_dt, G_xi_dt, K_xi_dt; /* as above */
    vd yields;                  /* b K xi dt sqrt(P), with a critical-state line */
};

struct gr_dilatant_flow {
    vd tau, gamma, dilation; /* Pa; plastic shear; psi gamma */
};

/* q, and what else is known at x. */
struct gr_dilatant_state {
    vd s, slope, psi, friction, root, q; /* s and its derivative; psi; mu + psi; sqrt(beta^2 + 4 p); q */
    vd bends;                            /* of a line: change by it of the derivatives of psi and of mu + psi */
};

GR_INLINE struct gr_dilatant_state gr_dilatant_at(const int line, const struct gr_dilatant_numbers *n, vd x, vd p, vd psi,
                                                  vd friction)
{
    const vd one = v_set(1.0), inverse = one / (one + x), zero = v_zero();
    struct gr_dilatant_state at = {.s = x * inverse, .slope = inverse * inverse};
    at.psi = v_fma(n->loosens, at.s, psi), at.friction = v_fma(n->rise, at.s, friction);
    if (line) {
        const vd share = one / v_fma(n->yields, x, one), full = at.psi, steep = n->loosens * at.slope;
        at.psi = full * share;
        at.friction = at.friction + (at.psi - full);
        at.bends = share * v_fnma(n->yields, at.psi, steep) - steep;
    }
    const vd beta = n->K_xi_dt * x * at.psi;
    at.root = v_sqrt(v_fma(beta, beta, v_set(4.0) * p));
    const vd sum = v_abs(beta) + at.root;
    at.q = v_select(v_ge(beta, zero), v_set(0.5) * sum, (p + p) / sum);
    return at;
}

/* x at a constant pressure p: a quadratic. */
static inline vd gr_dilatant_start(const struct gr_dilatant_numbers *n, vd trial, vd p, vd friction)
{
    const vd a = n->G_xi_dt * v_sqrt(p), b = a + v_fma(friction + n->rise, p, -trial), c = v_fnma(friction, p, trial);
    const vd root = v_sqrt(v_fma(b, b, v_set(4.0) * (a * c)));
    return v_select(v_gt(b, v_zero()), (c + c) / (b + root), (root - b) / (a + a));
}

/* The flow of a step.
 * Given: `line`, 1 with a critical-state line; tau_trial > friction p, p = K c > 0 in the lanes of `flows`, else undefined;
 * psi and mu + psi at I = 0. A lane stops by itself: its result does not depend on other lanes. */
GR_INLINE struct gr_dilatant_flow gr_flow_dilatant(const int line, const struct gr_dilatant_numbers *n, vd trial, vd p,
                                                   vd psi, vd friction, vm flows)
{
    const vd zero = v_zero(), two = v_set(2.0), most = v_set(GR_DILATANT_UNBOUNDED);
    vd x = v_keep(flows, v_min(most, gr_dilatant_start(n, trial, p, friction))), low = zero, high = most;
    vm wanted = flows;
    for (int k = 0; k < GR_DILATANT_STEPS && m_bits(wanted); k++) {
        const struct gr_dilatant_state at = gr_dilatant_at(line, n, x, p, psi, friction);
        const vd per_q = at.friction * at.q, left = v_fnma(v_fma(n->G_xi_dt, x, per_q), at.q, trial);
        vd of_product = v_fma(n->loosens * x, at.slope, at.psi), steep = n->rise * at.slope; /* of x psi, mu + psi */
        if (line) of_product = v_fma(x, at.bends, of_product), steep = steep + at.bends;
        const vd q_slope = n->K_xi_dt * of_product * at.q / at.root;
        const vd fall = v_fma(v_fma(n->G_xi_dt, x, two * per_q), q_slope, v_fma(steep, at.q, n->G_xi_dt) * at.q);
        const vm above = v_gt(left, zero); /* of the root: x is below it */
        low = v_select(above, x, low), high = v_select(above, high, x);
        const vd newton = x + left / fall;
        const vd between = v_select(v_gt(most, high), v_set(0.5) * (low + high), v_fma(two, x, v_set(1.0)));
        const vd next = v_select(m_and(v_gt(newton, low), v_gt(high, newton)), newton, between);
        const vd step = v_abs(next - x);
        x = v_select(wanted, v_min(most, next), x);
        wanted = m_and(wanted, v_gt(step, v_set(GR_DILATANT_LAST) * x));
    }
    const struct gr_dilatant_state at = gr_dilatant_at(line, n, x, p, psi, friction);
    const vd gamma = n->xi_dt * x * at.q;
    return (struct gr_dilatant_flow){
        .tau = v_max(zero, at.friction * at.q * at.q), .gamma = gamma, .dilation = at.psi * gamma};
}

/* The critical packing at a pressure p > 0, and p times its derivative by p. */
struct gr_critical {
    vd packing, rise;
};

static inline struct gr_critical gr_critical_at(vd p, double phi_c, double slope, double exponent)
{
    const vd log_p = v_log(v_max(v_set(1e-9), p * v_set(1 / GR_ATMOSPHERE))), least = v_set(1 / GR_DENSEST_CRITICAL);
    const vd fall = v_set(slope) * v_exp(v_set(exponent) * log_p), inverse = v_set(1 / phi_c) - fall;
    const vd packing = v_set(1.0) / v_max(least, inverse);
    return (struct gr_critical){.packing = packing,
                                .rise = v_keep(v_gt(inverse, least), v_set(exponent) * fall * packing * packing)};
}

/* ln(b) for 0.05 < b <= 1: eight times the power series of artanh((r - 1)/(r + 1)) of r = b^1/4, r > 0.47; to 1e-8 at the
 * lower end, and to round-off from 0.3 on. */
static inline vd gr_log_below_one(vd b)
{
    const vd one = v_set(1.0), r = v_sqrt(v_sqrt(b)), z = (r - one) / (r + one), square = z * z;
    vd sum = v_set(1.0 / 19);
    for (int k = 17; k > 0; k -= 2) sum = v_fma(sum, square, v_set(1.0 / k));
    return v_set(8.0) * z * sum;
}

/* Opening up to which dense material keeps its packing, as a logarithmic strain: that from which schemes count points as
 * disconnected by default. Without it each elastic rebound would loosen the material for good. */
#define GR_DILATANT_KEEPS 0.02

/* Material free of stress that is denser than critical where it rests, and has opened farther, c < -GR_DILATANT_KEEPS: its
 * grains have moved apart, and it rests at the packing that it would have if it were pressed together by as much, or at the
 * critical one. */
static inline void gr_loosen(vm free, vd *c, vd *bulking)
{
    const vd one = v_set(1.0), limit = v_set(-GR_DILATANT_KEEPS), now = v_max(v_set(0.05), *bulking);
    const vm loosens = m_and(free, m_and(v_gt(one, *bulking), v_gt(limit, *c)));
    if (!m_bits(loosens)) return;
    const vd critical = *c - gr_log_below_one(v_min(one, now)); /* c if it rested at the critical packing */
    const vm apart = v_gt(limit, critical);
    const vd there = v_select(apart, one, now * v_exp(v_clamp(limit - *c, 0.0, 4.0)));
    *bulking = v_select(loosens, v_min(one, there), *bulking);
    *c = v_select(loosens, v_select(apart, critical, limit), *c);
}
