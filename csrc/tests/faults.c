/* Allocations and threads that fail on demand (faults.h). */
#include "tests/faults.h"

#include <errno.h>
#include <pthread.h>
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

typedef void *thread_program(void *argument);

int __real_pthread_create(pthread_t *thread, const pthread_attr_t *how, thread_program *program, void *argument);
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *how, thread_program *program, void *argument);

static int threads_left = -1;

void faults_allow_threads(int n) { threads_left = n; }

int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *how, thread_program *program, void *argument)
{
    if (!threads_left) return EAGAIN;
    if (threads_left > 0) threads_left--;
    return __real_pthread_create(thread, how, program, argument);
}
