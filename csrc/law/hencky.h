/* The finite-strain law: Hencky elasticity combined with granular flow rules (Haeri & Skonieczny 2021,
 * Three-dimensional granular flow continuum modeling via MPM with hyperelastic nonlocal granular fluidity, section 3.2,
 * in another form).
 *
 * The stored energy per reference volume is G h:h + K c^2/2, with h the deviator of the logarithmic elastic strain and
 * c = ln(rho/rho_c):
 *
 *   Kirchhoff stress = 2 G h - p,  p = K c;  Cauchy stress = e^c times the Kirchhoff stress.
 *
 * Plastic flow preserves the volume and the principal axes of h. The stress therefore describes the whole state, h =
 * dev(stress)/2G. The elastic left Cauchy-Green tensor exp(2h) is not stored, and its determinant is 1 because every
 * step removes the trace of h. The published form stores F and F^p instead; F^p, stepped explicitly, changes its volume
 * in shear, and with it the pressure.
 *
 * A step:
 *
 *   h_trial = dev ln(F exp(2h) F^T)/2,  F = exp(dev L dt)      (strain.h; exact for a constant L)
 *   tau_trial = 2G sqrt(h_trial:h_trial/2),  tau after the flow of the step,  h = h_trial tau/tau_trial.
 *
 * Where c <= 0 the material is disconnected: stress, fluidity and plastic rate are zero. The elastic law has no such
 * rule.
 *
 * Accuracy: a few units in the last place relative to the larger of h and L dt, while both are small. For large ones
 * the condition of exp(2 h_trial) matters: 1e-13 at norms of 1/2. Norms of 2h and of dev L dt above GR_STRAIN_REACH are
 * reduced to it. */
#pragma once

#include <math.h>
#include <string.h>

#include "law/flow_rules.h"
#include "law/fluidity_update.h"
#include "law/strain.h"

struct gr_hencky_numbers {
    struct gr_fluidity_numbers fluidity;
    struct gr_flow_numbers flow;
    vd K, twoG, inv_twoG, mu_s, to_rate; /* to_rate = 1/(G dt) */
    vd reconnect_fluidity;               /* sqrt(2) reconnect_fluidity/(mu_2 dt) */
    const double *hardening;             /* h of hencky_blocks.h, which gives mu_s for each block; or NULL */
};

struct gr_hencky_point {
    struct gr_stress stress; /* Kirchhoff, Pa */
    vd g, rate;              /* fluidity, plastic shear rate, 1/s */
};

/* The numbers of the elasticity. */
static inline struct gr_hencky_numbers gr_hencky_elasticity_of(double K, double G, double dt)
{
    return (struct gr_hencky_numbers){
        .K = v_set(K), .twoG = v_set(2 * G), .inv_twoG = v_set(1 / (2 * G)), .to_rate = v_set(1 / (G * dt))};
}

/* The same of an elasticity with mu(I), of which only xi = I0/(d sqrt(rho_s)) counts. */
static inline struct gr_hencky_numbers gr_hencky_mu_I_of(double K, double G, double mu_s, double mu_2, double xi, double dt)
{
    struct gr_hencky_numbers n = gr_hencky_elasticity_of(K, G, dt);
    n.mu_s = v_set(mu_s);
    n.flow = gr_flow_numbers_of(mu_s, mu_2, xi * G * dt);
    return n;
}

static inline struct gr_hencky_numbers gr_hencky_numbers_of(const double parameter[GR_HENCKY_PARAMETER_COUNT], double dt)
{
#define GR_X(name, unit, doc) const double name = parameter[GR_HENCKY_P_##name];
    GR_HENCKY_PARAMETERS(GR_X)
#undef GR_X
    (void)t0, (void)p_averaging; /* used by gr_fluidity_numbers_of */
    struct gr_hencky_numbers n = gr_hencky_mu_I_of(K, G, mu_s, mu_2, I0 / (d * sqrt(rho_s)), dt);
    n.fluidity = gr_fluidity_numbers_of(parameter + GR_HENCKY_P_G, dt);
    n.reconnect_fluidity = v_set(M_SQRT2 * reconnect_fluidity / (mu_2 * dt));
    return n;
}

/* Frobenius norm of the symmetric part of L dt; in 2D L[4] is the component out of the plane. */
GR_INLINE vd gr_stretch_norm(const int dim, const vd *L)
{
    vd sum = v_zero();
    for (int i = 0; i < dim; i++) {
        sum = v_fma(L[i * dim + i], L[i * dim + i], sum);
        for (int j = 0; j < i; j++) {
            const vd shear = L[i * dim + j] + L[j * dim + i];
            sum = v_fma(v_set(0.5) * shear, shear, sum);
        }
    }
    if (dim == 2) sum = v_fma(L[4], L[4], sum);
    return v_sqrt(sum);
}

/* Deviator of the trial Kirchhoff stress. */
GR_INLINE struct gr_stress gr_hencky_trial(const int dim, const struct gr_hencky_numbers *n, const vd *L,
                                           const struct gr_stress *stress)
{
    struct gr_matrix full, strain;
    GR_EACH(dim, i, j) { strain.m[i][j] = stress->s[gr_place[i][j]] * n->inv_twoG; }
    GR_EACH(dim, i, j) { full.m[i][j] = i < dim && j < dim ? L[i * dim + j] : L[4]; }
    const struct gr_matrix h = gr_deviator(dim, &strain), gradient = gr_deviator(dim, &full);
    const struct gr_matrix trial = gr_trial_strain(dim, &h, &gradient);
    struct gr_stress out = {{v_zero()}};
    GR_EACH(dim, i, j)
    {
        if (j >= i) out.s[gr_place[i][j]] = trial.m[i][j] * n->twoG;
    }
    return out;
}

/* Result of a flow rule for p > 0: share = tau/tau_trial, fluidity, plastic shear rate. */
struct gr_hencky_return {
    vd share, g, rate;
};

GR_INLINE struct gr_hencky_return gr_hencky_local(const int flow, const struct gr_hencky_numbers *n, vd trial, vd p)
{
    const vd one = v_set(1.0), S0 = n->mu_s * p;
    const vm flows = v_gt(trial, S0);
    vd share = S0 / trial;
    if (flow == GR_HENCKY_linear_mu_I) share = gr_flow_linear_mu_I(&n->flow, trial, p, S0);
    if (flow == GR_HENCKY_mu_I) share = gr_flow_mu_I(&n->flow, trial, p, S0);
    share = v_select(flows, share, one);
    const vd rate = v_keep(flows, v_fnma(share, trial, trial) * n->to_rate);
    return (struct gr_hencky_return){.share = share, .rate = rate, .g = v_keep(flows, rate * p / (share * trial))};
}

/* The nonlocal flow rules. Where `before` is set the material was connected before the step; elsewhere it reconnects in
 * this step, with the fluidity `reconnected`. */
GR_INLINE struct gr_hencky_return gr_hencky_nonlocal(const int flow, const struct gr_hencky_numbers *n, vd trial, vd p,
                                                     vm before, vd reconnected, vd g_star, vd rate)
{
    const struct gr_inverse_pressure inverse = gr_invert_pressure(&n->fluidity, p);
    const vd one = v_set(1.0), m = trial * inverse.p, start = gr_fluidity_start(&n->fluidity, g_star);
    const struct gr_fluidity_point point =
        gr_fluidity_update(flow == GR_HENCKY_linear_ngf, &n->fluidity, m, inverse, start, rate);
    const vd scale = one / v_fma(n->fluidity.G_dt * reconnected, inverse.p, one);
    const vd share = v_select(before, point.scale, scale), g = v_select(before, point.g, reconnected);
    return (struct gr_hencky_return){.share = share, .g = g, .rate = v_select(before, point.mu, m * scale) * g};
}

/* The plastic flow of a step.
 * Given: the deviator of the trial stress, and p at the end of the step; for the rest see gr_hencky_nonlocal. */
GR_INLINE struct gr_hencky_point gr_hencky_flow(const int dim, const int flow, const struct gr_hencky_numbers *n,
                                                const struct gr_stress *trial, vd p, vm before, vd reconnected, vd g_star,
                                                vd rate)
{
    const vd zero = v_zero();
    const vm disconnected = v_ge(zero, p); /* NaN counts as connected, so that it appears in the stress */
    const int solid = flow == GR_HENCKY_elastic;
    struct gr_hencky_point out = {.g = zero, .rate = zero};
    struct gr_hencky_return r = {.share = v_set(1.0), .g = zero, .rate = zero};
    if (!solid) {
        const vd tau = v_sqrt(gr_tau_squared(dim, trial)), pressed = v_max(v_set(GR_LEAST_PRESSURE), p);
        if (flow == GR_HENCKY_linear_ngf || flow == GR_HENCKY_ngf)
            r = gr_hencky_nonlocal(flow, n, tau, pressed, before, reconnected, g_star, rate);
        else
            r = gr_hencky_local(flow, n, tau, pressed);
        out.g = v_select(disconnected, zero, r.g), out.rate = v_select(disconnected, zero, r.rate);
    }
    for (int i = 0; i < GR_STRESSES(dim); i++) {
        const vd s = i < 3 ? v_fma(r.share, trial->s[i], -p) : v_mul(r.share, trial->s[i]);
        out.stress.s[i] = solid ? s : v_select(disconnected, zero, s);
    }
    return out;
}

/* True if the points were connected before the step: a disconnected point has zero stress. */
GR_INLINE vm gr_hencky_is_connected(const struct gr_stress *stress)
{
    return v_gt(v_zero(), stress->s[0] + stress->s[1] + stress->s[2]);
}

/* A step at a block of points.
 * Given: L dt (row-major), c at the end of the step, the stress and the plastic shear rate before it, and the fluidity
 * after diffusion. */
GR_INLINE struct gr_hencky_point gr_hencky_update(const int dim, const int flow, const struct gr_hencky_numbers *n,
                                                  const vd *L, vd c, const struct gr_stress *stress, vd g_star, vd rate)
{
    const vd p = n->K * c;
    if (flow != GR_HENCKY_elastic && m_bits(v_ge(v_zero(), p)) == GR_ALL_LANES) return (struct gr_hencky_point){0};
    const struct gr_stress trial = gr_hencky_trial(dim, n, L, stress);
    const vd reconnected = n->reconnect_fluidity * gr_stretch_norm(dim, L);
    return gr_hencky_flow(dim, flow, n, &trial, p, gr_hencky_is_connected(stress), reconnected, g_star, rate);
}

/* A step at the block of points from k on. The rows have the order of hencky_points. */
GR_INLINE void hencky_block(const int dim, const int flow, const struct gr_hencky_numbers *n, double *const row[18],
                            int64_t k)
{
    const int stresses = GR_STRESSES(dim), first = dim * dim + 1, g = first + stresses;
    struct gr_stress stress;
    vd L[9];
    for (int i = 0; i < dim * dim; i++) L[i] = v_load(row[i] + k);
    if (dim == 2) L[4] = v_zero();
    for (int i = 0; i < stresses; i++) stress.s[i] = v_load(row[first + i] + k);
    const struct gr_hencky_point point =
        gr_hencky_update(dim, flow, n, L, v_load(row[dim * dim] + k), &stress, v_load(row[g] + k), v_load(row[g + 1] + k));
    for (int i = 0; i < stresses; i++) v_store(row[first + i] + k, point.stress.s[i]);
    v_store(row[g] + k, point.g);
    v_store(row[g + 1] + k, point.rate);
}

/* A step at arrays of points; an incomplete block goes through a buffer. `flow` is not a literal here, so that the trial
 * is compiled once and not for each flow rule. */
GR_INLINE void hencky_points(const int dim, const int flow, const struct gr_hencky_call *call)
{
    const struct gr_hencky_numbers n = gr_hencky_numbers_of(call->parameter, call->dt);
    const int first = dim * dim + 1, rows = first + GR_STRESSES(dim) + 2;
    double *row[18] = {0}, *last[18] = {0}, buffer[18][GR_W] = {{0}}; /* given: gradient, log-density; then those updated */
    for (int i = 0; i < dim * dim; i++) row[i] = (double *)call->gradient[i];
    row[dim * dim] = (double *)call->log_density;
    for (int i = 0; i < GR_STRESSES(dim); i++) row[first + i] = call->stress[i];
    row[rows - 2] = call->g, row[rows - 1] = call->shear_rate;
    int64_t k = 0;
    for (; k + GR_W <= call->n; k += GR_W) hencky_block(dim, flow, &n, row, k);
    const size_t bytes = sizeof(double) * (size_t)(call->n - k);
    if (!bytes) return;
    for (int i = 0; i < rows; i++) last[i] = memcpy(buffer[i], row[i] + k, bytes);
    hencky_block(dim, flow, &n, last, 0);
    for (int i = first; i < rows; i++) memcpy(row[i] + k, last[i], bytes);
}
