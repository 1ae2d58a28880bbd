/* The elastic predictor that the hypoelastic laws share, and its way in and out of the point arrays. */
#ifndef GR_LAW_TRIAL_H
#define GR_LAW_TRIAL_H

#include "law/law.h"

#define GR_STRESSES(dim) ((dim) == 2 ? 4 : 6)

struct gr_stress {
    vd s[6]; /* xx, yy, zz, xy, yz, xz */
};

/* Trial stress s + dt (C:D + W s - s W), Dunatunga & Kamrin 2015, eq. 3.10, with L dt given (row-major), or that of
 * which it is a `part`. The explicit Jaumann form is first order in the rotation of a step. */
static inline struct gr_stress gr_trial(const int dim, const double *gradient, const struct gr_law_call *call, int64_t at,
                                        vd K, vd G, vd part)
{
    struct gr_stress t;
    const vd half = v_set(0.5), two = v_set(2.0), lambda = K - two / v_set(3.0) * G, twoG = two * G;
    vd L[9];
    for (int c = 0; c < dim * dim; c++) L[c] = part * v_load(gradient + c * GR_W);
    for (int c = 0; c < GR_STRESSES(dim); c++) t.s[c] = v_load(call->stress[c] + at);
    const vd xx = t.s[0], yy = t.s[1], zz = t.s[2], xy = t.s[3];
    if (dim == 2) {
        const vd bulk = lambda * (L[0] + L[3]), w = half * (L[1] - L[2]);
        t.s[0] = v_fma(twoG, L[0], xx + bulk) + two * w * xy;
        t.s[1] = v_fma(twoG, L[3], yy + bulk) - two * w * xy;
        t.s[2] = zz + bulk;
        t.s[3] = v_fma(G, L[1] + L[2], xy) + w * (yy - xx);
    } else {
        const vd yz = t.s[4], xz = t.s[5], bulk = lambda * (L[0] + L[4] + L[8]);
        const vd wxy = half * (L[1] - L[3]), wxz = half * (L[2] - L[6]), wyz = half * (L[5] - L[7]);
        t.s[0] = v_fma(twoG, L[0], xx + bulk) + two * (wxy * xy + wxz * xz);
        t.s[1] = v_fma(twoG, L[4], yy + bulk) + two * (wyz * yz - wxy * xy);
        t.s[2] = v_fma(twoG, L[8], zz + bulk) - two * (wxz * xz + wyz * yz);
        t.s[3] = v_fma(G, L[1] + L[3], xy) + wxy * (yy - xx) + wxz * yz + wyz * xz;
        t.s[4] = v_fma(G, L[5] + L[7], yz) + wyz * (zz - yy) - wxy * xz - wxz * xy;
        t.s[5] = v_fma(G, L[2] + L[6], xz) + wxz * (zz - xx) + wxy * yz - wyz * xy;
    }
    return t;
}

/* Trace of the increment of a block. */
static inline vd gr_expansion(const int dim, const double *gradient)
{
    vd trace = v_load(gradient);
    for (int d = 1; d < dim; d++) trace = trace + v_load(gradient + d * (dim + 1) * GR_W);
    return trace;
}

/* Pressure -tr(s)/3; `s` is left as its deviator. */
static inline vd gr_split(struct gr_stress *t)
{
    const vd p = (t->s[0] + t->s[1] + t->s[2]) * v_set(-1.0 / 3.0);
    for (int c = 0; c < 3; c++) t->s[c] = t->s[c] + p;
    return p;
}

/* s:s/2 of a deviator, the square of the equivalent shear stress (eq. 2.10). */
static inline vd gr_tau_squared(const int dim, const struct gr_stress *t)
{
    vd normal = v_fma(t->s[0], t->s[0], v_fma(t->s[1], t->s[1], t->s[2] * t->s[2]));
    vd shear = t->s[3] * t->s[3];
    if (dim == 3) shear = v_fma(t->s[4], t->s[4], v_fma(t->s[5], t->s[5], shear));
    return v_fma(v_set(0.5), normal, shear);
}

#endif
