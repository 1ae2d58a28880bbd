/* The nonlocal law at a material point: friction and fluidity after a step, from the trial friction.
 *
 * A step of length dt is implicit in the reaction of the fluidity and in the flow that it allows (Dunatunga & Kamrin,
 * Modelling silo clogging with nonlocal granular rheology, eq. 5.4-5.7; 5.7 lacks t0 and has a wrong sign):
 *     mu = m/(1 + X),  X = G dt g/p,  m = tau_trial/p,
 *     g = g* - f [(mu_s - mu)/(mu_2 - mu) + k] g,  f = dt dmu/t0,  k = gdot sqrt(rho_s d^2/p)/I0,  dmu = mu_2 - mu_s.
 * Without the fraction, with q = 1 + f k and X* = G dt g-star/p, it is a quadratic equation in X. With phi = f/mu_2 and
 * all divided by mu_2, for m < mu_2, e = (mu_2 - m)/mu_2:
 *     a X^2 + [e q + phi (mu_s - m) - X*] X - e X* = 0,  a = q + phi mu_s;
 * for m >= mu_2, X = e + Y with e = (m - mu_2)/mu_2:
 *     a Y^2 + [e q + phi (e mu_s - m dmu/mu_2) - X*] Y - e phi m dmu/mu_2 = 0.
 * In both the last term is not positive: the root that is not negative is unique, it is the one with mu < mu_2, the
 * discriminant is a sum of terms that are not negative, and no sum of unlike signs decides the result (a text-book
 * root loses eight digits in every tenth state).
 *
 * The same with an unbounded friction, mu_2 = infinity in lambda but b = dmu/I0 as it is (Haeri & Skonieczny 2021, eq. 6):
 *     g = g* - theta [(mu_s - mu) + dmu k] g,  theta = dt/t0,
 *     c X^2 + [q + theta (mu_s - m) - X*] X - X* = 0,  c = q + theta mu_s.
 *
 * g-star = 0 stays zero up to m = (mu_2 + f mu_s)/(1 + f), beyond which mu becomes that (k = 0); of the
 * unbounded friction m = mu_s + 1/theta. */
#ifndef GR_LAW_FLUIDITY_UPDATE_H
#define GR_LAW_FLUIDITY_UPDATE_H

#include "law/law.h"

/* Pressures below this, Pa, are taken for it: squares of G dt g/p stay finite. */
#define GR_LEAST_PRESSURE 1e-30

/* The numbers of a step. */
struct gr_fluidity_numbers {
    vd mu_s, mu_2, below_mu_2, dmu_over_mu_2, inv_mu_2; /* friction */
    vd phi, a_phi;                                      /* f/mu_2, phi mu_s */
    vd theta, theta_mu_s;                               /* dt/t0 */
    vd G_dt, inv_G_dt;                                  /* Pa s */
    vd sink, largest_inv_root;                          /* f d sqrt(rho_s)/I0; 1/sqrt(p) in the sink is at most this */
};

struct gr_fluidity_point {
    vd mu, g; /* friction, 1; fluidity, 1/s */
};

static inline struct gr_fluidity_numbers gr_fluidity_numbers_of(const double parameter[GR_FLUIDITY_PARAMETER_COUNT],
                                                                double dt)
{
#define GR_X(name, unit, doc) const double name = parameter[GR_FLUIDITY_##name];
    GR_FLUIDITY_PARAMETERS(GR_X)
#undef GR_X
    const double phi = dt / t0 * (mu_2 - mu_s) / mu_2;
    return (struct gr_fluidity_numbers){
        .mu_s = v_set(mu_s),
        .mu_2 = v_set(mu_2),
        .below_mu_2 = v_set(nextafter(mu_2, 0)),
        .dmu_over_mu_2 = v_set((mu_2 - mu_s) / mu_2),
        .inv_mu_2 = v_set(1 / mu_2),
        .phi = v_set(phi),
        .a_phi = v_set(phi * mu_s),
        .theta = v_set(dt / t0),
        .theta_mu_s = v_set(dt / t0 * mu_s),
        .G_dt = v_set(G * dt),
        .inv_G_dt = v_set(1 / (G * dt)),
        .sink = v_set(dt / t0 * (mu_2 - mu_s) * d * sqrt(rho_s) / I0),
        .largest_inv_root = v_set(1 / sqrt(p_floor > GR_LEAST_PRESSURE ? p_floor : GR_LEAST_PRESSURE)),
    };
}

/* What the two quadratic equations share: q, X*, and the one root of a X^2 + b X - c = 0, a > 0, c >= 0, that is not
 * negative, without cancellation. */
struct gr_fluidity_start {
    vd q, X;
};

static inline struct gr_fluidity_start gr_fluidity_start_of(const struct gr_fluidity_numbers *n, vd p, vd g_star, vd rate)
{
    const vd inv_root = v_set(1.0) / v_sqrt_fast(p);
    return (struct gr_fluidity_start){
        .q = v_fma(n->sink * rate, v_min(inv_root, n->largest_inv_root), v_set(1.0)),
        .X = n->G_dt * v_max(v_zero(), g_star) * (inv_root * inv_root),
    };
}

static inline vd gr_fluidity_root(vd a, vd b, vd c)
{
    const vd root = v_sqrt_fast(v_fma(b, b, v_set(4.0) * (a * c)));
    const vm rises = v_gt(b, v_zero());
    return v_select(rises, c + c, root - b) / v_select(rises, b + root, v_set(2.0) * a);
}

/* Given: trial friction m in [0, 1e60], pressure p > 0, fluidity g_star after diffusion (negative: taken for zero),
 * plastic shear rate of the step before, 1/s. Returned: mu in [0, mu_2), g >= 0. NaN is never lost: g has it. */
static inline struct gr_fluidity_point gr_fluidity_update(const struct gr_fluidity_numbers *n, vd m, vd p, vd g_star,
                                                          vd rate)
{
    p = v_max(v_set(GR_LEAST_PRESSURE), p);
    const struct gr_fluidity_start start = gr_fluidity_start_of(n, p, g_star, rate);
    const vm beyond = v_ge(m, n->mu_2);
    const vd e = v_abs(m - n->mu_2) * n->inv_mu_2, pull = n->phi * (n->dmu_over_mu_2 * m);
    const vd reaction = v_select(beyond, v_fma(n->a_phi, e, -pull), n->phi * (n->mu_s - m));
    const vd b = v_fma(e, start.q, reaction) - start.X, c = e * v_select(beyond, pull, start.X); /* the last term is -c */
    const vd X = gr_fluidity_root(start.q + n->a_phi, b, c) + v_keep(beyond, e);
    /* rounding alone could make it mu_2 */
    return (struct gr_fluidity_point){.mu = v_min(n->below_mu_2, m / (v_set(1.0) + X)), .g = X * p * n->inv_G_dt};
}

/* The same with an unbounded friction. */
static inline struct gr_fluidity_point gr_fluidity_update_linear(const struct gr_fluidity_numbers *n, vd m, vd p, vd g_star,
                                                                 vd rate)
{
    p = v_max(v_set(GR_LEAST_PRESSURE), p);
    const struct gr_fluidity_start start = gr_fluidity_start_of(n, p, g_star, rate);
    const vd b = v_fma(n->theta, n->mu_s - m, start.q) - start.X;
    const vd X = gr_fluidity_root(start.q + n->theta_mu_s, b, start.X);
    return (struct gr_fluidity_point){.mu = m / (v_set(1.0) + X), .g = X * p * n->inv_G_dt};
}

/* Arrays of points. The last ones of a number that is no multiple of the lanes go through a buffer. */
static inline void fluidity_points(const struct gr_fluidity_call *call)
{
    const struct gr_fluidity_numbers n = gr_fluidity_numbers_of(call->parameter, call->dt);
    double in[4][GR_W], mu[GR_W], g[GR_W];
    int64_t k = 0;
    for (; k + GR_W <= call->n; k += GR_W) {
        const struct gr_fluidity_point point = gr_fluidity_update(&n, v_load(call->mu_trial + k), v_load(call->p + k),
                                                                  v_load(call->g_star + k), v_load(call->shear_rate + k));
        v_store(call->mu + k, point.mu);
        v_store(call->g + k, point.g);
    }
    if (k == call->n) return;
    for (int lane = 0; lane < GR_W; lane++) {
        const int64_t i = k + lane < call->n ? k + lane : k;
        in[0][lane] = call->mu_trial[i], in[1][lane] = call->p[i];
        in[2][lane] = call->g_star[i], in[3][lane] = call->shear_rate[i];
    }
    const struct gr_fluidity_point point =
        gr_fluidity_update(&n, v_load(in[0]), v_load(in[1]), v_load(in[2]), v_load(in[3]));
    v_store(mu, point.mu);
    v_store(g, point.g);
    for (int64_t i = k; i < call->n; i++) call->mu[i] = mu[i - k], call->g[i] = g[i - k];
}

#endif
