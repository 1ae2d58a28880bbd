/* Nonlocal granular fluidity (NGF): hypoelastic, with the plastic shear rate g mu that the fluidity g allows;
 * stress-free when disconnected. The diffusion of g comes before (fluidity/); the rest of the step is
 * fluidity_update.h.
 *
 * While no fluidity is diffused the law is mu(I), with g = gdot/mu: this local phase provides the initial fluidity.
 * Disconnected points have no fluidity, and bring none when they become dense again. */
#ifdef GR_LIST_LAWS
GR_LAW(ngf)
#else
#include "law/frictional.h"
#include "law/substep.h"

/* Order of the parameters; the parameters of the update at a point come last, all together. */
enum { NGF_K, NGF_A, NGF_POINT };

GR_INLINE void local_phase(const int dim, const struct gr_law_call *call)
{
    const double *q = call->parameter, *point = q + NGF_POINT;
    const double xi = point[GR_FLUIDITY_I0] / (point[GR_FLUIDITY_d] * sqrt(point[GR_FLUIDITY_rho_s]));
    const double local[] = {q[NGF_K], point[GR_FLUIDITY_G], point[GR_FLUIDITY_mu_s], point[GR_FLUIDITY_mu_2], xi};
    struct gr_law_call mu_I = *call;
    mu_I.parameter = local;
    gr_frictional(dim, GR_MU_I, &mu_I, 0);
}

/* Intermediate results that the stages hand on for a few blocks. Each stage is a chain of dependent operations. A
 * processor only looks far enough ahead to begin the next block if these chains are short, hence the separate stages. */
struct gr_ngf_block {
    vd p, m, scale; /* pressure, 0 where disconnected; trial friction; remaining share of the trial stress */
    struct gr_inverse_pressure inverse;
};

/* Elastic moduli, and the constants of the update. */
struct gr_ngf_numbers {
    vd K, G;
    struct gr_fluidity_numbers point;
};

/* The pressure that follows from the log-density c, or the given p; 0 where disconnected. NaN remains: another substep must
 * not mistake it for disconnected. */
GR_INLINE vd pressure_of(const struct gr_law_call *call, vd K, vd c, vd p)
{
    if (call->pressure_from_density) p = K * c;
    return v_keep(v_ge(c, v_zero()), v_max(v_zero(), p));
}

/* The trial state of the whole step: the deviators R of the rotated stress and D of the elastic increment.
 * Returned: the pressure at the end of the step. */
GR_INLINE vd trial_of_substep(const int dim, const struct gr_law_call *call, int64_t k, const struct gr_ngf_numbers *n, vd c,
                              struct gr_stress *turned, struct gr_stress *strained)
{
    const struct gr_gradient gradient = gr_gradient_of(dim, call, k);
    *turned = gr_turned(dim, gradient, call, call->slot[k]);
    for (int i = 0; i < GR_STRESSES(dim); i++) strained->s[i] = v_zero();
    gr_strain(dim, gradient, n->K, n->G, strained);
    const vd p = gr_split(turned);
    return pressure_of(call, n->K, c, p + gr_split(strained));
}

/* The first of many substeps: it sets the state between substeps and updates the fluidity once. */
GR_INLINE void begin_blocks(const int dim, const struct gr_law_call *call, const struct gr_ngf_numbers *n)
{
    for (int64_t k = 0; k < call->n_blocks; k++) {
        struct gr_stress turned, strained;
        const int64_t at = call->slot[k];
        const vd trace = gr_expansion(dim, gr_gradient_of(dim, call, k));
        const vd p = trial_of_substep(dim, call, k, n, v_load(call->log_density + at) - trace, &turned, &strained);
        gr_substeps_begin(dim, &n->point, &turned, &strained, p, call->substeps, at);
    }
    for (int64_t k = 0; k < call->n_blocks; k++) {
        const int64_t at = call->slot[k];
        const vd g_star = v_load(call->g_star + k * GR_W), start = gr_fluidity_start(&n->point, g_star);
        const vd g =
            gr_substep(0, 0, &n->point, v_set(call->fraction), call->substeps, at, start, v_zero(), call->shear_rate + at);
        v_store(call->g + at, g);
        if (call->gain) v_store(call->gain + at, g - g_star);
    }
}

/* The trial deviator, stored in place of the stress, and the trial friction. `many`: the last of many substeps. */
GR_INLINE void trial_block(const int dim, const int many, const struct gr_law_call *call, int64_t k,
                           const struct gr_ngf_numbers *n, struct gr_ngf_block *block)
{
    const int64_t at = call->slot[k];
    const vd c = v_load(call->log_density + at);
    struct gr_stress t, strained;
    if (many) {
        block->p = trial_of_substep(dim, call, k, n, c, &t, &strained);
        gr_substeps_end(dim, call->fraction, call->substeps, at, &t, &strained);
    } else {
        t = gr_trial(dim, call, k, n->K, n->G);
        block->p = pressure_of(call, n->K, c, gr_split(&t));
    }
    block->inverse = gr_invert_pressure(&n->point, block->p);
    const vd m = v_sqrt(gr_tau_squared(dim, &t)) * block->inverse.p;
    block->m = v_min(v_set(GR_LARGEST_FRICTION), m); /* NaN remains */
    for (int i = 0; i < GR_STRESSES(dim); i++) v_store(call->stress[i] + at, t.s[i]);
}

GR_INLINE void update_block(const struct gr_law_call *call, int64_t k, const struct gr_fluidity_numbers *n,
                            struct gr_ngf_block *block)
{
    const int64_t at = call->slot[k];
    const vd zero = v_zero();
    const vm disconnected = v_ge(zero, block->p);
    const vd g_star = v_load(call->g_star + k * GR_W), rate = v_load(call->shear_rate + at);
    const struct gr_fluidity_point point =
        gr_fluidity_update(0, n, block->m, block->inverse, gr_fluidity_start(n, g_star), rate);
    block->scale = point.scale;
    v_store(call->shear_rate + at, v_select(disconnected, zero, point.g * point.mu));
    v_store(call->g + at, v_select(disconnected, zero, point.g));
    if (call->gain) v_store(call->gain + at, v_select(disconnected, zero, point.g - g_star));
}

GR_INLINE void return_block(const int dim, const struct gr_law_call *call, int64_t k, const struct gr_ngf_block *block)
{
    const int64_t at = call->slot[k];
    const vm disconnected = v_ge(v_zero(), block->p);
    for (int i = 0; i < GR_STRESSES(dim); i++) {
        vd s = block->scale * v_load(call->stress[i] + at);
        if (i < 3) s = s - block->p;
        v_store(call->stress[i] + at, v_select(disconnected, v_zero(), s));
    }
}

/* The whole step, or the last of its substeps. */
GR_INLINE void flow_blocks(const int dim, const int many, const struct gr_law_call *call, const struct gr_ngf_numbers *n)
{
    enum { TOGETHER = 8 };
    struct gr_ngf_block block[TOGETHER];
    for (int64_t first = 0; first < call->n_blocks; first += TOGETHER) {
        const int64_t left = call->n_blocks - first, count = left < TOGETHER ? left : TOGETHER;
        for (int64_t k = 0; k < count; k++) trial_block(dim, many, call, first + k, n, &block[k]);
        for (int64_t k = 0; k < count; k++) update_block(call, first + k, &n->point, &block[k]);
        for (int64_t k = 0; k < count; k++) return_block(dim, call, first + k, &block[k]);
    }
}

GR_INLINE void law_ngf(const int dim, const struct gr_law_call *call)
{
    if (!call->g_star) {
        local_phase(dim, call);
        return;
    }
    const double *q = call->parameter + NGF_POINT;
    const struct gr_ngf_numbers n = {v_set(call->parameter[NGF_K]), v_set(q[GR_FLUIDITY_G]),
                                     gr_fluidity_numbers_of(q, call->dt)};
    if (!call->substeps)
        flow_blocks(dim, 0, call, &n);
    else if (call->begins)
        begin_blocks(dim, call, &n);
    else
        flow_blocks(dim, 1, call, &n);
}

GR_DESCRIBE_LAW(
    ngf,
    .doc = "nonlocal granular fluidity, stress-free when disconnected (Dunatunga & Kamrin, Modelling silo clogging with "
           "nonlocal granular rheology, eq. 2.1, 2.2)",
    .reaction = GR_NGF, .fluidity = NGF_POINT,
    .parameter = {{"K", "Pa", "bulk modulus"}, {"A", "1", "nonlocal amplitude"}, GR_FLUIDITY_PARAMETERS(GR_INFO)})
#endif
