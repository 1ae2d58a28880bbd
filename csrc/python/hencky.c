/* The kernel of the finite-strain law as a function of the module. */
#include "python/arrays.h"

static int flow_of(const char *name)
{
    for (int k = 0; k < GR_HENCKY_FLOW_COUNT; k++)
        if (!strcmp(gr_hencky_flow_names[k], name)) return k;
    PyErr_Format(PyExc_ValueError,
                 "there is no flow \"%s\": it must be one of"
#define GR_X(name, doc) " " #name
                 GR_HENCKY_FLOWS(GR_X)
#undef GR_X
                     ,
                 name);
    return -1;
}

static int take_parameters(PyObject *dict, double parameter[GR_HENCKY_PARAMETER_COUNT])
{
    const unsigned may_be_zero =
        1u << GR_HENCKY_P_reconnect_fluidity | 1u << GR_HENCKY_P_mu_s | 1u << GR_HENCKY_P_p_averaging;
    if (gr_take_parameters(dict, gr_hencky_parameter_table, GR_HENCKY_PARAMETER_COUNT, may_be_zero, parameter)) return -1;
    return gr_refuse_frictions(parameter[GR_HENCKY_P_mu_s], parameter[GR_HENCKY_P_mu_2]);
}

enum { GRADIENT, LOG_DENSITY, STRESS, G, SHEAR_RATE, ARRAYS };

/* Arrays that fit each other; the dimension is told by the gradient. Returned: it, or -1. */
static int take_arrays(PyObject *const objects[ARRAYS], struct gr_hencky_call *call)
{
    static const char *const names[ARRAYS] = {"gradient", "log_density", "stress", "g", "shear_rate"};
    static const double low[ARRAYS] = {-GR_LARGEST, -GR_LARGEST, -GR_LARGEST, -GR_LARGEST, 0};
    npy_intp shape[2] = {-1, -1};
    PyArrayObject *arrays[ARRAYS];
    double *row[ARRAYS];
    int dim = 0;
    for (int k = 0; k < ARRAYS; k++) {
        const int matrix = k == GRADIENT || k == STRESS;
        if (k == STRESS) shape[0] = dim == 2 ? 4 : 6;
        arrays[k] = gr_array(objects[k], names[k], NPY_DOUBLE, matrix ? 2 : 1, matrix ? shape : shape + 1, k >= STRESS);
        if (!arrays[k] || gr_refuse_values(names[k], arrays[k], low[k])) return -1;
        row[k] = PyArray_DATA(arrays[k]);
        if (k) continue;
        dim = PyArray_DIM(arrays[0], 0) == 4 ? 2 : PyArray_DIM(arrays[0], 0) == 9 ? 3 : 0;
        if (!dim) {
            PyErr_Format(PyExc_ValueError, "axis 0 of gradient has length %zd, but 4 or 9 is needed",
                         (Py_ssize_t)PyArray_DIM(arrays[0], 0));
            return -1;
        }
        shape[1] = PyArray_DIM(arrays[0], 1);
    }
    if (gr_refuse_overlap(arrays, names, ARRAYS)) return -1;
    call->n = shape[1];
    for (int i = 0; i < dim * dim; i++) call->gradient[i] = row[GRADIENT] + i * call->n;
    for (int i = 0; i < (dim == 2 ? 4 : 6); i++) call->stress[i] = row[STRESS] + i * call->n;
    call->log_density = row[LOG_DENSITY], call->g = row[G], call->shear_rate = row[SHEAR_RATE];
    return dim;
}

PyObject *gr_python_hencky_update(PyObject *module, PyObject *args)
{
    (void)module;
    struct gr_hencky_call call = {0};
    PyObject *parameters, *objects[ARRAYS];
    const char *name, *isa;
    if (!PyArg_ParseTuple(args, "sO!dOOOOOs:hencky_update", &name, &PyDict_Type, &parameters, &call.dt, &objects[0],
                          &objects[1], &objects[2], &objects[3], &objects[4], &isa))
        return NULL;
    const struct gr_kernels *kernels = gr_kernels_select(isa);
    if (!kernels) return PyErr_Format(PyExc_ValueError, "instruction set \"%s\" is not available on this machine", isa);
    const int flow = flow_of(name);
    if (flow < 0 || take_parameters(parameters, call.parameter) || gr_refuse_number("dt", call.dt, 0)) return NULL;
    const int dim = take_arrays(objects, &call);
    if (dim < 0) return NULL;
    Py_BEGIN_ALLOW_THREADS
    kernels->update_hencky(flow, dim, &call);
    Py_END_ALLOW_THREADS
    Py_RETURN_NONE;
}
