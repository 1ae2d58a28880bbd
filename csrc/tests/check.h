/* Checks for the C tests. A program is linked with check.c, which runs its tests in the order of their lines. */
#pragma once

#include <math.h>

/* TEST(what_holds) { ... }: a test is listed where it is defined. */
#define TEST(name)                                                                             \
    static void name(void);                                                                    \
    __attribute__((constructor)) static void list_##name(void) { check_list(name, __LINE__); } \
    static void name(void)

#define CHECK(condition)                                                                       \
    do {                                                                                       \
        if (!(condition)) check_fails(__FILE__, __LINE__, __func__, "not so: %s", #condition); \
    } while (0)

/* |a - b| <= tolerance; fails for NaN. */
#define CHECK_NEAR(a, b, tolerance)                                                                                        \
    do {                                                                                                                   \
        const double check_a = (a), check_b = (b), check_t = (tolerance);                                                  \
        if (!(fabs(check_a - check_b) <= check_t))                                                                         \
            check_fails(__FILE__, __LINE__, __func__, "%s = %.17g, not %.17g within %.3g", #a, check_a, check_b, check_t); \
    } while (0)

void check_list(void (*test)(void), int line);
void check_fails(const char *file, int line, const char *test, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
