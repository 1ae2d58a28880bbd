/* Damping of elastic waves: the viscous stress of points, which P2G adds to the stress of their law.
 *
 *   sigma_v = T C : (D - D_p) = T (K tr(D) 1 + 2 G dev(D) - G gdot s/tau)
 *
 * D is the strain rate; D_p = gdot s/(2 tau), with s the deviator of the stress and tau = sqrt(s:s/2), its plastic part.
 * Flow at a steady stress has D = D_p and is left alone. T is the damping time of the material
 * (granular/materials/base.py). Points that bear no stress have none of this either. */
#include "law/trial.h"
#include "mpm/contribution.h"

/* Set it for the points in the slots from `at` on, from their gradient L dt and their stress after the law. */
GR_INLINE void store_viscous_stress(const int dim, const struct gr_engine *e, struct gr_gradient gradient, int64_t at)
{
    const vd none = v_zero(), rate = v_set(e->clock.inv_dt), T = gr_of_material(e, GR_MATERIAL_DAMPING_TIME, at);
    const vd K = T * gr_of_material(e, GR_MATERIAL_BULK_MODULUS, at),
             G = T * gr_of_material(e, GR_MATERIAL_SHEAR_MODULUS, at);
    struct gr_stress s, viscous;
    vd largest = none;
    for (int c = 0; c < GR_STRESSES(dim); c++) {
        s.s[c] = component(e, GR_FIELD_stress, c, at);
        viscous.s[c] = none;
        largest = v_max(v_abs(s.s[c]), largest);
    }
    (void)gr_split(&s);
    gr_strain(dim, gradient, rate * K, rate * G, &viscous);
    const vd tau = v_sqrt(v_max(gr_tau_squared(dim, &s), v_set(GR_NOTHING)));
    const vd flow = G * component(e, GR_FIELD_shear_rate, 0, at) / tau;
    for (int c = 0; c < GR_STRESSES(dim); c++)
        v_store(gr_numbers(e, GR_FIELD_viscous_stress, c, at),
                v_keep(v_gt(largest, none), v_fnma(flow, s.s[c], viscous.s[c])));
}

/* The same for the n blocks of points that a law was called for. */
static __attribute__((noinline)) void damp_elastic(const struct gr_engine *e, int64_t n, const int64_t *slot,
                                                   const gr_real *gradient, const gr_real *hoop)
{
    for (int64_t k = 0; k < n; k++) {
        const gr_real *of_rings = e->config.axisymmetric ? hoop + k * GR_W : 0;
        if (e->config.dim == 2)
            store_viscous_stress(2, e, (struct gr_gradient){gradient + k * 4 * GR_W, of_rings}, slot[k]);
        else
            store_viscous_stress(3, e, (struct gr_gradient){gradient + k * 9 * GR_W, 0}, slot[k]);
    }
}

/* Stress of the points in the slots from `at` on that makes forces: the stress of the law, and where the scene has them the
 * terms of the dampings of flutter and of elastic waves. */
GR_INLINE void acting_stress(const int dim, const struct gr_engine *e, int64_t at, vd stress[6])
{
    struct gr_stress s;
    for (int c = 0; c < GR_STRESSES(dim); c++) s.s[c] = component(e, GR_FIELD_stress, c, at);
    for (int c = 0; c < GR_STRESSES(dim); c++) stress[c] = s.s[c];
    if (e->points.field[GR_FIELD_overstress]) {
        const vd over = component(e, GR_FIELD_overstress, 0, at);
        (void)gr_split(&s);
        for (int c = 0; c < GR_STRESSES(dim); c++) stress[c] = v_fma(over, s.s[c], stress[c]);
    }
    if (e->points.field[GR_FIELD_viscous_stress])
        for (int c = 0; c < GR_STRESSES(dim); c++) stress[c] = stress[c] + component(e, GR_FIELD_viscous_stress, c, at);
}
