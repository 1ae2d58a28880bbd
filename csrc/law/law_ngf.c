/* Nonlocal granular fluidity: elastic, with the plastic shear rate g mu that the fluidity g allows; stress-free when
 * disconnected. The diffusion of g has been made (fluidity/); the rest of the step is fluidity_update.h.
 *
 * Without a diffused fluidity it is the mu(I) law, with g = gdot/mu: the local phase from which g is seeded. Points
 * that bear nothing have no fluidity, and bring none with them when they become dense again. */
#include "law/fluidity_update.h"
#include "law/trial.h"

#define GR_LARGEST_FRICTION 1e60 /* of a trial: its square is finite */

static inline void local_phase(const int dim, const struct gr_law_call *call)
{
    const double *q = call->parameter, *point = q + GR_NGF_POINT;
    const double xi = point[GR_FLUIDITY_I0] / (point[GR_FLUIDITY_d] * sqrt(point[GR_FLUIDITY_rho_s]));
    const double local[] = {q[GR_NGF_K], point[GR_FLUIDITY_G], point[GR_FLUIDITY_mu_s], point[GR_FLUIDITY_mu_2], xi};
    struct gr_law_call mu_i = *call;
    mu_i.parameter = local;
    law_frictional(dim, 1, &mu_i);
}

/* What the stages of a few blocks hand on. Stages, because each is a chain of operations that wait for one another:
 * a processor looks far enough ahead to begin the next block only if a chain is short. */
struct gr_ngf_block {
    vd p, m, scale; /* pressure, 0 where loose; trial friction; what is left of the trial stress */
    struct gr_inverse_pressure inverse;
};

/* Trial deviator, written in place of the stress, and its friction. */
static inline void try_block(const int dim, const struct gr_law_call *call, int64_t k, vd K, vd G,
                             const struct gr_fluidity_numbers *n, struct gr_ngf_block *block)
{
    const int64_t at = call->slot[k];
    const double *gradient = call->gradient + k * dim * dim * GR_W;
    struct gr_stress t = gr_trial(dim, gradient, call, at, K, G, v_set(call->part));
    const vd c = v_fnma(v_set(call->behind), gr_expansion(dim, gradient), v_load(call->log_density + at));
    vd p = gr_split(&t);
    if (call->pressure_from_density) p = K * c;
    block->p = v_keep(v_ge(c, v_zero()), v_max(v_zero(), p)); /* NaN stays: another substep must not take it for loose */
    block->inverse = gr_invert_pressure(n, block->p);
    const vd m = v_sqrt_fast(gr_tau_squared(dim, &t)) * block->inverse.p;
    block->m = v_min(v_set(GR_LARGEST_FRICTION), m); /* NaN stays */
    for (int i = 0; i < GR_STRESSES(dim); i++) v_store(call->stress[i] + at, t.s[i]);
}

static inline void update_block(const struct gr_law_call *call, int64_t k, const struct gr_fluidity_numbers *n,
                                struct gr_ngf_block *block)
{
    const int64_t at = call->slot[k];
    const vd zero = v_zero();
    const vm loose = v_ge(zero, block->p);
    const vd g_star = v_set(call->g_star[k]), rate = v_load(call->shear_rate + at);
    const struct gr_fluidity_point point = gr_fluidity_update(n, block->m, block->p, block->inverse, g_star, rate);
    block->scale = point.scale;
    v_store(call->shear_rate + at, v_select(loose, zero, point.g * point.mu));
    v_store(call->g + at, v_select(loose, zero, point.g));
    if (call->gain) v_store(call->gain + at, v_select(loose, zero, point.g - g_star));
}

static inline void return_block(const int dim, const struct gr_law_call *call, int64_t k, const struct gr_ngf_block *block)
{
    const int64_t at = call->slot[k];
    const vm loose = v_ge(v_zero(), block->p);
    for (int i = 0; i < GR_STRESSES(dim); i++) {
        vd s = block->scale * v_load(call->stress[i] + at);
        if (i < 3) s = s - block->p;
        v_store(call->stress[i] + at, v_select(loose, v_zero(), s));
    }
}

static inline void law_ngf(const int dim, const struct gr_law_call *call)
{
    enum { TOGETHER = 8 };
    if (!call->g_star) {
        local_phase(dim, call);
        return;
    }
    const double *q = call->parameter + GR_NGF_POINT;
    const struct gr_fluidity_numbers n = gr_fluidity_numbers_of(q, call->dt);
    const vd K = v_set(call->parameter[GR_NGF_K]), G = v_set(q[GR_FLUIDITY_G]);
    struct gr_ngf_block block[TOGETHER];
    for (int64_t first = 0; first < call->n_blocks; first += TOGETHER) {
        const int64_t left = call->n_blocks - first, count = left < TOGETHER ? left : TOGETHER;
        for (int64_t k = 0; k < count; k++) try_block(dim, call, first + k, K, G, &n, &block[k]);
        for (int64_t k = 0; k < count; k++) update_block(call, first + k, &n, &block[k]);
        for (int64_t k = 0; k < count; k++) return_block(dim, call, first + k, &block[k]);
    }
}
