/* Inlets of an engine (mpm/inflow.h) and their state. */
#include "mpm/inflow.h"

#include "python/arrays.h"

PyObject *gr_python_add_inlet(struct gr_engine *e, PyObject *args)
{
    const npy_intp shape[2] = {-1, e->n_components};
    struct gr_inlet inlet = {0};
    PyObject *records;
    if (!PyArg_ParseTuple(args, "Oi(ddd)dddp:add_inlet", &records, &inlet.axis, &inlet.velocity[0], &inlet.velocity[1],
                          &inlet.velocity[2], &inlet.spacing, &inlet.begin, &inlet.end, &inlet.yields))
        return NULL;
    PyArrayObject *array = gr_array(records, "records", NPY_DOUBLE, 2, shape, 0);
    if (!array) return NULL;
    inlet.n_sites = PyArray_DIM(array, 0);
    inlet.record = PyArray_DATA(array);
    const int error = gr_inflow_add(e, &inlet);
    if (error) return gr_raise(error, NULL);
    Py_RETURN_NONE;
}

PyObject *gr_python_inflow(const struct gr_engine *e)
{
    const npy_intp shape[1] = {e->inflow ? gr_inflow_size(e->inflow) : 0};
    PyObject *array = PyArray_SimpleNew(1, shape, NPY_INT64);
    if (array && e->inflow) gr_inflow_state(e->inflow, PyArray_DATA((PyArrayObject *)array));
    return array;
}

PyObject *gr_python_restore_inflow(struct gr_engine *e, PyObject *object)
{
    const npy_intp shape[1] = {e->inflow ? gr_inflow_size(e->inflow) : 0};
    PyArrayObject *array = gr_array(object, "inflow", NPY_INT64, 1, shape, 0);
    if (!array) return NULL;
    if (e->inflow && gr_inflow_restore(e->inflow, PyArray_DATA(array)))
        return PyErr_Format(PyExc_ValueError, "inflow must hold an id of at least 0, and for each inlet as many points that "
                                              "entered, wait or were missed as were due");
    Py_RETURN_NONE;
}
