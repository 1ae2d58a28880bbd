/* Damping of flutter: growing waves of a whole layer in slow plastic flow (docs/explanation/flutter.md).
 *
 * Pressure makes strength, but flow makes no pressure: the elasticity of a layer at yield feeds shear waves that grow until
 * all of it flows. The unsteady part of the plastic shear rate meets a viscosity eta, in forces alone:
 *
 *   sigma' = sigma + mu' p s/tau,   mu' = (eta/p) unsteady max(0, 1 - <gdot>/gdot_end) where gdot > 0,
 *   unsteady = the part of gdot - <gdot> beyond STEADY <gdot>,   T d<gdot>/dt = gdot - <gdot>,
 *   eta = X rho_c c_w h,   T = M h/c_w,   h = p/max(rho_c g, |grad p|),   gdot_end = N c_w g mu rho_c/G.
 *
 * h is the depth of a point in a layer, and the size of the loaded region where a body presses it: the lengths belong to
 * the material, and T is M times the time in which a compression wave crosses h. Faster flow turns stress back to its own
 * direction, at the rate G gdot/tau, before a wave can use it. X, M, N: granular/mpm/damping.py. */
#include "law/trial.h"
#include "mpm/contribution.h"

/* Largest share of the deviator. In flutter at its full size the pressure varies by 7 % and the strength with it
 * (measured). */
#define LARGEST_OVERSTRESS 0.25

/* Share of the mean by which a steady rate may differ from it: a flow that starts or slows down does, by its rate of change
 * times T, and would be slowed down as if it were heavier. In flutter gdot varies by all of its mean (measured). */
#define STEADY 0.1

/* Update the overstress of the points in the slots from `at` on, from the stress and the plastic shear rate that the law
 * gave them in the step before. It remains until the next update. */
GR_INLINE void damp_flutter(const int dim, const struct gr_engine *e, int64_t at)
{
    const vd zero = v_zero(), nothing = v_set(GR_NOTHING);
    const double interval = e->config.flutter_interval * e->clock.dt;
    const vd rho_dx = v_set(-1.0) / gr_of_material(e, GR_MATERIAL_FORCE_SCALE, at);
    gr_real *const place = gr_numbers(e, GR_FIELD_mean_shear_rate, 0, at);
    const vd rate = component(e, GR_FIELD_shear_rate, 0, at);
    struct gr_stress s;
    for (int c = 0; c < GR_STRESSES(dim); c++) s.s[c] = component(e, GR_FIELD_stress, c, at);
    const vd p = v_max(gr_split(&s), zero), tau = v_sqrt(v_max(gr_tau_squared(dim, &s), nothing));
    vd steep = zero; /* |grad p|/(rho_c g); the gradient is of log-densities as pressures of the first material */
    for (int d = 0; d < dim; d++) {
        const vd gradient = component(e, GR_FIELD_density_gradient, d, at);
        steep = v_fma(gradient, gradient, steep);
    }
    steep = v_max(gr_of_material(e, GR_MATERIAL_FLUTTER_DEPTH, at) * v_sqrt(steep), v_set(1.0));
    const vd memory = gr_of_material(e, GR_MATERIAL_FLUTTER_MEMORY, at) * p / steep;
    const vd now = v_fma(memory, v_load(place), v_set(interval) * rate) / (memory + v_set(interval));
    const vd mean =
        e->clock.step > e->config.flutter_interval ? now : rate; /* a flow that is there at the start is steady */
    v_store(place, mean);
    const vd slow = v_set(1.0) - gr_of_material(e, GR_MATERIAL_FLUTTER_END, at) * mean * p / tau;
    const vd most = v_set(GR_MOST_DIFFUSED * e->config.dx / interval) * rho_dx / v_max(p, nothing);
    const vd viscous = v_min(gr_of_material(e, GR_MATERIAL_FLUTTER_TIME, at) / steep, most);
    const vd unsteady = rate - v_max(v_min(rate, v_set(1 + STEADY) * mean), v_set(1 - STEADY) * mean);
    const vd over = v_clamp(v_max(slow, zero) * viscous * unsteady * p / tau, -LARGEST_OVERSTRESS, LARGEST_OVERSTRESS);
    v_store(gr_numbers(e, GR_FIELD_overstress, 0, at), v_keep(m_and(v_gt(p, zero), v_gt(rate, zero)), over));
}
