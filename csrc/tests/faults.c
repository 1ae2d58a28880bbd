/* Allocations that fail on demand (faults.h). */
#include "tests/faults.h"

#include <stddef.h>

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *old, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *old, size_t size);

static long countdown, calls;
static int hit;

void faults_at(long n)
{
    countdown = n;
    calls = 0;
    hit = 0;
}

int faults_end(void)
{
    countdown = 0;
    return hit;
}

long faults_calls(void) { return calls; }

static int fails(void)
{
    calls++;
    if (!countdown || --countdown) return 0;
    return hit = 1;
}

void *__wrap_malloc(size_t size) { return fails() ? NULL : __real_malloc(size); }
void *__wrap_calloc(size_t count, size_t size) { return fails() ? NULL : __real_calloc(count, size); }
void *__wrap_realloc(void *old, size_t size) { return fails() ? NULL : __real_realloc(old, size); }
