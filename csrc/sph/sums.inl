/* Sums over neighbours in one step: densities, strain rates and forces, in their order; included by kernels.c.
 *
 * The kernel is the cubic spline W = c w(q) with q = r/h, w = (2 - q)+^3/4 - (1 - q)+^3 (eq. 5.14). Its gradient at a
 * point is c/h^2 G(q) d with d the vector to the neighbour, G = 3 - 9 q/4 for q < 1, 3 (2 - q)+^2/(4 q) beyond.
 * Constant factors are taken out of the sums: W = weight norm x (4 h^3 w), and the gradient is slope norm x (4 h G/3)
 * d. */
#include "core/simd.h"
#include "sph/sph.h"

static const double sph_least_square = 1e-200; /* least r^2: not 0 for a point and itself */

/* Weight norm c/(4 h^3), 1/m^(dim + 3). */
static double sph_weight_norm(int dim, double h)
{
    const double pi = 3.14159265358979323846, c = dim == 2 ? 10.0 / (7.0 * pi * h * h) : 1.0 / (pi * h * h * h);
    return c / (4.0 * h * h * h);
}

/* Slope norm 3 c/(4 h^3), 1/m^(dim + 3). */
static double sph_slope_norm(int dim, double h) { return 3.0 * sph_weight_norm(dim, h); }

/* Slope norm for particles, scaled so that gradients of linear fields are exact on the seeding lattice. */
static double sph_gradient_norm(int dim, const struct gr_sph *s)
{
    return sph_slope_norm(dim, s->config.parameter[GR_SPH_P_h]) / s->config.parameter[GR_SPH_P_gradient];
}

/* A block of neighbours, and the position of a point relative to the blocks of its shift. */
struct sph_place {
    vd at[3];
    int32_t shift; /* -1: not set yet */
    int32_t row;   /* first row of the block */
};

/* Vectors d from a point to the points of a block.
 * Returned: their squared lengths. */
GR_INLINE vd sph_ways(int dim, const struct gr_sph *s, int64_t a, struct gr_block block, struct sph_place *place, vd *d)
{
    vd r2 = v_set(sph_least_square);
    place->row = block.row;
    if (block.shift != place->shift) { /* rare: most points have no periodic images nearby */
        place->shift = block.shift;
        for (int k = 0; k < dim; k++) place->at[k] = v_set(s->row[k][a] - s->shift[block.shift][k]);
    }
    for (int k = 0; k < dim; k++) {
        d[k] = v_load(s->row[k] + block.row) - place->at[k];
        r2 = v_fma(d[k], d[k], r2);
    }
    return r2;
}

/* Unnormalised kernel 4 h^3 w, m^3. */
GR_INLINE vd sph_weight(vd r2, double h)
{
    const vd r = v_sqrt(r2), t = v_max(v_set(2.0 * h) - r, v_set(0.0));
    const vd inner = v_fma(r2, v_fma(v_set(3.0), r, v_set(-6.0 * h)), v_set(4.0 * h * h * h));
    return v_select(v_gt(v_set(h), r), inner, t * t * t);
}

/* Unnormalised slope 4 h G/3, m. */
GR_INLINE vd sph_slope(vd r2, double h)
{
    const vd r = v_sqrt(r2), per_r = v_set(1.0) / r, t = v_max(v_set(2.0 * h) - r, v_set(0.0));
    return v_select(v_gt(v_set(h), r), v_fnma(v_set(3.0), r, v_set(4.0 * h)), t * t * per_r);
}

/* sum_b f_b w over blocks [first, last) of the neighbours of a point. */
GR_INLINE double sph_sum(int dim, const struct gr_sph *s, const double *f, int64_t a, int64_t first, int64_t last)
{
    const double h = s->config.parameter[GR_SPH_P_h];
    vd sum = v_set(0.0), d[3];
    struct sph_place place = {.shift = -1};
    for (int64_t k = first; k < last; k++) {
        const vd r2 = sph_ways(dim, s, a, s->block[k], &place, d);
        sum = v_fma(v_load(f + place.row), sph_weight(r2, h), sum);
    }
    return v_sum(sum);
}

/* Number of points whose sums are computed before the operations that use them, so that neither waits for the other. */
enum { SPH_TILE = 64 };

/* Density rho~ = sum_b m_b W (eq. 5.17), and m/rho~. */
GR_INLINE void sph_densities(int dim, struct gr_sph *s, int64_t first, int64_t last)
{
    const double *mass = gr_sph_rows(s, GR_SPH_FIELD_mass)[0], norm = sph_weight_norm(dim, s->config.parameter[GR_SPH_P_h]);
    for (int64_t a = first; a < last; a++) s->rho_plain[a] = norm * sph_sum(dim, s, mass, a, s->begin[a], s->end[a]);
    for (int64_t a = first; a < last; a++) s->lump[a] = mass[a] / s->rho_plain[a];
}

/* Shepard filter rho = rho~/sum_b (m_b/rho~_b) W (eq. 5.18); m/rho; and the speed of sound, c^2 = K/rho (eq. 5.6). */
GR_INLINE void sph_filter(int dim, struct gr_sph *s, int64_t first, int64_t last, struct gr_sph_extremes *extremes)
{
    const double *mass = gr_sph_rows(s, GR_SPH_FIELD_mass)[0], *p = s->config.parameter;
    const double norm = sph_weight_norm(dim, p[GR_SPH_P_h]);
    double *rho = gr_sph_rows(s, GR_SPH_FIELD_rho)[0];
    const double rho0 = first < s->wall_first ? p[GR_SPH_P_rho0] : p[GR_SPH_P_rho0_wall];
    const double stiff = 1.5 * p[GR_SPH_P_kappa], shear = 4.0 / 3.0 * p[GR_SPH_P_shear_modulus];
    for (int64_t tile = first; tile < last; tile += SPH_TILE) {
        const int64_t end = tile + SPH_TILE < last ? tile + SPH_TILE : last;
        double c2[SPH_TILE], most = extremes->speed2;
        for (int64_t a = tile; a < end; a++) c2[a - tile] = norm * sph_sum(dim, s, s->lump, a, s->begin[a], s->end[a]);
        for (int64_t a = tile; a < end; a++) {
            rho[a] = s->rho_plain[a] / c2[a - tile];
            s->volume[a] = mass[a] / rho[a];
            const double ratio = rho[a] / rho0;
            c2[a - tile] = (stiff * ratio * sqrt(ratio) + shear) / rho[a];
        }
        for (int64_t a = tile; a < end; a++) most = c2[a - tile] > most ? c2[a - tile] : most;
        extremes->speed2 = most;
    }
}

enum { SPH_SAME, SPH_TO_WALL, SPH_FROM_WALL }; /* pair: of the same kind; seen from a particle; seen from a wall point */

/* Factor z of the artificial velocity of a wall, v_b = (1 - z) v_a + z v_w. The relative velocity is z (v_w - v_a); the
 * velocity then vanishes on the surface of the wall, between a depth below and a height above it (eqs. 5.23, 5.24). */
GR_INLINE vd sph_factor(int pair, const struct gr_sph *s, double *const *normal, const double *depth, int64_t a, int64_t b,
                        int dim, const vd *d)
{
    const vd largest = v_set(s->config.parameter[GR_SPH_P_z_max]), zero = v_set(0.0);
    vd below, height;
    if (pair == SPH_TO_WALL) {
        below = v_load(depth + b), height = zero - below;
        for (int k = 0; k < dim; k++) height = v_fnma(v_load(normal[k] + b), d[k], height);
    } else {
        below = v_set(depth[a]), height = zero - below;
        for (int k = 0; k < dim; k++) height = v_fma(v_set(normal[k][a]), d[k], height);
    }
    const vd z = v_min(v_set(1.0) + below / height, largest);
    return v_select(v_gt(height, zero), z, largest);
}

/* Sums of a point over its neighbours. */
struct sph_sums {
    vd D[6];    /* V_b G (dv_i d_j + dv_j d_i): xx, yy, zz, which are halved, xy, yz, xz */
    vd spin[3]; /* for an elastic material: V_b G (dv_j d_i - dv_i d_j): yx, zy, xz */
    vd near[3]; /* with a different friction at walls: V_b G |n_b|, n the normals of walls */
};

/* Add the blocks [first, last) of neighbours to the sums of a point. */
GR_INLINE void sph_add_rates(int dim, int pair, int elastic, const struct gr_sph *s, int64_t a, int64_t first, int64_t last,
                             struct sph_sums *sums)
{
    vd *const D = sums->D, *const spin = sums->spin;
    const int finds_walls = pair == SPH_TO_WALL && s->config.wall_friction;
    double *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    double *const *normal = gr_sph_rows(s, GR_SPH_FIELD_normal);
    const double *depth = gr_sph_rows(s, GR_SPH_FIELD_depth)[0], h = s->config.parameter[GR_SPH_P_h];
    struct sph_place place = {.shift = -1};
    const int artificial = pair != SPH_SAME && s->config.parameter[GR_SPH_P_z_max] > 1.0;
    for (int64_t k = first; k < last; k++) {
        vd d[3], dv[3];
        const vd r2 = sph_ways(dim, s, a, s->block[k], &place, d);
        vd weight = v_load(s->volume + place.row) * sph_slope(r2, h);
        for (int i = 0; finds_walls && i < dim; i++)
            sums->near[i] = v_fma(weight, v_abs(v_load(normal[i] + place.row)), sums->near[i]);
        if (artificial) weight = weight * sph_factor(pair, s, normal, depth, a, place.row, dim, d);
        for (int i = 0; i < dim; i++) dv[i] = weight * (v_load(v[i] + place.row) - v_set(v[i][a]));
        for (int i = 0; i < dim; i++) D[i] = v_fma(dv[i], d[i], D[i]);
        D[3] = v_fma(dv[0], d[1], v_fma(dv[1], d[0], D[3]));
        if (dim == 3) {
            D[4] = v_fma(dv[1], d[2], v_fma(dv[2], d[1], D[4]));
            D[5] = v_fma(dv[0], d[2], v_fma(dv[2], d[0], D[5]));
        }
        if (!elastic) continue;
        spin[0] = v_fma(dv[1], d[0], v_fnma(dv[0], d[1], spin[0]));
        if (dim == 3) {
            spin[1] = v_fma(dv[2], d[1], v_fnma(dv[1], d[2], spin[1]));
            spin[2] = v_fma(dv[0], d[2], v_fnma(dv[2], d[0], spin[2]));
        }
    }
}

/* Strain rates and, for an elastic material, spins (eqs. 5.2, 5.21) of a tile at most, divided by the slope norm; and, with
 * different friction at walls, numbers above 0 for the axes along which a point feels a wall. */
GR_INLINE void sph_rates(int dim, int elastic, const struct gr_sph *s, int64_t first, int64_t last,
                         double (*rates)[SPH_TILE], double (*near)[SPH_TILE])
{
    double *const *normal = gr_sph_rows(s, GR_SPH_FIELD_normal);
    const int is_wall = first >= s->wall_first;
    for (int64_t a = first; a < last; a++) {
        struct sph_sums sums = {0};
        if (is_wall) { /* wall points do not strain each other */
            sph_add_rates(dim, SPH_FROM_WALL, elastic, s, a, s->begin[a], s->middle[a], &sums);
        } else {
            sph_add_rates(dim, SPH_SAME, elastic, s, a, s->begin[a], s->middle[a], &sums);
            if (s->middle[a] < s->end[a]) sph_add_rates(dim, SPH_TO_WALL, elastic, s, a, s->middle[a], s->end[a], &sums);
        }
        for (int k = 0; k < 6; k++) rates[k][a - first] = (k < 3 ? 2.0 : 1.0) * v_sum(sums.D[k]);
        for (int k = 0; elastic && k < 3; k++) rates[6 + k][a - first] = v_sum(sums.spin[k]);
        for (int k = 0; s->config.wall_friction && k < dim; k++)
            near[k][a - first] = is_wall ? fabs(normal[k][a]) : v_sum(sums.near[k]);
    }
}

/* Add m_b G (T_a + T_b) d of blocks [first, last), T = sigma/rho^2. */
GR_INLINE void sph_add_forces(int dim, const struct gr_sph *s, int64_t a, int64_t first, int64_t last, vd *sum)
{
    double *const *pull = s->pull;
    const double *mass = gr_sph_rows(s, GR_SPH_FIELD_mass)[0], h = s->config.parameter[GR_SPH_P_h];
    struct sph_place place = {.shift = -1};
    for (int64_t k = first; k < last; k++) {
        vd d[3], T[6];
        const vd r2 = sph_ways(dim, s, a, s->block[k], &place, d);
        const vd weight = v_load(mass + place.row) * sph_slope(r2, h);
        for (int c = 0; c < (dim == 2 ? 4 : 6); c++)
            if (dim == 3 || c != 2) T[c] = v_load(pull[c] + place.row) + v_set(pull[c][a]);
        for (int i = 0; i < dim; i++) d[i] = weight * d[i];
        if (dim == 2) {
            sum[0] = v_fma(T[0], d[0], v_fma(T[3], d[1], sum[0]));
            sum[1] = v_fma(T[3], d[0], v_fma(T[1], d[1], sum[1]));
        } else {
            sum[0] = v_fma(T[0], d[0], v_fma(T[3], d[1], v_fma(T[5], d[2], sum[0])));
            sum[1] = v_fma(T[3], d[0], v_fma(T[1], d[1], v_fma(T[4], d[2], sum[1])));
            sum[2] = v_fma(T[5], d[0], v_fma(T[4], d[1], v_fma(T[2], d[2], sum[2])));
        }
    }
}

/* Acceleration of the particles, a = sum_b m_b (sigma_a/rho_a^2 + sigma_b/rho_b^2) grad W + g (eq. 5.20, whose sum
 * lacks m_b). */
GR_INLINE void sph_forces(int dim, struct gr_sph *s, int64_t first, int64_t last, struct gr_sph_extremes *extremes)
{
    double *const *acceleration = gr_sph_rows(s, GR_SPH_FIELD_a), scale = sph_gradient_norm(dim, s);
    for (int64_t a = first; a < last; a++) {
        vd sums[3] = {v_set(0.0), v_set(0.0), v_set(0.0)};
        double square = 0.0;
        sph_add_forces(dim, s, a, s->begin[a], s->middle[a], sums);
        if (s->middle[a] < s->end[a]) sph_add_forces(dim, s, a, s->middle[a], s->end[a], sums);
        for (int i = 0; i < dim; i++) {
            acceleration[i][a] = scale * v_sum(sums[i]) + s->gravity[i];
            square += acceleration[i][a] * acceleration[i][a];
        }
        if (square > extremes->acceleration2) extremes->acceleration2 = square;
    }
}
