#include "python/arrays.h"

#include <math.h>

PyObject *gr_SimulationError;

static int refuse_layout(PyArrayObject *array, const char *name, int ndim, const npy_intp *shape, int writeable)
{
    if (!PyArray_IS_C_CONTIGUOUS(array) || !PyArray_ISALIGNED(array))
        return gr_refuse("%s must be C-contiguous and aligned", name);
    if (writeable && !PyArray_ISWRITEABLE(array)) return gr_refuse("%s is read-only, but the core writes to it", name);
    if (PyArray_NDIM(array) != ndim)
        return gr_refuse("%s has %d dimensions, but %d are needed", name, PyArray_NDIM(array), ndim);
    for (int d = 0; d < ndim; d++)
        if (shape[d] >= 0 && PyArray_DIM(array, d) != shape[d])
            return gr_refuse("axis %d of %s has length %zd, but %zd is needed", d, name, PyArray_DIM(array, d), shape[d]);
    return 0;
}

PyArrayObject *gr_array(PyObject *object, const char *name, int type, int ndim, const npy_intp *shape, int writeable)
{
    if (!PyArray_CheckExact(object)) {
        PyErr_Format(PyExc_TypeError, "%s must be a numpy.ndarray, not %s", name, Py_TYPE(object)->tp_name);
        return NULL;
    }
    PyArrayObject *array = (PyArrayObject *)object;
    if (PyArray_TYPE(array) != type || !PyArray_ISNOTSWAPPED(array)) {
        PyArray_Descr *wanted = PyArray_DescrFromType(type);
        PyErr_Format(PyExc_TypeError, "%s has dtype %R, but %R is needed (arrays are borrowed, never converted)", name,
                     (PyObject *)PyArray_DESCR(array), (PyObject *)wanted);
        Py_XDECREF(wanted);
        return NULL;
    }
    return refuse_layout(array, name, ndim, shape, writeable) ? NULL : array;
}

int gr_refuse_overlap(PyArrayObject *const *arrays, const char *const *names, int n)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i; j++) {
            if (!arrays[i] || !arrays[j]) continue;
            const char *a = PyArray_BYTES(arrays[i]), *b = PyArray_BYTES(arrays[j]);
            if (a < b + PyArray_NBYTES(arrays[j]) && b < a + PyArray_NBYTES(arrays[i]))
                return gr_refuse("%s and %s share memory", names[j], names[i]);
        }
    return 0;
}

int gr_refuse(const char *format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    PyErr_Format(PyExc_ValueError, "%s", text);
    return -1;
}

int gr_refuse_row(const char *table, PyObject *row)
{
    if (!PyTuple_Check(row)) PyErr_Format(PyExc_TypeError, "each row of %s must be a tuple", table);
    return PyTuple_Check(row) ? 0 : -1;
}

int gr_refuse_number(const char *name, double value, int may_be_zero)
{
    if (isfinite(value) && (value > 0 || (may_be_zero && value == 0))) return 0;
    return gr_refuse("%s = %.9g must be %s and finite", name, value, may_be_zero ? "zero or positive" : "positive");
}

int gr_refuse_values(const char *name, PyArrayObject *array, double low)
{
    const double *value = PyArray_DATA(array), high = GR_LARGEST;
    const npy_intp n = PyArray_SIZE(array);
    int64_t right = 0; /* counted without a branch: a compiler takes several numbers at once */
    for (npy_intp k = 0; k < n; k++) right += (value[k] >= low) & (value[k] <= high);
    if (right == n) return 0;
    npy_intp k = 0;
    while (value[k] >= low && value[k] <= high) k++;
    return gr_refuse("%s[%lld] = %.9g is outside the range %g to %g", name, (long long)k, value[k], low, high);
}

int gr_take_float(PyObject *dict, const char *kind, const char *name, double *out)
{
    PyObject *value = PyDict_GetItemString(dict, name);
    if (!value) return gr_refuse("the %s %s is missing", kind, name);
    *out = PyFloat_AsDouble(value);
    return PyErr_Occurred() ? -1 : 0;
}

int gr_take_parameters(PyObject *dict, const struct gr_parameter_info *table, int n, unsigned may_be_zero, double *parameter)
{
    for (int k = 0; k < n; k++)
        if (gr_take_float(dict, "parameter", table[k].name, &parameter[k]) ||
            gr_refuse_number(table[k].name, parameter[k], may_be_zero >> k & 1u))
            return -1;
    return 0;
}

int gr_take_index(const char *kind, const char *name, const char *const *names, int n)
{
    char list[256] = "";
    for (int k = 0; k < n; k++) {
        if (!strcmp(names[k], name)) return k;
        snprintf(list + strlen(list), sizeof list - strlen(list), " %s", names[k]);
    }
    return gr_refuse("there is no %s \"%s\": it must be one of%s", kind, name, list);
}

PyObject *gr_append(PyObject *list, PyObject *row)
{
    if (list && (!row || PyList_Append(list, row))) Py_CLEAR(list);
    Py_XDECREF(row);
    return list;
}

PyObject *gr_put(PyObject *dict, const char *name, PyObject *value)
{
    if (dict && (!value || PyDict_SetItemString(dict, name, value))) Py_CLEAR(dict);
    Py_XDECREF(value);
    return dict;
}

PyObject *gr_raise_at(int error, const struct gr_failed_at *at)
{
    const char *message = gr_error_message(error);
    char text[256];
    if (error == GR_ERR_DEVICE && at->words)
        snprintf(text, sizeof text, "%s in step %lld (t = %.9g s): %s", message, (long long)at->step, at->time, at->words);
    else if (error == GR_ERR_DIVERGED || error == GR_ERR_LAW || error == GR_ERR_ELSEWHERE)
        snprintf(text, sizeof text, "%s in step %lld (t = %.9g s)", message, (long long)at->step, at->time);
    else
        snprintf(text, sizeof text, "%s: point %lld at (%.9g, %.9g%s%.9g) in step %lld (t = %.9g s)", message,
                 (long long)at->id, at->x, at->y, at->dim == 3 ? ", " : "; z = ", at->z, (long long)at->step, at->time);
    if (error == GR_ERR_OUTSIDE) {
        PyErr_SetString(PyExc_ValueError, text);
        return NULL;
    }
    PyObject *exception = PyObject_CallFunction(gr_SimulationError, "s", text);
    PyObject *point = PyLong_FromLongLong(at->id), *step = PyLong_FromLongLong(at->step);
    if (exception && point && step && !PyObject_SetAttrString(exception, "point", point) &&
        !PyObject_SetAttrString(exception, "step", step))
        PyErr_SetObject(gr_SimulationError, exception);
    Py_XDECREF(exception);
    Py_XDECREF(point);
    Py_XDECREF(step);
    return NULL;
}

PyObject *gr_raise(int error, const struct gr_engine *engine)
{
    enum { NONE, MEMORY, INTERNAL, SIMULATION, VALUE };
    static const int kinds[] = {
#define GR_X(code, exception, message) exception,
        GR_ERRORS(GR_X)
#undef GR_X
    };
    const int kind = error > 0 && error < GR_ERROR_COUNT ? kinds[error] : INTERNAL;
    if (kind == MEMORY) return PyErr_NoMemory();
    if (engine && (kind == SIMULATION || error == GR_ERR_OUTSIDE)) {
        const struct gr_failed_at failure = {
            engine->failure.id,   engine->failure.step, engine->config.dim, engine->failure.x[0],
            engine->failure.x[1], engine->failure.x[2], engine->clock.time, engine->device ? engine->device->failure : NULL};
        return gr_raise_at(error, &failure);
    }
    PyErr_SetString(kind == VALUE ? PyExc_ValueError : PyExc_RuntimeError, gr_error_message(error));
    return NULL;
}
