/* Tests of core/exact.c: the order of terms, cancellation, the whole range of doubles, infinities. */
#include "core/exact.h"

#include <float.h>
#include <math.h>

#include "tests/check.h"

static double next(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return ldexp((double)(int64_t)*state, (int)(*state >> 33 & 127) - 127);
}

TEST(order_and_sharing_do_not_matter)
{
    enum { N = 3000 };
    static double x[N];
    struct gr_exact up = {.nan = 0}, down = {.nan = 0}, parts[2] = {{.nan = 0}, {.nan = 0}};
    uint64_t state = 1;
    for (int i = 0; i < N; i++) x[i] = next(&state);
    for (int i = 0; i < N; i++)
        gr_exact_add(&up, x[i]), gr_exact_add(&down, x[N - 1 - i]), gr_exact_add(&parts[i % 3 == 0], x[i]);
    CHECK(gr_exact_value(&up) == gr_exact_value(&down));
    for (int k = 0; k < 2; k++) gr_exact_carry(&parts[k]);
    for (int i = 0; i < GR_EXACT_DIGITS; i++) parts[0].digit[i] += parts[1].digit[i];
    CHECK(gr_exact_value(&up) == gr_exact_value(&parts[0]));
    for (int i = 0; i < N; i++) gr_exact_add(&up, -x[i]);
    CHECK(gr_exact_value(&up) == 0);
}

TEST(the_whole_range_of_doubles)
{
    const double x[] = {DBL_MAX, 1, -DBL_MAX, DBL_TRUE_MIN, DBL_MIN, -3e-320, 0.1, -0.0};
    struct gr_exact sum = {.nan = 0};
    for (int i = 0; i < 8; i++) {
        struct gr_exact one = {.nan = 0};
        gr_exact_add(&one, x[i]);
        CHECK(gr_exact_value(&one) == x[i]);
        gr_exact_add(&sum, x[i]);
    }
    CHECK(fabs(gr_exact_value(&sum) - 1.1) <= 2 * DBL_EPSILON);
    gr_exact_add(&sum, -1), gr_exact_add(&sum, -0.1);
    CHECK(gr_exact_value(&sum) == DBL_TRUE_MIN + DBL_MIN - 3e-320);
}

TEST(terms_that_are_not_finite)
{
    struct gr_exact sum = {.nan = 0};
    gr_exact_add(&sum, 1), gr_exact_add(&sum, INFINITY);
    CHECK(gr_exact_value(&sum) == INFINITY);
    gr_exact_add(&sum, -INFINITY);
    CHECK(isnan(gr_exact_value(&sum)));
    struct gr_exact other = {.nan = 0};
    gr_exact_add(&other, -INFINITY);
    CHECK(gr_exact_value(&other) == -INFINITY);
    gr_exact_add(&other, NAN);
    CHECK(isnan(gr_exact_value(&other)));
}
