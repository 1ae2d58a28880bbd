#include "python/engine_common.h"

#include <math.h>
#include <unistd.h>

int gr_refuse_state(int exists, int is_bound, int busy)
{
    if (exists && is_bound && !busy) return 0;
    PyErr_SetString(PyExc_RuntimeError, exists && is_bound ? "the engine is running in another thread"
                                                           : "the engine has no points: call bind first");
    return -1;
}

int gr_take_run(PyObject *args, long long *max_steps, double *until, int *threads)
{
    if (!PyArg_ParseTuple(args, "Ldi", max_steps, until, threads)) return -1;
    if (*max_steps >= 0 && !isnan(*until) && *threads >= 1 && *threads <= GR_MAX_THREADS)
        return gr_team_is_lost(*threads) ? -1 : 0;
    PyErr_Format(PyExc_ValueError, "max_steps must not be negative, until not NaN, threads 1 to %d", GR_MAX_THREADS);
    return -1;
}

/* A team of gcc's OpenMP does not live on in a forked child, which would wait for it for ever. The process in
 * which a team first ran is all that is kept beyond an engine. */
int gr_team_is_lost(int threads)
{
#if defined(_OPENMP) && !defined(__clang__)
    static pid_t home;
    if (threads == 1) return 0;
    if (!home) home = getpid();
    if (home == getpid()) return 0;
    PyErr_Format(PyExc_RuntimeError,
                 "threads = %d must be 1 in a process that was forked after a simulation ran with threads; or begin "
                 "processes by multiprocessing's \"spawn\" or \"forkserver\"",
                 threads);
    return 1;
#else
    (void)threads;
    return 0;
#endif
}

const struct gr_kernels *gr_take_kernels(const char *isa)
{
    const struct gr_kernels *kernels = gr_kernels_select(isa);
    if (!kernels) PyErr_Format(PyExc_ValueError, "instruction set \"%s\" is not available on this machine", isa);
    return kernels;
}

PyObject *gr_add_field(PyObject *list, const struct gr_field_info *info, int components)
{
    PyObject *row = list ? Py_BuildValue("siss", info->name, components, info->unit, info->doc) : NULL;
    if (!row || PyList_Append(list, row)) Py_CLEAR(list);
    Py_XDECREF(row);
    return list;
}

static PyObject *scalar_named(PyObject *dict, const char *name)
{
    PyObject *value = PyDict_GetItemString(dict, name);
    if (!value) PyErr_Format(PyExc_ValueError, "the scalar %s is missing", name);
    return value;
}

int gr_take_float(PyObject *dict, const char *name, double *out)
{
    PyObject *value = scalar_named(dict, name);
    if (value) *out = PyFloat_AsDouble(value);
    return value && !PyErr_Occurred() ? 0 : -1;
}

int gr_take_integer(PyObject *dict, const char *name, int64_t *out)
{
    PyObject *value = scalar_named(dict, name);
    if (value) *out = PyLong_AsLongLong(value);
    return value && !PyErr_Occurred() ? 0 : -1;
}

static int put(PyObject *dict, const char *name, PyObject *value)
{
    const int error = !value || PyDict_SetItemString(dict, name, value);
    Py_XDECREF(value);
    return error ? -1 : 0;
}

int gr_put_float(PyObject *dict, const char *name, double value) { return put(dict, name, PyFloat_FromDouble(value)); }

int gr_put_integer(PyObject *dict, const char *name, int64_t value) { return put(dict, name, PyLong_FromLongLong(value)); }
