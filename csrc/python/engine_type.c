/* The Python type `Engine`: it borrows the buffers of the points and steps them with the GIL released. */
#include <math.h>
#include <stddef.h>

#include "python/arrays.h"

struct engine_object {
    PyObject_HEAD
    struct gr_engine *engine;
    const struct gr_kernels *kernels;
    PyObject *buffers[GR_FIELD_COUNT + 1]; /* the arrays that are lent, the ids last */
    int busy;
};

static struct gr_engine *ready(struct engine_object *self, int bound)
{
    if (!self->engine || (bound && !self->engine->id)) {
        PyErr_SetString(PyExc_RuntimeError, "the engine has no points: call bind first");
        return NULL;
    }
    if (self->busy) {
        PyErr_SetString(PyExc_RuntimeError, "the engine is running in another thread");
        return NULL;
    }
    return self->engine;
}

/* ---- construction ---- */

static int take_axes(struct gr_config *c, PyObject *shape, PyObject *lower, PyObject *periodic, PyObject *open_low,
                     PyObject *open_high, PyObject *creases)
{
    PyObject *const lists[] = {shape, lower, periodic, open_low, open_high, creases};
    for (int k = 0; k < 6; k++)
        if (!PyTuple_Check(lists[k]) || PyTuple_GET_SIZE(lists[k]) != c->dim) {
            PyErr_SetString(PyExc_ValueError,
                            "shape, lower, periodic, open_low, open_high and creases must be tuples of length dim");
            return -1;
        }
    int64_t nodes = 1;
    for (int d = 0; d < c->dim; d++) {
        const long n = PyLong_AsLong(PyTuple_GET_ITEM(shape, d));
        if (n == -1 && PyErr_Occurred()) return -1;
        if (n < 1 || n > 1000000000 || (nodes *= 2 * n + 2) > ((int64_t)1 << 32)) {
            PyErr_Format(PyExc_ValueError, "shape[%d] = %ld is outside the range of the grid", d, n);
            return -1;
        }
        c->shape[d] = (int)n;
        c->lower[d] = PyFloat_AsDouble(PyTuple_GET_ITEM(lower, d));
        c->periodic[d] = PyObject_IsTrue(PyTuple_GET_ITEM(periodic, d));
        c->open_low[d] = PyObject_IsTrue(PyTuple_GET_ITEM(open_low, d));
        c->open_high[d] = PyObject_IsTrue(PyTuple_GET_ITEM(open_high, d));
        const npy_intp any[1] = {-1};
        PyArrayObject *lines = gr_array(PyTuple_GET_ITEM(creases, d), "creases", NPY_INT32, 1, any, 0);
        if (!lines || PyErr_Occurred()) return -1;
        if (!isfinite(c->lower[d])) {
            PyErr_Format(PyExc_ValueError, "lower[%d] is not finite", d);
            return -1;
        }
        c->n_creases[d] = (int)PyArray_DIM(lines, 0);
        c->creases[d] = PyArray_DATA(lines);
    }
    return 0;
}

static int take_walls(struct gr_config *c, PyObject *walls, struct gr_wall *table)
{
    if (!PyList_Check(walls) || PyList_GET_SIZE(walls) < 1 || PyList_GET_SIZE(walls) > 256) {
        PyErr_SetString(PyExc_ValueError, "walls must be a list of 1 to 256 rows, row 0 the free node");
        return -1;
    }
    c->n_walls = (int)PyList_GET_SIZE(walls);
    for (int k = 0; k < c->n_walls; k++) {
        struct gr_wall *w = &table[k];
        PyObject *row = PyList_GET_ITEM(walls, k);
        if (!PyTuple_Check(row)) {
            PyErr_SetString(PyExc_TypeError, "each row of walls must be a tuple");
            return -1;
        }
        if (!PyArg_ParseTuple(row, "iidiidi;a row of walls is (fixed, clamp, friction, normal, side, opens_at, after)",
                              &w->fixed, &w->clamp, &w->friction, &w->normal, &w->side, &w->opens_at, &w->after))
            return -1;
        if (!(w->friction >= 0)) {
            PyErr_Format(PyExc_ValueError, "walls[%d]: friction must not be negative", k);
            return -1;
        }
    }
    c->walls = table;
    return 0;
}

/* Numbers of nodes and of grouping cells that the codes and flags must have. */
static int64_t count_along(const struct gr_config *c, int d, int nodes)
{
    const int n = c->shape[d];
    if (c->basis == GR_QUADRATIC) return !nodes || c->periodic[d] ? n : n + 2 + c->n_creases[d];
    return (nodes || c->basis == GR_UGIMP) && !c->periodic[d] ? n + 1 : n;
}

static int take_map(const struct gr_config *c, PyObject *object, const char *name, int nodes, const uint8_t **out)
{
    npy_intp shape[3];
    for (int d = 0; d < c->dim; d++) shape[c->dim - 1 - d] = (npy_intp)count_along(c, d, nodes);
    *out = NULL;
    if (!nodes && object == Py_None) return 0;
    PyArrayObject *array = gr_array(object, name, NPY_UINT8, c->dim, shape, 0);
    if (!array) return -1;
    const uint8_t *data = PyArray_DATA(array);
    for (npy_intp k = 0; nodes && k < PyArray_SIZE(array); k++)
        if (data[k] >= c->n_walls) {
            PyErr_Format(PyExc_ValueError, "%s names wall row %d, but there are %d", name, (int)data[k], c->n_walls);
            return -1;
        }
    *out = data;
    return 0;
}

static int take_gravity(struct gr_config *c, PyObject *times, PyObject *vectors)
{
    const npy_intp any[1] = {-1};
    PyArrayObject *t = gr_array(times, "gravity_times", NPY_DOUBLE, 1, any, 0);
    if (!t) return -1;
    const npy_intp shape[2] = {PyArray_DIM(t, 0), c->dim};
    PyArrayObject *g = gr_array(vectors, "gravity_vectors", NPY_DOUBLE, 2, shape, 0);
    if (!g) return -1;
    c->n_gravity = (int)PyArray_DIM(t, 0);
    c->gravity_times = PyArray_DATA(t);
    c->gravity_vectors = PyArray_DATA(g);
    for (int k = 0; k < c->n_gravity; k++)
        if (!isfinite(c->gravity_times[k]) || (k && !(c->gravity_times[k] > c->gravity_times[k - 1]))) {
            PyErr_SetString(PyExc_ValueError, "gravity_times must be finite and increase");
            return -1;
        }
    return 0;
}

static int take_numbers(PyObject *dict, const char *name, double *out)
{
    PyObject *value = PyDict_GetItemString(dict, name);
    if (!value) {
        PyErr_Format(PyExc_ValueError, "the number %s is missing", name);
        return -1;
    }
    *out = PyFloat_AsDouble(value);
    if (PyErr_Occurred()) return -1;
    if (!isfinite(*out)) {
        PyErr_Format(PyExc_ValueError, "%s = %R must be finite", name, value);
        return -1;
    }
    return 0;
}

static int take_all_numbers(struct gr_config *c, PyObject *numbers, PyObject *parameters)
{
#define GR_TAKE(name, place)                                       \
    if (take_numbers(numbers, name, &c->place)) return -1;
    GR_TAKE("dx", dx)
    GR_TAKE("half_extent", lambda)
    GR_TAKE("keep_velocity_rate", keep_velocity_rate)
    GR_TAKE("rho_c", rho_c)
    GR_TAKE("wave_speed", wave_speed)
    GR_TAKE("mass_cutoff", mass_cutoff)
    GR_TAKE("cfl", cfl)
    GR_TAKE("dt", dt)
    GR_TAKE("diffusion", cure.diffusion)
    GR_TAKE("shear_diffusion", cure.shear_diffusion)
    GR_TAKE("feedback", cure.feedback)
    GR_TAKE("feedback_limit", cure.feedback_limit)
    GR_TAKE("shift", cure.shift)
    GR_TAKE("shift_limit", cure.shift_limit)
    GR_TAKE("tension_reach", cure.reach)
#undef GR_TAKE
    const struct gr_law_info *law = &gr_law_table[c->law];
    for (int k = 0; k < law->n_parameters; k++)
        if (take_numbers(parameters, law->parameter[k].name, &c->parameter[k])) return -1;
    return 0;
}

static int law_index(const char *name)
{
    for (int k = 0; k < GR_LAW_COUNT; k++)
        if (!strcmp(gr_law_table[k].name, name)) return k;
    PyErr_Format(PyExc_ValueError, "there is no law \"%s\"", name);
    return -1;
}

static int engine_init(struct engine_object *self, PyObject *args, PyObject *kwargs)
{
    static char *names[] = {"dim", "basis", "affine", "diffused", "xpic_order", "pressure_from_density", "law", "isa",
                            "shape", "lower", "periodic", "open_low", "open_high", "creases", "walls", "node_codes",
                            "cell_flags", "gravity_times", "gravity_vectors", "numbers", "parameters", NULL};
    struct gr_config c = {0};
    struct gr_wall table[256];
    const char *law, *isa;
    PyObject *shape, *lower, *periodic, *open_low, *open_high, *creases, *walls, *codes, *flags, *times, *vectors;
    PyObject *numbers, *parameters;
    if (self->engine) {
        PyErr_SetString(PyExc_RuntimeError, "the engine is already built");
        return -1;
    }
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "$iiiiiissOOOOOOOOOOOO!O!", names, &c.dim, &c.basis, &c.affine,
                                     &c.diffused, &c.xpic_order, &c.pressure_from_density, &law, &isa, &shape, &lower,
                                     &periodic, &open_low, &open_high, &creases, &walls, &codes, &flags, &times,
                                     &vectors, &PyDict_Type, &numbers, &PyDict_Type, &parameters))
        return -1;
    if (c.dim < 2 || c.dim > 3 || c.basis < 0 || c.basis >= GR_BASIS_COUNT || c.diffused < 0 || c.diffused > 1) {
        PyErr_SetString(PyExc_ValueError, "dim must be 2 or 3, basis 0 to 2 and diffused 0 or 1");
        return -1;
    }
    c.law = law_index(law);
    if (c.law < 0) return -1;
    self->kernels = gr_kernels_select(isa);
    if (!self->kernels) {
        PyErr_Format(PyExc_ValueError, "instruction set \"%s\" is not available on this machine", isa);
        return -1;
    }
    if (take_axes(&c, shape, lower, periodic, open_low, open_high, creases) || take_walls(&c, walls, table) ||
        take_map(&c, codes, "node_codes", 1, &c.node_codes) || take_map(&c, flags, "cell_flags", 0, &c.cell_flags) ||
        take_gravity(&c, times, vectors) || take_all_numbers(&c, numbers, parameters))
        return -1;
    const int error = gr_engine_new(&self->engine, &c);
    if (error) {
        gr_raise(error, NULL);
        return -1;
    }
    return 0;
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
    if (!PyArg_ParseTuple(args, "Ldi", &max_steps, &until, &threads)) return NULL;
    struct gr_engine *e = ready(self, 1);
    if (!e) return NULL;
    if (max_steps < 0 || isnan(until) || threads < 1 || threads > GR_MAX_THREADS)
        return PyErr_Format(PyExc_ValueError, "max_steps must not be negative, until not NaN, threads 1 to %d", GR_MAX_THREADS);
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

static PyObject *engine_scatter(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    return run_stage(self, gr_scatter);
}

static PyObject *engine_grid(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    return run_stage(self, gr_grid);
}

static PyObject *engine_gather(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    return run_stage(self, gr_gather);
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
            const int64_t source = e->mesh.node_source[i * e->K + k];
            const double *block = e->sums + (source >> 5) * e->sum_stride;
            for (int q = 0; q < rows; q++) sum[q] += block[gr_sum_place((int)dim, e->K, q, (int)(source & 31))];
        }
        ((double *)PyArray_DATA((PyArrayObject *)m))[i] = sum[0];
        for (npy_intp d = 0; d < dim; d++) {
            const struct gr_axis *axis = &e->axis[d];
            ((double *)PyArray_DATA((PyArrayObject *)x))[i * dim + d] =
                axis->origin + axis->node_position[id % axis->n_nodes] * e->config.dx;
            id /= axis->n_nodes;
            ((double *)PyArray_DATA((PyArrayObject *)p))[i * dim + d] = sum[1 + d];
            ((double *)PyArray_DATA((PyArrayObject *)f))[i * dim + d] = sum[1 + dim + d];
            ((double *)PyArray_DATA((PyArrayObject *)v))[i * dim + d] = e->node_data[i * e->node_stride + d];
            ((double *)PyArray_DATA((PyArrayObject *)w))[i * dim + d] = e->node_data[i * e->node_stride + dim + d];
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
#define GR_FLOATS(X) X(time) X(dt) X(time_anchor) X(lent_dt) X(dropped_mass)
#define GR_INTEGERS(X) X(step) X(step_anchor) X(dropped) X(clamped) X(n_points)

static PyObject *engine_scalars(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 0);
    PyObject *out = e ? PyDict_New() : NULL, *value;
    if (!out) return NULL;
#define GR_X(name)                                                          \
    value = PyFloat_FromDouble(e->name);                                    \
    if (!value || PyDict_SetItemString(out, #name, value)) goto fail;       \
    Py_CLEAR(value);
    GR_FLOATS(GR_X)
#undef GR_X
#define GR_X(name)                                                          \
    value = PyLong_FromLongLong(e->name);                                   \
    if (!value || PyDict_SetItemString(out, #name, value)) goto fail;       \
    Py_CLEAR(value);
    GR_INTEGERS(GR_X)
#undef GR_X
    return out;
fail:
    Py_XDECREF(value);
    Py_DECREF(out);
    return NULL;
}

static PyObject *engine_restore(struct engine_object *self, PyObject *dict)
{
    struct gr_engine *e = ready(self, 0);
    if (!e) return NULL;
    if (!PyDict_Check(dict)) return PyErr_Format(PyExc_TypeError, "restore needs a dict of scalars");
    PyObject *value;
#define GR_X(name)                                                                                     \
    if (!(value = PyDict_GetItemString(dict, #name)))                                                  \
        return PyErr_Format(PyExc_ValueError, "the scalar %s is missing", #name);                      \
    const double float_##name = PyFloat_AsDouble(value);                                               \
    if (PyErr_Occurred()) return NULL;
    GR_FLOATS(GR_X)
#undef GR_X
#define GR_X(name)                                                                                     \
    if (!(value = PyDict_GetItemString(dict, #name)))                                                  \
        return PyErr_Format(PyExc_ValueError, "the scalar %s is missing", #name);                      \
    const long long integer_##name = PyLong_AsLongLong(value);                                         \
    if (PyErr_Occurred()) return NULL;
    GR_INTEGERS(GR_X)
#undef GR_X
    if (integer_n_points != e->n_points)
        return PyErr_Format(PyExc_ValueError, "n_points = %lld does not agree with the points bound", integer_n_points);
    if (!isfinite(float_time) || !isfinite(float_time_anchor) || !(float_dt >= 0) || !(float_lent_dt > 0) ||
        integer_step < integer_step_anchor)
        return PyErr_Format(PyExc_ValueError, "the scalars of the restart are not valid");
#define GR_X(name) e->name = float_##name;
    GR_FLOATS(GR_X)
#undef GR_X
#define GR_X(name) e->name = integer_##name;
    GR_INTEGERS(GR_X)
#undef GR_X
    e->lent_scale = -1.0 / e->lent_dt;
    e->sums_valid = 0;
    Py_RETURN_NONE;
}

static PyObject *engine_stable_dt(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 1);
    return e ? PyFloat_FromDouble(gr_stable_dt(e)) : NULL;
}

/* fields() -> [(name, components, unit, doc)] that this engine carries. */
static PyObject *engine_fields(struct engine_object *self, PyObject *unused)
{
    (void)unused;
    struct gr_engine *e = ready(self, 0);
    PyObject *out = e ? PyList_New(0) : NULL;
    for (int f = 0; out && f < GR_FIELD_COUNT; f++) {
        if (!gr_engine_uses(&e->config, f)) continue;
        const struct gr_field_info *info = &gr_field_table[f];
        PyObject *row = Py_BuildValue("siss", info->name, gr_field_components(f, e->config.dim), info->unit, info->doc);
        if (!row || PyList_Append(out, row)) Py_CLEAR(out);
        Py_XDECREF(row);
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
    {"scatter", (PyCFunction)engine_scatter, METH_NOARGS, "scatter()\n--\n\nP2G alone: the sums of all cells."},
    {"grid", (PyCFunction)engine_grid, METH_NOARGS, "grid()\n--\n\nThe grid stage alone: nodal velocities of this step."},
    {"gather", (PyCFunction)engine_gather, METH_NOARGS, "gather()\n--\n\nG2P and stress update alone; completes the step."},
    {"nodes", (PyCFunction)engine_nodes, METH_NOARGS, "nodes()\n--\n\nCopies of the nodal arrays: x, mass, momentum, force, v, w."},
    {"cells", (PyCFunction)engine_cells, METH_NOARGS, "cells()\n--\n\n(offset, count) of the cells in the point arrays."},
    {"scalars", (PyCFunction)engine_scalars, METH_NOARGS, "scalars()\n--\n\nThe numbers that a restart needs."},
    {"restore", (PyCFunction)engine_restore, METH_O, "restore(scalars)\n--\n\nSet the numbers of a restart."},
    {"stable_dt", (PyCFunction)engine_stable_dt, METH_NOARGS, "stable_dt()\n--\n\ncfl dx/(c + |v|max), s."},
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
