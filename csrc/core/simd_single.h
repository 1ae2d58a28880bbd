/* The vectors of simd.h in single precision. Fields of points and of nodes stay doubles in memory: a load narrows them and a
 * store widens them. Positions are doubles, since a point moves by a small part of its coordinate in a step. */
#pragma once

#if defined(GR_ONE_LANE)
typedef double vx __attribute__((vector_size(8)));
typedef double vx_in_memory __attribute__((vector_size(8), aligned(8)));
static inline vx x_set(double a) { return (vx){a}; }
static inline vx x_load(const double *p) { return (vx) * (const vx_in_memory *)p; }
static inline void x_store(double *p, vx a) { *(vx_in_memory *)p = (vx_in_memory)a; }
static inline vx x_widen(vd a) { return (vx){a[0]}; }
static inline vd x_narrow(vx a) { return (vd){(float)a[0]}; }
static inline vx x_plus(vx a, vx b) { return a + b; }
static inline vd x_minus(vx a, vx b) { return x_narrow(a - b); }
static inline vm x_gt(vx a, vx b) { return (vm){-(int32_t)(a[0] > b[0])}; }
static inline vm x_ge(vx a, vx b) { return (vm){-(int32_t)(a[0] >= b[0])}; }
#elif defined(__AVX512F__) || (defined(__AVX2__) && defined(__FMA__))
#include <immintrin.h>
#define GR_W 8
typedef __m256 vd; /* with AVX-512 as many floats as a vector of doubles has lanes */
static inline vd v_set(double a) { return _mm256_set1_ps((float)a); }
static inline vd v_fma(vd a, vd b, vd c) { return _mm256_fmadd_ps(a, b, c); }
static inline vd v_fnma(vd a, vd b, vd c) { return _mm256_fnmadd_ps(a, b, c); }
static inline vd v_min(vd a, vd b) { return _mm256_min_ps(a, b); }
static inline vd v_max(vd a, vd b) { return _mm256_max_ps(a, b); }
static inline vd v_sqrt(vd a) { return _mm256_sqrt_ps(a); }
/* The upper half of `before` and the lower of `a`: with it each half of `a` has what comes before. */
static inline __m256i v_between(vd a, vd before) { return _mm256_castps_si256(_mm256_permute2f128_ps(before, a, 0x21)); }
static inline vd v_after_1(vd a, vd before)
{
    return _mm256_castsi256_ps(_mm256_alignr_epi8(_mm256_castps_si256(a), v_between(a, before), 12));
}
static inline vd v_after_2(vd a, vd before)
{
    return _mm256_castsi256_ps(_mm256_alignr_epi8(_mm256_castps_si256(a), v_between(a, before), 8));
}
#endif

#if defined(GR_ONE_LANE)
#elif defined(__AVX512F__)
typedef __mmask8 vm;
typedef __m512d vx;
static inline vm v_gt(vd a, vd b) { return _mm256_cmp_ps_mask(a, b, _CMP_GT_OQ); }
static inline vm v_ge(vd a, vd b) { return _mm256_cmp_ps_mask(a, b, _CMP_GE_OQ); }
static inline vm m_and(vm a, vm b) { return a & b; }
static inline unsigned m_bits(vm a) { return a; }
static inline vm m_of_bits(unsigned bits) { return (vm)bits; }
static inline vd v_select(vm m, vd a, vd b) { return _mm256_mask_blend_ps(m, b, a); }
static inline vd v_keep(vm m, vd a) { return _mm256_maskz_mov_ps(m, a); }
static inline vx x_set(double a) { return _mm512_set1_pd(a); }
typedef double vx_in_memory __attribute__((vector_size(64), aligned(8))); /* aliases doubles alone, see simd.h */
static inline vx x_load(const double *p) { return (vx) * (const vx_in_memory *)p; }
static inline void x_store(double *p, vx a) { *(vx_in_memory *)p = (vx_in_memory)a; }
static inline vx x_widen(vd a) { return _mm512_cvtps_pd(a); }
static inline vd x_narrow(vx a) { return _mm512_cvtpd_ps(a); }
static inline vx x_plus(vx a, vx b) { return a + b; }
static inline vd x_minus(vx a, vx b) { return x_narrow(a - b); }
static inline vm x_gt(vx a, vx b) { return _mm512_cmp_pd_mask(a, b, _CMP_GT_OQ); }
static inline vm x_ge(vx a, vx b) { return _mm512_cmp_pd_mask(a, b, _CMP_GE_OQ); }
#elif defined(__AVX2__) && defined(__FMA__)
typedef __m256 vm;
typedef struct {
    __m256d half[2];
} vx;
static inline vm v_gt(vd a, vd b) { return _mm256_cmp_ps(a, b, _CMP_GT_OQ); }
static inline vm v_ge(vd a, vd b) { return _mm256_cmp_ps(a, b, _CMP_GE_OQ); }
static inline vm m_and(vm a, vm b) { return _mm256_and_ps(a, b); }
static inline unsigned m_bits(vm a) { return (unsigned)_mm256_movemask_ps(a); }
static inline vm m_of_bits(unsigned bits)
{
    const __m256i lanes = _mm256_set_epi32(128, 64, 32, 16, 8, 4, 2, 1);
    return _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32((int)bits), lanes), lanes));
}
static inline vd v_select(vm m, vd a, vd b) { return _mm256_blendv_ps(b, a, m); }
static inline vd v_keep(vm m, vd a) { return _mm256_and_ps(m, a); }
static inline vx x_set(double a) { return (vx){{_mm256_set1_pd(a), _mm256_set1_pd(a)}}; }
typedef double vx_half_in_memory __attribute__((vector_size(32), aligned(8))); /* aliases doubles alone, see simd.h */
static inline vx x_load(const double *p)
{
    return (vx){{(__m256d) * (const vx_half_in_memory *)p, (__m256d) * (const vx_half_in_memory *)(p + 4)}};
}
static inline void x_store(double *p, vx a)
{
    *(vx_half_in_memory *)p = (vx_half_in_memory)a.half[0];
    *(vx_half_in_memory *)(p + 4) = (vx_half_in_memory)a.half[1];
}
static inline vx x_widen(vd a)
{
    return (vx){{_mm256_cvtps_pd(_mm256_castps256_ps128(a)), _mm256_cvtps_pd(_mm256_extractf128_ps(a, 1))}};
}
static inline vd x_narrow(vx a) { return _mm256_set_m128(_mm256_cvtpd_ps(a.half[1]), _mm256_cvtpd_ps(a.half[0])); }
static inline vx x_plus(vx a, vx b) { return (vx){{a.half[0] + b.half[0], a.half[1] + b.half[1]}}; }
static inline vd x_minus(vx a, vx b) { return x_narrow((vx){{a.half[0] - b.half[0], a.half[1] - b.half[1]}}); }
/* The lower halves of the masks of four doubles and four more, in order. */
static inline vm x_mask(__m256d low, __m256d high)
{
    const __m256 both = _mm256_shuffle_ps(_mm256_castpd_ps(low), _mm256_castpd_ps(high), 0x88);
    return _mm256_castpd_ps(_mm256_permute4x64_pd(_mm256_castps_pd(both), 0xd8));
}
static inline vm x_gt(vx a, vx b)
{
    return x_mask(_mm256_cmp_pd(a.half[0], b.half[0], _CMP_GT_OQ), _mm256_cmp_pd(a.half[1], b.half[1], _CMP_GT_OQ));
}
static inline vm x_ge(vx a, vx b)
{
    return x_mask(_mm256_cmp_pd(a.half[0], b.half[0], _CMP_GE_OQ), _mm256_cmp_pd(a.half[1], b.half[1], _CMP_GE_OQ));
}
#define GR_MASK_OF_HALVES
typedef vx xm;
static inline __m256d x_half_within(__m256d a, __m256d begin, __m256d end)
{
    return _mm256_and_pd(_mm256_cmp_pd(a, begin, _CMP_GE_OQ), _mm256_cmp_pd(end, a, _CMP_GT_OQ));
}
static inline xm x_within(vx a, vx begin, vx end)
{
    return (xm){
        {x_half_within(a.half[0], begin.half[0], end.half[0]), x_half_within(a.half[1], begin.half[1], end.half[1])}};
}
static inline xm x_and(xm a, xm b)
{
    return (xm){{_mm256_and_pd(a.half[0], b.half[0]), _mm256_and_pd(a.half[1], b.half[1])}};
}
static inline unsigned x_bits(xm a)
{
    return (unsigned)(_mm256_movemask_pd(a.half[0]) | _mm256_movemask_pd(a.half[1]) << 4);
}
#else
/* Portable version, four lanes. */
#define GR_W 4
typedef float vd __attribute__((vector_size(16)));
typedef int32_t vm __attribute__((vector_size(16)));
typedef double vd_pair __attribute__((vector_size(16)));
typedef struct {
    vd_pair half[2];
} vx;
static inline vd v_set(double a) { return (vd){(float)a, (float)a, (float)a, (float)a}; }
static inline vd v_fma(vd a, vd b, vd c) { return a * b + c; }
static inline vd v_fnma(vd a, vd b, vd c) { return c - a * b; }
static inline vd v_after_1(vd a, vd before) { return (vd){before[3], a[0], a[1], a[2]}; }
static inline vd v_after_2(vd a, vd before) { return (vd){before[2], before[3], a[0], a[1]}; }
static inline vm v_gt(vd a, vd b) { return (vm)(a > b); }
static inline vm v_ge(vd a, vd b) { return (vm)(a >= b); }
static inline vm m_and(vm a, vm b) { return a & b; }
static inline vm m_of_bits(unsigned bits)
{
    return (vm){-(int32_t)(bits & 1), -(int32_t)(bits >> 1 & 1), -(int32_t)(bits >> 2 & 1), -(int32_t)(bits >> 3 & 1)};
}
static inline unsigned m_bits(vm a) { return (unsigned)((a[0] & 1) | (a[1] & 2) | (a[2] & 4) | (a[3] & 8)); }
static inline vd v_select(vm m, vd a, vd b) { return (vd)((m & (vm)a) | (~m & (vm)b)); }
static inline vd v_keep(vm m, vd a) { return (vd)(m & (vm)a); }
/* As the x86 instructions do, return the second operand where the comparison fails, so that NaN behaves the same. */
static inline vd v_min(vd a, vd b) { return v_select(v_gt(b, a), a, b); }
static inline vd v_max(vd a, vd b) { return v_select(v_gt(a, b), a, b); }
static inline vd v_sqrt(vd a) { return (vd){sqrtf(a[0]), sqrtf(a[1]), sqrtf(a[2]), sqrtf(a[3])}; }
typedef double vd_pair_in_memory __attribute__((vector_size(16), aligned(8)));
static inline vx x_set(double a) { return (vx){{{a, a}, {a, a}}}; }
static inline vx x_load(const double *p)
{
    return (vx){{(vd_pair) * (const vd_pair_in_memory *)p, (vd_pair) * (const vd_pair_in_memory *)(p + 2)}};
}
static inline void x_store(double *p, vx a)
{
    *(vd_pair_in_memory *)p = (vd_pair_in_memory)a.half[0];
    *(vd_pair_in_memory *)(p + 2) = (vd_pair_in_memory)a.half[1];
}
static inline vx x_widen(vd a) { return (vx){{{a[0], a[1]}, {a[2], a[3]}}}; }
static inline vd x_narrow(vx a)
{
    return (vd){(float)a.half[0][0], (float)a.half[0][1], (float)a.half[1][0], (float)a.half[1][1]};
}
static inline vx x_plus(vx a, vx b) { return (vx){{a.half[0] + b.half[0], a.half[1] + b.half[1]}}; }
static inline vd x_minus(vx a, vx b) { return x_narrow((vx){{a.half[0] - b.half[0], a.half[1] - b.half[1]}}); }
static inline vm x_gt(vx a, vx b)
{
    return (vm){-(a.half[0][0] > b.half[0][0]), -(a.half[0][1] > b.half[0][1]), -(a.half[1][0] > b.half[1][0]),
                -(a.half[1][1] > b.half[1][1])};
}
static inline vm x_ge(vx a, vx b)
{
    return (vm){-(a.half[0][0] >= b.half[0][0]), -(a.half[0][1] >= b.half[0][1]), -(a.half[1][0] >= b.half[1][0]),
                -(a.half[1][1] >= b.half[1][1])};
}
#endif

typedef float gr_real;
typedef int32_t vi __attribute__((vector_size(4 * GR_W)));
typedef float v_four __attribute__((vector_size(16), aligned(4)));
typedef float vd_in_memory __attribute__((vector_size(4 * GR_W), aligned(4)));
static inline vd v_load_real(const float *p) { return (vd) * (const vd_in_memory *)p; }
static inline vd v_load_field(const double *p) { return x_narrow(x_load(p)); }
static inline void v_store_real(float *p, vd a) { *(vd_in_memory *)p = (vd_in_memory)a; }
static inline void v_store_field(double *p, vd a) { x_store(p, x_widen(a)); }
static inline void v_stream(float *p, vd a) { v_store_real(p, a); } /* rows are half a line: not worth it */
static inline void v_streamed(void) {}
#define v_load(p) _Generic((p), float * : v_load_real, const float * : v_load_real, default : v_load_field)(p)
#define v_store(p, a) _Generic((p), float * : v_store_real, default : v_store_field)(p, a)
static inline vx x_fma(vd a, vd b, vx c) { return x_plus(c, x_widen(a * b)); }
static inline vx x_add(vx a, vd b) { return x_plus(a, x_widen(b)); }
