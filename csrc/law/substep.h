/* Substeps of the nonlocal law: a step divided into many at one velocity gradient, without stress tensors in between.
 *
 * A step rotates the deviator of the stress to R and strains it by D. Each of n substeps adds D/n, and then its plastic
 * flow leaves a share z of the deviator. After any number of substeps the deviator therefore is a R + b D, with
 * b <- b + 1/n before the flow and (a, b) <- z (a, b) after it. Its norm needs only three products of R and D, which
 * are computed once. The pressure is that at the end of the step in all substeps. A substep thus costs little more than
 * the update of the fluidity at a point. */
#pragma once

#include "law/fluidity_update.h"
#include "law/trial.h"

#define GR_LARGEST_FRICTION GR_PRECISION(1e60, 1e10) /* of a trial state; its square is finite */

GR_INLINE double *gr_substep_at(double *substeps, int64_t at, enum gr_substep_number number)
{
    return substeps + at * GR_SUBSTEP_COUNT + number * GR_W;
}

/* Set the state of the points before the first substep, from R (`turned`), D (`strained`) and the pressure p. Disconnected
 * points have p = 0: all their products are zero, so that they have neither friction nor plastic rate. NaN remains. */
GR_INLINE void gr_substeps_begin(const int dim, const struct gr_fluidity_numbers *n, const struct gr_stress *turned,
                                 const struct gr_stress *strained, vd p, double *substeps, int64_t at)
{
    const struct gr_inverse_pressure inverse = gr_invert_pressure(n, p);
    const vd zero = v_zero(), most = v_set(GR_LARGEST_FRICTION * GR_LARGEST_FRICTION);
    const vd square = v_select(v_ge(zero, p), zero, inverse.p * inverse.p);
    const vd across = v_set(2.0) * gr_half_product(dim, turned, strained);
    v_store(gr_substep_at(substeps, at, GR_SUBSTEP_turned), v_min(most, square * gr_tau_squared(dim, turned)));
    v_store(gr_substep_at(substeps, at, GR_SUBSTEP_across), v_min(most, square * across));
    v_store(gr_substep_at(substeps, at, GR_SUBSTEP_strained), v_min(most, square * gr_tau_squared(dim, strained)));
    v_store(gr_substep_at(substeps, at, GR_SUBSTEP_of_turned), v_set(1.0));
    v_store(gr_substep_at(substeps, at, GR_SUBSTEP_of_strained), zero);
    v_store(gr_substep_at(substeps, at, GR_SUBSTEP_p), p);
    v_store(gr_substep_at(substeps, at, GR_SUBSTEP_inverse_p), inverse.p);
    v_store(gr_substep_at(substeps, at, GR_SUBSTEP_sink), inverse.sink);
    v_store(gr_substep_at(substeps, at, GR_SUBSTEP_unit_g), inverse.unit_g);
}

/* Replace R in `turned` by the deviator before the flow of the last substep. */
GR_INLINE void gr_substeps_end(const int dim, double fraction, double *substeps, int64_t at, struct gr_stress *turned,
                               const struct gr_stress *strained)
{
    const vd a = v_load(gr_substep_at(substeps, at, GR_SUBSTEP_of_turned));
    const vd b = v_load(gr_substep_at(substeps, at, GR_SUBSTEP_of_strained)) + v_set(fraction);
    for (int i = 0; i < GR_STRESSES(dim); i++) turned->s[i] = v_fma(b, strained->s[i], a * turned->s[i]);
}

/* Make one substep.
 * Given: the start value of gr_fluidity_start; `reconnected`, the fluidity of points that reconnect in this substep,
 * 1/s, and -1 for all others. It is used only if `reconnects` is set.
 * Updated: the plastic shear rate, 1/s.
 * Returned: the fluidity g, 1/s, undefined where disconnected. */
GR_INLINE vd gr_substep(const int linear, const int reconnects, const struct gr_fluidity_numbers *n, vd fraction,
                        double *substeps, int64_t at, vd start, vd reconnected, gr_real *rate)
{
    double *const to_a = gr_substep_at(substeps, at, GR_SUBSTEP_of_turned), *const to_b = gr_substep_at(
                                                                                substeps, at, GR_SUBSTEP_of_strained);
    const struct gr_inverse_pressure inverse = {v_load(gr_substep_at(substeps, at, GR_SUBSTEP_inverse_p)),
                                                v_load(gr_substep_at(substeps, at, GR_SUBSTEP_sink)),
                                                v_load(gr_substep_at(substeps, at, GR_SUBSTEP_unit_g))};
    const vd a = v_load(to_a), b = v_load(to_b) + fraction, turned = v_load(gr_substep_at(substeps, at, GR_SUBSTEP_turned));
    const vd across = v_load(gr_substep_at(substeps, at, GR_SUBSTEP_across)),
             strained = v_load(gr_substep_at(substeps, at, GR_SUBSTEP_strained));
    const vd square = v_fma(a, v_fma(a, turned, b * across), b * b * strained);
    const vd m = v_sqrt(v_max(v_zero(), square)); /* NaN remains */
    struct gr_fluidity_point point = gr_fluidity_update(linear, n, m, inverse, start, v_load(rate));
    if (reconnects) {
        const vd one = v_set(1.0);
        const vm now = v_ge(reconnected, v_zero());
        const vd scale = one / v_fma(n->G_dt * reconnected, inverse.p, one);
        point.scale = v_select(now, scale, point.scale);
        point.mu = v_select(now, m * scale, point.mu);
        point.g = v_select(now, reconnected, point.g);
    }
    v_store(to_a, point.scale * a);
    v_store(to_b, point.scale * b);
    v_store(rate, point.g * point.mu);
    return point.g;
}
