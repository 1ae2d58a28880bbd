/* The finite-strain law (hencky.h) for blocks of points of the engine. The engine stores the Cauchy stress, which is
 * e^c times the Kirchhoff stress, c = ln(rho/rho_c).
 *
 * Whatever the scheme, the pressure follows from the density. While the fluidity is not yet diffused, a nonlocal flow rule
 * is in its local phase: it uses the flow rule that it equals where the fluidity is uniform, with g = gdot/mu. */
#pragma once

#include "law/hencky.h"
#include "law/substep.h"

/* Friction that depends on the plastic strain (Klar et al. 2016, ACM Trans. Graph. 35, Drucker-Prager elastoplasticity
 * for sand animation, section 7.3). With q, the norm of the plastic strain summed over the steps,
 *
 *   phi = h0 + (h1 q - h3) exp(-h2 q),   tau <= mu p,  mu = 2 sqrt(3) sin(phi)/(3 - sin(phi)),
 *
 * the cone through triaxial compression at the friction angle phi; tau = |s|/sqrt(2). The flow of a step uses the
 * friction at its beginning and adds |increment of plastic strain| = gdot dt/sqrt(2) to q. */
#define GR_DEGREE 0.017453292519943295 /* pi/180 */

/* sin(x) for 0 <= x <= pi/2 to 3e-16, by its power series up to x^19. */
static inline vd gr_sine(vd x)
{
    static const double factor[] = {-1.0 / (18 * 19), -1.0 / (16 * 17), -1.0 / (14 * 15), -1.0 / (12 * 13), -1.0 / (10 * 11),
                                    -1.0 / (8 * 9),   -1.0 / (6 * 7),   -1.0 / (4 * 5),   -1.0 / (2 * 3)};
    const vd square = x * x;
    vd sum = v_set(1.0);
    for (int k = 0; k < 9; k++) sum = v_fma(v_set(factor[k]) * square, sum, v_set(1.0));
    return x * sum;
}

#define TWO_SQRT_3 3.4641016151377544 /* mu = 2 sqrt(3) sin(phi)/(3 - sin(phi)) of triaxial compression */

/* Friction coefficient at the plastic strain q.
 * Given: h = (h0, h1, h2, h3) with h0, h1, h3 in degrees; q >= 0.
 * Returned: mu. */
static inline vd gr_hardened_friction(const double h[4], vd q)
{
    const vd decay = v_exp(v_max(v_set(-700.0), v_set(-h[2]) * q));
    const vd phi = v_fma(v_fma(v_set(h[1]), q, v_set(-h[3])), decay, v_set(h[0]));
    const vd sine = gr_sine(v_clamp(v_set(GR_DEGREE) * phi, 0.0, 90 * GR_DEGREE));
    return v_set(TWO_SQRT_3) * sine / (v_set(3.0) - sine);
}

#define GR_FURTHEST 600.0 /* bound of |log-density|, so that the values of points about to leave stay finite */

/* State of a block of points at the beginning of a step. */
struct gr_hencky_block {
    struct gr_stress stress; /* Kirchhoff */
    vd L[9], c;              /* log-density at the end of the step */
};

GR_INLINE struct gr_hencky_block hencky_block_of(const int dim, const struct gr_law_call *call, int64_t k)
{
    const int64_t at = call->slot[k];
    const struct gr_gradient gradient = gr_gradient_of(dim, call, k);
    vd begin = v_load(call->log_density + at), end = begin;
    if (call->begins)
        end = end - gr_expansion(dim, gradient);
    else
        begin = begin + gr_expansion(dim, gradient);
    const vd to_kirchhoff = v_exp(-v_clamp(begin, -GR_FURTHEST, GR_FURTHEST));
    struct gr_hencky_block block = {.c = v_clamp(end, -GR_FURTHEST, GR_FURTHEST)};
    gr_load_gradient(dim, gradient, block.L);
    for (int i = 0; i < GR_STRESSES(dim); i++) block.stress.s[i] = to_kirchhoff * v_load(call->stress[i] + at);
    return block;
}

/* The first or the last of many substeps. R is the trial stress for the spin alone; R + D that for the whole L dt. */
GR_INLINE struct gr_hencky_point hencky_substep(const int dim, const int flow, const struct gr_hencky_numbers *n,
                                                const struct gr_law_call *call, const struct gr_hencky_block *block,
                                                int64_t at, vd g_star, vd rate)
{
    const vd p = v_max(v_zero(), n->K * block->c); /* NaN remains */
    const vd reconnected = n->reconnect_fluidity * v_set(call->fraction) * gr_stretch_norm(dim, block->L);
    const vm before = gr_hencky_is_connected(&block->stress);
    struct gr_stress turned = {{v_zero()}}, strained = turned;
    vd L[9];
    for (int pass = 0; pass < 2; pass++) { /* a loop, so that the trial is compiled once */
        turned = strained;
        for (int i = 0; i < dim; i++)
            for (int j = 0; j < dim; j++) {
                const vd other = pass ? v_zero() : block->L[j * dim + i];
                L[i * dim + j] = v_set(pass ? 1.0 : 0.5) * (block->L[i * dim + j] - other);
            }
        if (dim == 2) L[4] = pass ? block->L[4] : v_zero();
        strained = gr_hencky_trial(dim, n, L, &block->stress);
    }
    for (int i = 0; i < GR_STRESSES(dim); i++) strained.s[i] = strained.s[i] - turned.s[i];
    if (call->begins) {
        const vd in_this_step = v_select(before, v_set(-1.0), v_select(v_gt(p, v_zero()), reconnected, v_set(-1.0)));
        const vd start = gr_fluidity_start(&n->fluidity, g_star), fraction = v_set(call->fraction);
        gr_real *const of_rate = call->shear_rate + at;
        gr_substeps_begin(dim, &n->fluidity, &turned, &strained, p, call->substeps, at);
        return (struct gr_hencky_point){.g = gr_substep(flow == GR_HENCKY_linear_ngf, 1, &n->fluidity, fraction,
                                                        call->substeps, at, start, in_this_step, of_rate)};
    }
    const vm since = v_gt(v_load(gr_substep_at(call->substeps, at, GR_SUBSTEP_p)), v_zero());
    gr_substeps_end(dim, call->fraction, call->substeps, at, &turned, &strained);
    const vd known = v_select(since, v_set(1.0), v_keep(before, v_set(1.0)));
    return gr_hencky_flow(dim, flow, n, &turned, p, v_gt(known, v_zero()), reconnected, g_star, rate);
}

GR_INLINE void hencky_blocks_of(const int dim, const int flow, struct gr_hencky_numbers *n, const struct gr_law_call *call)
{
    for (int64_t k = 0; k < call->n_blocks; k++) {
        const int64_t at = call->slot[k];
        const struct gr_hencky_block block = hencky_block_of(dim, call, k);
        const vd hardened = call->plastic_strain ? v_load(call->plastic_strain + at) : v_zero();
        if (n->hardening) n->mu_s = gr_hardened_friction(n->hardening, hardened);
        const vd g_star = call->g_star ? v_load(call->g_star + k * GR_W) : v_zero();
        const vd rate = call->shear_rate ? v_load(call->shear_rate + at) : v_zero();
        const struct gr_hencky_point point =
            call->substeps ? hencky_substep(dim, flow, n, call, &block, at, g_star, rate)
                           : gr_hencky_update(dim, flow, n, block.L, block.c, &block.stress, g_star, rate);
        if (call->substeps && call->begins) {
            v_store(call->g + at, point.g);
            if (call->gain) v_store(call->gain + at, point.g - g_star);
            continue;
        }
        const vd to_cauchy = v_exp(block.c);
        for (int i = 0; i < GR_STRESSES(dim); i++) v_store(call->stress[i] + at, to_cauchy * point.stress.s[i]);
        if (call->shear_rate) v_store(call->shear_rate + at, point.rate);
        if (call->g) v_store(call->g + at, point.g);
        if (call->gain) v_store(call->gain + at, v_keep(v_gt(point.g, v_zero()), point.g - g_star));
        if (call->plastic_strain) {
            const vd strain = v_set(M_SQRT1_2 * call->dt) * point.rate;
            v_store(call->plastic_strain + at, hardened + strain);
        }
    }
}

/* `flow` is not a literal here: the trial is compiled once for all flow rules. */
static __attribute__((noinline)) void gr_hencky_blocks(int dim, int flow, struct gr_hencky_numbers *n,
                                                       const struct gr_law_call *call)
{
    if (dim == 2)
        hencky_blocks_of(2, flow, n, call);
    else
        hencky_blocks_of(3, flow, n, call);
}

/* A law with mu(I): K, G, mu_s, mu_2 and xi. */
static inline void gr_hencky_mu_I_blocks(const int dim, int flow, const struct gr_law_call *call)
{
    const double *q = call->parameter;
    struct gr_hencky_numbers n = gr_hencky_mu_I_of(q[0], q[1], q[2], q[3], q[4], call->dt);
    gr_hencky_blocks(dim, flow, &n, call);
}

/* Order of the parameters of the nonlocal finite-strain laws: the amplitude A, then GR_HENCKY_PARAMETERS. */
enum { GR_HENCKY_NGF_A, GR_HENCKY_NGF_POINT, GR_HENCKY_NGF_FLUIDITY = GR_HENCKY_NGF_POINT + GR_HENCKY_P_G };

/* A nonlocal law. While the fluidity is not diffused, it is in its local phase and uses the local flow rule. */
static inline void gr_hencky_nonlocal_blocks(const int dim, int nonlocal, int local, const struct gr_law_call *call)
{
    struct gr_hencky_numbers n = gr_hencky_numbers_of(call->parameter + GR_HENCKY_NGF_POINT, call->dt);
    gr_hencky_blocks(dim, call->g_star ? nonlocal : local, &n, call);
}
