/* Vectors of GR_W doubles (SIMD lanes), with one definition for each instruction set.
 *
 * `vd` has the ordinary operators + - * /; the functions below are operations without an operator in C. `vm` is a lane mask.
 * The width GR_W depends on how a kernel is compiled, never on the data: rows of points always have GR_LANES slots, which
 * shorter vectors take in parts.
 *
 * With GR_SINGLE kernels compute in single precision (simd_single.h): `vd` are floats then, `gr_real` is the type of what
 * kernels keep for themselves, and `vx`, of positions, are doubles in any case.
 *
 * v_after_1 and v_after_2 move the lanes of `a` up by one or two; the last lanes of `before` come first. m_of_bits is the
 * inverse of m_bits. */
#pragma once

#include <math.h>
#include <stdint.h>

#define GR_INLINE static inline __attribute__((always_inline))

/* Put before a loop over components, axes or the nodes of a cell (27 at most), so that all are known at compile time and
 * the operands stay in registers. */
#define GR_UNROLLED _Pragma("GCC unroll 27")

#define GR_LANES 8 /* cells of a tile; rows of points are this long in all instruction sets */

/* Sizes of what a processor keeps on its stack, and a thread of a device, which is one of many and has one lane. */
#ifdef GR_ON_DEVICE
#define GR_SIZE(processor, device) (device)
#else
#define GR_SIZE(processor, device) (processor)
#endif

#ifdef GR_ONE_LANE
#include "core/simd_one_lane.h"
#endif
#ifdef GR_SINGLE
#include "core/simd_single.h"
#elif defined(GR_ONE_LANE)
static inline double v_sum(vd a) { return a[0]; }
#elif defined(__AVX512F__)
#include <immintrin.h>
#define GR_W 8
typedef __m512d vd;
typedef __mmask8 vm;
static inline vd v_set(double a) { return _mm512_set1_pd(a); }
static inline vd v_fma(vd a, vd b, vd c) { return _mm512_fmadd_pd(a, b, c); }
static inline vd v_fnma(vd a, vd b, vd c) { return _mm512_fnmadd_pd(a, b, c); }
static inline vd v_min(vd a, vd b) { return _mm512_min_pd(a, b); }
static inline vd v_max(vd a, vd b) { return _mm512_max_pd(a, b); }
static inline vd v_sqrt(vd a) { return _mm512_sqrt_pd(a); }
static inline vm v_gt(vd a, vd b) { return _mm512_cmp_pd_mask(a, b, _CMP_GT_OQ); }
static inline vm v_ge(vd a, vd b) { return _mm512_cmp_pd_mask(a, b, _CMP_GE_OQ); }
static inline vm m_and(vm a, vm b) { return a & b; }
static inline unsigned m_bits(vm a) { return a; }
static inline vm m_of_bits(unsigned bits) { return (vm)bits; }
static inline vd v_select(vm m, vd a, vd b) { return _mm512_mask_blend_pd(m, b, a); }
static inline vd v_keep(vm m, vd a) { return _mm512_maskz_mov_pd(m, a); }
static inline double v_sum(vd a) { return _mm512_reduce_add_pd(a); }
static inline vd v_after_1(vd a, vd before) { return (vd)_mm512_alignr_epi64((__m512i)a, (__m512i)before, 7); }
static inline vd v_after_2(vd a, vd before) { return (vd)_mm512_alignr_epi64((__m512i)a, (__m512i)before, 6); }
#elif defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#define GR_W 4
typedef __m256d vd;
typedef __m256d vm;
static inline vd v_set(double a) { return _mm256_set1_pd(a); }
static inline vd v_fma(vd a, vd b, vd c) { return _mm256_fmadd_pd(a, b, c); }
static inline vd v_fnma(vd a, vd b, vd c) { return _mm256_fnmadd_pd(a, b, c); }
static inline vd v_min(vd a, vd b) { return _mm256_min_pd(a, b); }
static inline vd v_max(vd a, vd b) { return _mm256_max_pd(a, b); }
static inline vd v_sqrt(vd a) { return _mm256_sqrt_pd(a); }
static inline vm v_gt(vd a, vd b) { return _mm256_cmp_pd(a, b, _CMP_GT_OQ); }
static inline vm v_ge(vd a, vd b) { return _mm256_cmp_pd(a, b, _CMP_GE_OQ); }
static inline vm m_and(vm a, vm b) { return _mm256_and_pd(a, b); }
static inline unsigned m_bits(vm a) { return (unsigned)_mm256_movemask_pd(a); }
static inline vm m_of_bits(unsigned bits)
{
    const __m256i lanes = _mm256_set_epi64x(8, 4, 2, 1);
    return _mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(_mm256_set1_epi64x((int64_t)bits), lanes), lanes));
}
static inline vd v_select(vm m, vd a, vd b) { return _mm256_blendv_pd(b, a, m); }
static inline vd v_keep(vm m, vd a) { return _mm256_and_pd(m, a); }
static inline double v_sum(vd a)
{
    const __m128d b = _mm256_castpd256_pd128(a) + _mm256_extractf128_pd(a, 1);
    return b[0] + b[1];
}
static inline vd v_after_2(vd a, vd before) { return _mm256_permute2f128_pd(before, a, 0x21); }
static inline vd v_after_1(vd a, vd before) { return _mm256_shuffle_pd(v_after_2(a, before), a, 0x5); }
#else
/* Portable version: two lanes, written with the vector extension of gcc and clang (SSE2, NEON, ...). */
#define GR_W 2
typedef double vd __attribute__((vector_size(16)));
typedef int64_t vm __attribute__((vector_size(16)));
static inline vd v_set(double a) { return (vd){a, a}; }
static inline vd v_fma(vd a, vd b, vd c) { return a * b + c; }
static inline vd v_fnma(vd a, vd b, vd c) { return c - a * b; }
static inline vm v_gt(vd a, vd b) { return (vm)(a > b); }
static inline vm v_ge(vd a, vd b) { return (vm)(a >= b); }
static inline vm m_and(vm a, vm b) { return a & b; }
static inline unsigned m_bits(vm a) { return (unsigned)(a[0] & 1) | (unsigned)(a[1] & 2); }
static inline vm m_of_bits(unsigned bits) { return (vm){-(int64_t)(bits & 1), -(int64_t)(bits >> 1 & 1)}; }
static inline vd v_select(vm m, vd a, vd b) { return (vd)((m & (vm)a) | (~m & (vm)b)); }
static inline vd v_keep(vm m, vd a) { return (vd)(m & (vm)a); }
/* As the x86 instructions do, return the second operand where the comparison fails, so that NaN behaves the same. */
static inline vd v_min(vd a, vd b) { return v_select(v_gt(b, a), a, b); }
static inline vd v_max(vd a, vd b) { return v_select(v_gt(a, b), a, b); }
static inline vd v_sqrt(vd a) { return (vd){sqrt(a[0]), sqrt(a[1])}; }
static inline double v_sum(vd a) { return a[0] + a[1]; }
static inline vd v_after_1(vd a, vd before) { return (vd){before[1], a[0]}; }
static inline vd v_after_2(vd a, vd before)
{
    (void)a;
    return before;
}
#endif

#ifndef GR_SINGLE
typedef double gr_real;
typedef int64_t vi __attribute__((vector_size(8 * GR_W)));

/* Loads and stores whose type tells the compiler that only doubles are accessed. The intrinsics may alias anything, and
 * a compiler would read every pointer again after each store. */
typedef double vd_in_memory __attribute__((vector_size(8 * GR_W), aligned(8)));
static inline vd v_load(const double *p) { return (vd) * (const vd_in_memory *)p; }
static inline void v_store(double *p, vd a) { *(vd_in_memory *)p = (vd_in_memory)a; }
/* Store past the caches, where a vector is a whole line of them, aligned to its size: memory is not read first. Other threads
 * see it from v_streamed() on. */
#if defined(__AVX512F__) && !defined(GR_ONE_LANE)
static inline void v_stream(double *p, vd a) { _mm512_stream_pd(p, a); }
static inline void v_streamed(void) { _mm_sfence(); }
#else
static inline void v_stream(double *p, vd a) { v_store(p, a); }
static inline void v_streamed(void) {}
#endif
typedef double v_four __attribute__((vector_size(32), aligned(8))); /* the width is the same in all instruction sets */

/* Positions. x_fma: a b + c; x_minus: a - b; x_within: begin <= a < end, as a mask that x_bits turns into a bit for each
 * lane. */
typedef vd vx;
static inline vx x_set(double a) { return v_set(a); }
static inline vx x_load(const double *p) { return v_load(p); }
static inline void x_store(double *p, vx a) { v_store(p, a); }
static inline vx x_fma(vd a, vd b, vx c) { return v_fma(a, b, c); }
static inline vx x_add(vx a, vd b) { return a + b; }
static inline vd x_minus(vx a, vx b) { return a - b; }
static inline vm x_gt(vx a, vx b) { return v_gt(a, b); }
static inline vm x_ge(vx a, vx b) { return v_ge(a, b); }

#endif

/* Masks of positions. Where one vector of the others takes two of positions, these are the masks of both halves. */
#ifndef GR_MASK_OF_HALVES
typedef vm xm;
static inline xm x_within(vx a, vx begin, vx end) { return m_and(x_ge(a, begin), x_gt(end, a)); }
static inline xm x_and(xm a, xm b) { return m_and(a, b); }
static inline unsigned x_bits(xm a) { return m_bits(a); }
#endif

/* Store four numbers; and copy eight that were stored so, past the caches. They are loaded in fours: a wider load would wait
 * until they have left the processor. */
static inline void v_store_four(gr_real *p, gr_real a, gr_real b, gr_real c, gr_real d)
{
    *(v_four *)p = (v_four){a, b, c, d};
}
static inline void v_copy_eight(gr_real *to, const gr_real *from)
{
#if defined(__AVX512F__) && !defined(GR_SINGLE) && !defined(GR_ONE_LANE)
    const __m512d low = _mm512_castpd256_pd512(_mm256_loadu_pd(from));
    v_stream(to, _mm512_insertf64x4(low, _mm256_loadu_pd(from + 4), 1));
#else
    *(v_four *)to = *(const v_four *)from;
    *(v_four *)(to + 4) = *(const v_four *)(from + 4);
#endif
}

/* A number that depends on the round-off and range of what kernels compute with. */
#ifdef GR_SINGLE
#define GR_PRECISION(in_double, in_single) (in_single)
#else
#define GR_PRECISION(in_double, in_single) (in_double)
#endif
#define GR_NOTHING GR_PRECISION(1e-300, 1e-37)       /* added to a denominator that may be 0 */
#define GR_LARGEST_POWER GR_PRECISION(600.0, 80.0)   /* of e */
#define GR_MANTISSA GR_PRECISION(52, 23)             /* bits */
#define GR_ROUNDING GR_PRECISION(0x1.8p52, 0x1.8p23) /* adding it leaves the nearest integer in the low bits */
#define GR_EXP_TERMS GR_PRECISION(13, 7)             /* of the series of exp, for |r| <= ln(2)/2 */
/* The leading bits of ln 2, and the rest. */
#define GR_LN_2 GR_PRECISION(6.93147180369123816490e-01, 0.693359375)
#define GR_LN_2_REST GR_PRECISION(1.9082149292705877e-10, -2.12194440054690582e-4)

#define GR_VECTORS (GR_LANES / GR_W) /* vectors of a row of a tile */

/* Vectors of a row of a tile that a call works on: a processor has all of them, a thread of a device one. */
struct gr_parts {
    int first, last;
};
#define GR_ALL_PARTS ((struct gr_parts){0, GR_VECTORS})
#define GR_EACH_PART(part, parts) for (int part = (parts).first; part < (parts).last; part++)
#define GR_ALL_LANES ((1u << GR_W) - 1u)

static const double gr_inverse_factorial[14] = {
    1.0,          1.0,           1.0 / 2.0,      1.0 / 6.0,       1.0 / 24.0,       1.0 / 120.0,       1.0 / 720.0,
    1.0 / 5040.0, 1.0 / 40320.0, 1.0 / 362880.0, 1.0 / 3628800.0, 1.0 / 39916800.0, 1.0 / 479001600.0, 1.0 / 6227020800.0,
};

/* exp(x) to round-off for |x| <= GR_LARGEST_POWER: x = n ln 2 + r, a power series in r, and 2^n by setting the exponent
 * bits. */
static inline vd v_exp(vd x)
{
    const vd shift = v_set(GR_ROUNDING);
    const vd t = v_fma(x, v_set(1.4426950408889634), shift), n = t - shift;
    const vd r = v_fnma(n, v_set(GR_LN_2_REST), v_fnma(n, v_set(GR_LN_2), x));
    vd e = v_set(gr_inverse_factorial[GR_EXP_TERMS]);
    for (int k = GR_EXP_TERMS - 1; k > 1; k--) e = v_fma(e, r, v_set(gr_inverse_factorial[k]));
    e = v_fma(e * r, r, r) + v_set(1.0);
    return e * (vd)(((vi)t << GR_MANTISSA) + (vi)v_set(1.0));
}

#define GR_LOG_TERMS GR_PRECISION(23, 9) /* of the series of artanh, for |z| <= 0.172 */

/* ln(x) for a normal x > 0, to two units of its last digit: x = m 2^n with m from sqrt(1/2) to sqrt(2), by the exponent
 * bits, and ln m = 2 artanh(z) with z = (m - 1)/(m + 1), a power series. */
static inline vd v_log(vd x)
{
    const vd shift = v_set(GR_ROUNDING), one = v_set(1.0);
    const vi exponent = ((vi)x - (vi)v_set(0.70710678118654752)) >> GR_MANTISSA;
    const vd n = (vd)(exponent + (vi)shift) - shift, m = (vd)((vi)x - (exponent << GR_MANTISSA));
    const vd z = (m - one) / (m + one), square = z * z;
    vd sum = v_set(1.0 / GR_LOG_TERMS);
    for (int k = GR_LOG_TERMS - 2; k > 1; k -= 2) sum = v_fma(sum, square, v_set(1.0 / k));
    const vd twice = z + z;
    return v_fma(n, v_set(GR_LN_2), v_fma(n, v_set(GR_LN_2_REST), v_fma(twice * square, sum, twice)));
}

static inline vd v_mul(vd a, vd b) { return a * b; }
static inline vd v_add(vd a, vd b) { return a + b; }
static inline vd v_sub(vd a, vd b) { return a - b; }
static inline vd v_zero(void) { return v_set(0.0); }
static inline vd v_abs(vd a) { return v_max(a, -a); }
static inline vd v_clamp(vd a, double lo, double hi) { return v_min(v_max(a, v_set(lo)), v_set(hi)); }
