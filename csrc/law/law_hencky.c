/* The finite-strain law (hencky.h) at the points of the engine, whose stress is Cauchy's: e^c that of Kirchhoff.
 *
 * The pressure is that of the density, whatever the scheme. A nonlocal flow without a diffused fluidity is in its local
 * phase: the flow that it has where the fluidity is even, with g = gdot/mu. */
#include "law/hencky.h"

#define GR_FURTHEST 600.0 /* log-density that a point may have on its way out */

GR_INLINE void hencky_blocks_of(const int dim, const int flow, const struct gr_hencky_numbers *n,
                                const struct gr_law_call *call)
{
    const vd part = v_set(call->part), behind = v_set(call->behind);
    for (int64_t k = 0; k < call->n_blocks; k++) {
        const int64_t at = call->slot[k];
        const double *gradient = call->gradient + k * dim * dim * GR_W;
        const vd trace = gr_expansion(dim, gradient), g_star = v_set(call->g_star ? call->g_star[k] : 0);
        const vd c = v_clamp(v_fnma(behind, trace, v_load(call->log_density + at)), -GR_FURTHEST, GR_FURTHEST);
        const vd to_kirchhoff = v_exp(-v_clamp(v_fma(part, trace, c), -GR_FURTHEST, GR_FURTHEST)), to_cauchy = v_exp(c);
        struct gr_stress stress;
        vd L[9];
        for (int i = 0; i < dim * dim; i++) L[i] = part * v_load(gradient + i * GR_W);
        for (int i = 0; i < GR_STRESSES(dim); i++) stress.s[i] = to_kirchhoff * v_load(call->stress[i] + at);
        const vd rate = call->shear_rate ? v_load(call->shear_rate + at) : v_zero();
        const struct gr_hencky_point point = gr_hencky_update(dim, flow, n, L, c, &stress, g_star, rate);
        for (int i = 0; i < GR_STRESSES(dim); i++) v_store(call->stress[i] + at, to_cauchy * point.stress.s[i]);
        if (call->shear_rate) v_store(call->shear_rate + at, point.rate);
        if (call->g) v_store(call->g + at, point.g);
        if (call->gain) v_store(call->gain + at, v_keep(v_gt(point.g, v_zero()), point.g - g_star));
    }
}

/* `flow` is no literal: one body of the trial serves all laws. */
static __attribute__((noinline)) void hencky_blocks_2d(int flow, const struct gr_hencky_numbers *n,
                                                       const struct gr_law_call *call)
{
    hencky_blocks_of(2, flow, n, call);
}

static __attribute__((noinline)) void hencky_blocks_3d(int flow, const struct gr_hencky_numbers *n,
                                                       const struct gr_law_call *call)
{
    hencky_blocks_of(3, flow, n, call);
}

static inline void hencky_blocks(const int dim, int flow, const struct gr_hencky_numbers *n, const struct gr_law_call *call)
{
    if (dim == 2)
        hencky_blocks_2d(flow, n, call);
    else
        hencky_blocks_3d(flow, n, call);
}

/* The numbers of laws that have no grain size: only xi = I0/(d sqrt(rho_s)) counts. */
static inline struct gr_hencky_numbers sizeless(const struct gr_law_call *call, double mu_s, double mu_2, double xi)
{
    double q[GR_HENCKY_PARAMETER_COUNT] = {0};
    q[GR_HENCKY_P_K] = call->parameter[0], q[GR_HENCKY_P_G] = call->parameter[1];
    q[GR_HENCKY_P_mu_s] = mu_s, q[GR_HENCKY_P_mu_2] = mu_2, q[GR_HENCKY_P_I0] = xi;
    q[GR_HENCKY_P_rho_s] = q[GR_HENCKY_P_d] = q[GR_HENCKY_P_t0] = 1;
    return gr_hencky_numbers_of(q, call->dt);
}

static inline void law_hencky_elastic(const int dim, const struct gr_law_call *call)
{
    const struct gr_hencky_numbers n = sizeless(call, 1, 2, 1);
    hencky_blocks(dim, GR_HENCKY_elastic, &n, call);
}

static inline void law_hencky_drucker_prager(const int dim, const struct gr_law_call *call)
{
    const struct gr_hencky_numbers n = sizeless(call, call->parameter[2], 2 * call->parameter[2], 1);
    hencky_blocks(dim, GR_HENCKY_drucker_prager, &n, call);
}

static inline void law_hencky_mu_i(const int dim, const struct gr_law_call *call)
{
    const struct gr_hencky_numbers n = sizeless(call, call->parameter[2], call->parameter[3], call->parameter[4]);
    hencky_blocks(dim, GR_HENCKY_local_saturating, &n, call);
}

static inline void law_hencky_linear(const int dim, const struct gr_law_call *call)
{
    const struct gr_hencky_numbers n = sizeless(call, call->parameter[2], call->parameter[3], call->parameter[4]);
    hencky_blocks(dim, GR_HENCKY_local_linear, &n, call);
}

static inline void law_hencky_ngf(const int dim, const struct gr_law_call *call)
{
    const struct gr_hencky_numbers n = gr_hencky_numbers_of(call->parameter + GR_HENCKY_NGF_POINT, call->dt);
    if (call->g_star)
        hencky_blocks(dim, GR_HENCKY_nonlocal_saturating, &n, call);
    else
        hencky_blocks(dim, GR_HENCKY_local_saturating, &n, call);
}

static inline void law_hencky_ngf_linear(const int dim, const struct gr_law_call *call)
{
    const struct gr_hencky_numbers n = gr_hencky_numbers_of(call->parameter + GR_HENCKY_NGF_POINT, call->dt);
    if (call->g_star)
        hencky_blocks(dim, GR_HENCKY_nonlocal_linear, &n, call);
    else
        hencky_blocks(dim, GR_HENCKY_local_linear, &n, call);
}
