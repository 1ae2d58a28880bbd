/* Runs the tests of a program (check.h). */
#include "tests/check.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_TESTS = 64, MOST_LINES = 20 }; /* failures that are printed; all are counted */

static struct {
    void (*run)(void);
    int line;
} tests[MOST_TESTS];
static int n_tests, failures;

void check_list(void (*test)(void), int line)
{
    int k = n_tests++;
    if (k == MOST_TESTS) abort();
    for (; k && tests[k - 1].line > line; k--) tests[k] = tests[k - 1];
    tests[k].run = test, tests[k].line = line;
}

void check_fails(const char *file, int line, const char *test, const char *format, ...)
{
    va_list arguments;
    if (failures++ >= MOST_LINES) return;
    va_start(arguments, format);
    fprintf(stderr, "%s:%d: %s: ", file, line, test);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

/* The last line that is printed is read by run.sh. */
int main(int count, char **arguments)
{
    int failed = 0;
    for (int k = 0; k < n_tests; k++) {
        const int before = failures;
        tests[k].run();
        failed += failures > before;
    }
    const char *folder = count ? strrchr(arguments[0], '/') : NULL;
    printf("%s: %d passed, %d failed\n", folder ? folder + 1 : "tests", n_tests - failed, failed);
    return failed > 0;
}
