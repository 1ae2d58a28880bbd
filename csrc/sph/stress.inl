/* Stress of particles and wall points, for as many points at once as a vector has lanes; included by kernels.c. */
#include <string.h>

#include "core/simd.h"
#include "sph/sph.h"

/* Data of a tile of consecutive points: one array per component. */
struct sph_tile {
    double rates[9][SPH_TILE]; /* strain rate D: xx, yy, zz, xy, yz, xz, and spin: yx, zy, xz, divided by the norm of the
                                  gradient */
    double rho[SPH_TILE], elastic[6][SPH_TILE];
    double near[3][SPH_TILE]; /* above 0 for the axes along which a point feels a wall */
    double shear_rate[SPH_TILE], pull[6][SPH_TILE];
};

struct sph_strength {
    vd p, tau, mu_wall; /* pressure, shear strength, friction on walls */
};

/* Pressure and shear strength (eqs. 5.5, 5.7, 5.8). */
GR_INLINE struct sph_strength sph_strength_of(const struct gr_sph *s, double rho0, vd rho, vd rate, vd div)
{
    const double *c = s->config.parameter;
    const vd ratio = rho / v_set(rho0), zero = v_set(0.0);
    const vd p = v_max(v_set(c[GR_SPH_P_kappa]) * (ratio * v_sqrt(ratio) - v_set(1.0)), zero);
    const vd share = rate / (v_set(c[GR_SPH_P_D_star]) + rate);
    const vd mu = v_set(c[GR_SPH_P_mu_l]) + v_set(c[GR_SPH_P_mu_h] - c[GR_SPH_P_mu_l]) * share;
    const vd moves = v_select(v_gt(rate, zero), rate, v_set(1.0));
    const vd beta = v_clamp(v_select(v_gt(rate, zero), div, zero) / moves, 0.0, c[GR_SPH_P_dilation]);
    return (struct sph_strength){p, (mu + beta) * p + v_set(c[GR_SPH_P_cohesion]), v_set(c[GR_SPH_P_mu_wall]) + beta};
}

/* Magnitude |T| = sqrt(T:T/2). */
GR_INLINE vd sph_size(const vd *T)
{
    const vd normal = T[0] * T[0] + T[1] * T[1] + T[2] * T[2];
    return v_sqrt(v_set(0.5) * normal + T[3] * T[3] + T[4] * T[4] + T[5] * T[5]);
}

/* Share of a trial stress of magnitude `size` that the strength tau allows. */
GR_INLINE vd sph_share(vd tau, vd size)
{
    const vm within = v_ge(tau, size);
    return v_select(within, v_set(1.0), tau / v_select(within, v_set(1.0), size));
}

/* Limit the shear stress t that a trial stress T has on the planes along walls nearby: after the cut to the strength tau it
 * is at most mu_wall times the pressure on the plane, p - T_dd, and the cohesion. With R the magnitude of all other
 * components the cut leaves the share q = min(1, tau/sqrt(R^2 + t^2)) of both, so that with A = mu_wall p + c and
 * B = mu_wall T_dd
 *
 *   q t <= A - q B,   t <= A - B if q = 1,   else t <= (A sqrt(tau^2 B^2 + R^2 (tau^2 - A^2)) - tau^2 B)/(tau^2 - A^2).
 *
 * For A >= tau the material yields before it slides on the wall. */
GR_INLINE void sph_slip(int dim, const struct sph_strength *law, double cohesion, const vd *near, vd *T)
{
    static const int shear[3][2] = {{3, 5}, {3, 4}, {5, 4}};
    const vd zero = v_set(0.0), one = v_set(1.0), tau2 = law->tau * law->tau,
             A = v_fma(law->mu_wall, law->p, v_set(cohesion));
    const vd above = tau2 - A * A;
    for (int d = 0; d < dim; d++) {
        const vm slips = m_and(v_gt(near[d], zero), v_gt(above, zero));
        const vd size = sph_size(T), B = law->mu_wall * T[d];
        vd t2 = T[shear[d][0]] * T[shear[d][0]];
        if (dim == 3) t2 = v_fma(T[shear[d][1]], T[shear[d][1]], t2);
        const vd R2 = v_max(size * size - t2, zero), elastic = v_max(A - B, zero);
        const vd root = v_sqrt(v_max(v_fma(tau2 * B, B, R2 * above), zero));
        const vd flowing = v_max((A * root - tau2 * B) / v_select(slips, above, one), zero);
        const vd most = v_select(v_gt(v_fma(elastic, elastic, R2), tau2), flowing, elastic);
        const vd factor = v_select(slips, sph_share(most, v_sqrt(t2)), one);
        T[shear[d][0]] *= factor;
        if (dim == 3) T[shear[d][1]] *= factor;
    }
}

/* Rotate a stress by the spin of a step: Q T Q^T with Q of the quaternion (1, turn), turn = spin dt/2. */
GR_INLINE void sph_turn(int dim, vd x, vd y, vd z, vd *T)
{
    static const int place[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
    const vd one = v_set(1.0), per = v_set(2.0) / (one + x * x + y * y + z * z);
    const vd Q[3][3] = {{one - per * (y * y + z * z), per * (x * y - z), per * (x * z + y)},
                        {per * (x * y + z), one - per * (x * x + z * z), per * (y * z - x)},
                        {per * (x * z - y), per * (y * z + x), one - per * (x * x + y * y)}};
    vd half[3][3], turned[6];
    for (int i = 0; i < dim; i++)
        for (int j = 0; j < dim; j++) {
            half[i][j] = v_set(0.0);
            for (int k = 0; k < dim; k++) half[i][j] = v_fma(Q[i][k], T[place[k][j]], half[i][j]);
        }
    for (int i = 0; i < dim; i++)
        for (int j = i; j < dim; j++) {
            turned[place[i][j]] = v_set(0.0);
            for (int k = 0; k < dim; k++) turned[place[i][j]] = v_fma(half[i][k], Q[j][k], turned[place[i][j]]);
        }
    for (int i = 0; i < dim; i++)
        for (int j = i; j < dim; j++) T[place[i][j]] = turned[place[i][j]];
}

/* Elastic stress after a step, from the one before it, the shear stress and its viscosity. The strain that is not
 * plastic acts on the spring (stiffness) and the dashpot (eta) alike. It never exceeds the strength, so that material
 * that separates loses its elastic stress. */
GR_INLINE void sph_relax(vd stiffness, vd eta, vd tau, const vd *shear, vd *elastic)
{
    const vd mean = (shear[0] + shear[1] + shear[2]) / v_set(3.0), share = stiffness / (stiffness + eta);
    for (int k = 0; k < 6; k++) {
        vd deviator = shear[k];
        if (k < 3) deviator -= mean;
        elastic[k] += share * (deviator - elastic[k]);
    }
    const vd factor = sph_share(tau, sph_size(elastic));
    for (int k = 0; k < 6; k++) elastic[k] *= factor;
}

/* Stress sigma = -p I + (mu p + c) D/|D| (eq. 5.3), as sigma/rho^2, of the points of one vector from index i on. Below
 * its strength the material has the largest viscosity eta and, parallel to it, the shear modulus G: |T| <= mu p + c for
 * T = E + eta D + G dt dev D, with E the elastic stress so far. */
GR_INLINE void sph_stress_of(int dim, int elastic, const struct gr_sph *s, double rho0, struct sph_tile *tile, int i)
{
    const double *c = s->config.parameter, h = c[GR_SPH_P_h], scale = sph_gradient_norm(dim, s);
    const vd rho = v_load(tile->rho + i), stiffness = v_set(c[GR_SPH_P_shear_modulus] * s->dt);
    const vd eta = v_set(c[GR_SPH_P_regularisation] * h * h / s->dt) * rho, per_rho2 = v_set(1.0) / (rho * rho);
    vd D[6], T[6], E[6];
    for (int k = 0; k < 6; k++) D[k] = v_set(scale) * v_load(tile->rates[k] + i), E[k] = v_set(0.0);
    const vd div = v_set(0.5) * (D[0] + D[1] + D[2]), rate = sph_size(D);
    const struct sph_strength law = sph_strength_of(s, rho0, rho, rate, div);
    if (elastic) {
        vd turn[3];
        for (int k = 0; k < 3; k++) {
            turn[k] = v_set(0.0);
            if (!k || dim == 3) turn[k] = v_set(0.25 * s->dt * scale) * v_load(tile->rates[6 + k] + i);
        }
        for (int k = 0; k < (dim == 2 ? 4 : 6); k++) E[k] = v_load(tile->elastic[k] + i);
        sph_turn(dim, turn[1], turn[2], turn[0], E);
    }
    for (int k = 0; k < 6; k++) {
        T[k] = E[k] + (eta + stiffness) * D[k];
        if (k < 3) T[k] -= stiffness * div / v_set(1.5);
    }
    if (s->config.wall_friction) {
        vd near[3];
        for (int d = 0; d < dim; d++) near[d] = v_load(tile->near[d] + i);
        sph_slip(dim, &law, c[GR_SPH_P_cohesion], near, T);
    }
    const vd share = sph_share(law.tau, sph_size(T));
    for (int k = 0; k < (dim == 2 ? 4 : 6); k++) {
        const vd p = k < 3 ? law.p : v_set(0.0);
        v_store(tile->pull[k] + i, per_rho2 * (share * T[k] - p));
    }
    v_store(tile->shear_rate + i, rate);
    if (!elastic) return;
    for (int k = 0; k < 6; k++) T[k] *= share;
    sph_relax(stiffness, eta, law.tau, T, E);
    for (int k = 0; k < (dim == 2 ? 4 : 6); k++) v_store(tile->elastic[k] + i, E[k]);
}

/* Stresses of the rows [first, last), tile by tile, as a vector may extend beyond the rows of a thread. */
GR_INLINE void sph_stresses(int dim, int elastic, struct gr_sph *s, int64_t first, int64_t last)
{
    double *const *old = gr_sph_rows(s, GR_SPH_FIELD_elastic_stress);
    double *rate = gr_sph_rows(s, GR_SPH_FIELD_shear_rate)[0], *rho = gr_sph_rows(s, GR_SPH_FIELD_rho)[0];
    const double rho0 = s->config.parameter[first < s->wall_first ? GR_SPH_P_rho0 : GR_SPH_P_rho0_wall];
    struct sph_tile tile = {0}; /* values beyond the last row must be finite */
    for (int64_t a = first; a < last; a += SPH_TILE) {
        const int64_t n = last - a < SPH_TILE ? last - a : SPH_TILE;
        const size_t bytes = sizeof(double) * (size_t)n;
        sph_rates(dim, elastic, s, a, a + n, tile.rates, tile.near);
        memcpy(tile.rho, rho + a, bytes);
        for (int k = 0; elastic && k < (dim == 2 ? 4 : 6); k++) memcpy(tile.elastic[k], old[k] + a, bytes);
        for (int i = 0; i < n; i += GR_W) sph_stress_of(dim, elastic, s, rho0, &tile, i);
        memcpy(rate + a, tile.shear_rate, bytes);
        for (int k = 0; k < (dim == 2 ? 4 : 6); k++) {
            memcpy(s->pull[k] + a, tile.pull[k], bytes);
            if (elastic) memcpy(old[k] + a, tile.elastic[k], bytes);
        }
    }
}
