/* The Python type `Sph`: the engine of smoothed particle hydrodynamics (SPH), which borrows the buffers of the points and steps
 * them with the GIL released. */
#include <math.h>

#include "python/engine_common.h"
#include "sph/sph.h"

struct sph_object {
    PyObject_HEAD
    struct gr_sph *engine;
    const struct gr_kernels *kernels;
    PyObject *buffers[GR_SPH_FIELD_COUNT + 1]; /* the borrowed arrays, the ids last */
    int busy;
};

static struct gr_sph *ready(struct sph_object *self, int bound)
{
    struct gr_sph *s = self->engine;
    return gr_refuse_state(s != NULL, s && (!bound || s->id), self->busy) ? NULL : s;
}

/* ---- construction ---- */

static int take_domain(struct gr_sph_config *c, PyObject *lower, PyObject *upper, PyObject *periodic)
{
    PyObject *const lists[] = {lower, upper, periodic};
    if (c->dim < 2 || c->dim > 3) {
        PyErr_Format(PyExc_ValueError, "dim = %d must be 2 or 3", c->dim);
        return -1;
    }
    for (int k = 0; k < 3; k++)
        if (!PyTuple_Check(lists[k]) || PyTuple_GET_SIZE(lists[k]) != c->dim) {
            PyErr_SetString(PyExc_ValueError, "lower, upper and periodic must be tuples of length dim");
            return -1;
        }
    for (int d = 0; d < c->dim; d++) {
        c->lower[d] = PyFloat_AsDouble(PyTuple_GET_ITEM(lower, d));
        c->upper[d] = PyFloat_AsDouble(PyTuple_GET_ITEM(upper, d));
        c->periodic[d] = PyObject_IsTrue(PyTuple_GET_ITEM(periodic, d));
        if (PyErr_Occurred()) return -1;
        if (!(fabs(c->lower[d]) <= GR_LARGEST) || !(fabs(c->upper[d]) <= GR_LARGEST) || !(c->upper[d] > c->lower[d])) {
            PyErr_Format(PyExc_ValueError, "upper[%d] must exceed lower[%d], both finite", d, d);
            return -1;
        }
    }
    return 0;
}

/* Walls from rows (lower, upper, v, from, until, axis), 12 numbers each. */
static int take_walls(struct gr_sph_config *c, PyObject *object)
{
    const npy_intp shape[2] = {-1, 12};
    PyArrayObject *array = gr_array(object, "walls", NPY_DOUBLE, 2, shape, 0);
    if (!array) return -1;
    const npy_intp n = PyArray_DIM(array, 0);
    if (n > GR_SPH_MAX_WALLS) {
        PyErr_Format(PyExc_ValueError, "walls must be at most %d, not %zd", GR_SPH_MAX_WALLS, n);
        return -1;
    }
    c->n_walls = (int)n;
    for (int k = 0; k < n; k++) {
        const double *row = (const double *)PyArray_DATA(array) + 12 * k;
        struct gr_sph_wall *wall = &c->wall[k];
        memcpy(wall, row, 11 * sizeof *row);
        int valid = wall->from >= 0 && wall->until >= 0 && row[11] >= 0 && row[11] < c->dim;
        for (int d = 0; d < c->dim; d++) valid = valid && wall->lower[d] < wall->upper[d] && fabs(wall->v[d]) <= GR_LARGEST;
        if (!valid) {
            PyErr_Format(PyExc_ValueError, "walls[%d] must have lower < upper, finite velocities, from and until >= 0", k);
            return -1;
        }
        wall->axis = (int)row[11];
    }
    return 0;
}

static int sph_init(struct sph_object *self, PyObject *args, PyObject *kwargs)
{
    static char *names[] = {"dim",        "lower",         "upper",           "periodic", "isa", "wall_friction",
                            "parameters", "gravity_times", "gravity_vectors", "walls",    "gas", NULL};
    struct gr_sph_config c = {0};
    const char *isa;
    PyObject *lower, *upper, *periodic, *parameters, *times, *vectors, *walls, *gas;
    if (self->engine) {
        PyErr_SetString(PyExc_RuntimeError, "the engine is already built");
        return -1;
    }
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "$iOOOspO!OOOO:Sph", names, &c.dim, &lower, &upper, &periodic, &isa,
                                     &c.wall_friction, &PyDict_Type, &parameters, &times, &vectors, &walls, &gas) ||
        take_domain(&c, lower, upper, periodic) ||
        gr_take_parameters(parameters, gr_sph_parameter_table, GR_SPH_PARAMETER_COUNT, gr_sph_may_be_zero, c.parameter) ||
        gr_take_gravity(c.dim, times, vectors, &c.n_gravity, &c.gravity_times, &c.gravity_vectors) || take_walls(&c, walls))
        return -1;
    self->kernels = gr_take_kernels(isa);
    if (!self->kernels) return -1;
    if (c.n_gravity < 1) {
        PyErr_SetString(PyExc_ValueError, "gravity_times must hold at least one time");
        return -1;
    }
    const int error = gr_sph_new(&self->engine, &c, self->kernels->lanes);
    if (error) gr_raise(error, NULL);
    return error || gr_take_gas(self->engine, gas) ? -1 : 0;
}

static void sph_dealloc(struct sph_object *self)
{
    PyTypeObject *type = Py_TYPE(self);
    gr_sph_free(self->engine);
    for (int k = 0; k <= GR_SPH_FIELD_COUNT; k++) Py_XDECREF(self->buffers[k]);
    type->tp_free((PyObject *)self);
    Py_DECREF(type);
}

/* ---- buffers ---- */

/* The arrays of a dict that the engine needs, checked, the ids last. Returned: how many, or -1 with an exception set. */
static int take_buffers(const struct gr_sph *s, PyObject *buffers, PyArrayObject **arrays, double **row)
{
    const char *names[GR_SPH_FIELD_COUNT + 1];
    npy_intp shape[2] = {0, -1};
    int n = 0, n_rows = 0;
    for (int f = 0; f <= GR_SPH_FIELD_COUNT; f++) {
        const int is_id = f == GR_SPH_FIELD_COUNT;
        shape[0] = is_id ? 0 : gr_sph_components(s, f);
        if (!is_id && !shape[0]) continue;
        PyObject *object = PyDict_GetItemString(buffers, names[n] = is_id ? "id" : gr_sph_field_table[f].name);
        if (!object) {
            PyErr_Format(PyExc_ValueError, "the buffer %s is missing", names[n]);
            return -1;
        }
        arrays[n] =
            is_id ? gr_array(object, "id", NPY_INT64, 1, shape + 1, 1) : gr_array(object, names[n], NPY_DOUBLE, 2, shape, 1);
        if (!arrays[n]) return -1;
        shape[1] = PyArray_DIM(arrays[n], is_id ? 0 : 1);
        for (int k = 0; k < shape[0]; k++) row[n_rows++] = (double *)PyArray_DATA(arrays[n]) + k * shape[1];
        n++;
    }
    return gr_refuse_overlap(arrays, names, n) ? -1 : n;
}

/* bind(buffers, n_particles, wall_first, n_walls, fresh, gas_first, n_gas) */
static PyObject *sph_bind(struct sph_object *self, PyObject *args)
{
    PyObject *buffers;
    Py_ssize_t n_particles, wall_first, n_walls, gas_first = 0, n_gas = 0;
    int fresh;
    PyArrayObject *arrays[GR_SPH_FIELD_COUNT + 1];
    double *row[GR_SPH_MAX_ROWS] = {0};
    if (!PyArg_ParseTuple(args, "O!nnnp|nn", &PyDict_Type, &buffers, &n_particles, &wall_first, &n_walls, &fresh, &gas_first,
                          &n_gas))
        return NULL;
    struct gr_sph *s = ready(self, 0);
    const int n_arrays = s ? take_buffers(s, buffers, arrays, row) : -1;
    if (n_arrays < 0) return NULL;
    const npy_intp capacity = PyArray_DIM(arrays[n_arrays - 1], 0);
    if (n_particles < 0 || n_walls < 0 || capacity > INT32_MAX || wall_first < GR_LANES || wall_first > capacity ||
        n_particles > wall_first - GR_LANES || n_walls > capacity - wall_first - GR_LANES)
        return PyErr_Format(
            PyExc_ValueError,
            "%zd particles and %zd wall points from row %zd on do not fit buffers of %zd places with %d spare "
            "ones behind each",
            n_particles, n_walls, wall_first, (Py_ssize_t)capacity, GR_LANES);
    if (gr_refuse_gas_rows(s, wall_first + n_walls, gas_first, n_gas, capacity)) return NULL;
    for (int k = 0; k < n_arrays; k++) {
        Py_INCREF(arrays[k]);
        Py_XSETREF(self->buffers[k], (PyObject *)arrays[k]);
    }
    gr_sph_place_gas(s, gas_first, n_gas);
    const int error =
        gr_sph_bind(s, row, PyArray_DATA(arrays[n_arrays - 1]), capacity, n_particles, wall_first, n_walls, fresh);
    if (error) return gr_raise(error, NULL);
    Py_RETURN_NONE;
}

/* ---- stepping ---- */

/* advance(max_steps, until, threads) */
static PyObject *sph_advance(struct sph_object *self, PyObject *args)
{
    long long max_steps;
    double until;
    int threads, error;
    struct gr_sph *s = ready(self, 1);
    if (!s || gr_take_run(args, &max_steps, &until, &threads)) return NULL;
    self->busy = 1;
    Py_BEGIN_ALLOW_THREADS
    error = gr_sph_advance(s, self->kernels->sph, max_steps, until, threads);
    Py_END_ALLOW_THREADS
    self->busy = 0;
    if (!error) Py_RETURN_NONE;
    const struct gr_failure at = {s->error_id, s->step, s->config.dim, s->error_x[0], s->error_x[1], s->error_x[2], s->time};
    const int has_place = error == GR_ERR_NOT_FINITE || error == GR_ERR_RUNAWAY;
    return has_place ? gr_raise_at(error, &at) : gr_raise(error, NULL);
}

/* ---- looking in ---- */

/* The numbers of the engine that a restart needs, name and place. */
#define GR_FLOATS(X) X(time) X(dt) X(speed2) X(acceleration2) X(dropped_mass) X(gas_speed2)
#define GR_INTEGERS(X) X(step) X(dropped) X(started) X(stopped) X(gas_dropped)

static PyObject *sph_scalars(struct sph_object *self, PyObject *unused)
{
    (void)unused;
    const struct gr_sph *s = ready(self, 0);
    if (!s) return NULL;
    PyObject *out = PyDict_New();
    if (out && gr_put_integer(out, "n_points", s->n_particles)) Py_CLEAR(out);
#define GR_X(name) \
    if (out && gr_put_float(out, #name, s->name)) Py_CLEAR(out);
    GR_FLOATS(GR_X)
#undef GR_X
#define GR_X(name) \
    if (out && gr_put_integer(out, #name, s->name)) Py_CLEAR(out);
    GR_INTEGERS(GR_X)
    GR_X(rebuilds)
    GR_X(n_walls)
    GR_X(n_gas)
#undef GR_X
    return out;
}

static PyObject *sph_restore(struct sph_object *self, PyObject *dict)
{
    struct gr_sph *s = ready(self, 0);
    if (!s) return NULL;
    if (!PyDict_Check(dict)) return PyErr_Format(PyExc_TypeError, "restore needs a dict of scalars");
    struct gr_sph new = *s;
#define GR_X(name) \
    if (gr_take_float(dict, #name, &new.name)) return NULL;
    GR_FLOATS(GR_X)
#undef GR_X
#define GR_X(name) \
    if (gr_take_integer(dict, #name, &new.name)) return NULL;
    GR_INTEGERS(GR_X)
#undef GR_X
    if (!isfinite(new.time) || !(new.dt > 0) || !(new.speed2 > 0) || !(new.acceleration2 >= 0) || new.step < 0)
        return PyErr_Format(PyExc_ValueError, "the scalars of the restart are not valid");
    *s = new;
    Py_RETURN_NONE;
}

static PyObject *sph_stable_dt(struct sph_object *self, PyObject *unused)
{
    (void)unused;
    const struct gr_sph *s = ready(self, 0);
    return s ? PyFloat_FromDouble(gr_sph_stable_dt(s)) : NULL;
}

static PyObject *sph_fields(struct sph_object *self, PyObject *unused)
{
    (void)unused;
    const struct gr_sph *s = ready(self, 0);
    PyObject *list = s ? PyList_New(0) : NULL;
    for (int f = 0; list && f < GR_SPH_FIELD_COUNT; f++) {
        if (!gr_sph_components(s, f)) continue;
        list = gr_add_field(list, &gr_sph_field_table[f], gr_sph_components(s, f));
    }
    return list;
}

static PyObject *sph_isa(struct sph_object *self, void *unused)
{
    (void)unused;
    return PyUnicode_FromString(self->kernels ? self->kernels->isa : "");
}

static PyMethodDef methods[] = {
    {"bind", (PyCFunction)sph_bind, METH_VARARGS,
     "bind(buffers, n_particles, wall_first, n_walls, fresh, gas_first=0, n_gas=0)\n--\n\nLend {name: float64 (component, capacity)} and id: int64 (capacity,). Nothing is copied."},
    {"advance", (PyCFunction)sph_advance, METH_VARARGS,
     "advance(max_steps, until, threads)\n--\n\nRun steps until a count or a time, the GIL released."},
    {"scalars", (PyCFunction)sph_scalars, METH_NOARGS, "scalars()\n--\n\nThe numbers that a restart needs, and counts."},
    {"restore", (PyCFunction)sph_restore, METH_O, "restore(scalars)\n--\n\nSet the numbers of a restart."},
    {"stable_dt", (PyCFunction)sph_stable_dt, METH_NOARGS,
     "stable_dt()\n--\n\ncfl times the smaller of h/(4 c) and sqrt(h/|a|)/4, s."},
    {"fields", (PyCFunction)sph_fields, METH_NOARGS, "fields()\n--\n\n[(name, components, unit, doc)] of the buffers."},
    {NULL, NULL, 0, NULL}};

static PyGetSetDef getters[] = {{"isa", (getter)sph_isa, NULL, "instruction set of the kernels", NULL},
                                {NULL, NULL, NULL, NULL, NULL}};

static PyType_Slot slots[] = {{Py_tp_init, sph_init},
                              {Py_tp_new, PyType_GenericNew},
                              {Py_tp_dealloc, sph_dealloc},
                              {Py_tp_methods, methods},
                              {Py_tp_getset, getters},
                              {Py_tp_doc, "The engine of SPH; see granular.sph."},
                              {0, NULL}};

static PyType_Spec spec = {"granular._core.Sph", sizeof(struct sph_object), 0, Py_TPFLAGS_DEFAULT, slots};

PyTypeObject *gr_sph_type(PyObject *module) { return (PyTypeObject *)PyType_FromModuleAndSpec(module, &spec, NULL); }
