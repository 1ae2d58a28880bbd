/* The vectors of simd.h with one lane, and the roundings of AVX2 and AVX-512: what a thread of a device computes. */
#pragma once

#ifdef GR_SINGLE
typedef float gr_lane;
typedef int32_t gr_lane_bits;
#define GR_OF_LANE(function) function##f
#else
typedef double gr_lane;
typedef int64_t gr_lane_bits;
#define GR_OF_LANE(function) function
#endif

#define GR_W 1
typedef gr_lane vd __attribute__((vector_size(sizeof(gr_lane))));
typedef gr_lane_bits vm __attribute__((vector_size(sizeof(gr_lane))));
static inline vd v_set(double a) { return (vd){(gr_lane)a}; }
static inline vd v_fma(vd a, vd b, vd c) { return (vd){GR_OF_LANE(__builtin_fma)(a[0], b[0], c[0])}; }
static inline vd v_fnma(vd a, vd b, vd c) { return (vd){GR_OF_LANE(__builtin_fma)(-a[0], b[0], c[0])}; }
static inline vm v_gt(vd a, vd b) { return (vm){-(gr_lane_bits)(a[0] > b[0])}; }
static inline vm v_ge(vd a, vd b) { return (vm){-(gr_lane_bits)(a[0] >= b[0])}; }
static inline vm m_and(vm a, vm b) { return a & b; }
static inline unsigned m_bits(vm a) { return (unsigned)(a[0] & 1); }
static inline vm m_of_bits(unsigned bits) { return (vm){-(gr_lane_bits)(bits & 1)}; }
static inline vd v_select(vm m, vd a, vd b) { return (vd){m[0] ? a[0] : b[0]}; }
static inline vd v_keep(vm m, vd a) { return (vd){m[0] ? a[0] : 0}; }
/* As the x86 instructions do, return the second operand where the comparison fails, so that NaN behaves the same. */
static inline vd v_min(vd a, vd b) { return v_select(v_gt(b, a), a, b); }
static inline vd v_max(vd a, vd b) { return v_select(v_gt(a, b), a, b); }
static inline vd v_sqrt(vd a) { return (vd){GR_OF_LANE(__builtin_sqrt)(a[0])}; }
