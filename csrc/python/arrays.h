/* What the Python rooms share: checks of NumPy arrays, and the one place where core errors become exceptions. */
#ifndef GR_PYTHON_ARRAYS_H
#define GR_PYTHON_ARRAYS_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define PY_ARRAY_UNIQUE_SYMBOL granular_core_array_api
#ifndef GR_IMPORTS_NUMPY
#define NO_IMPORT_ARRAY
#endif
#include <numpy/arrayobject.h>

#include "mpm/engine.h"

/* A C-contiguous, aligned array of `type`, of exactly `ndim` dimensions with the sizes given (-1: any), writeable
 * where asked. Never converts. Returned: borrowed pointer, or NULL with TypeError or ValueError set. */
PyArrayObject *gr_array(PyObject *object, const char *name, int type, int ndim, const npy_intp *shape, int writeable);

/* Refuse arrays that share memory. Returned: 0, or -1 with ValueError set. */
int gr_refuse_overlap(PyArrayObject *const *arrays, const char *const *names, int n);

/* Raise the exception of a core error. Always returns NULL. */
PyObject *gr_raise(int error, const struct gr_engine *engine);

/* The configuration that keyword arguments describe; it points into them and into `walls`. Returned: 0, or -1 with
 * an exception set. */
int gr_parse_config(PyObject *args, PyObject *kwargs, struct gr_config *out, struct gr_wall walls[256], const char **isa);

/* Whether the team of OpenMP died in a fork of this process, so that only one thread can run. Returned: 0, or 1 with
 * RuntimeError set. */
int gr_team_is_lost(int threads);

/* fluidity.c: functions of the module. */
PyObject *gr_python_fluidity_update(PyObject *module, PyObject *args);
PyObject *gr_python_fluidity_diffuse(PyObject *module, PyObject *args, PyObject *kwargs);

extern PyObject *gr_SimulationError;
extern PyTypeObject *gr_engine_type(PyObject *module);

#endif
