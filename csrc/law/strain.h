/* Exponentials and logarithms of 3 x 3 matrices in lanes, without eigenvectors: what finite elastic strains need.
 *
 * By Cayley and Hamilton a function of a 3 x 3 matrix M is a polynomial a0 + a1 M + a2 M^2, and a power series in M is
 * summed by its three coefficients alone: M times it costs two multiplications where tr M = 0. So a matrix is
 * multiplied once, not once for each term. All is arranged about the unit matrix (exp - 1, log(1 + .)), so that small
 * strains keep all of their digits, not those of 1 + strain.
 *
 * In the plane (dim = 2) the components xz, yz, zx, zy are taken for zero and never touched. */
#ifndef GR_LAW_STRAIN_H
#define GR_LAW_STRAIN_H

#include "law/trial.h"

/* Norms (Frobenius) of exponents, beyond which one is shortened to this. Elastic strains of grains are of the order
 * pressure/stiffness, strains of a step below the Courant number: it keeps what has gone wrong elsewhere finite. */
#define GR_STRAIN_REACH 2.0

struct gr_matrix {
    vd m[3][3];
};

/* Whether the component (i, j) is there. */
#define GR_COUPLED(dim, i, j) ((dim) == 3 || ((i) == 2) == ((j) == 2))

/* Loops over components: unrolled, so that components are registers. */
#define GR_UNROLLED _Pragma("GCC unroll 16")
#define GR_EACH(dim, i, j) \
    GR_UNROLLED            \
    for (int i = 0; i < 3; i++) GR_UNROLLED for (int j = 0; j < 3; j++) if (GR_COUPLED(dim, i, j))

/* Place of a component among the six of a symmetric matrix. */
static const int gr_place[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};

GR_INLINE vd gr_trace(const struct gr_matrix *a) { return a->m[0][0] + a->m[1][1] + a->m[2][2]; }

/* a b; where the product is known to be symmetric, half of it is made. */
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
        vd sum = a->m[i][i] * b->m[i][j]; /* (i, i) is always there */
        GR_UNROLLED
        for (int k = 0; k < 3; k++)
            if (k != i && GR_COUPLED(dim, i, k)) sum = v_fma(a->m[i][k], b->m[k][j], sum);
        c.m[i][j] = sum;
    }
    return c;
}

/* tr(a b), and with the transpose of b the sum of a_ij b_ij; by rows, which do not wait for each other. */
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

/* The deviator. */
GR_INLINE struct gr_matrix gr_deviator(const int dim, const struct gr_matrix *a)
{
    struct gr_matrix b;
    const vd mean = gr_trace(a) * v_set(1.0 / 3.0);
    GR_EACH(dim, i, j) { b.m[i][j] = i == j ? v_sub(a->m[i][j], mean) : a->m[i][j]; }
    return b;
}

/* a1 M + a2 M2, and a0 on the diagonal. */
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

/* (1 + E)^2 - 1 of E = a0 + a1 M + a2 M^2 with M^3 = e2 M + e3. */
static inline void gr_square_exponential(vd a[3], vd e2, vd e3)
{
    const vd two = v_set(2.0), a12 = two * a[1] * a[2], a22 = a[2] * a[2];
    const vd b0 = v_fma(two + a[0], a[0], a12 * e3);
    const vd b1 = v_fma(two * (v_set(1.0) + a[0]), a[1], v_fma(a12, e2, a22 * e3));
    const vd b2 = v_fma(two * (v_set(1.0) + a[0]), a[2], v_fma(a[1], a[1], a22 * e2));
    a[0] = b0, a[1] = b1, a[2] = b2;
}

enum {
    GR_EXPONENTIAL_TERMS = 10,  /* (1/8)^10/11! = 2e-17 of it is left out */
    GR_EXPONENTIAL_HALVINGS = 4 /* from GR_STRAIN_REACH to 1/8 */
};

static const double gr_inverse_factorial[GR_EXPONENTIAL_TERMS + 1] = {
    1.0,         1.0,          1.0 / 2.0,     1.0 / 6.0,      1.0 / 24.0,      1.0 / 120.0,
    1.0 / 720.0, 1.0 / 5040.0, 1.0 / 40320.0, 1.0 / 362880.0, 1.0 / 3628800.0,
};

/* exp(M) - 1 of a matrix without trace. Norms above 1/8 are halved, and the exponential squared as often; lanes that do
 * not need it are left alone by it, to the last bit. */
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
    for (int k = GR_EXPONENTIAL_TERMS - 1; k >= 0; k--) { /* times M */
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

/* Coefficients of atanh(w)/w in w^2. */
static const double gr_inverse_odd[] = {1.0,        1.0 / 3.0,  1.0 / 5.0,  1.0 / 7.0,  1.0 / 9.0, 1.0 / 11.0,
                                        1.0 / 13.0, 1.0 / 15.0, 1.0 / 17.0, 1.0 / 19.0, 1.0 / 21.0};

/* atanh(w)/w, 0 <= w < 1: with (1 + w)/(1 - w) = 2^n (1 + t)/(1 - t), |t| < .1716, the logarithm of which is
 * n ln 2 + 2 atanh t; n = 0 leaves t = w. */
static inline vd gr_atanh_over(vd w)
{
    const vd one = v_set(1.0), magic = v_set(0x1.8p52);
    w = v_min(w, v_set(0x1.fffffffffffffp-1));
    const vd above = one + w, below = one - w;
    const vi exponent = (vi)(v_set(1.4142135623730951) * above / below) >> 52;
    const vd power = (vd)(exponent << 52), n = (vd)(exponent + (vi)magic) - v_set(0x1.8p52 + 1023.0);
    const vd t = v_fnma(power, below, above) / v_fma(power, below, above), y = t * t;
    vd sum = v_set(gr_inverse_odd[10]); /* .1716^20/23 = 2e-17 of it is left out */
    for (int k = 9; k >= 0; k--) sum = v_fma(sum, y, v_set(gr_inverse_odd[k]));
    const vd whole = v_fma(n, v_set(0.34657359027997265), sum * t);
    return v_select(v_gt(n, v_zero()), whole / w, sum);
}

/* atanh(x)/(x - y) - atanh(y)/(x - y), without cancellation. */
static inline vd gr_atanh_slope(vd x, vd y)
{
    const vd below = v_set(1.0) - x * y;
    return gr_atanh_over(v_abs((x - y) / below)) / below;
}

/* Coefficients a1, a2 of atanh(Z) = a0 + a1 Z + a2 Z^2 by Newton's interpolation at the eigenvalues: c the one that
 * stands off from the other two, a and b those, which may be as close to each other as they like: in the formulas
 * stand their sum, their product and the slope between them only.
 *
 * Given: the trace of Z, e2 and e3 of its deviator, X^3 = e2 X + e3. With X = sqrt(e2/3) y it is y^3 - 3 y = 2 r,
 * |r| <= 1, whose largest root for r >= 0, in [sqrt 3, 2], Newton's method finds from 2 on. */
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
    a[0] = zero; /* of no effect on the deviator */
}

enum { GR_ATANH_TERMS = 7 }; /* no eigenvalue of Z is above (2/3)^1/2 norms: (1/96)^8/17 = 8e-18 is left out */

/* Deviator of log(1 + c)/2 of a symmetric c, 1 + c being positive definite: the logarithmic strain of the left
 * Cauchy-Green tensor 1 + c, scaled to determinant 1. It is atanh(Z), Z = c (2 + c)^-1: a series for norms of Z up to
 * 1/8, above by the eigenvalues. */
GR_INLINE struct gr_matrix gr_logarithmic_strain(const int dim, const struct gr_matrix *c)
{
    const vd two = v_set(2.0), zero = v_zero(), one = v_set(1.0), half = v_set(0.5);
    struct gr_matrix q, P, Z, Z2;
    GR_EACH(dim, i, j) { q.m[i][j] = i == j ? v_add(c->m[i][j], two) : c->m[i][j]; }
    GR_EACH(dim, i, j) /* cofactors of q; those of a symmetric matrix need no transposition */
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

    /* Z^3 = t1 Z^2 - t2 Z + t3, and from it Z^4 */
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

/* Logarithmic strain after a step, from that before (both symmetric deviators) and the deviator of L dt:
 * exp(2 h) -> F exp(2 h) F^T with F = exp(L dt), which is exact for a velocity gradient that stays. */
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

#endif
