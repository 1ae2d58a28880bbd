/* Sums over neighbours for the gas in one step, in their order; included by kernels.c after sums.inl.
 *
 * With e the porosity, the momentum balances of both phases (Anderson and Jackson 1967, in the form with a common
 * pressure) are
 *
 *     rho D v_s = div sigma - (1 - e) grad p + rho g + B (v_g - v_s)
 *     e rho_g D v_g =        -      e grad p + e rho_g g - B (v_g - v_s),    p = c^2 rho_g
 *     B = e^2 eta/k (Darcy) for small e, of Wen and Yu (1966) for large e.
 *
 * Their sum contains the stress of the granular material and the whole gradient of the gas pressure (effective stress).
 * Particles and walls exclude gas from their volume. The pressure forces derive from one energy, act along the line
 * between two points and are equal and opposite: they conserve momentum and, up to the error of the time step, energy.
 * The drag is distributed by the weights of the kernel. */
#include "sph/gas.h"

static const double sph_least_porosity = 0.05; /* for grains compressed far beyond rho0 */
static const double sph_full_coverage = 0.9;   /* a point with a larger coverage by particles is inside the granular
                                                  material */
static const double sph_nearest = 0.25;        /* height above a wall below which the wall repels gas, in h */
static const double sph_least_open = 0.05;     /* least volume share that a wall leaves to a point behind its face */

/* sum_b w over the points of gas around a point, including itself; or, with `walls`, sum_b w (1 - e_b) over the wall
 * points, where e is 0 if they are impermeable. */
GR_INLINE double sph_gas_count(int dim, const struct gr_sph *s, const double *porosity, int64_t a, int walls)
{
    const double h = s->config.parameter[GR_SPH_P_h];
    const int64_t first = walls ? s->middle[a] : s->end[a], last = walls ? s->end[a] : s->gas->end[a];
    struct sph_place place = {.shift = -1};
    vd sum = v_set(0.0), d[3];
    for (int64_t k = first; k < last; k++) {
        const vd r2 = sph_ways(dim, s, a, s->block[k], &place, d);
        const vd w = sph_weight(r2, h);
        sum = walls ? v_fma(v_set(1.0) - v_load(porosity + place.row), w, sum) : v_add(sum, w);
    }
    return v_sum(sum);
}

/* Volume share of the grains in what walls leave. It is the mean over the particles around a point, (1 - e) = sum_j v_j
 * W/S with v = m/(density of the grains) and S = sum_j (m_j/rho_j) W, where S is near one, and falls to zero with S. By
 * the division by S a gas that moves through a bed does not feel single particles: along its way sum_j v_j W varies by
 * some 1e-2, and 1e-2 of the ambient pressure exceeds the weight of beds. */
static double sph_solid_share(double volume, double coverage)
{
    const double t = coverage / sph_full_coverage;
    return coverage > 0.0 ? volume / coverage * (t < 1.0 ? t * t * (3.0 - 2.0 * t) : 1.0) : 0.0;
}

/* Volume, porosity, density and pressure of the points of gas. The volume of a point, with the grains in it, is the
 * part of its surroundings that walls leave over the number density of points: V = A/n with A = 1 - sum_w v_w W, n =
 * sum_b W. At the start the mass follows from the density, later the density from the mass. */
GR_INLINE void sph_gas_volumes(int dim, struct gr_sph *s, int64_t first, int64_t last)
{
    const struct gr_sph_gas *gas = s->gas;
    const double *p = gas->parameter, *grain = gr_sph_rows(s, GR_SPH_FIELD_mass)[0];
    const double norm = sph_weight_norm(dim, s->config.parameter[GR_SPH_P_h]);
    const double c2 = p[GR_SPH_GAS_P_sound_speed] * p[GR_SPH_GAS_P_sound_speed];
    double *const *stress = gr_sph_rows(s, GR_SPH_FIELD_stress);
    double *mass = gr_sph_rows(s, GR_SPH_FIELD_mass)[0], *rho = gr_sph_rows(s, GR_SPH_FIELD_rho)[0];
    double *porosity = gr_sph_rows(s, GR_SPH_FIELD_porosity)[0];
    for (int64_t a = first; a < last; a++) {
        const double number = norm * sph_gas_count(dim, s, porosity, a, 0);
        const double walls = norm * p[GR_SPH_GAS_P_wall_volume] * sph_gas_count(dim, s, porosity, a, 1);
        const double solid = sph_sum(dim, s, grain, a, s->begin[a], s->middle[a]);
        const double open = 1.0 - walls > sph_least_open ? 1.0 - walls : sph_least_open;
        const double coverage = norm * sph_sum(dim, s, s->volume, a, s->begin[a], s->middle[a]) / open;
        const double e = 1.0 - sph_solid_share(norm * solid / (p[GR_SPH_GAS_P_grain_density] * open), coverage);
        porosity[a] = e > sph_least_porosity ? e : sph_least_porosity;
        gas->volume[a] = open / number;
        gas->per_mass[a] = solid > 0.0 && e < 1.0 ? 1.0 / solid : 0.0;
        if (s->started)
            rho[a] = mass[a] / (porosity[a] * gas->volume[a]);
        else
            mass[a] = rho[a] * (porosity[a] * gas->volume[a]);
        const double gauge = c2 * rho[a] - p[GR_SPH_GAS_P_pressure];
        gas->pull[a] = gauge / number;
        gas->own_pull[a] = gas->pull[a] * gas->volume[a];
        for (int k = 0; k < 3; k++) stress[k][a] = -c2 * rho[a];
    }
}

/* Pressure forces, from the energy sum_a (m c^2 ln rho + p0 m/rho) with rho = m/V and p the pressure minus the ambient
 * p0:
 *
 *     F_a = - sum_b (p_a V_a/n_a + p_b V_b/n_b + m_a m_b Q) grad W - p_a/n_a sum_w v_w grad W.
 *
 * Q is the artificial viscosity of Monaghan (1992) between approaching points of gas, Q = (-alpha c u + 2 alpha u^2)/R,
 * u = h v.d/(d^2 + h^2/100) < 0, R = (m_a/V_a + m_b/V_b)/2. A point nearer to an impermeable wall than h/4 is pushed
 * away by c^2/h times the missing part of the height, since inside a wall the pressure does not hold it back. */
GR_INLINE void sph_gas_forces(int dim, struct gr_sph *s, int64_t first, int64_t last)
{
    const struct gr_sph_gas *gas = s->gas;
    double *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    const double *mass = gr_sph_rows(s, GR_SPH_FIELD_mass)[0], *porosity = gr_sph_rows(s, GR_SPH_FIELD_porosity)[0];
    const double h = s->config.parameter[GR_SPH_P_h], per_h = 1.0 / h, scale = sph_slope_norm(dim, h);
    const double alpha = gas->parameter[GR_SPH_GAS_P_damping], c = gas->parameter[GR_SPH_GAS_P_sound_speed];
    double *const *normal = gr_sph_rows(s, GR_SPH_FIELD_normal);
    const double *depth = gr_sph_rows(s, GR_SPH_FIELD_depth)[0];
    const vd one = v_set(1.0), zero = v_set(0.0), wall = v_set(gas->parameter[GR_SPH_GAS_P_wall_volume]);
    for (int64_t a = first; a < last; a++) {
        const vd pull = v_set(gas->own_pull[a]), m = v_set(mass[a]), volume = v_set(gas->volume[a]);
        struct sph_place place = {.shift = -1};
        vd sum[3] = {zero, zero, zero}, walls[3] = {zero, zero, zero}, stop[3] = {zero, zero, zero}, wall_sum = zero, d[3];
        for (int64_t k = s->middle[a]; k < s->end[a]; k++) {
            const vd r2 = sph_ways(dim, s, a, s->block[k], &place, d);
            const vd sealed = one - v_load(porosity + place.row), w = sealed * sph_weight(r2, h);
            const vd weight = wall * sealed * sph_slope(r2, h);
            vd height = zero - v_load(depth + place.row);
            for (int i = 0; i < dim; i++) height = v_fnma(v_load(normal[i] + place.row), d[i], height);
            const vd lack = w * v_max(one - height * v_set(per_h / sph_nearest), zero);
            wall_sum = v_add(wall_sum, w);
            for (int i = 0; i < dim; i++) {
                walls[i] = v_fma(weight, d[i], walls[i]);
                stop[i] = v_fma(lack, v_load(normal[i] + place.row), stop[i]);
            }
        }
        for (int64_t k = s->end[a]; k < gas->end[a]; k++) {
            const vd r2 = sph_ways(dim, s, a, s->block[k], &place, d);
            const vd mb = v_load(mass + place.row), vb = v_load(gas->volume + place.row);
            vd way = zero;
            for (int i = 0; i < dim; i++) way = v_fma(v_load(v[i] + place.row) - v_set(v[i][a]), d[i], way);
            const vd u = v_min(v_set(h) * way / (r2 + v_set(0.01 * h * h)), zero);
            /* m_a m_b/R = 2 m_a m_b V_a V_b/(m_a V_b + m_b V_a), zero for spare rows */
            const vd both = v_set(2.0) * m * mb * volume * vb / v_max(m * vb + mb * volume, v_set(1e-290));
            const vd q = v_set(alpha) * both * u * v_fma(v_set(2.0), u, v_set(-c));
            const vd weight = (pull + v_load(gas->own_pull + place.row) + q) * sph_slope(r2, h);
            for (int i = 0; i < dim; i++) sum[i] = v_fma(weight, d[i], sum[i]);
        }
        const double about = v_sum(wall_sum), stiff = about > 0.0 ? mass[a] * c * c * per_h / about : 0.0;
        for (int i = 0; i < dim; i++)
            gas->push[i][a] = stiff * v_sum(stop[i]) - scale * (v_sum(sum[i]) + gas->pull[a] * v_sum(walls[i]));
    }
}

/* Mass of the gas assigned to a particle over its pull mass: sum_a m_a w/(sum_j m_j w). */
GR_INLINE void sph_gas_loads(int dim, struct gr_sph *s, int64_t first, int64_t last)
{
    const struct gr_sph_gas *gas = s->gas;
    const double *mass = gr_sph_rows(s, GR_SPH_FIELD_mass)[0], h = s->config.parameter[GR_SPH_P_h];
    for (int64_t j = first; j < last; j++) {
        struct sph_place place = {.shift = -1};
        vd sum = v_set(0.0), d[3];
        for (int64_t k = s->end[j]; k < gas->end[j]; k++) {
            const vd r2 = sph_ways(dim, s, j, s->block[k], &place, d);
            sum = v_fma(v_load(mass + place.row) * v_load(gas->per_mass + place.row), sph_weight(r2, h), sum);
        }
        gas->load[j] = v_sum(sum);
    }
}

/* Transfer forces to the particles: add sign sum_a f_a share_a w/(sum_i m_i w) to their accelerations. For `is_push`
 * these are the share 1 - e_a of the pressure forces, else all of the drag forces with the opposite sign. */
GR_INLINE void sph_gas_hand_over(int dim, struct gr_sph *s, int64_t first, int64_t last, int is_push,
                                 struct gr_sph_extremes *extremes)
{
    const struct gr_sph_gas *gas = s->gas;
    double *const *f = is_push ? gas->push : gas->drag, *const *acceleration = gr_sph_rows(s, GR_SPH_FIELD_a);
    const double *porosity = gr_sph_rows(s, GR_SPH_FIELD_porosity)[0], h = s->config.parameter[GR_SPH_P_h];
    for (int64_t j = first; j < last; j++) {
        struct sph_place place = {.shift = -1};
        vd sum[3] = {v_set(0.0), v_set(0.0), v_set(0.0)}, d[3];
        double square = 0.0;
        for (int64_t k = s->end[j]; k < gas->end[j]; k++) {
            const vd r2 = sph_ways(dim, s, j, s->block[k], &place, d);
            vd w = v_load(gas->per_mass + place.row) * sph_weight(r2, h);
            w = is_push ? w * (v_set(1.0) - v_load(porosity + place.row)) : v_set(0.0) - w;
            for (int i = 0; i < dim; i++) sum[i] = v_fma(w, v_load(f[i] + place.row), sum[i]);
        }
        for (int i = 0; i < dim; i++) {
            acceleration[i][j] += v_sum(sum[i]);
            square += acceleration[i][j] * acceleration[i][j];
        }
        if (square > extremes->acceleration2) extremes->acceleration2 = square;
    }
}

/* Mass that a point gains from others, with momentum at the mean of both velocities:
 *
 *     dm_a/dt = sum_b 2 psi h/c (e_a + e_b)/2 V_a V_b (p_b - p_a - (grad p_a + grad p_b).d/2) (d.grad W)/d^2.
 *
 * This is the diffusion of Antuono et al. (2010). Pressures that alternate from point to point have no gradient in
 * these sums and would persist without it. It vanishes for a linear field. */
GR_INLINE void sph_gas_exchange(int dim, struct gr_sph *s, int64_t first, int64_t last)
{
    const struct gr_sph_gas *gas = s->gas;
    double *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    const double *porosity = gr_sph_rows(s, GR_SPH_FIELD_porosity)[0], *rho = gr_sph_rows(s, GR_SPH_FIELD_rho)[0];
    const double *p = gas->parameter, h = s->config.parameter[GR_SPH_P_h], c = p[GR_SPH_GAS_P_sound_speed];
    const double scale = p[GR_SPH_GAS_P_diffusion] * sph_slope_norm(dim, h) * h / c;
    for (int64_t a = first; a < last; a++) {
        struct sph_place place = {.shift = -1};
        vd sum = v_set(0.0), carry[3] = {sum, sum, sum}, d[3], slope[3];
        for (int i = 0; i < dim; i++) slope[i] = v_set(gas->push[i][a] / gas->volume[a]);
        for (int64_t k = s->end[a]; k < gas->end[a]; k++) {
            const vd r2 = sph_ways(dim, s, a, s->block[k], &place, d);
            const vd volume = v_max(v_load(gas->volume + place.row), v_set(1e-290));
            vd jump = v_set(c * c) * (v_load(rho + place.row) - v_set(rho[a]));
            for (int i = 0; i < dim; i++)
                jump = v_fma(v_set(0.5) * (slope[i] + v_load(gas->push[i] + place.row) / volume), d[i], jump);
            const vd gain = (v_set(porosity[a]) + v_load(porosity + place.row)) * volume * jump * sph_slope(r2, h);
            sum = sum + gain;
            for (int i = 0; i < dim; i++) carry[i] = v_fma(gain, v_set(v[i][a]) + v_load(v[i] + place.row), carry[i]);
        }
        gas->gain[a] = scale * gas->volume[a] * v_sum(sum);
        for (int i = 0; i < dim; i++) gas->carry[i][a] = 0.5 * scale * gas->volume[a] * v_sum(carry[i]);
    }
}

/* Drag coefficient B at the porosity e and a relative speed. Up to the porosity of Darcy it is e^2 eta/k. Beyond a
 * range above it (Wen and Yu 1966) it is (3/4) C_D e (1 - e) rho |v|/d e^-2.65 with C_D = 24/Re (1 + 0.15 Re^0.687),
 * 0.44 from Re = 1000 on, Re = e rho |v| d/eta, written as 18 e (1 - e) eta/d^2 (C_D Re/24) e^-3.65. In between a cubic
 * blends the two. */
static double sph_drag_coefficient(const double *p, double e, double rho, double speed)
{
    const double eta = p[GR_SPH_GAS_P_viscosity], size = p[GR_SPH_GAS_P_diameter];
    const double darcy = e * e * eta / p[GR_SPH_GAS_P_permeability];
    const double t = (e - p[GR_SPH_GAS_P_darcy_porosity]) / p[GR_SPH_GAS_P_blend];
    if (!(t > 0.0)) return darcy;
    const double reynolds = e * rho * speed * size / eta;
    const double factor = reynolds < 1000.0 ? 1.0 + 0.15 * pow(reynolds, 0.687) : 0.44 / 24.0 * reynolds;
    const double dilute = 18.0 * eta / (size * size) * (1.0 - e) * factor * pow(e, -2.65);
    return t < 1.0 ? darcy + t * t * (3.0 - 2.0 * t) * (dilute - darcy) : dilute;
}

/* Drag over a step. A point of gas of mass m meets the particles around it, whose velocities are averaged with the
 * weights of the kernel. They can be moved like a mass m/L, with L the largest of their loads. With constant forces the
 * relative velocity r and the relative acceleration f obey dr/dt = f - r/t, 1/t = B V (1 + L)/m. The exact solution is
 * used, so that no step is too long; a long step leaves Darcy's velocity f t. Half of the impulse is applied at the end
 * of this step and half at the beginning of the next, like all accelerations. */
GR_INLINE void sph_gas_drag(int dim, struct gr_sph *s, int64_t first, int64_t last)
{
    const struct gr_sph_gas *gas = s->gas;
    double *const *v = gr_sph_rows(s, GR_SPH_FIELD_v), *const *acceleration = gr_sph_rows(s, GR_SPH_FIELD_a);
    const double *mass = gr_sph_rows(s, GR_SPH_FIELD_mass)[0], *rho = gr_sph_rows(s, GR_SPH_FIELD_rho)[0];
    const double *porosity = gr_sph_rows(s, GR_SPH_FIELD_porosity)[0], h = s->config.parameter[GR_SPH_P_h];
    for (int64_t a = first; a < last; a++) {
        struct sph_place place = {.shift = -1};
        vd sum[3], rate[3], d[3], most = v_set(0.0);
        double r[3], f[3], speed2 = 0.0;
        for (int i = 0; i < dim; i++) sum[i] = rate[i] = v_set(0.0);
        for (int64_t k = s->begin[a]; gas->per_mass[a] > 0.0 && k < s->middle[a]; k++) {
            const vd r2 = sph_ways(dim, s, a, s->block[k], &place, d);
            const vd w = v_load(mass + place.row) * sph_weight(r2, h);
            for (int i = 0; i < dim; i++) {
                sum[i] = v_fma(w, v_load(v[i] + place.row), sum[i]);
                rate[i] = v_fma(w, v_load(acceleration[i] + place.row), rate[i]);
            }
            most = v_select(v_gt(w, v_set(0.0)), v_max(v_load(gas->load + place.row), most), most);
        }
        double lanes[GR_W], load = 0.0;
        v_store(lanes, most);
        for (int k = 0; k < GR_W; k++) load = lanes[k] > load ? lanes[k] : load;
        for (int i = 0; i < dim; i++) {
            acceleration[i][a] = porosity[a] * gas->push[i][a] / mass[a] + s->gravity[i];
            r[i] = gas->per_mass[a] * v_sum(sum[i]) - v[i][a];
            f[i] = gas->per_mass[a] * v_sum(rate[i]) - acceleration[i][a];
            speed2 += r[i] * r[i];
        }
        double per_step = 0.0, ended = 0.0; /* dt/t, and 1 - exp(-dt/t), the share of the way to rest */
        if (gas->per_mass[a] > 0.0) {
            const double B = sph_drag_coefficient(gas->parameter, porosity[a], rho[a], sqrt(speed2));
            per_step = s->dt * B * gas->volume[a] * (1.0 + load) / mass[a], ended = -expm1(-per_step);
        }
        const double late = per_step > 0.0 ? 1.0 - ended / per_step : 0.0;
        for (int i = 0; i < dim; i++) {
            gas->drag[i][a] = mass[a] / (1.0 + load) * (r[i] * ended / s->dt + f[i] * late);
            acceleration[i][a] += gas->drag[i][a] / mass[a];
        }
    }
}

/* One stage of a step. */
GR_INLINE void sph_stage(int dim, struct gr_sph *s, enum gr_sph_stage stage, int64_t first, int64_t last,
                         struct gr_sph_extremes *extremes)
{
    const int elastic = s->config.parameter[GR_SPH_P_shear_modulus] > 0;
    if (stage == GR_SPH_DENSITIES) sph_densities(dim, s, first, last);
    if (stage == GR_SPH_FILTER) sph_filter(dim, s, first, last, extremes);
    if (stage == GR_SPH_STRESSES && elastic) sph_stresses(dim, 1, s, first, last);
    if (stage == GR_SPH_STRESSES && !elastic) sph_stresses(dim, 0, s, first, last);
    if (stage == GR_SPH_FORCES) sph_forces(dim, s, first, last, extremes);
    if (stage == GR_SPH_GAS_VOLUMES) sph_gas_volumes(dim, s, first, last);
    if (stage == GR_SPH_GAS_FORCES) sph_gas_forces(dim, s, first, last);
    if (stage == GR_SPH_GAS_LOADS) sph_gas_loads(dim, s, first, last);
    if (stage == GR_SPH_GAS_SHARES) sph_gas_hand_over(dim, s, first, last, 1, extremes);
    if (stage == GR_SPH_GAS_EXCHANGE) sph_gas_exchange(dim, s, first, last);
    if (stage == GR_SPH_GAS_DRAG) sph_gas_drag(dim, s, first, last);
    if (stage == GR_SPH_GAS_REACTIONS) sph_gas_hand_over(dim, s, first, last, 0, extremes);
}
