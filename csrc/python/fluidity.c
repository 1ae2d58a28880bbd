/* The fluidity of an engine, and its diffusion as a function of the module. */
#include <math.h>

#include "python/engine_common.h"

int gr_refuse_diffusion(const struct gr_engine *e)
{
    const struct gr_nonlocal *nonlocal = &e->config.nonlocal;
    if (!e->nonlocal.fluidity) return 0;
    const double dt = gr_longest_dt(&e->config), limit = gr_fluidity_limit(e->nonlocal.fluidity, nonlocal->method);
    const struct gr_diffusion_call call = {nonlocal->method, dt / nonlocal->substeps, 1};
    const int error = gr_fluidity_check(e->nonlocal.fluidity, &call);
    if (!error) return 0;
    if (error == GR_ERR_LIMIT)
        return gr_refuse(
            "dt = %.4g s in %d substeps of the fluidity must be below %.4g s each, the limit of method \"%s\" and "
            "stencil \"%s\": take %.0f substeps or more, or method \"implicit\"",
            dt, nonlocal->substeps, limit, gr_diffusion_names[nonlocal->method], gr_stencil_names[nonlocal->stencil],
            floor(dt / limit) + 1);
    gr_raise(error, NULL);
    return -1;
}

PyObject *gr_python_fluidity(const struct gr_engine *e)
{
    if (!e->nonlocal.fluidity) Py_RETURN_NONE;
    const struct gr_nonlocal *nonlocal = &e->config.nonlocal;
    return Py_BuildValue("{s:s,s:i,s:d,s:L,s:L}", "method", gr_diffusion_names[nonlocal->method], "substeps",
                         nonlocal->substeps, "limit", gr_fluidity_limit(e->nonlocal.fluidity, nonlocal->method),
                         "iterations", (long long)e->nonlocal.cg_iterations, "clamped",
                         (long long)e->nonlocal.clamped_cells);
}

static int refuse_numbers(const struct gr_fluidity_config *c, const struct gr_diffusion_call *call, int threads)
{
    if (gr_refuse_number("dx", c->dx, 0) || gr_refuse_number("A", c->A, 1) || gr_refuse_number("d", c->d, 0) ||
        gr_refuse_number("t0", c->t0, 0) || gr_refuse_number("dt", call->dt, 0) ||
        gr_refuse_number("tolerance", c->tolerance, 0))
        return -1;
    if (c->tolerance >= 1) return gr_refuse("tolerance must be below 1");
    if (c->max_iterations < 1) return gr_refuse("max_iterations = %lld must be at least 1", (long long)c->max_iterations);
    if (call->steps < 0) return gr_refuse("steps = %lld must not be negative", (long long)call->steps);
    if (threads < 1 || threads > GR_MAX_THREADS) return gr_refuse("threads = %d must be 1 to %d", threads, GR_MAX_THREADS);
    return 0;
}

/* Shape and maps of the grid; dim as in `g`. */
static int take_grid(struct gr_fluidity_config *c, PyObject *periodic, PyObject *const objects[4], PyArrayObject *arrays[4])
{
    static const char *const names[] = {"g", "dense", "faces", "distance"};
    c->dim = PyArray_CheckExact(objects[0]) && PyArray_NDIM((PyArrayObject *)objects[0]) == 3 ? 3 : 2;
    npy_intp shape[4] = {2 * c->dim, -1, -1, -1};
    if (!(arrays[0] = gr_array(objects[0], names[0], NPY_DOUBLE, c->dim, shape + 1, 1))) return -1;
    for (int a = 0; a < c->dim; a++) shape[1 + a] = PyArray_DIM(arrays[0], a);
    c->rough_bodies = objects[3] != Py_None;
    if (c->rough_bodies && !(arrays[3] = gr_array(objects[3], names[3], NPY_DOUBLE, c->dim, shape + 1, 0))) return -1;
    if (!(arrays[1] = gr_array(objects[1], names[1], NPY_BOOL, c->dim, shape + 1, 0)) ||
        !(arrays[2] = gr_array(objects[2], names[2], NPY_UINT8, c->dim + 1, shape, 0)) ||
        gr_refuse_overlap(arrays, names, 3 + c->rough_bodies) || gr_refuse_values("g", arrays[0], 0) ||
        (c->rough_bodies && gr_refuse_values(names[3], arrays[3], -1e60)))
        return -1;
    if (!PyArray_SIZE(arrays[0])) return gr_refuse("g has no cells");
    c->face = PyArray_DATA(arrays[2]);
    for (npy_intp k = 0; k < PyArray_SIZE(arrays[2]); k++)
        if (c->face[k] >= GR_FACE_COUNT)
            return gr_refuse("faces has the value %d, but 0 (linked), 1 (open) or 2 (rough) is needed", (int)c->face[k]);
    if (!PyTuple_Check(periodic) || PyTuple_GET_SIZE(periodic) != c->dim)
        return gr_refuse("periodic must be a tuple of %d, one for each axis of g, x first", c->dim);
    for (int a = 0; a < c->dim; a++) {
        c->shape[a] = PyArray_DIM(arrays[0], c->dim - 1 - a);
        c->periodic[a] = PyObject_IsTrue(PyTuple_GET_ITEM(periodic, a));
        if (c->periodic[a] < 0) return -1;
    }
    return 0;
}

static PyObject *raise_diffusion(int error, const struct gr_fluidity *f, const struct gr_diffusion_call *call)
{
    char text[256];
    if (error == GR_ERR_LIMIT)
        snprintf(
            text, sizeof text,
            "dt = %.9g s must be shorter than %.9g s, the limit of the %s diffusion with the stencil \"%s\" for dx = %.9g m and "
            "A^2 d^2/t0 = %.9g m^2/s; \"implicit\" has none",
            call->dt, gr_fluidity_limit(f, call->method), gr_diffusion_names[call->method], gr_stencil_names[f->stencil],
            f->dx, f->diffusivity);
    else if (error == GR_ERR_DIVERGED)
        snprintf(text, sizeof text, "%s to tolerance = %.3g in max_iterations = %lld", gr_error_message(error), f->tolerance,
                 (long long)f->max_iterations);
    else
        return gr_raise(error, NULL);
    PyErr_SetString(error == GR_ERR_LIMIT ? PyExc_ValueError : PyExc_RuntimeError, text);
    return NULL;
}

/* Give the distances of all cells from a rough surface. The distances of the points of a border cell are the same. */
static void set_distances(struct gr_fluidity *f, const double *distance)
{
    f->has_inside = 1;
    for (int64_t i = 0; i < f->n_cells; i++) {
        gr_fluidity_set_distance(f, i, distance[i], distance[i]);
        for (int k = 0; k < 2 * f->n_links; k++) {
            const int8_t *o = f->offset[k / 2];
            const int sign = k % 2 ? 1 : -1, offset[3] = {sign * o[0], sign * o[1], sign * o[2]};
            const int64_t j = gr_fluidity_reach(f, i, offset);
            if (j >= 0 && j != i) gr_fluidity_set_link(f, i, k, distance[j]);
        }
    }
}

/* The diffusion on a grid made for it, in place; g does not change where it fails. */
static PyObject *diffuse(struct gr_fluidity *f, const struct gr_kernels *kernels, const struct gr_diffusion_call *call,
                         PyArrayObject *const arrays[4], int threads)
{
    const size_t bytes = (size_t)f->n_cells * sizeof(double);
    const npy_bool *dense = PyArray_DATA(arrays[1]);
    int error = gr_fluidity_cover(f, NULL, NULL, 0); /* all, in the order of the box */
    if (error) return gr_raise(error, NULL);
    memcpy(f->g, PyArray_DATA(arrays[0]), bytes);
    for (int64_t i = 0; i < f->n_cells; i++) f->dense[i] = dense[i] != 0;
    if (f->rough_bodies) set_distances(f, PyArray_DATA(arrays[3]));
    Py_BEGIN_ALLOW_THREADS
    error = gr_fluidity_run(f, kernels->passes, call, threads);
    Py_END_ALLOW_THREADS
    if (error) return raise_diffusion(error, f, call);
    memcpy(PyArray_DATA(arrays[0]), f->g, bytes);
    return Py_BuildValue("{s:L,s:L,s:d}", "iterations", (long long)f->iterations, "clamped", (long long)f->clamped, "limit",
                         gr_fluidity_limit(f, call->method));
}

PyObject *gr_python_fluidity_diffuse(PyObject *Py_UNUSED(module), PyObject *args, PyObject *kwargs)
{
    static char *names[] = {"method",    "stencil",        "dx",       "A",     "d",     "t0", "dt",       "steps",
                            "tolerance", "max_iterations", "periodic", "faces", "dense", "g",  "distance", "threads",
                            "isa",       "first_radius",   NULL};
    struct gr_fluidity_config config = {.first_radius = -1};
    struct gr_diffusion_call call = {0};
    const char *method, *stencil, *isa;
    long long steps, max_iterations;
    int threads;
    PyObject *periodic, *objects[4];
    PyArrayObject *arrays[4] = {NULL};
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "$ssdddddLdLOOOOOisd:fluidity_diffuse", names, &method, &stencil,
                                     &config.dx, &config.A, &config.d, &config.t0, &call.dt, &steps, &config.tolerance,
                                     &max_iterations, &periodic, &objects[2], &objects[1], &objects[0], &objects[3],
                                     &threads, &isa, &config.first_radius))
        return NULL;
    config.axisymmetric = config.first_radius != -1;
    call.steps = steps, config.max_iterations = max_iterations;
    const struct gr_kernels *kernels = gr_take_kernels(isa);
    if (!kernels) return NULL;
    call.method = gr_take_index("method", method, gr_diffusion_names, GR_DIFFUSION_COUNT);
    config.stencil = gr_take_index("stencil", stencil, gr_stencil_names, GR_STENCIL_COUNT);
    if (call.method < 0 || config.stencil < 0 || refuse_numbers(&config, &call, threads) ||
        take_grid(&config, periodic, objects, arrays))
        return NULL;
    const int radial = config.dim == 2 && !config.periodic[0] && config.first_radius >= 0 && isfinite(config.first_radius);
    if (config.axisymmetric && !radial) {
        gr_refuse("first_radius = %.9g must be finite and >= 0, for a plane whose first axis is not periodic",
                  config.first_radius);
        return NULL;
    }
    struct gr_fluidity *f;
    const int error = gr_fluidity_new(&f, &config);
    if (error) return gr_raise(error, NULL);
    PyObject *out = diffuse(f, kernels, &call, arrays, threads);
    gr_fluidity_free(f);
    return out;
}
