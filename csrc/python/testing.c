/* Kernels of the laws as functions of the module, alone: for the tests, which hold them against other implementations. */
#include <math.h>

#include "python/engine_common.h"

/* ---- law_update ---- */

/* law_update(law, dim, parameters, dt, pressure_from_density, gradient, log_density, stress, shear_rate, isa,
 *            g_star=None, g=None, plastic_strain=None) */
PyObject *gr_python_law_update(PyObject *module, PyObject *args)
{
    (void)module;
    const char *name, *isa;
    int dim, eos;
    double dt, parameter[GR_LAW_MAX_PARAMETERS] = {0};
    PyObject *parameters, *objects[7] = {0, 0, 0, 0, Py_None, Py_None, Py_None};
    if (!PyArg_ParseTuple(args, "siO!diOOOOs|OOO", &name, &dim, &PyDict_Type, &parameters, &dt, &eos, &objects[0],
                          &objects[1], &objects[2], &objects[3], &isa, &objects[4], &objects[5], &objects[6]))
        return NULL;
    const int law = gr_law_index(name);
    const struct gr_kernels *kernels = gr_kernels_select(isa);
    if (law < 0 || !kernels || dim < 2 || dim > 3 || !(dt > 0) || !isfinite(dt))
        return PyErr_Format(PyExc_ValueError, "law_update: law \"%s\", dim %d, instruction set \"%s\" or dt is not valid",
                            name, dim, isa);
    for (int k = 0; k < gr_law_parameters(gr_law_at(law)); k++) {
        PyObject *value = PyDict_GetItemString(parameters, gr_law_at(law)->parameter[k].name);
        if (!value) return PyErr_Format(PyExc_ValueError, "the parameter %s is missing", gr_law_at(law)->parameter[k].name);
        parameter[k] = PyFloat_AsDouble(value);
        if (PyErr_Occurred()) return NULL;
    }
    const npy_intp blocks[3] = {-1, dim * dim, kernels->lanes};
    PyArrayObject *gradient = gr_array(objects[0], "gradient", NPY_DOUBLE, 3, blocks, 0);
    if (!gradient) return NULL;
    const npy_intp n = PyArray_DIM(gradient, 0), places = n * kernels->lanes;
    const npy_intp per_block[1] = {n}, one[1] = {places}, many[2] = {dim == 2 ? 4 : 6, places};
    PyArrayObject *arrays[7] = {gradient, gr_array(objects[1], "log_density", NPY_DOUBLE, 1, one, 0)};
    int n_arrays = 4;
    if (!arrays[1]) return NULL;
    if (!(arrays[2] = gr_array(objects[2], "stress", NPY_DOUBLE, 2, many, 1))) return NULL;
    if (!(arrays[3] = gr_array(objects[3], "shear_rate", NPY_DOUBLE, 1, one, 1))) return NULL;
    const char *names[7] = {"gradient", "log_density", "stress", "shear_rate", "g", "g_star"};
    if (objects[5] != Py_None && !(arrays[n_arrays++] = gr_array(objects[5], "g", NPY_DOUBLE, 1, one, 1))) return NULL;
    if (objects[4] != Py_None && n_arrays == 4)
        return PyErr_Format(PyExc_ValueError, "g_star is given without g, that it makes");
    if (objects[4] != Py_None && !(arrays[n_arrays++] = gr_array(objects[4], "g_star", NPY_DOUBLE, 1, per_block, 0)))
        return NULL;
    const int fluidity = n_arrays - 4;
    names[n_arrays] = "plastic_strain";
    if (objects[6] != Py_None && !(arrays[n_arrays++] = gr_array(objects[6], "plastic_strain", NPY_DOUBLE, 1, one, 1)))
        return NULL;
    if (gr_refuse_overlap(arrays, names, n_arrays)) return NULL;
    int64_t *slot = PyMem_Malloc(sizeof(int64_t) * (size_t)(n + 1));
    if (!slot) return PyErr_NoMemory();
    for (npy_intp k = 0; k < n; k++) slot[k] = k * kernels->lanes;
    struct gr_law_call call = {.n_blocks = n,
                               .slot = slot,
                               .gradient = PyArray_DATA(gradient),
                               .dt = dt,
                               .fraction = 1,
                               .pressure_from_density = eos,
                               .parameter = parameter,
                               .log_density = PyArray_DATA(arrays[1]),
                               .shear_rate = PyArray_DATA(arrays[3]),
                               .g = fluidity > 0 ? PyArray_DATA(arrays[4]) : NULL,
                               .g_star = fluidity > 1 ? PyArray_DATA(arrays[5]) : NULL,
                               .plastic_strain = objects[6] != Py_None ? PyArray_DATA(arrays[n_arrays - 1]) : NULL};
    for (int c = 0; c < (dim == 2 ? 4 : 6); c++) call.stress[c] = (double *)PyArray_DATA(arrays[2]) + c * places;
    kernels->laws[law]->update[dim - 2](&call);
    PyMem_Free(slot);
    Py_RETURN_NONE;
}

/* ---- fluidity_update ---- */

static int take_fluidity_parameters(PyObject *dict, double parameter[GR_FLUIDITY_PARAMETER_COUNT])
{
    const unsigned may_be_zero = 1u << GR_FLUIDITY_mu_s | 1u << GR_FLUIDITY_p_averaging;
    if (gr_take_parameters(dict, gr_fluidity_parameter_table, GR_FLUIDITY_PARAMETER_COUNT, may_be_zero, parameter))
        return -1;
    return gr_refuse_frictions(parameter[GR_FLUIDITY_mu_s], parameter[GR_FLUIDITY_mu_2]);
}

PyObject *gr_python_fluidity_update(PyObject *module, PyObject *args)
{
    (void)module;
    static const char *const names[] = {"mu_trial", "p", "g_star", "shear_rate", "mu", "g"};
    const double low[] = {0, 1e-60, -GR_LARGEST, 0};
    struct gr_fluidity_call call = {0};
    PyObject *parameters, *objects[6];
    const char *isa;
    if (!PyArg_ParseTuple(args, "O!dOOOOOOs:fluidity_update", &PyDict_Type, &parameters, &call.dt, &objects[0], &objects[1],
                          &objects[2], &objects[3], &objects[4], &objects[5], &isa))
        return NULL;
    const struct gr_kernels *kernels = gr_take_kernels(isa);
    if (!kernels) return NULL;
    if (take_fluidity_parameters(parameters, call.parameter) || gr_refuse_number("dt", call.dt, 0)) return NULL;
    npy_intp length[1] = {-1};
    PyArrayObject *arrays[6];
    for (int k = 0; k < 6; k++) {
        arrays[k] = gr_array(objects[k], names[k], NPY_DOUBLE, 1, length, k >= 4);
        if (!arrays[k] || (k < 4 && gr_refuse_values(names[k], arrays[k], low[k]))) return NULL;
        length[0] = PyArray_DIM(arrays[0], 0);
    }
    if (gr_refuse_overlap(arrays, names, 6)) return NULL;
    call.n = length[0];
    call.mu_trial = PyArray_DATA(arrays[0]), call.p = PyArray_DATA(arrays[1]), call.g_star = PyArray_DATA(arrays[2]);
    call.shear_rate = PyArray_DATA(arrays[3]), call.mu = PyArray_DATA(arrays[4]), call.g = PyArray_DATA(arrays[5]);
    kernels->update_fluidity(&call);
    Py_RETURN_NONE;
}

/* ---- hencky_update ---- */

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

static int take_hencky_parameters(PyObject *dict, double parameter[GR_HENCKY_PARAMETER_COUNT])
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
    const struct gr_kernels *kernels = gr_take_kernels(isa);
    if (!kernels) return NULL;
    const int flow = flow_of(name);
    if (flow < 0 || take_hencky_parameters(parameters, call.parameter) || gr_refuse_number("dt", call.dt, 0)) return NULL;
    const int dim = take_arrays(objects, &call);
    if (dim < 0) return NULL;
    Py_BEGIN_ALLOW_THREADS
    kernels->update_hencky(flow, dim, &call);
    Py_END_ALLOW_THREADS
    Py_RETURN_NONE;
}
