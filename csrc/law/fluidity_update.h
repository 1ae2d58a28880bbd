/* The nonlocal law at a material point: friction and fluidity after a step, from the trial friction.
 *
 * A step of length dt is implicit in the reaction of the fluidity and in the flow that it allows (Dunatunga & Kamrin,
 * Modelling silo clogging with nonlocal granular rheology, eq. 5.4-5.7; 5.7 lacks t0 and has a wrong sign):
 *
 *   mu = m/(1 + X),  X = G dt g/p,  m = tau_trial/p,
 *   g = g* - f [(mu_s - mu)/(mu_2 - mu) + k] g,  f = dt dmu/t0,  k = gdot sqrt(rho_s d^2/p)/I0,  dmu = mu_2 - mu_s.
 *
 * Multiplied out, with q = 1 + f k and X* = G dt g-star/p, this is a quadratic equation in X. With phi = f/mu_2 and
 * after division by mu_2, for m < mu_2, e = (mu_2 - m)/mu_2:
 *
 *   a X^2 + [e q + phi (mu_s - m) - X*] X - e X* = 0,  a = q + phi mu_s;
 *
 * for m >= mu_2, X = e + Y with e = (m - mu_2)/mu_2:
 *
 *   a Y^2 + [e q + phi (e mu_s - m dmu/mu_2) - X*] Y - e phi m dmu/mu_2 = 0.
 *
 * In both equations the last term is not positive. There is exactly one root that is not negative, and it is the one
 * with mu < mu_2. The discriminant is a sum of terms that are not negative, and no cancellation affects the result.
 * (The textbook formula loses eight digits in every tenth state.)
 *
 * The linear law has an unbounded friction: mu_2 is infinite in the denominator above, while dmu/I0 keeps its value
 * (Haeri & Skonieczny 2021, eq. 6):
 *
 *   g = g* - theta [(mu_s - mu) + dmu k] g,  theta = dt/t0,
 *   c X^2 + [q + theta (mu_s - m) - X*] X - X* = 0,  c = q + theta mu_s.
 *
 * A point represents a part of the depth through which p varies by h to either side. In k, 1/sqrt(p) is therefore
 * replaced by its mean 2/(sqrt(p + h) + sqrt(p - h)), without the second root where p < h. In the uppermost layer of
 * points below a free surface p = h, and the mean is sqrt(2) times the value at p.
 *
 * g-star = 0 remains zero up to m = (mu_2 + f mu_s)/(1 + f); beyond that mu becomes this value (k = 0). With the
 * unbounded friction the limit is m = mu_s + 1/theta. */
#pragma once

#include "law/law.h"

/* Smallest pressure used, Pa: squares of G dt g/p stay finite. */
#define GR_LEAST_PRESSURE GR_PRECISION(1e-30, 1e-12)

/* The coefficients of the quadratic equation are scaled by this power of two, which changes no bit of the root.
 * Products of two of them, and the single division for two quotients, then stay finite up to m = g_star = rate = 1e60, in
 * single precision 1e10. */
#define GR_FLUIDITY_UNIT GR_PRECISION(0x1p-160, 0x1p-20)

/* Constants of a step. */
struct gr_fluidity_numbers {
    vd mu_s, mu_2, below_mu_2, dmu_over_mu_2, inv_mu_2; /* friction */
    vd G_dt, inv_G_dt, p_averaging;                     /* Pa s; Pa */
    /* multiplied by GR_FLUIDITY_UNIT: */
    vd one, start;        /* 1; G dt */
    vd phi, a_phi;        /* f/mu_2, phi mu_s */
    vd theta, theta_mu_s; /* dt/t0 */
    vd twice_sink;        /* 2 f d sqrt(rho_s)/I0 */
};

struct gr_fluidity_point {
    vd scale, mu, g; /* 1/(1 + X), friction, 1; fluidity, 1/s */
};

static inline struct gr_fluidity_numbers gr_fluidity_numbers_of(const double parameter[GR_FLUIDITY_PARAMETER_COUNT],
                                                                double dt)
{
#define GR_X(name, unit, doc) const double name = parameter[GR_FLUIDITY_##name];
    GR_FLUIDITY_PARAMETERS(GR_X)
#undef GR_X
    const double unit = GR_FLUIDITY_UNIT, theta = unit * (dt / t0), phi = theta * (mu_2 - mu_s) / mu_2;
    return (struct gr_fluidity_numbers){
        .mu_s = v_set(mu_s),
        .mu_2 = v_set(mu_2),
        .below_mu_2 = v_set(nextafter(mu_2, 0)),
        .dmu_over_mu_2 = v_set((mu_2 - mu_s) / mu_2),
        .inv_mu_2 = v_set(1 / mu_2),
        .G_dt = v_set(G * dt),
        .inv_G_dt = v_set(1 / (G * dt)),
        .p_averaging = v_set(p_averaging),
        .one = v_set(unit),
        .start = v_set(unit * (G * dt)),
        .phi = v_set(phi),
        .a_phi = v_set(phi * mu_s),
        .theta = v_set(theta),
        .theta_mu_s = v_set(theta * mu_s),
        .twice_sink = v_set(2 * theta * (mu_2 - mu_s) * d * sqrt(rho_s) / I0),
    };
}

/* Quantities that an update needs of the pressure. A pressure p > 0 counts as GR_LEAST_PRESSURE at least. */
struct gr_inverse_pressure {
    vd p, sink, unit_g; /* 1/p; f k/rate, with the mean of 1/sqrt(p); p/(G dt), the fluidity for which X = 1, 1/s */
};

/* Compute them with one division. */
static inline struct gr_inverse_pressure gr_invert_pressure(const struct gr_fluidity_numbers *n, vd p)
{
    p = v_max(v_set(GR_LEAST_PRESSURE), p);
    /* One root uses the division unit, the other runs in parallel. */
    const vd roots = v_sqrt(p + n->p_averaging) + v_sqrt(v_max(v_zero(), p - n->p_averaging));
    const vd inverse = v_set(1.0) / (p * roots);
    return (struct gr_inverse_pressure){inverse * roots, n->twice_sink * (p * inverse), p * n->inv_G_dt};
}

/* Start value of a step: G dt g_star, scaled like the coefficients. A negative fluidity counts as zero. */
static inline vd gr_fluidity_start(const struct gr_fluidity_numbers *n, vd g_star)
{
    return n->start * v_max(v_zero(), g_star);
}

/* The point that belongs to the root: X = Y + offset, a Y^2 + b Y - c = 0 with a > 0 and c >= 0, scaled alike. The
 * quotients Y and 1/(1 + X) come from one division. */
static inline struct gr_fluidity_point gr_fluidity_of_root(vd a, vd b, vd c, vd offset, vd m, vd unit_g)
{
    const vd one = v_set(1.0), twice_a = a + a, twice_c = c + c, root = v_sqrt(v_fma(b, b, twice_a * twice_c));
    const vm rises = v_gt(b, v_zero());
    const vd above = v_select(rises, twice_c, root - b), below = v_select(rises, b + root, twice_a); /* Y */
    const vd whole = v_fma(below, one + offset, above);                                              /* below (1 + X) */
    const vd part = one / (below * whole), scale = below * (below * part);
    const vd X = v_fma(above * whole, part, offset);
    return (struct gr_fluidity_point){scale, m * scale, X * unit_g};
}

/* Update of the saturating law or, if `linear`, of the one with unbounded friction.
 * Given: the trial friction m in [0, 1e60], the inverse of the pressure p, gr_fluidity_start, and the plastic shear
 * rate of the step before, 1/s.
 * Returned: mu in [0, mu_2), of the linear law mu >= 0; g >= 0. NaN is never lost: it appears in g. */
GR_INLINE struct gr_fluidity_point gr_fluidity_update(const int linear, const struct gr_fluidity_numbers *n, vd m,
                                                      struct gr_inverse_pressure inverse, vd start, vd rate)
{
    const vd q = v_fma(inverse.sink, rate, n->one), a = q + n->a_phi;
    const vm beyond = v_ge(m, n->mu_2);
    struct gr_fluidity_point point;
    start = start * inverse.p; /* X* */
    if (linear) {
        const vd b = v_fma(n->theta, n->mu_s - m, q) - start;
        return gr_fluidity_of_root(q + n->theta_mu_s, b, start, v_zero(), m, inverse.unit_g);
    }
    if (!m_bits(beyond)) { /* the usual case, with fewer operations */
        const vd e = (n->mu_2 - m) * n->inv_mu_2, b = v_fma(e, q, n->phi * (n->mu_s - m)) - start;
        point = gr_fluidity_of_root(a, b, e * start, v_zero(), m, inverse.unit_g);
    } else {
        const vd e = v_abs(m - n->mu_2) * n->inv_mu_2, pull = n->phi * (n->dmu_over_mu_2 * m);
        const vd reaction = v_select(beyond, v_fma(n->a_phi, e, -pull), n->phi * (n->mu_s - m));
        const vd b = v_fma(e, q, reaction) - start, c = e * v_select(beyond, pull, start); /* the last term is -c */
        point = gr_fluidity_of_root(a, b, c, v_keep(beyond, e), m, inverse.unit_g);
    }
    point.mu = v_min(n->below_mu_2, point.mu); /* without this, rounding could give mu_2 */
    return point;
}

/* The same for arrays of points; an incomplete block goes through a buffer. */
static inline void fluidity_points(const struct gr_fluidity_call *call)
{
    const struct gr_fluidity_numbers n = gr_fluidity_numbers_of(call->parameter, call->dt);
    const double *const row[4] = {call->mu_trial, call->p, call->g_star, call->shear_rate};
    double buffer[6][GR_W] = {{0}};
    for (int64_t k = 0; k < call->n; k += GR_W) {
        const int whole = k + GR_W <= call->n, rest = whole ? 0 : (int)(call->n - k);
        vd in[4];
        for (int i = 0; i < 4; i++) {
            for (int lane = 0; lane < rest; lane++) buffer[i][lane] = row[i][k + lane];
            in[i] = v_load(whole ? row[i] + k : buffer[i]);
        }
        const struct gr_fluidity_point point =
            gr_fluidity_update(0, &n, in[0], gr_invert_pressure(&n, in[1]), gr_fluidity_start(&n, in[2]), in[3]);
        v_store(whole ? call->mu + k : buffer[4], point.mu);
        v_store(whole ? call->g + k : buffer[5], point.g);
        for (int lane = 0; lane < rest; lane++) call->mu[k + lane] = buffer[4][lane], call->g[k + lane] = buffer[5][lane];
    }
}
