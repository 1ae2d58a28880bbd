/* A GPU by the interface of its driver (driver.h): modules of PTX, launches, and managed memory, which the threads of the
 * processor and of the GPU see at the same addresses. The names and numbers are those of the driver interface of CUDA. */
#include "gpu/driver.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "core/memory.h"
#include "gpu/blocks.h"
#include "mpm/device.h"

typedef uint64_t address; /* of memory of the device */

/* X(name in the library, type of what it takes): functions that return 0 or an error. */
#define FUNCTIONS(X)                                                                                            \
    X(cuInit, (unsigned))                                                                                       \
    X(cuDriverGetVersion, (int *))                                                                              \
    X(cuGetErrorString, (int, const char **))                                                                   \
    X(cuDeviceGetCount, (int *))                                                                                \
    X(cuDeviceGet, (int *, int))                                                                                \
    X(cuDeviceGetName, (char *, int, int))                                                                      \
    X(cuDeviceGetAttribute, (int *, int, int))                                                                  \
    X(cuDevicePrimaryCtxRetain, (void **, int))                                                                 \
    X(cuCtxSetCurrent, (void *))                                                                                \
    X(cuCtxSetLimit, (int, size_t))                                                                             \
    X(cuCtxSynchronize, (void))                                                                                 \
    X(cuLinkCreate_v2, (unsigned, int *, void **, void **))                                                     \
    X(cuLinkAddData_v2, (void *, int, void *, size_t, const char *, unsigned, int *, void **))                  \
    X(cuLinkComplete, (void *, void **, size_t *))                                                              \
    X(cuLinkDestroy, (void *))                                                                                  \
    X(cuModuleLoadData, (void **, const void *))                                                                \
    X(cuModuleGetFunction, (void **, void *, const char *))                                                     \
    X(cuLaunchKernel,                                                                                           \
      (void *, unsigned, unsigned, unsigned, unsigned, unsigned, unsigned, unsigned, void *, void **, void **)) \
    X(cuMemGetInfo_v2, (size_t *, size_t *))                                                                    \
    X(cuMemAlloc_v2, (address *, size_t))                                                                       \
    X(cuMemHostAlloc, (void **, size_t, unsigned))                                                              \
    X(cuMemAllocManaged, (address *, size_t, unsigned))                                                         \
    X(cuMemFree_v2, (address))                                                                                  \
    X(cuMemPrefetchAsync, (address, size_t, int, void *))                                                       \
    X(cuMemcpyHtoDAsync_v2, (address, const void *, size_t, void *))

enum {
    OLDEST_DRIVER = 12000, /* CUDA 12.0, as the text of the kernels asks for */
    OLDEST_GPU = 75,       /* compute capability 7.5, of 2018 */
    MAJOR = 75,            /* attributes */
    MINOR = 76,
    MANAGED = 83,
    CONCURRENT = 89, /* the processor may use managed memory while threads run */
    ATTACH_GLOBAL = 1,
    LIMIT_STACK = 0,
    INPUT_PTX = 1,
    STACK = 16384, /* bytes of a thread: twice the largest frame of a kernel (ptxas -v), for the calls in it */
    BLOCK = 128,   /* threads; not tuned */
    STAGED = 1 << 20
};

static struct {
    void *library;
    int tried, device;
    char refusal[256]; /* why there is no GPU; empty if there is one */
    void *context, *function[2][GR_STAGE_COUNT];
    address engine;        /* a copy of the engine that runs, and behind it one of the work of a pass */
    struct gr_engine last; /* what was copied last */
    char *staged;          /* copies on their way: STAGED bytes that the GPU reads by itself */
    size_t n_staged;
#define X(name, types) int(*name) types;
    FUNCTIONS(X)
#undef X
} gpu;

static pthread_mutex_t guard = PTHREAD_MUTEX_INITIALIZER;

/* ---- Memory ---- */

static void *take_managed(size_t bytes)
{
    address block = 0;
    if (gpu.cuCtxSetCurrent(gpu.context) || gpu.cuMemAllocManaged(&block, bytes, ATTACH_GLOBAL)) return NULL;
    return (void *)(uintptr_t)block;
}

static void drop_managed(void *block)
{
    if (!gpu.cuCtxSetCurrent(gpu.context)) (void)gpu.cuMemFree_v2((address)(uintptr_t)block);
}

static const struct gr_pool pool = {take_managed, drop_managed};

static void *take(size_t bytes) { return gr_take_block(&pool, bytes); }
static void give(void *block) { gr_give_block(&pool, block); }

/* ---- Launches ---- */

/* Note an error of the driver; nothing is launched after the first. */
static void note(struct gr_device *d, int error)
{
    const char *text = NULL;
    if (!error || *d->failure) return;
    if (gpu.cuGetErrorString(error, &text) || !text) text = "unknown error";
    snprintf(d->failure, sizeof d->failure, "%s (error %d of the driver)", text, error);
}

static void bring(void *begin, size_t bytes)
{
    (void)gpu.cuMemPrefetchAsync((address)(uintptr_t)begin, bytes, gpu.device, NULL);
}

/* Let this thread of the processor call the driver. */
static void enter(struct gr_device *d)
{
    if (!*d->failure) note(d, gpu.cuCtxSetCurrent(gpu.context));
}

static void begin(struct gr_device *d)
{
    enter(d);
    if (!*d->failure) gr_each_block(bring); /* only for speed: memory follows its use in any case */
}

/* Wait for all launches and copies. Returned: an error of the driver, as of the next ones. */
static int synchronize(void)
{
    gpu.n_staged = 0;
    return gpu.cuCtxSynchronize();
}

/* Copy to the memory of the GPU, after the launches so far. The source may change at once. */
static int copy(address to, const void *from, size_t bytes)
{
    const size_t space = (bytes + 63) / 64 * 64;
    const int error = gpu.n_staged + space > STAGED ? synchronize() : 0;
    char *const staged = gpu.staged + gpu.n_staged;
    if (error) return error;
    memcpy(staged, from, bytes);
    gpu.n_staged += space;
    return gpu.cuMemcpyHtoDAsync_v2(to, staged, bytes, NULL);
}

/* Copy the engine to the GPU if it is not what is there: the processor changes it between launches, and its pages are not to
 * go to and fro. Returned: an error of the driver. */
static int copy_engine(const struct gr_engine *e)
{
    const int same = !memcmp(&gpu.last, e, sizeof *e), error = same ? 0 : copy(gpu.engine, e, sizeof *e);
    if (!same && !error) memcpy(&gpu.last, e, sizeof *e);
    return error;
}

/* Engines of several threads take turns, launch by launch. */
static void run(const struct gr_launch *launch, enum gr_device_stage stage, int64_t n)
{
    struct gr_device *d = launch->e->device;
    struct gr_launch there = *launch;
    int64_t threads = n;
    void *arguments[] = {&there, &threads};
    const int64_t blocks = (n + BLOCK - 1) / BLOCK;
    const address engine = gpu.engine, work = engine + sizeof *launch->e;
    if (!n) return;
    there.e = (struct gr_engine *)(uintptr_t)engine;
    there.work = (const void *)(uintptr_t)work;
    enter(d);
    pthread_mutex_lock(&guard);
    if (!*d->failure) note(d, copy_engine(launch->e));
    if (!*d->failure && launch->bytes) note(d, copy(work, launch->work, launch->bytes));
    if (!*d->failure)
        note(d, gpu.cuLaunchKernel(gpu.function[launch->e->config.single][stage], (unsigned)blocks, 1, 1, BLOCK, 1, 1, 0,
                                   NULL, arguments, NULL));
    pthread_mutex_unlock(&guard);
}

static void wait(struct gr_device *d)
{
    enter(d);
    pthread_mutex_lock(&guard);
    note(d, synchronize()); /* after a failure, too: no thread may use memory that is given back then */
    pthread_mutex_unlock(&guard);
}

const struct gr_backend gr_gpu = {.name = "gpu", .memory = {take, give}, .begin = begin, .run = run, .wait = wait};

/* ---- Opening ---- */

#define REFUSE(...)                                             \
    do {                                                        \
        snprintf(gpu.refusal, sizeof gpu.refusal, __VA_ARGS__); \
        return -1;                                              \
    } while (0)

/* Refuse with the text of an error of the driver. */
static int refuse_error(const char *what, int error)
{
    const char *text = NULL;
    if (!gpu.cuGetErrorString || gpu.cuGetErrorString(error, &text) || !text) text = "unknown error";
    REFUSE("%s: %s (error %d of the driver)", what, text, error);
}

static int load_driver(void)
{
    int version = 0, error;
    gpu.library = dlopen("libcuda.so.1", RTLD_NOW | RTLD_LOCAL);
    if (!gpu.library) REFUSE("there is no driver: %s", dlerror());
#define X(name, types)                               \
    *(void **)&gpu.name = dlsym(gpu.library, #name); \
    if (!gpu.name) REFUSE("the driver is too old: it has no function %s", #name);
    FUNCTIONS(X)
#undef X
    if ((error = gpu.cuInit(0))) return refuse_error("the driver does not begin", error);
    if ((error = gpu.cuDriverGetVersion(&version))) return refuse_error("the driver does not answer", error);
    if (version < OLDEST_DRIVER)
        REFUSE("the driver is too old: it is of CUDA %d.%d, must be of %d.%d or later", version / 1000, version % 1000 / 10,
               OLDEST_DRIVER / 1000, OLDEST_DRIVER % 1000 / 10);
    return 0;
}

static int find_device(void)
{
    int n = 0, major = 0, minor = 0, managed = 0, concurrent = 0;
    int error = gpu.cuDeviceGetCount(&n);
    if (error || n < 1) REFUSE("the driver finds no GPU");
    if ((error = gpu.cuDeviceGet(&gpu.device, 0)) || (error = gpu.cuDeviceGetAttribute(&major, MAJOR, gpu.device)) ||
        (error = gpu.cuDeviceGetAttribute(&minor, MINOR, gpu.device)) ||
        (error = gpu.cuDeviceGetAttribute(&managed, MANAGED, gpu.device)) ||
        (error = gpu.cuDeviceGetAttribute(&concurrent, CONCURRENT, gpu.device)))
        return refuse_error("the GPU does not answer", error);
    if (10 * major + minor < OLDEST_GPU)
        REFUSE("the GPU is too old: it has compute capability %d.%d, must have %d.%d or higher", major, minor,
               OLDEST_GPU / 10, OLDEST_GPU % 10);
    if (!managed || !concurrent) REFUSE("the GPU has no managed memory that a processor may use at the same time");
    if ((error = gpu.cuDevicePrimaryCtxRetain(&gpu.context, gpu.device)) || (error = gpu.cuCtxSetCurrent(gpu.context)) ||
        (error = gpu.cuCtxSetLimit(LIMIT_STACK, STACK)) || (error = gpu.cuMemHostAlloc((void **)&gpu.staged, STAGED, 0)) ||
        (error = gpu.cuMemAlloc_v2(&gpu.engine, sizeof(struct gr_engine) + GR_MOST_WORK)))
        return refuse_error("the GPU cannot be used", error);
    return 0;
}

/* Compile the texts of the kernels for the GPU; the driver keeps the result for the next time. */
static int load_kernels(const char *const text[2], const size_t size[2])
{
    static const char *const stages[] = {
#define GR_X(stage, unit) #stage,
        GR_DEVICE_STAGES(GR_X)
#undef GR_X
    };
    static const char *const precisions[] = {"double", "single"};
    void *link = NULL, *module = NULL, *image = NULL;
    size_t bytes = 0;
    int error = gpu.cuLinkCreate_v2(0, NULL, NULL, &link);
    for (int k = 0; k < 2 && !error; k++)
        error = gpu.cuLinkAddData_v2(link, INPUT_PTX, (void *)text[k], size[k], precisions[k], 0, NULL, NULL);
    if (!error) error = gpu.cuLinkComplete(link, &image, &bytes);
    if (!error) error = gpu.cuModuleLoadData(&module, image);
    if (link) (void)gpu.cuLinkDestroy(link);
    for (int k = 0; k < 2 * GR_STAGE_COUNT && !error; k++) {
        char name[64];
        const int stage = k % GR_STAGE_COUNT, single = k / GR_STAGE_COUNT;
        snprintf(name, sizeof name, "%s_%s", precisions[single], stages[stage]);
        error = gpu.cuModuleGetFunction(&gpu.function[single][stage], module, name);
    }
    return error ? refuse_error("the kernels cannot be loaded", error) : 0;
}

const char *gr_open_gpu(const char *const text[2], const size_t size[2])
{
    pthread_mutex_lock(&guard);
    if (!gpu.tried) (void)(load_driver() || find_device() || load_kernels(text, size));
    gpu.tried = 1;
    pthread_mutex_unlock(&guard);
    return *gpu.refusal ? gpu.refusal : NULL;
}

struct gr_gpu_info gr_gpu_info(void)
{
    struct gr_gpu_info info = {{0}, 0, 0};
    if (!gpu.tried || *gpu.refusal || gpu.cuCtxSetCurrent(gpu.context)) return info;
    (void)gpu.cuDeviceGetName(info.name, sizeof info.name, gpu.device);
    (void)gpu.cuMemGetInfo_v2(&info.free, &info.total);
    return info;
}
