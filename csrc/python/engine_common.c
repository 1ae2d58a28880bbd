#include "python/engine_common.h"

#include <math.h>

#include "kernels.h"

void gr_free_object(struct gr_object *self)
{
    PyTypeObject *type = Py_TYPE(self);
    for (int k = 0; k <= self->n_fields; k++) Py_XDECREF(self->buffers[k]);
    Py_XDECREF(self->borrowed);
    Py_XDECREF(self->link);
    type->tp_free((PyObject *)self);
    Py_DECREF(type);
}

int gr_begin_object(struct gr_object *self, const char *isa)
{
    if (self->engine)
        PyErr_SetString(PyExc_RuntimeError, "the engine is already built");
    else
        self->kernels = gr_take_kernels(isa);
    return PyErr_Occurred() ? -1 : 0;
}

void *gr_ready(const struct gr_object *self, int must_be_bound)
{
    const int has_points = self->engine && (!must_be_bound || self->is_bound);
    gr_use_memory(self);
    if (has_points && !self->busy) return self->engine;
    PyErr_SetString(PyExc_RuntimeError,
                    has_points ? "the engine is running in another thread" : "the engine has no points: call bind first");
    return NULL;
}

PyObject *gr_python_fields(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    PyObject *list = gr_ready(self, 0) ? PyList_New(0) : NULL;
    for (int f = 0; list && f < self->n_fields; f++) {
        const struct gr_field_info *info = &self->fields[f];
        if (!self->components[f]) continue;
        PyObject *dtype = (PyObject *)PyArray_DescrFromType(self->type[f]);
        list = gr_append(list, Py_BuildValue("sissN", info->name, self->components[f], info->unit, info->doc, dtype));
    }
    return list;
}

Py_ssize_t gr_take_buffers(const struct gr_object *self, PyObject *dict, PyArrayObject **arrays)
{
    const char *names[GR_MAX_FIELDS + 1];
    const int n = self->n_fields;
    npy_intp shape[2] = {0, -1};
    for (int k = n; k >= 0; k--) { /* the ids first, which have the number of slots */
        const int components = k < n ? self->components[k] : 1;
        arrays[k] = NULL;
        if (!components) continue;
        shape[0] = components;
        names[k] = k == n ? "id" : self->fields[k].name;
        PyObject *object = PyDict_GetItemString(dict, names[k]);
        if (!object) return gr_refuse("the buffer %s is missing", names[k]);
        arrays[k] = k == n ? gr_array(object, names[k], NPY_INT64, 1, shape + 1, 1)
                           : gr_array(object, names[k], self->type[k], 2, shape, 1);
        if (!arrays[k]) return -1;
        if (k == n) shape[1] = PyArray_DIM(arrays[k], 0);
    }
    return gr_refuse_overlap(arrays, names, n + 1) ? -1 : shape[1];
}

void gr_keep_buffers(struct gr_object *self, PyArrayObject *const *arrays)
{
    for (int k = 0; k <= self->n_fields; k++) {
        Py_XINCREF(arrays[k]);
        Py_XSETREF(self->buffers[k], arrays[k]);
    }
}

int gr_take_run(PyObject *args, long long *max_steps, double *until, int *threads)
{
    if (!PyArg_ParseTuple(args, "Ldi", max_steps, until, threads)) return -1;
    if (*max_steps >= 0 && !isnan(*until) && *threads >= 1 && *threads <= GR_MAX_THREADS) return 0;
    return gr_refuse("max_steps must not be negative, until not NaN, threads 1 to %d", GR_MAX_THREADS);
}

const struct gr_kernels *gr_take_kernels(const char *isa)
{
    const struct gr_kernels *kernels = gr_kernels_select(isa);
    if (!kernels) PyErr_Format(PyExc_ValueError, "instruction set \"%s\" is not available on this machine", isa);
    return kernels;
}

static void free_zeros(PyObject *capsule) { gr_free(PyCapsule_GetPointer(capsule, NULL)); }

PyObject *gr_python_zeros(struct gr_object *self, PyObject *args)
{
    Py_ssize_t n;
    if (!PyArg_ParseTuple(args, "n", &n) || !gr_ready(self, 0)) return NULL;
    if (n < 0) return PyErr_Format(PyExc_ValueError, "n = %zd must not be negative", n);
    void *block = gr_calloc((size_t)n + !n, 1);
    PyObject *owner = block ? PyCapsule_New(block, NULL, free_zeros) : PyErr_NoMemory();
    if (!owner) {
        gr_free(block);
        return NULL;
    }
    const npy_intp shape[1] = {n};
    PyObject *array = PyArray_SimpleNewFromData(1, shape, NPY_UINT8, block);
    if (!array) {
        Py_DECREF(owner);
        return NULL;
    }
    if (!PyArray_SetBaseObject((PyArrayObject *)array, owner)) return array;
    Py_DECREF(array);
    return NULL;
}

PyObject *gr_python_scalars(const struct gr_object *self, const struct gr_scalar *table, int n)
{
    const char *engine = gr_ready(self, 0);
    PyObject *out = engine ? PyDict_New() : NULL;
    for (int k = 0; out && k < n; k++) {
        const void *at = engine + table[k].place;
        PyObject *value =
            table[k].is_float ? PyFloat_FromDouble(*(const double *)at) : PyLong_FromLongLong(*(const int64_t *)at);
        out = gr_put(out, table[k].name, value);
    }
    return out;
}

int gr_take_scalars(PyObject *dict, const struct gr_scalar *table, int n, void *out)
{
    if (!PyDict_Check(dict)) {
        PyErr_SetString(PyExc_TypeError, "restore needs a dict of scalars");
        return -1;
    }
    for (int k = 0; k < n; k++) {
        void *at = (char *)out + table[k].place;
        PyObject *value = PyDict_GetItemString(dict, table[k].name);
        if (!value) return gr_refuse("the scalar %s is missing", table[k].name);
        if (!table[k].is_float && !PyLong_Check(value)) {
            PyErr_Format(PyExc_TypeError, "the scalar %s must be an int, not %s", table[k].name, Py_TYPE(value)->tp_name);
            return -1;
        }
        if (table[k].is_float)
            *(double *)at = PyFloat_AsDouble(value);
        else
            *(int64_t *)at = PyLong_AsLongLong(value);
        if (PyErr_Occurred()) return -1;
    }
    return 0;
}

int gr_refuse_range(const char *name, double value, double low, double high)
{
    if (value >= low && value <= high) return 0;
    return gr_refuse("%s = %.9g must be from %.4g to %.9g", name, value, low, high);
}

int gr_refuse_count(const char *name, int64_t value)
{
    const int64_t most = INT64_MAX / 4;
    if (value >= 0 && value <= most) return 0;
    return gr_refuse("%s = %lld must be from 0 to %lld", name, (long long)value, (long long)most);
}

int gr_refuse_clock(double time, double dt)
{
    if (time + dt > time) return 0;
    return gr_refuse("time = %.9g s must be one that a step of %.4g s changes", time, dt);
}

void gr_set_scalars(void *engine, const struct gr_scalar *table, int n, const void *from)
{
    for (int k = 0; k < n; k++) memcpy((char *)engine + table[k].place, (const char *)from + table[k].place, 8);
}

static PyObject *isa_of(struct gr_object *self, void *Py_UNUSED(unused))
{
    return PyUnicode_FromString(self->kernels ? self->kernels->isa : "");
}

static PyObject *refused_threads_of(struct gr_object *self, void *Py_UNUSED(unused))
{
    return PyLong_FromLong(self->refused_threads);
}

static PyGetSetDef getters[] = {
    {"isa", (getter)isa_of, NULL, "instruction set of the kernels", NULL},
    {"refused_threads", (getter)refused_threads_of, NULL, "threads that the system refused in the last advance", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

PyTypeObject *gr_make_type(PyObject *module, const char *name, const char *doc, initproc init, destructor dealloc,
                           PyMethodDef *methods)
{
    PyType_Slot slots[] = {{Py_tp_init, init},
                           {Py_tp_new, PyType_GenericNew},
                           {Py_tp_dealloc, dealloc},
                           {Py_tp_methods, methods},
                           {Py_tp_getset, getters},
                           {Py_tp_doc, (void *)doc},
                           {0, NULL}};
    PyType_Spec spec = {name, sizeof(struct gr_object), 0, Py_TPFLAGS_DEFAULT, slots};
    return (PyTypeObject *)PyType_FromModuleAndSpec(module, &spec, NULL);
}
