/* Checks for the C tests. A test is a function; a program runs several and reports how many passed. */
#pragma once

#include <math.h>
#include <stdio.h>

enum { CHECK_LINES = 20 }; /* failures that are printed; all are counted */

static int check_failures, check_passed, check_failed;

#define CHECK(condition)                                                                              \
    do {                                                                                              \
        if (!(condition)) {                                                                           \
            if (check_failures++ < CHECK_LINES)                                                       \
                fprintf(stderr, "%s:%d: %s: not so: %s\n", __FILE__, __LINE__, __func__, #condition); \
        }                                                                                             \
    } while (0)

/* |a - b| <= tolerance; fails for NaN. */
#define CHECK_NEAR(a, b, tolerance)                                                                                 \
    do {                                                                                                            \
        const double check_a = (a), check_b = (b), check_t = (tolerance);                                           \
        if (!(fabs(check_a - check_b) <= check_t)) {                                                                \
            if (check_failures++ < CHECK_LINES)                                                                     \
                fprintf(stderr, "%s:%d: %s: %s = %.17g, not %.17g within %.3g\n", __FILE__, __LINE__, __func__, #a, \
                        check_a, check_b, check_t);                                                                 \
        }                                                                                                           \
    } while (0)

#define RUN(test)                                \
    do {                                         \
        const int check_before = check_failures; \
        test();                                  \
        if (check_failures == check_before)      \
            check_passed++;                      \
        else                                     \
            check_failed++;                      \
    } while (0)

/* Print the last line of a program, which run.sh reads.
 * Returned: its exit status. */
static inline int check_report(const char *name)
{
    printf("%s: %d passed, %d failed\n", name, check_passed, check_failed);
    return check_failed > 0;
}
