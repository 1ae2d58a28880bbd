/* Tests of gpu/libc/math.h: what a GPU has in place of functions of a C library has their bits. */
#define fmax own_fmax
#define fmin own_fmin
#define ldexp own_ldexp
#define nextafter own_nextafter
#include "gpu/libc/math.h"
#undef fmax
#undef fmin
#undef ldexp
#undef nextafter
#undef INFINITY
#undef NAN
#undef M_PI
#undef M_SQRT2
#undef M_SQRT1_2
#undef fabs
#undef sqrt
#undef isfinite

#include <float.h>
#include <math.h>
#include <string.h>

#include "tests/check.h"
#include "tests/scene.h"

static int same(double a, double b) { return !memcmp(&a, &b, sizeof a) || (isnan(a) && isnan(b)); }

static const double SPECIAL[] = {0.0,     -0.0,     1.0,      -1.0,      0x1p-1074, -0x1p-1074, DBL_MIN,
                                 DBL_MAX, -DBL_MAX, INFINITY, -INFINITY, NAN,       0.6435,     1 - 0x1p-53};
enum { N = sizeof SPECIAL / sizeof *SPECIAL };

TEST(next_and_extremes)
{
    for (int i = 0; i < N; i++)
        for (int k = 0; k < N; k++) {
            const double x = SPECIAL[i], y = SPECIAL[k];
            CHECK(same(own_nextafter(x, y), nextafter(x, y)));
            if (x == 0 && y == 0) continue; /* to the sign of zero */
            CHECK(same(own_fmax(x, y), fmax(x, y)) && same(own_fmin(x, y), fmin(x, y)));
        }
}

/* Whole numbers below 2^33, as the digits of exact sums are. */
TEST(powers)
{
    scene_seed(5);
    for (int n = -1100; n < 1020; n++) {
        const double x = floor(scene_random(1, 8e9));
        CHECK(same(own_ldexp(x, n), ldexp(x, n)) && same(own_ldexp(-x, n), ldexp(-x, n)));
        CHECK(same(own_ldexp(0, n), 0));
    }
}
