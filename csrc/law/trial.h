/* The elastic predictor (trial stress) of the hypoelastic laws, and its loads and stores. */
#pragma once

#include "law/law.h"

#define GR_STRESSES(dim) ((dim) == 2 ? 4 : 6)

struct gr_stress {
    vd s[6]; /* xx, yy, zz, xy, yz, xz */
};

/* L dt of a block of points: components row-major, and in an axisymmetric plane the one out of it, else NULL. */
struct gr_gradient {
    const gr_real *of_plane, *hoop;
};

GR_INLINE struct gr_gradient gr_gradient_of(const int dim, const struct gr_law_call *call, int64_t k)
{
    return (struct gr_gradient){call->gradient + k * dim * dim * GR_W, call->hoop ? call->hoop + k * GR_W : 0};
}

/* Its components; in 2D L[4] is the one out of the plane. */
GR_INLINE void gr_load_gradient(const int dim, struct gr_gradient gradient, vd L[9])
{
    for (int c = 0; c < dim * dim; c++) L[c] = v_load(gradient.of_plane + c * GR_W);
    if (dim == 2) L[4] = gradient.hoop ? v_load(gradient.hoop) : v_zero();
}

/* Add the elastic increment dt C:D to `t`. */
GR_INLINE void gr_strain(const int dim, struct gr_gradient gradient, vd K, vd G, struct gr_stress *t)
{
    const vd lambda = K - v_set(2.0) / v_set(3.0) * G, twoG = v_set(2.0) * G;
    vd L[9];
    gr_load_gradient(dim, gradient, L);
    vd trace = dim == 2 ? L[0] + L[3] : L[0] + L[4] + L[8];
    if (dim == 2 && gradient.hoop) trace = trace + L[4];
    const vd bulk = lambda * trace;
    for (int c = 0; c < dim; c++) t->s[c] = v_fma(twoG, L[c * (dim + 1)], t->s[c] + bulk);
    if (dim == 2) t->s[2] = t->s[2] + bulk;
    if (dim == 2 && gradient.hoop) t->s[2] = v_fma(twoG, L[4], t->s[2]);
    t->s[3] = v_fma(G, L[1] + L[dim], t->s[3]);
    if (dim == 3) {
        t->s[4] = v_fma(G, L[5] + L[7], t->s[4]);
        t->s[5] = v_fma(G, L[2] + L[6], t->s[5]);
    }
}

/* The stress of a block of points after the rotation of a step: s + dt (W s - s W), of first order in dt. */
GR_INLINE struct gr_stress gr_turned(const int dim, struct gr_gradient gradient, const struct gr_law_call *call, int64_t at)
{
    struct gr_stress t;
    const vd half = v_set(0.5), two = v_set(2.0);
    vd L[9];
    gr_load_gradient(dim, gradient, L);
    for (int c = 0; c < GR_STRESSES(3); c++) t.s[c] = c < GR_STRESSES(dim) ? v_load(call->stress[c] + at) : v_zero();
    const vd xx = t.s[0], yy = t.s[1], zz = t.s[2], xy = t.s[3];
    if (dim == 2) {
        const vd w = half * (L[1] - L[2]), turned = two * w * xy;
        t.s[0] = xx + turned;
        t.s[1] = yy - turned;
        t.s[3] = v_fma(w, yy - xx, xy);
    } else {
        const vd yz = t.s[4], xz = t.s[5];
        const vd wxy = half * (L[1] - L[3]), wxz = half * (L[2] - L[6]), wyz = half * (L[5] - L[7]);
        t.s[0] = xx + two * (wxy * xy + wxz * xz);
        t.s[1] = yy + two * (wyz * yz - wxy * xy);
        t.s[2] = zz - two * (wxz * xz + wyz * yz);
        t.s[3] = xy + wxy * (yy - xx) + wxz * yz + wyz * xz;
        t.s[4] = yz + wyz * (zz - yy) - wxy * xz - wxz * xy;
        t.s[5] = xz + wxz * (zz - xx) + wxy * yz - wyz * xy;
    }
    return t;
}

/* Trial stress s + dt (C:D + W s - s W) of block k of a call, Dunatunga & Kamrin 2015, eq. 3.10. */
GR_INLINE struct gr_stress gr_trial(const int dim, const struct gr_law_call *call, int64_t k, vd K, vd G)
{
    const struct gr_gradient gradient = gr_gradient_of(dim, call, k);
    struct gr_stress t = gr_turned(dim, gradient, call, call->slot[k]);
    gr_strain(dim, gradient, K, G, &t);
    return t;
}

/* Trace of the velocity increment L dt of a block: the volumetric strain of the step. */
GR_INLINE vd gr_expansion(const int dim, struct gr_gradient gradient)
{
    vd trace = v_load(gradient.of_plane);
    for (int d = 1; d < dim; d++) trace = trace + v_load(gradient.of_plane + d * (dim + 1) * GR_W);
    if (dim == 2 && gradient.hoop) trace = trace + v_load(gradient.hoop);
    return trace;
}

/* Split a stress: return the pressure -tr(s)/3 and leave the deviator in `t`. */
GR_INLINE vd gr_split(struct gr_stress *t)
{
    const vd p = (t->s[0] + t->s[1] + t->s[2]) * v_set(-1.0 / 3.0);
    for (int c = 0; c < 3; c++) t->s[c] = t->s[c] + p;
    return p;
}

/* s:t/2 of two deviators. */
GR_INLINE vd gr_half_product(const int dim, const struct gr_stress *s, const struct gr_stress *t)
{
    const vd normal = v_fma(s->s[0], t->s[0], v_fma(s->s[1], t->s[1], s->s[2] * t->s[2]));
    vd shear = s->s[3] * t->s[3];
    if (dim == 3) shear = v_fma(s->s[4], t->s[4], v_fma(s->s[5], t->s[5], shear));
    return v_fma(v_set(0.5), normal, shear);
}

/* s:s/2 of a deviator, the square of the equivalent shear stress tau (eq. 2.10). */
GR_INLINE vd gr_tau_squared(const int dim, const struct gr_stress *t) { return gr_half_product(dim, t, t); }
