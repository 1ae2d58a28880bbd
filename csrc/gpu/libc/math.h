/* What the kernels use of math.h, for a GPU, which has no C library. */
#pragma once

#define INFINITY (__builtin_inff())
#define NAN (__builtin_nanf(""))
#define M_PI 3.14159265358979323846
#define M_SQRT2 1.41421356237309504880
#define M_SQRT1_2 0.70710678118654752440
#define fabs __builtin_fabs
#define rint __builtin_rint
#define sqrt __builtin_sqrt
#define floor __builtin_floor
#define isfinite(x) __builtin_isfinite(x)

/* As the functions of a processor, to the sign of zero. */
static inline double fmax(double x, double y) { return x >= y || y != y ? x : y; }
static inline double fmin(double x, double y) { return x <= y || y != y ? x : y; }

/* A double and its bits. */
union gr_bits {
    double value;
    long long bits;
};

/* x 2^n of a whole number x, rounded once: the first products are exact. */
static inline double ldexp(double x, int n)
{
    for (; n < -1022; n += 1022) x *= 0x1p-1022;
    for (; n > 1023; n -= 1023) x *= 0x1p1023;
    return x * (union gr_bits){.bits = (long long)(n + 1023) << 52}.value;
}

/* The number next to x on the way to y. */
static inline double nextafter(double x, double y)
{
    union gr_bits next = {x};
    if (!(x < y || x > y)) return x == y ? y : x + y;
    if (x == 0) return y > 0 ? 0x1p-1074 : -0x1p-1074;
    next.bits += (x < y) == (x > 0) ? 1 : -1; /* away from zero, or towards it */
    return next.value;
}
