/* The Python type `Engine`: it borrows the buffers of the points and steps them with the GIL released. */
#include <math.h>
#include <stddef.h>

#include "python/engine_common.h"

struct engine_object {
    PyObject_HEAD
    struct gr_engine *engine;
    const struct gr_kernels *kernels;
    PyObject *buffers[GR_FIELD_COUNT + 1]; /* the borrowed arrays, the ids last */
    int busy;
};

static struct gr_engine *ready(struct engine_object *self, int bound)
{
    struct gr_engine *e = self->engine;
    return gr_refuse_state(e != NULL, e && (!bound || e->id), self->busy) ? NULL : e;
}

/* ---- construction ---- */

/* A substep of the diffusion that is too long. Returned: 0, or -1 with ValueError set. */
static int refuse_diffusion(const struct gr_engine *e)
{
    const struct gr_nonlocal *nonlocal = &e->config.nonlocal;
    if (!e->fluidity) return 0;
    const double dt = gr_longest_dt(&e->config), limit = gr_fluidity_limit(e->fluidity, nonlocal->method);
    const struct gr_diffusion_call call = {nonlocal->method, dt / nonlocal->substeps, 1};
    const int error = gr_fluidity_check(e->fluidity, &call);
    if (error == GR_ERR_LIMIT) {
        char text[320];
        snprintf(text, sizeof text,
                 "dt = %.4g s in %d substeps of the fluidity must be below %.4g s each, the limit of method \"%s\" and "
                 "stencil \"%s\": take %.0f substeps or more, or method \"implicit\"",
                 dt, nonlocal->substeps, limit, gr_diffusion_names[nonlocal->method], gr_stencil_names[nonlocal->stencil],
                 floor(dt / limit) + 1);
        PyErr_SetString(PyExc_ValueError, text);
    } else if (error) {
        gr_raise(error, NULL);
    }
    return error ? -1 : 0;
}

static int engine_init(struct engine_object *self, PyObject *args, PyObject *kwargs)
{
    struct gr_config config;
    struct gr_tables tables;
    const char *isa;
    if (self->engine) {
        PyErr_SetString(PyExc_RuntimeError, "the engine is already built");
        return -1;
    }
    if (gr_parse_config(args, kwargs, &config, &tables, &isa)) return -1;
    self->kernels = gr_take_kernels(isa);
    if (!self->kernels) return -1;
    const int error = gr_engine_new(&self->engine, &config);
    if (error) gr_raise(error, NULL);
    return error || refuse_diffusion(self->engine) ? -1 : 0;
}

static void engine_dealloc(struct engine_object *self)
{
    PyTypeObject *type = Py_TYPE(self);
    gr_engine_free(self->engine);
    for (int k = 0; k <= GR_FIELD_COUNT; k++) Py_XDECREF(self->buffers[k]);
    type->tp_free((PyObject *)self);
    Py_DECREF(type);
}

/* ---- buffers ---- */

/* bind(buffers, n_points, fresh): lend the arrays {name: (component, capacity)} and "id" (capacity,). */
static PyObject *engine_bind(struct engine_object *self, PyObject *args)
{
    PyObject *buffers;
    Py_ssize_t n_points;
    int fresh;
    if (!PyArg_ParseTuple(args, "O!np", &PyDict_Type, &buffers, &n_points, &fresh)) return NULL;
    struct gr_engine *e = ready(self, 0);
    if (!e) return NULL;
    PyArrayObject *arrays[GR_FIELD_COUNT + 1];
    const char *names[GR_FIELD_COUNT + 1];
    double *field[GR_FIELD_COUNT] = {0};
    int field_of[GR_FIELD_COUNT + 1], n = 0;
    const npy_intp any[1] = {-1};
    PyObject *ids = PyDict_GetItemString(buffers, "id");
    PyArrayObject *id = ids ? gr_array(ids, "id", NPY_INT64, 1, any, 1) : NULL;
    if (!id) {
        if (!PyErr_Occurred()) PyErr_SetString(PyExc_ValueError, "the buffer id is missing");
        return NULL;
    }
    const npy_intp capacity = PyArray_DIM(id, 0);
    for (int f = 0; f < GR_FIELD_COUNT; f++) {
        if (!gr_engine_uses(&e->config, f)) continue;
        const char *name = gr_field_table[f].name;
        const npy_intp shape[2] = {gr_field_components(f, e->config.dim), capacity};
        PyObject *object = PyDict_GetItemString(buffers, name);
        if (!object) return PyErr_Format(PyExc_ValueError, "the buffer %s is missing", name);
        arrays[n] = gr_array(object, name, NPY_DOUBLE, 2, shape, 1);
        if (!arrays[n]) return NULL;
        field[f] = PyArray_DATA(arrays[n]);
        names[n] = name;
        field_of[n++] = f;
    }
    arrays[n] = id, names[n] = "id", field_of[n++] = GR_FIELD_COUNT;
    if (gr_refuse_overlap(arrays, names, n)) return NULL;
    if (n_points < 0 || n_points > capacity || (!fresh && capacity < e->capacity))
        return PyErr_Format(PyExc_ValueError, "%zd points do not fit buffers of %zd places", n_points, (Py_ssize_t)capacity);
    for (int k = 0; k < n; k++) {
        Py_INCREF(arrays[k]);
        Py_XSETREF(self->buffers[field_of[k]], (PyObject *)arrays[k]);
    }
    gr_engine_bind(e, field, PyArray_DATA(id), capacity);
    if (fresh) {
        e->n_points = e->used = n_points;
        e->n_pending = 0;
        for (int64_t c = 0; c < e->mesh.n_cells; c++) e->mesh.cell[c].count = 0;
        if (e->mesh.n_cells) return PyErr_Format(PyExc_RuntimeError, "points can be given once");
    }
    Py_RETURN_NONE;
}

static PyObject *engine_regroup(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 1);
    if (!e) return NULL;
    const int error = gr_regroup(e);
    if (error == GR_ERR_CAPACITY) return PyLong_FromLongLong(e->needed_capacity);
    if (error) return gr_raise(error, e);
    e->error = GR_OK;
    return PyLong_FromLong(0);
}

/* ---- stepping ---- */

/* advance(max_steps, until, threads) -> needed capacity: 0, or the places that the buffers must have to go on. */
static PyObject *engine_advance(struct engine_object *self, PyObject *args)
{
    long long max_steps;
    double until;
    int threads, error;
    struct gr_engine *e = ready(self, 1);
    if (!e || gr_take_run(args, &max_steps, &until, &threads)) return NULL;
    self->busy = 1;
    Py_BEGIN_ALLOW_THREADS
    error = gr_advance(e, self->kernels, max_steps, until, threads);
    Py_END_ALLOW_THREADS
    self->busy = 0;
    if (error == GR_ERR_CAPACITY) return PyLong_FromLongLong(e->needed_capacity);
    return error ? gr_raise(error, e) : PyLong_FromLong(0);
}

static PyObject *run_stage(struct engine_object *self, int (*stage)(struct gr_engine *, const struct gr_kernels *))
{
    struct gr_engine *e = ready(self, 1);
    if (!e) return NULL;
    const int error = stage(e, self->kernels);
    if (error == GR_ERR_CAPACITY) return PyLong_FromLongLong(e->needed_capacity);
    return error ? gr_raise(error, e) : PyLong_FromLong(0);
}

static PyObject *engine_p2g(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    return run_stage(self, gr_p2g);
}

static PyObject *engine_grid(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    return run_stage(self, gr_grid);
}

static PyObject *engine_g2p(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    return run_stage(self, gr_g2p);
}

/* ---- looking in ---- */

static PyObject *engine_nodes(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 1);
    if (!e) return NULL;
    const npy_intp n = e->mesh.n_nodes, dim = e->config.dim, rows = 1 + 2 * dim;
    const npy_intp one[1] = {n}, many[2] = {n, dim};
    PyObject *x = PyArray_SimpleNew(2, many, NPY_DOUBLE), *v = PyArray_SimpleNew(2, many, NPY_DOUBLE);
    PyObject *m = PyArray_SimpleNew(1, one, NPY_DOUBLE), *p = PyArray_SimpleNew(2, many, NPY_DOUBLE);
    PyObject *f = PyArray_SimpleNew(2, many, NPY_DOUBLE), *w = PyArray_SimpleNew(2, many, NPY_DOUBLE);
    if (!x || !v || !m || !p || !f || !w) goto fail;
    for (npy_intp i = 0; i < n; i++) {
        int64_t id = e->mesh.node_id[i];
        double sum[7] = {0};
        for (int k = 0; k < e->K; k++) {
            const double *part = e->sums + e->mesh.node_source[i * e->K + k];
            for (int q = 0; q < rows; q++) sum[q] += part[q];
        }
        ((double *)PyArray_DATA((PyArrayObject *)m))[i] = sum[GR_SUM_MASS];
        for (npy_intp d = 0; d < dim; d++) {
            const struct gr_axis *axis = &e->axis[d];
            ((double *)PyArray_DATA((PyArrayObject *)x))[i * dim + d] =
                axis->origin + axis->node_position[id % axis->n_nodes] * e->config.dx;
            id /= axis->n_nodes;
            ((double *)PyArray_DATA((PyArrayObject *)p))[i * dim + d] = sum[GR_SUM_MOMENTUM + d];
            ((double *)PyArray_DATA((PyArrayObject *)f))[i * dim + d] = sum[GR_SUM_FORCE(dim) + d];
            ((double *)PyArray_DATA((PyArrayObject *)v))[i * dim + d] =
                e->node_data[i * e->node_stride + GR_NODE_VELOCITY + d];
            ((double *)PyArray_DATA((PyArrayObject *)w))[i * dim + d] =
                e->node_data[i * e->node_stride + GR_NODE_UPDATE(dim) + d];
        }
    }
    return Py_BuildValue("{s:N,s:N,s:N,s:N,s:N,s:N}", "x", x, "mass", m, "momentum", p, "force", f, "v", v, "w", w);
fail:
    Py_XDECREF(x), Py_XDECREF(v), Py_XDECREF(m), Py_XDECREF(p), Py_XDECREF(f), Py_XDECREF(w);
    return NULL;
}

/* cells() -> (offset, count) of the active cells: rows [offset, offset + count) of the buffers hold points. */
static PyObject *engine_cells(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 1);
    if (!e) return NULL;
    const npy_intp n[1] = {e->mesh.n_cells};
    PyObject *offset = PyArray_SimpleNew(1, n, NPY_INT64), *count = PyArray_SimpleNew(1, n, NPY_INT64);
    if (!offset || !count) {
        Py_XDECREF(offset);
        Py_XDECREF(count);
        return NULL;
    }
    for (npy_intp c = 0; c < n[0]; c++) {
        ((int64_t *)PyArray_DATA((PyArrayObject *)offset))[c] = e->mesh.cell[c].offset;
        ((int64_t *)PyArray_DATA((PyArrayObject *)count))[c] = e->mesh.cell[c].count;
    }
    return Py_BuildValue("NN", offset, count);
}

/* The numbers of the engine that a restart needs, name and place. */
#define GR_FLOATS(X) X(time) X(dt) X(time_anchor) X(shift_dt) X(dropped_mass)
#define GR_INTEGERS(X) X(step) X(step_anchor) X(dropped) X(clamped) X(n_points)

static PyObject *engine_scalars(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 0);
    PyObject *out = e ? PyDict_New() : NULL;
#define GR_X(name) \
    if (out && gr_put_float(out, #name, e->name)) Py_CLEAR(out);
    GR_FLOATS(GR_X)
#undef GR_X
#define GR_X(name) \
    if (out && gr_put_integer(out, #name, e->name)) Py_CLEAR(out);
    GR_INTEGERS(GR_X)
#undef GR_X
    return out;
}

static PyObject *engine_restore(struct engine_object *self, PyObject *dict)
{
    struct gr_engine *e = ready(self, 0);
    if (!e) return NULL;
    if (!PyDict_Check(dict)) return PyErr_Format(PyExc_TypeError, "restore needs a dict of scalars");
#define GR_X(name)       \
    double float_##name; \
    if (gr_take_float(dict, #name, &float_##name)) return NULL;
    GR_FLOATS(GR_X)
#undef GR_X
#define GR_X(name)          \
    int64_t integer_##name; \
    if (gr_take_integer(dict, #name, &integer_##name)) return NULL;
    GR_INTEGERS(GR_X)
#undef GR_X
    if (integer_n_points != e->n_points)
        return PyErr_Format(PyExc_ValueError, "n_points = %lld does not agree with the points bound",
                            (long long)integer_n_points);
    if (!isfinite(float_time) || !isfinite(float_time_anchor) || !(float_dt >= 0) || !(float_shift_dt > 0) ||
        integer_step < integer_step_anchor)
        return PyErr_Format(PyExc_ValueError, "the scalars of the restart are not valid");
#define GR_X(name) e->name = float_##name;
    GR_FLOATS(GR_X)
#undef GR_X
#define GR_X(name) e->name = integer_##name;
    GR_INTEGERS(GR_X)
#undef GR_X
    e->shift_scale = -1.0 / e->shift_dt;
    e->sums_valid = 0;
    Py_RETURN_NONE;
}

static PyObject *engine_bodies(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 0);
    return e ? gr_python_bodies(e) : NULL;
}

static PyObject *engine_restore_bodies(struct engine_object *self, PyObject *array)
{
    struct gr_engine *e = ready(self, 0);
    if (!e || gr_restore_bodies(e, array)) return NULL;
    Py_RETURN_NONE;
}

static PyObject *engine_split(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 0);
    return e ? gr_python_split(e) : NULL;
}

static PyObject *engine_restore_split(struct engine_object *self, PyObject *array)
{
    struct gr_engine *e = ready(self, 0);
    if (!e || gr_restore_split(e, array)) return NULL;
    Py_RETURN_NONE;
}

static PyObject *engine_refresh(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 0);
    if (!e) return NULL;
    e->sums_valid = 0;
    Py_RETURN_NONE;
}

static PyObject *engine_stable_dt(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 1);
    return e ? PyFloat_FromDouble(gr_stable_dt(e)) : NULL;
}

/* fluidity() -> how the fluidity is diffused, and what that has taken since the engine was built; None without one. */
static PyObject *engine_fluidity(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 0);
    if (!e) return NULL;
    if (!e->fluidity) Py_RETURN_NONE;
    const struct gr_nonlocal *nonlocal = &e->config.nonlocal;
    return Py_BuildValue("{s:s,s:i,s:d,s:L,s:L}", "method", gr_diffusion_names[nonlocal->method], "substeps",
                         nonlocal->substeps, "limit", gr_fluidity_limit(e->fluidity, nonlocal->method), "iterations",
                         (long long)e->cg_iterations, "clamped", (long long)e->clamped_cells);
}

/* fields() -> [(name, components, unit, doc)] that this engine carries. */
static PyObject *engine_fields(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 0);
    PyObject *out = e ? PyList_New(0) : NULL;
    for (int f = 0; out && f < GR_FIELD_COUNT; f++) {
        if (!gr_engine_uses(&e->config, f)) continue;
        out = gr_add_field(out, &gr_field_table[f], gr_field_components(f, e->config.dim));
    }
    return out;
}

static PyObject *engine_isa(struct engine_object *self, void *unused)
{
    (void)unused;
    return self->kernels ? PyUnicode_FromString(self->kernels->isa) : PyUnicode_FromString("");
}

static PyMethodDef methods[] = {
    {"bind", (PyCFunction)engine_bind, METH_VARARGS,
     "bind(buffers, n_points, fresh)\n--\n\nLend {name: float64 (component, capacity)} and id: int64 (capacity,). Nothing is copied."},
    {"regroup", (PyCFunction)engine_regroup, METH_NOARGS,
     "regroup()\n--\n\nGroup the points by cell; returns the capacity needed if the buffers are too small, else 0."},
    {"advance", (PyCFunction)engine_advance, METH_VARARGS,
     "advance(max_steps, until, threads)\n--\n\nRun steps until a count or a time, the GIL released; returns as regroup."},
    {"p2g", (PyCFunction)engine_p2g, METH_NOARGS, "p2g()\n--\n\nP2G alone: the sums of all cells."},
    {"grid", (PyCFunction)engine_grid, METH_NOARGS, "grid()\n--\n\nThe grid stage alone: nodal velocities of this step."},
    {"g2p", (PyCFunction)engine_g2p, METH_NOARGS, "g2p()\n--\n\nG2P and stress update alone; completes the step."},
    {"nodes", (PyCFunction)engine_nodes, METH_NOARGS,
     "nodes()\n--\n\nCopies of the nodal arrays: x, mass, momentum, force, v, w."},
    {"cells", (PyCFunction)engine_cells, METH_NOARGS, "cells()\n--\n\n(offset, count) of the cells in the point arrays."},
    {"scalars", (PyCFunction)engine_scalars, METH_NOARGS, "scalars()\n--\n\nThe numbers that a restart needs."},
    {"restore", (PyCFunction)engine_restore, METH_O, "restore(scalars)\n--\n\nSet the numbers of a restart."},
    {"bodies", (PyCFunction)engine_bodies, METH_NOARGS,
     "bodies()\n--\n\nState of the bodies, (n, 19): position, orientation (quaternion), velocity, angular velocity, impulse,\n"
     "angular impulse."},
    {"restore_bodies", (PyCFunction)engine_restore_bodies, METH_O,
     "restore_bodies(state)\n--\n\nSet the state of the bodies, as bodies() gave it."},
    {"split", (PyCFunction)engine_split, METH_NOARGS,
     "split()\n--\n\nPoses at which the cells about thin bodies are double, (n, 7): position, orientation (quaternion)."},
    {"restore_split", (PyCFunction)engine_restore_split, METH_O,
     "restore_split(poses)\n--\n\nSet these poses, as split() gave them."},
    {"refresh", (PyCFunction)engine_refresh, METH_NOARGS,
     "refresh()\n--\n\nMake the sums of the cells anew: the buffers may have been written to."},
    {"stable_dt", (PyCFunction)engine_stable_dt, METH_NOARGS, "stable_dt()\n--\n\ncfl dx/(c + |v|max), s."},
    {"fluidity", (PyCFunction)engine_fluidity, METH_NOARGS,
     "fluidity()\n--\n\nmethod, substeps, limit (s), iterations, clamped (cells) of a nonlocal law; None without one."},
    {"fields", (PyCFunction)engine_fields, METH_NOARGS, "fields()\n--\n\n[(name, components, unit, doc)] of the buffers."},
    {NULL, NULL, 0, NULL}};

static PyGetSetDef getters[] = {{"isa", (getter)engine_isa, NULL, "instruction set of the kernels", NULL},
                                {NULL, NULL, NULL, NULL, NULL}};

static PyType_Slot slots[] = {{Py_tp_init, engine_init},
                              {Py_tp_new, PyType_GenericNew},
                              {Py_tp_dealloc, engine_dealloc},
                              {Py_tp_methods, methods},
                              {Py_tp_getset, getters},
                              {Py_tp_doc, "The engine of a simulation; see granular.Simulation."},
                              {0, NULL}};

static PyType_Spec spec = {"granular._core.Engine", sizeof(struct engine_object), 0, Py_TPFLAGS_DEFAULT, slots};

PyTypeObject *gr_engine_type(PyObject *module) { return (PyTypeObject *)PyType_FromModuleAndSpec(module, &spec, NULL); }
