/* What the kernels use of math.h, for a GPU, which has no C library. */
#pragma once

#define INFINITY (__builtin_inff())
#define M_PI 3.14159265358979323846
#define M_SQRT2 1.41421356237309504880
#define M_SQRT1_2 0.70710678118654752440
#define fabs __builtin_fabs
#define sqrt __builtin_sqrt
#define floor __builtin_floor
#define isfinite(x) __builtin_isfinite(x)

/* As the functions of a processor, to the sign of zero. */
static inline double fmax(double x, double y) { return x >= y || y != y ? x : y; }
static inline double fmin(double x, double y) { return x <= y || y != y ? x : y; }

double nextafter(double x, double y);
