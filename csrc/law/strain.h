/* Exponentials and logarithms of 3 x 3 matrices in SIMD lanes, without eigenvectors, for finite elastic strains.
 *
 * By the theorem of Cayley and Hamilton a function of a 3 x 3 matrix M is a polynomial a0 + a1 M + a2 M^2. A power series in
 * M is therefore summed by these three coefficients alone; multiplying them by M costs two multiplications where tr M = 0.
 * Matrices are multiplied once, not once per term. All formulas are arranged about the unit matrix (exp - 1, log(1 + .)), so
 * that small strains keep the relative accuracy of the strain instead of 1 + strain.
 *
 * In 2D (dim = 2) the components xz, yz, zx, zy are taken as zero and never accessed. */
#pragma once

#include "law/trial.h"

/* Largest Frobenius norm of an exponent; a larger one is scaled down to it. Elastic strains of granular material are of the
 * order pressure/stiffness and the strain of a step is below the Courant number, so that this only keeps numbers finite
 * after errors elsewhere. */
#define GR_STRAIN_REACH 2.0

struct gr_matrix {
    vd m[3][3];
};

/* True if the component (i, j) is used: in 2D those that couple z to x or y are not. */
#define GR_COUPLED(dim, i, j) ((dim) == 3 || ((i) == 2) == ((j) == 2))

/* Loops over components. */
#define GR_EACH(dim, i, j) \
    GR_UNROLLED            \
    for (int i = 0; i < 3; i++) GR_UNROLLED for (int j = 0; j < 3; j++) if (GR_COUPLED(dim, i, j))

/* Index of component (i, j) among the six of a symmetric matrix. */
static const int gr_place[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};

GR_INLINE vd gr_trace(const struct gr_matrix *a) { return a->m[0][0] + a->m[1][1] + a->m[2][2]; }

/* The product a b. If it is known to be symmetric, only half of it is computed. */
GR_INLINE struct gr_matrix gr_product(const int dim, const int symmetric, const struct gr_matrix *a,
                                      const struct gr_matrix *b)
{
    struct gr_matrix c;
    GR_EACH(dim, i, j)
    {
        if (symmetric && j < i) {
            c.m[i][j] = c.m[j][i];
            continue;
        }
        vd sum = a->m[i][i] * b->m[i][j]; /* component (i, i) is always used */
        GR_UNROLLED
        for (int k = 0; k < 3; k++)
            if (k != i && GR_COUPLED(dim, i, k)) sum = v_fma(a->m[i][k], b->m[k][j], sum);
        c.m[i][j] = sum;
    }
    return c;
}

/* tr(a b) or, if `transposed`, the sum of a_ij b_ij. The rows are summed separately, so that they do not wait for each
 * other. */
GR_INLINE vd gr_trace_of_product(const int dim, const struct gr_matrix *a, const struct gr_matrix *b, const int transposed)
{
    vd row[3];
    GR_UNROLLED
    for (int i = 0; i < 3; i++) {
        row[i] = a->m[i][i] * b->m[i][i];
        GR_UNROLLED
        for (int j = 0; j < 3; j++)
            if (j != i && GR_COUPLED(dim, i, j)) row[i] = v_fma(a->m[i][j], transposed ? b->m[i][j] : b->m[j][i], row[i]);
    }
    return row[0] + row[1] + row[2];
}

/* The deviator of a. */
GR_INLINE struct gr_matrix gr_deviator(const int dim, const struct gr_matrix *a)
{
    struct gr_matrix b;
    const vd mean = gr_trace(a) * v_set(1.0 / 3.0);
    GR_EACH(dim, i, j) { b.m[i][j] = i == j ? v_sub(a->m[i][j], mean) : a->m[i][j]; }
    return b;
}

/* a0 + a1 M + a2 M2. */
GR_INLINE struct gr_matrix gr_quadratic(const int dim, vd a0, vd a1, const struct gr_matrix *M, vd a2,
                                        const struct gr_matrix *M2)
{
    struct gr_matrix b;
    GR_EACH(dim, i, j)
    {
        const vd high = i == j ? v_fma(a2, M2->m[i][j], a0) : v_mul(a2, M2->m[i][j]);
        b.m[i][j] = v_fma(a1, M->m[i][j], high);
    }
    return b;
}

/* Coefficients of (1 + E)^2 - 1 from the coefficients of E = a0 + a1 M + a2 M^2, with M^3 = e2 M + e3. */
static inline void gr_square_exponential(vd a[3], vd e2, vd e3)
{
    const vd two = v_set(2.0), a12 = two * a[1] * a[2], a22 = a[2] * a[2];
    const vd b0 = v_fma(two + a[0], a[0], a12 * e3);
    const vd b1 = v_fma(two * (v_set(1.0) + a[0]), a[1], v_fma(a12, e2, a22 * e3));
    const vd b2 = v_fma(two * (v_set(1.0) + a[0]), a[2], v_fma(a[1], a[1], a22 * e2));
    a[0] = b0, a[1] = b1, a[2] = b2;
}

enum {
    GR_EXPONENTIAL_TERMS = 10,  /* relative truncation error (1/8)^10/11! = 2e-17 */
    GR_EXPONENTIAL_HALVINGS = 4 /* they take a norm from GR_STRAIN_REACH to 1/8 */
};

/* exp(M) - 1 of a matrix without trace. If its norm exceeds 1/8, M is halved until it does not and the exponential is
 * squared as often. Lanes that need no halving are left unchanged, to the last bit. */
GR_INLINE struct gr_matrix gr_exponential(const int dim, const int symmetric, const struct gr_matrix *M)
{
    const vd one = v_set(1.0), most = v_set(1.0 / 64.0);
    const struct gr_matrix M2 = gr_product(dim, symmetric, M, M);
    const vd norm2 = symmetric ? gr_trace(&M2) : gr_trace_of_product(dim, M, M, 1);
    vd e2 = v_set(0.5) * gr_trace(&M2), e3 = gr_trace_of_product(dim, M, &M2, 0) * v_set(1.0 / 3.0);
    vd scale = one, halvings = v_zero();
    const unsigned large = m_bits(v_gt(norm2, most));
    if (large) {
        const vm beyond = v_gt(norm2, v_set(GR_STRAIN_REACH * GR_STRAIN_REACH));
        scale = v_select(beyond, v_set(GR_STRAIN_REACH) / v_sqrt(norm2), one);
        for (int k = 0; k < GR_EXPONENTIAL_HALVINGS; k++) {
            const vm halve = v_gt(norm2 * scale * scale, most);
            scale = v_select(halve, v_set(0.5) * scale, scale);
            halvings = v_select(halve, halvings + one, halvings);
        }
        e2 = e2 * scale * scale, e3 = e3 * scale * scale * scale;
    }
    vd a[3] = {v_set(gr_inverse_factorial[GR_EXPONENTIAL_TERMS]), v_zero(), v_zero()};
    GR_UNROLLED
    for (int k = GR_EXPONENTIAL_TERMS - 1; k >= 0; k--) { /* multiply by M and add the next term */
        const vd a0 = v_fma(a[2], e3, v_set(k ? gr_inverse_factorial[k] : 0.0)), a1 = v_fma(a[2], e2, a[0]);
        a[2] = a[1], a[1] = a1, a[0] = a0;
    }
    if (large) {
        for (int k = 0; k < GR_EXPONENTIAL_HALVINGS; k++) {
            vd b[3] = {a[0], a[1], a[2]};
            const vm again = v_gt(halvings, v_set(k));
            gr_square_exponential(b, e2, e3);
            for (int i = 0; i < 3; i++) a[i] = v_select(again, b[i], a[i]);
        }
        a[1] = a[1] * scale, a[2] = a[2] * scale * scale;
    }
    return gr_quadratic(dim, a[0], a[1], M, a[2], &M2);
}

/* Coefficients of the series of atanh(w)/w in w^2. */
static const double gr_inverse_odd[] = {1.0,        1.0 / 3.0,  1.0 / 5.0,  1.0 / 7.0,  1.0 / 9.0, 1.0 / 11.0,
                                        1.0 / 13.0, 1.0 / 15.0, 1.0 / 17.0, 1.0 / 19.0, 1.0 / 21.0};

/* atanh(w)/w for 0 <= w < 1. Write (1 + w)/(1 - w) = 2^n (1 + t)/(1 - t) with |t| < 0.1716; its logarithm is
 * n ln 2 + 2 atanh t. With n = 0, t = w. */
static inline vd gr_atanh_over(vd w)
{
    const vd one = v_set(1.0), magic = v_set(0x1.8p52);
    w = v_min(w, v_set(0x1.fffffffffffffp-1));
    const vd above = one + w, below = one - w;
    const vi exponent = (vi)(v_set(1.4142135623730951) * above / below) >> 52;
    const vd power = (vd)(exponent << 52), n = (vd)(exponent + (vi)magic) - v_set(0x1.8p52 + 1023.0);
    const vd t = v_fnma(power, below, above) / v_fma(power, below, above), y = t * t;
    vd sum = v_set(gr_inverse_odd[10]); /* relative truncation error 0.1716^20/23 = 2e-17 */
    for (int k = 9; k >= 0; k--) sum = v_fma(sum, y, v_set(gr_inverse_odd[k]));
    const vd whole = v_fma(n, v_set(0.34657359027997265), sum * t);
    return v_select(v_gt(n, v_zero()), whole / w, sum);
}

/* (atanh(x) - atanh(y))/(x - y), without cancellation. */
static inline vd gr_atanh_slope(vd x, vd y)
{
    const vd below = v_set(1.0) - x * y;
    return gr_atanh_over(v_abs((x - y) / below)) / below;
}

/* Coefficients a1, a2 of atanh(Z) = a0 + a1 Z + a2 Z^2, by Newton's interpolation at the eigenvalues of Z. The
 * eigenvalue c is the one farthest from the other two, a and b. These may be arbitrarily close to each other: the
 * formulas contain only their sum, their product and the divided difference between them.
 *
 * Given: the trace of Z, and e2, e3 of its deviator X, X^3 = e2 X + e3. With X = sqrt(e2/3) y the characteristic
 * equation becomes y^3 - 3 y = 2 r, |r| <= 1. For r >= 0 its largest root lies in [sqrt 3, 2]; Newton's method finds it
 * from 2. */
static __attribute__((noinline)) void gr_atanh_interpolated(vd trace, vd e2, vd e3, vd a[3])
{
    const vd zero = v_zero(), one = v_set(1.0), three = v_set(3.0), half = v_set(0.5);
    const vd size2 = v_max(e2 * v_set(1.0 / 3.0), v_set(1e-30)), size = v_sqrt(size2), r2 = e3 / (size2 * size);
    const vd sign = v_select(v_ge(r2, zero), one, -one), target = v_min(v_abs(r2), v_set(2.0));
    vd y = v_set(2.0);
    for (int k = 0; k < 6; k++) {
        const vd square = y * y;
        y = y - (v_fma(square - three, y, -target)) / (three * (square - one));
    }
    const vd mean = trace * v_set(1.0 / 3.0), unit = sign * size;
    const vd apart = half * v_sqrt(v_max(zero, three * (v_set(4.0) - y * y)));
    const vd zc = v_fma(unit, y, mean), za = v_fma(unit, apart - half * y, mean), zb = v_fma(unit, -apart - half * y, mean);
    const vd slope = gr_atanh_slope(za, zb);
    a[2] = (gr_atanh_slope(zb, zc) - slope) / (zc - za);
    a[1] = v_fnma(a[2], za + zb, slope);
    a[0] = zero; /* without effect on the deviator */
}

enum { GR_ATANH_TERMS = 7 }; /* eigenvalues of Z are at most (2/3)^1/2 norms: truncation (1/96)^8/17 = 8e-18 */

/* Deviator of log(1 + c)/2 for a symmetric c with 1 + c positive definite: the logarithmic strain of the left
 * Cauchy-Green tensor 1 + c, scaled to determinant 1. It is the deviator of atanh(Z), Z = c (2 + c)^-1: by a power
 * series for norms of Z up to 1/8, by the eigenvalues above. */
GR_INLINE struct gr_matrix gr_logarithmic_strain(const int dim, const struct gr_matrix *c)
{
    const vd two = v_set(2.0), zero = v_zero(), one = v_set(1.0), half = v_set(0.5);
    struct gr_matrix q, P, Z, Z2;
    GR_EACH(dim, i, j) { q.m[i][j] = i == j ? v_add(c->m[i][j], two) : c->m[i][j]; }
    GR_EACH(dim, i, j) /* cofactors of q; a symmetric matrix needs no transposition */
    {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
        if (j < i) {
            P.m[i][j] = P.m[j][i];
            continue;
        }
        const int straight = GR_COUPLED(dim, i1, j1), crossed = GR_COUPLED(dim, i1, j2) && GR_COUPLED(dim, i2, j1);
        const vd minus = crossed ? v_mul(q.m[i1][j2], q.m[i2][j1]) : zero;
        P.m[i][j] = straight ? v_fma(q.m[i1][j1], q.m[i2][j2], -minus) : -minus;
    }
    vd det = q.m[0][0] * P.m[0][0];
    for (int j = 1; j < 3; j++)
        if (GR_COUPLED(dim, 0, j)) det = v_fma(q.m[0][j], P.m[0][j], det);
    const vd inverse = one / det;
    GR_EACH(dim, i, j) { P.m[i][j] = P.m[i][j] * inverse; }
    Z = gr_product(dim, 1, c, &P);
    Z2 = gr_product(dim, 1, &Z, &Z);

    /* Z^3 = t1 Z^2 - t2 Z + t3, and Z^4 from it */
    const vd t1 = gr_trace(&Z), norm2 = gr_trace(&Z2), t2 = half * v_fma(t1, t1, -norm2);
    const vd cube = gr_trace_of_product(dim, &Z, &Z2, 0);
    const vd t3 = v_fma(t2, t1, (cube - t1 * norm2)) * v_set(1.0 / 3.0);
    const vd f0 = t1 * t3, f1 = v_fnma(t1, t2, t3), f2 = v_fma(t1, t1, -t2);
    vd a[3] = {v_set(gr_inverse_odd[GR_ATANH_TERMS]), zero, zero};
    GR_UNROLLED
    for (int k = GR_ATANH_TERMS - 1; k >= 0; k--) {
        const vd a0 = v_fma(a[1], t3, v_fma(a[2], f0, v_set(gr_inverse_odd[k])));
        const vd a1 = v_fnma(a[1], t2, a[2] * f1), a2 = v_fma(a[1], t1, v_fma(a[2], f2, a[0]));
        a[0] = a0, a[1] = a1, a[2] = a2;
    }
    const vd a1 = v_fnma(a[2], t2, a[0]), a2 = v_fma(a[2], t1, a[1]);
    a[0] = zero, a[1] = a1, a[2] = a2;
    const vm large = v_gt(norm2, v_set(1.0 / 64.0));
    if (m_bits(large)) {
        vd b[3];
        const struct gr_matrix X = gr_deviator(dim, &Z), X2 = gr_product(dim, 1, &X, &X);
        gr_atanh_interpolated(t1, half * gr_trace(&X2), gr_trace_of_product(dim, &X, &X2, 0) * v_set(1.0 / 3.0), b);
        for (int i = 0; i < 3; i++) a[i] = v_select(large, b[i], a[i]);
    }
    const struct gr_matrix h = gr_quadratic(dim, a[0], a[1], &Z, a[2], &Z2);
    return gr_deviator(dim, &h);
}

/* Logarithmic strain after a step, from the strain before it and the deviator of L dt (h and the result are symmetric
 * deviators): exp(2 h) -> F exp(2 h) F^T with F = exp(L dt), which is exact for a constant velocity gradient. */
GR_INLINE struct gr_matrix gr_trial_strain(const int dim, const struct gr_matrix *h, const struct gr_matrix *L)
{
    struct gr_matrix twice, T, c;
    GR_EACH(dim, i, j) { twice.m[i][j] = h->m[i][j] + h->m[i][j]; }
    const struct gr_matrix e = gr_exponential(dim, 1, &twice), f = gr_exponential(dim, 0, L);
    T = gr_product(dim, 0, &f, &e); /* T = F (1 + e) - 1 */
    GR_EACH(dim, i, j) { T.m[i][j] = T.m[i][j] + (e.m[i][j] + f.m[i][j]); }
    GR_EACH(dim, i, j) /* T F^T + F^T - 1 */
    {
        if (j < i) {
            c.m[i][j] = c.m[j][i];
            continue;
        }
        vd sum = T.m[i][j] + f.m[j][i];
        GR_UNROLLED
        for (int k = 0; k < 3; k++)
            if (GR_COUPLED(dim, i, k) && GR_COUPLED(dim, k, j)) sum = v_fma(T.m[i][k], f.m[j][k], sum);
        c.m[i][j] = sum;
    }
    return gr_logarithmic_strain(dim, &c);
}
