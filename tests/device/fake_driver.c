/* A driver of GPUs for tests, as libcuda.so.1: its GPU is the processor, which runs the kernels for GPUs, compiled from the
 * same file, one thread after the other. Launches wait until they are waited for, as those of a GPU may: who reads what they
 * make sooner sees what was there before. FAKE_GPU names a fault: none, old_driver, old_gpu, windows, little_memory, or lost, after as
 * many launches as FAKE_LAUNCHES says. */
#include <dlfcn.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "fake_driver.h"
#include "mpm/device.h"

#define EXPORT __attribute__((visibility("default")))

enum { MOST_WAITING = 64 };

_Thread_local int64_t fake_thread;

typedef void entry(struct gr_launch launch, int64_t n);

static long launches;

/* What waits to be done: a copy of `bytes` bytes, or a launch. */
static struct job {
    void *to, *from;
    size_t bytes;
    entry *function;
    struct gr_launch launch;
    int64_t n, threads;
} waiting[MOST_WAITING];
static int n_waiting;
static pthread_mutex_t guard = PTHREAD_MUTEX_INITIALIZER; /* of all this: threads may call a driver at once */

static void do_all(void)
{
    for (int k = 0; k < n_waiting; k++) {
        const struct job *job = &waiting[k];
        if (job->bytes) memcpy(job->to, job->from, job->bytes);
        if (job->bytes) free(job->from);
        for (fake_thread = 0; fake_thread < job->threads; fake_thread++) job->function(job->launch, job->n);
    }
    n_waiting = 0;
}

static void add_job(const struct job *job)
{
    pthread_mutex_lock(&guard);
    if (n_waiting == MOST_WAITING) do_all();
    waiting[n_waiting++] = *job;
    pthread_mutex_unlock(&guard);
}

static int has(const char *fault)
{
    const char *asked = getenv("FAKE_GPU");
    return asked && !strcmp(asked, fault);
}

EXPORT int cuInit(unsigned flags) { return (int)flags; }
EXPORT int cuDriverGetVersion(int *version) { return *version = has("old_driver") ? 11040 : 12080, 0; }
EXPORT int cuGetErrorString(int error, const char **text) { return *text = error == 719 ? "it was lost" : "it failed", 0; }
EXPORT int cuDeviceGetCount(int *n) { return *n = !has("none"), 0; }
EXPORT int cuDeviceGet(int *device, int k) { return *device = k, 0; }
EXPORT int cuDeviceGetName(char *name, int size, int device) { return strncpy(name, "fake", (size_t)size), device; }
EXPORT int cuDeviceGetAttribute(int *value, int which, int device)
{
    *value = which == 75 ? (has("old_gpu") ? 6 : 9) : which == 89 ? !has("windows") : which != 76;
    return device;
}
EXPORT int cuDevicePrimaryCtxRetain(void **context, int device) { return *context = &launches, device; }
EXPORT int cuCtxSetCurrent(void *context) { return context != &launches; }
EXPORT int cuCtxSetLimit(int limit, size_t value) { return limit || value < 1024; }
EXPORT int cuCtxSynchronize(void)
{
    pthread_mutex_lock(&guard);
    do_all();
    pthread_mutex_unlock(&guard);
    return 0;
}
EXPORT int cuLinkCreate_v2(unsigned n, int *options, void **values, void **link)
{
    (void)options, (void)values;
    return *link = &launches, (int)n;
}
EXPORT int cuLinkAddData_v2(void *link, int type, void *data, size_t size, const char *name, unsigned n, int *options,
                            void **values)
{
    (void)link, (void)name, (void)n, (void)options, (void)values;
    return type != 1 || strlen(data) + 1 != size || !strstr(data, ".version 8.0");
}
EXPORT int cuLinkComplete(void *link, void **image, size_t *size) { return *image = link, *size = 1, 0; }
EXPORT int cuLinkDestroy(void *link) { return !link; }
EXPORT int cuModuleLoadData(void **module, const void *image) { return *module = (void *)(uintptr_t)image, 0; }
EXPORT int cuModuleGetFunction(void **function, void *module, const char *name)
{
    void *self = dlopen("libcuda.so.1", RTLD_NOW | RTLD_NOLOAD);
    return !module || !self || !(*function = dlsym(self, name));
}
EXPORT int cuLaunchKernel(void *function, unsigned x, unsigned y, unsigned z, unsigned threads, unsigned ty, unsigned tz,
                          unsigned shared, void *stream, void **arguments, void **more)
{
    (void)stream, (void)more;
    if (y != 1 || z != 1 || ty != 1 || tz != 1 || shared || !x) return 1;
    if (has("lost") && launches++ >= atol(getenv("FAKE_LAUNCHES"))) return 719;
    struct job job = {.function = (entry *)(uintptr_t)function, .threads = (int64_t)x * threads};
    memcpy(&job.launch, arguments[0], sizeof job.launch);
    memcpy(&job.n, arguments[1], sizeof job.n);
    add_job(&job);
    return 0;
}
EXPORT int cuMemGetInfo_v2(size_t *free, size_t *total)
{
    return *free = has("little_memory") ? 1 << 20 : (size_t)8 << 30, *total = (size_t)8 << 30, 0;
}
EXPORT int cuMemAlloc_v2(uint64_t *block, size_t bytes) { return !(*block = (uint64_t)(uintptr_t)malloc(bytes)); }
EXPORT int cuMemHostAlloc(void **block, size_t bytes, unsigned flags) { return flags || !(*block = malloc(bytes)); }
EXPORT int cuMemAllocManaged(uint64_t *block, size_t bytes, unsigned flags)
{
    return flags != 1 || cuMemAlloc_v2(block, bytes);
}
EXPORT int cuMemFree_v2(uint64_t block) { return free((void *)(uintptr_t)block), 0; }
EXPORT int cuMemPrefetchAsync(uint64_t block, size_t bytes, int device, void *stream)
{
    (void)stream;
    return !block || !bytes || device;
}
EXPORT int cuMemcpyHtoDAsync_v2(uint64_t to, const void *from, size_t bytes, void *stream)
{
    const struct job job = {.to = (void *)(uintptr_t)to, .from = malloc(bytes), .bytes = bytes};
    (void)stream;
    if (!job.from) return 2;
    memcpy(job.from, from, bytes);
    add_job(&job);
    return 0;
}
