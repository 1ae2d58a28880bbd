/* The life of a fluidity lattice, its limits, and a team of its own to run it. */
#include "fluidity/fluidity.h"

#include <math.h>
#include <stdlib.h>

#ifdef _OPENMP
#include <omp.h>
#endif

#include "core/simd.h"

const char *const gr_diffusion_names[GR_DIFFUSION_COUNT] = {
#define GR_X(name) #name,
    GR_DIFFUSIONS(GR_X)
#undef GR_X
};

/* Whether a cell is the last along an axis (side 1) or the first (side 0). */
static int at_end(const struct gr_fluidity_config *c, const struct gr_fluidity *f, int64_t i, int axis, int side)
{
    return i / f->stride[axis] % c->shape[axis] == (side ? c->shape[axis] - 1 : 0);
}

/* Number of the cell behind a face, through a periodic end too; -1 if there is none, or it is the cell itself. */
static int64_t behind(const struct gr_fluidity_config *c, const struct gr_fluidity *f, int64_t i, int axis, int side)
{
    const int64_t step = side ? f->stride[axis] : -f->stride[axis];
    if (!at_end(c, f, i, axis, side)) return i + step;
    return c->periodic[axis] && c->shape[axis] > 1 ? i - step * (c->shape[axis] - 1) : -1;
}

static int is_linked(const struct gr_fluidity_config *c, const struct gr_fluidity *f, int64_t i, int axis, int side)
{
    const int64_t j = behind(c, f, i, axis, side);
    return j >= 0 && c->face[(2 * axis + side) * f->n_cells + i] == GR_FACE_LINK &&
           c->face[(2 * axis + 1 - side) * f->n_cells + j] == GR_FACE_LINK;
}

/* Links across periodic ends, in the order of their cells; counted only where there is no room for them yet. */
static int64_t list_wraps(const struct gr_fluidity_config *c, struct gr_fluidity *f)
{
    int64_t n = 0;
    for (int64_t i = 0; i < f->n_cells; i++) {
        if (f->wrap && i % GR_CHUNK == 0) f->wrap_first[i / GR_CHUNK] = n;
        for (int k = 0; k < 2 * f->dim; k++)
            if (at_end(c, f, i, k / 2, k % 2) && is_linked(c, f, i, k / 2, k % 2)) {
                if (f->wrap) f->wrap[n] = (struct gr_wrap){i, behind(c, f, i, k / 2, k % 2), 0};
                n++;
            }
    }
    if (f->wrap) f->wrap_first[f->n_chunks] = n;
    return n;
}

static void read_faces(const struct gr_fluidity_config *c, struct gr_fluidity *f)
{
    for (int64_t i = 0; i < f->n_cells; i++) {
        int faces = 0;
        for (int k = 0; k < 2 * f->dim; k++) {
            const int rough = c->face[k * f->n_cells + i] == GR_FACE_ROUGH, linked = is_linked(c, f, i, k / 2, k % 2);
            f->rough[i] += 2 * rough;
            faces += rough + linked;
            if (k % 2 && !at_end(c, f, i, k / 2, 1)) f->link[k / 2][i] = (uint8_t)linked;
        }
        if (faces > f->most_faces) f->most_faces = faces;
    }
}

static int is_valid(const struct gr_fluidity_config *c)
{
    if (c->dim < 2 || c->dim > 3 || c->max_iterations < 1) return 0;
    for (int a = 0; a < c->dim; a++)
        if (c->shape[a] < 1) return 0;
    return c->dx > 0 && c->A >= 0 && c->d > 0 && c->t0 > 0 && c->tolerance > 0 && c->tolerance < 1 &&
           isfinite(c->A * c->A * c->d * c->d / (c->t0 * c->dx * c->dx));
}

/* All arrays, zero. They begin `margin` places into their room. */
static int allocate(struct gr_fluidity *f, int64_t margin)
{
    const int64_t room = f->n_padded + 2 * margin;
    double **const vectors[] = {&f->g,       &f->rough,     &f->work[0],   &f->work[1],
                                &f->work[2], &f->weight[0], &f->weight[1], &f->weight[2]};
    uint8_t **const maps[] = {&f->dense, &f->link[0], &f->link[1], &f->link[2]};
    const int n_vectors = 5 + f->dim, n_maps = 1 + f->dim;
    double *doubles = f->doubles = calloc((size_t)(n_vectors * room + 3 * f->n_chunks), sizeof(double));
    uint8_t *bytes = f->bytes = calloc((size_t)(n_maps * room), 1);
    int64_t *integers = f->integers = calloc((size_t)(2 * f->n_chunks + 1), sizeof(int64_t));
    if (!doubles || !bytes || !integers) return GR_ERR_MEMORY;
    for (int k = 0; k < n_vectors; k++) *vectors[k] = doubles + k * room + margin;
    for (int k = 0; k < n_maps; k++) *maps[k] = bytes + k * room + margin;
    for (int k = 0; k < 3; k++) f->partial[k] = doubles + n_vectors * room + k * f->n_chunks;
    f->partial_clamped = integers;
    f->wrap_first = integers + f->n_chunks;
    return GR_OK;
}

int gr_fluidity_new(struct gr_fluidity **out, const struct gr_fluidity_config *config)
{
    *out = NULL;
    if (!is_valid(config)) return GR_ERR_CONFIG;
    struct gr_fluidity *f = calloc(1, sizeof *f);
    if (!f) return GR_ERR_MEMORY;
    f->dim = config->dim;
    f->n_cells = 1;
    for (int a = 0; a < f->dim; a++) f->stride[a] = f->n_cells, f->n_cells *= config->shape[a];
    f->n_padded = (f->n_cells + GR_LANES - 1) / GR_LANES * GR_LANES;
    f->n_chunks = (f->n_cells + GR_CHUNK - 1) / GR_CHUNK;
    f->dx = config->dx;
    f->diffusivity = config->A * config->A * config->d * config->d / config->t0;
    f->tolerance = config->tolerance;
    f->max_iterations = config->max_iterations;
    int error = allocate(f, (f->stride[f->dim - 1] + GR_LANES - 1) / GR_LANES * GR_LANES);
    if (error) goto out;
    f->wrap = malloc((size_t)(list_wraps(config, f) + 1) * sizeof *f->wrap);
    if (!f->wrap) {
        error = GR_ERR_MEMORY;
        goto out;
    }
    list_wraps(config, f);
    read_faces(config, f);
    *out = f;
    return GR_OK;
out:
    gr_fluidity_free(f);
    return error;
}

void gr_fluidity_free(struct gr_fluidity *f)
{
    if (!f) return;
    free(f->doubles);
    free(f->bytes);
    free(f->integers);
    free(f->wrap);
    free(f);
}

/* (s^2 + s - 2)/4: how many explicit steps s stages of rkl2 are worth. */
static double worth(double s) { return (s * s + s - 2) / 4; }

double gr_fluidity_limit(const struct gr_fluidity *f, int method)
{
    const double rate = f->most_faces * f->diffusivity / (f->dx * f->dx);
    if (method == GR_DIFFUSION_implicit || !(rate > 0)) return INFINITY;
    return method == GR_DIFFUSION_explicit ? 1 / rate : worth(GR_RKL2_MAX_STAGES) / rate;
}

int gr_fluidity_stages(const struct gr_fluidity *f, double dt)
{
    const double limit = gr_fluidity_limit(f, GR_DIFFUSION_explicit);
    int s = 3;
    while (s < GR_RKL2_MAX_STAGES && !(dt < worth(s) * limit)) s += 2;
    return s;
}

int gr_fluidity_check(const struct gr_fluidity *f, const struct gr_diffusion_call *call)
{
    if (call->method < 0 || call->method >= GR_DIFFUSION_COUNT || call->steps < 0 || !(call->dt > 0) || !isfinite(call->dt))
        return GR_ERR_CONFIG;
    return call->dt < gr_fluidity_limit(f, call->method) ? GR_OK : GR_ERR_LIMIT;
}

int gr_fluidity_run(struct gr_fluidity *f, gr_diffuse *kernel, const struct gr_diffusion_call *call, int threads)
{
    struct gr_barrier barrier = {.threads = 1};
    const int error = gr_fluidity_check(f, call);
    if (error) return error;
#ifdef _OPENMP
#pragma omp parallel num_threads(threads > GR_MAX_THREADS ? GR_MAX_THREADS : threads)
    {
#pragma omp single
        barrier.threads = omp_get_num_threads();
        kernel(f, call, &barrier, omp_get_thread_num());
    }
#else
    (void)threads;
    kernel(f, call, &barrier, 0);
#endif
    return f->error;
}
