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

/* Trace of the increment of a block. */
static inline vd expansion_of(const int dim, const double *gradient)
{
    vd trace = v_load(gradient);
    for (int d = 1; d < dim; d++) trace = trace + v_load(gradient + d * (dim + 1) * GR_W);
    return trace;
}

static inline void law_ngf(const int dim, const struct gr_law_call *call)
{
    if (!call->g_star) {
        local_phase(dim, call);
        return;
    }
    const double *q = call->parameter + GR_NGF_POINT;
    const struct gr_fluidity_numbers n = gr_fluidity_numbers_of(q, call->dt);
    const vd K = v_set(call->parameter[GR_NGF_K]), G = v_set(q[GR_FLUIDITY_G]), zero = v_zero();
    const vd part = v_set(call->part), behind = v_set(call->behind);
    for (int64_t k = 0; k < call->n_blocks; k++) {
        const int64_t at = call->slot[k];
        const double *gradient = call->gradient + k * dim * dim * GR_W;
        const vd g_star = v_set(call->g_star[k]);
        struct gr_stress t = gr_trial(dim, gradient, call, at, K, G, part);
        const vd c = v_fnma(behind, expansion_of(dim, gradient), v_load(call->log_density + at));
        vd p = gr_split(&t);
        if (call->pressure_from_density) p = K * c;
        const vm dense = m_and(v_ge(c, zero), v_gt(p, zero));
        struct gr_fluidity_point point = {zero, zero, zero};
        if (m_bits(dense)) {
            const struct gr_inverse_pressure inverse = gr_invert_pressure(&n, p);
            const vd trial = v_sqrt_fast(gr_tau_squared(dim, &t)) * inverse.p;
            const vd m = v_min(v_set(GR_LARGEST_FRICTION), trial); /* NaN stays */
            point = gr_fluidity_update(&n, m, p, inverse, g_star, v_load(call->shear_rate + at));
            const vd scale = v_keep(dense, point.scale);
            p = v_keep(dense, p);
            for (int i = 0; i < 3; i++) t.s[i] = v_fma(scale, v_keep(dense, t.s[i]), -p);
            for (int i = 3; i < GR_STRESSES(dim); i++) t.s[i] = scale * v_keep(dense, t.s[i]);
        } else {
            for (int i = 0; i < GR_STRESSES(dim); i++) t.s[i] = zero;
        }
        for (int i = 0; i < GR_STRESSES(dim); i++) v_store(call->stress[i] + at, t.s[i]);
        v_store(call->shear_rate + at, v_keep(dense, point.g * point.mu));
        v_store(call->g + at, v_keep(dense, point.g));
        if (call->gain) v_store(call->gain + at, v_keep(dense, point.g - g_star));
    }
}
