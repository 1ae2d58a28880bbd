/* Inlets of the engines (core/inlets.h) and their state. */
#include "mpm/inflow.h"
#include "python/arrays.h"
#include "sph/inflow.h"
#include "sph/sph.h"

/* The records of an inlet, with the components of an engine. Returned: 0, or -1 with an exception set. */
static int take_records(PyObject *records, int n_components, struct gr_inlet *inlet)
{
    const npy_intp shape[2] = {-1, n_components};
    PyArrayObject *array = gr_array(records, "records", NPY_DOUBLE, 2, shape, 0);
    if (!array) return -1;
    inlet->n_sites = PyArray_DIM(array, 0);
    inlet->record = PyArray_DATA(array);
    return 0;
}

PyObject *gr_python_add_inlet(struct gr_engine *e, PyObject *args)
{
    struct gr_inlet inlet = {0};
    PyObject *records;
    if (!PyArg_ParseTuple(args, "Oi(ddd)dddp:add_inlet", &records, &inlet.axis, &inlet.velocity[0], &inlet.velocity[1],
                          &inlet.velocity[2], &inlet.spacing, &inlet.begin, &inlet.end, &inlet.yields) ||
        take_records(records, e->points.n_components, &inlet))
        return NULL;
    const int error = gr_inflow_add(e, &inlet);
    if (error) return gr_raise(error, NULL);
    Py_RETURN_NONE;
}

PyObject *gr_python_add_sph_inlet(struct gr_sph *s, PyObject *args)
{
    struct gr_inlet inlet = {0};
    struct gr_sph_box box = {0};
    PyObject *records;
    if (!PyArg_ParseTuple(args, "Oi(ddd)dddp(ddd)(ddd):add_inlet", &records, &inlet.axis, &inlet.velocity[0],
                          &inlet.velocity[1], &inlet.velocity[2], &inlet.spacing, &inlet.begin, &inlet.end, &box.is_gas,
                          &box.lower[0], &box.lower[1], &box.lower[2], &box.upper[0], &box.upper[1], &box.upper[2]) ||
        take_records(records, gr_sph_row_count(s), &inlet))
        return NULL;
    const int error = gr_sph_add_inlet(s, &inlet, &box);
    if (error) return gr_raise(error, NULL);
    Py_RETURN_NONE;
}

PyObject *gr_python_inflow(const struct gr_inlets *inlets)
{
    const npy_intp shape[1] = {inlets ? gr_inlets_size(inlets) : 0};
    PyObject *array = PyArray_SimpleNew(1, shape, NPY_INT64);
    if (array && inlets) gr_inlets_state(inlets, PyArray_DATA((PyArrayObject *)array));
    return array;
}

PyObject *gr_python_restore_inflow(struct gr_inlets *inlets, PyObject *object)
{
    const npy_intp shape[1] = {inlets ? gr_inlets_size(inlets) : 0};
    PyArrayObject *array = gr_array(object, "inflow", NPY_INT64, 1, shape, 0);
    if (!array) return NULL;
    if (inlets && gr_inlets_restore(inlets, PyArray_DATA(array)))
        return PyErr_Format(PyExc_ValueError, "inflow must hold an id of at least 0, and for each inlet as many points that "
                                              "entered, wait or were missed as were due");
    Py_RETURN_NONE;
}

enum { LOADS = 7 }; /* numbers of a box: force, impulse, work */

PyObject *gr_python_inlet_loads(const struct gr_sph *s)
{
    const npy_intp shape[2] = {s->inflow && s->inflow->inlets ? s->inflow->inlets->n_inlets : 0, LOADS};
    PyObject *array = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
    double *out = array ? PyArray_DATA((PyArrayObject *)array) : NULL;
    for (int k = 0; out && k < shape[0]; k++, out += LOADS) {
        const struct gr_sph_box *box = &s->inflow->box[k];
        memcpy(out, box->force, sizeof box->force), memcpy(out + 3, box->impulse, sizeof box->impulse), out[6] = box->work;
    }
    return array;
}

PyObject *gr_python_restore_inlet_loads(struct gr_sph *s, PyObject *object)
{
    const npy_intp shape[2] = {s->inflow && s->inflow->inlets ? s->inflow->inlets->n_inlets : 0, LOADS};
    PyArrayObject *array = gr_array(object, "loads", NPY_DOUBLE, 2, shape, 0);
    if (!array || gr_refuse_values("loads", array, -GR_LARGEST)) return NULL;
    const double *from = PyArray_DATA(array);
    for (int k = 0; k < shape[0]; k++, from += LOADS) {
        struct gr_sph_box *box = &s->inflow->box[k];
        memcpy(box->force, from, sizeof box->force), memcpy(box->impulse, from + 3, sizeof box->impulse);
        box->work = from[6];
    }
    Py_RETURN_NONE;
}
