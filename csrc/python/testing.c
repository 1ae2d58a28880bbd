/* Kernels of the laws as functions of the module, alone: for the tests, which hold them against other implementations. */
#include <math.h>

#include "python/engine_common.h"

/* ---- law_update ---- */

PyObject *gr_python_law_update(PyObject *Py_UNUSED(module), PyObject *args)
{
    enum { GRADIENT, LOG_DENSITY, STRESS, SHEAR_RATE, G, G_STAR, PLASTIC_STRAIN, SEPARATED, BULKING, ARRAYS };
    static const char *const names[ARRAYS] = {"gradient", "log_density",    "stress",    "shear_rate", "g",
                                              "g_star",   "plastic_strain", "separated", "bulking"};
    const char *name, *isa;
    int dim, eos;
    double dt, parameter[GR_LAW_MAX_PARAMETERS] = {0};
    PyObject *parameters, *objects[ARRAYS] = {0, 0, 0, 0, Py_None, Py_None, Py_None, Py_None, Py_None};
    if (!PyArg_ParseTuple(args, "siO!diOOOOs|OOOOO", &name, &dim, &PyDict_Type, &parameters, &dt, &eos, &objects[0],
                          &objects[1], &objects[2], &objects[3], &isa, &objects[G_STAR], &objects[G],
                          &objects[PLASTIC_STRAIN], &objects[SEPARATED], &objects[BULKING]))
        return NULL;
    const int law = gr_law_index(name);
    const struct gr_kernels *kernels = gr_kernels_select(isa);
    if (law < 0 || !kernels || dim < 2 || dim > 3 || !(dt > 0) || !isfinite(dt))
        return PyErr_Format(PyExc_ValueError, "law_update: law \"%s\", dim %d, instruction set \"%s\" or dt is not valid",
                            name, dim, isa);
    for (int k = 0; k < gr_law_parameters(gr_law_at(law)); k++)
        if (gr_take_float(parameters, "parameter", gr_law_at(law)->parameter[k].name, &parameter[k])) return NULL;
    const npy_intp blocks[3] = {-1, dim * dim, kernels->lanes};
    PyArrayObject *arrays[ARRAYS] = {gr_array(objects[GRADIENT], "gradient", NPY_DOUBLE, 3, blocks, 0)};
    if (!arrays[GRADIENT]) return NULL;
    const npy_intp n = PyArray_DIM(arrays[GRADIENT], 0), places = n * kernels->lanes,
                   of_stress[2] = {dim == 2 ? 4 : 6, places};
    for (int k = LOG_DENSITY; k < ARRAYS; k++) {
        const npy_intp *shape = k == STRESS ? of_stress : &places;
        if (k >= G && objects[k] == Py_None) continue;
        const int changes = (k >= STRESS && k != G_STAR) || (k == LOG_DENSITY && gr_law_at(law)->dilates);
        arrays[k] = gr_array(objects[k], names[k], NPY_DOUBLE, k == STRESS ? 2 : 1, shape, changes);
        if (!arrays[k]) return NULL;
    }
    if (gr_law_at(law)->dilates && !arrays[BULKING])
        return PyErr_Format(PyExc_ValueError, "bulking is not given to law \"%s\", that changes it", name);
    if (arrays[G_STAR] && !arrays[G]) return PyErr_Format(PyExc_ValueError, "g_star is given without g, that it makes");
    if (gr_refuse_overlap(arrays, names, ARRAYS)) return NULL;
    int64_t *slot = PyMem_Malloc(sizeof(int64_t) * (size_t)(n + 1));
    if (!slot) return PyErr_NoMemory();
    for (npy_intp k = 0; k < n; k++) slot[k] = k * kernels->lanes;
    struct gr_law_call call = {.n_blocks = n,
                               .slot = slot,
                               .gradient = PyArray_DATA(arrays[GRADIENT]),
                               .dt = dt,
                               .fraction = 1,
                               .pressure_from_density = eos,
                               .parameter = parameter,
                               .log_density = PyArray_DATA(arrays[LOG_DENSITY]),
                               .shear_rate = PyArray_DATA(arrays[SHEAR_RATE]),
                               .g = arrays[G] ? PyArray_DATA(arrays[G]) : NULL,
                               .g_star = arrays[G_STAR] ? PyArray_DATA(arrays[G_STAR]) : NULL,
                               .plastic_strain = arrays[PLASTIC_STRAIN] ? PyArray_DATA(arrays[PLASTIC_STRAIN]) : NULL,
                               .separated = arrays[SEPARATED] ? PyArray_DATA(arrays[SEPARATED]) : NULL,
                               .bulking = arrays[BULKING] ? PyArray_DATA(arrays[BULKING]) : NULL};
    for (int c = 0; c < of_stress[0]; c++) call.stress[c] = (double *)PyArray_DATA(arrays[STRESS]) + c * places;
    kernels->laws[law]->update[dim - 2](&call);
    PyMem_Free(slot);
    Py_RETURN_NONE;
}

static int refuse_frictions(double mu_s, double mu_2)
{
    return mu_2 > mu_s ? 0 : gr_refuse("mu_2 = %.9g must exceed mu_s = %.9g", mu_2, mu_s);
}

/* ---- fluidity_update ---- */

PyObject *gr_python_fluidity_update(PyObject *Py_UNUSED(module), PyObject *args)
{
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
    const unsigned may_be_zero = 1u << GR_FLUIDITY_mu_s | 1u << GR_FLUIDITY_p_averaging;
    if (gr_take_parameters(parameters, gr_fluidity_parameter_table, GR_FLUIDITY_PARAMETER_COUNT, may_be_zero,
                           call.parameter) ||
        refuse_frictions(call.parameter[GR_FLUIDITY_mu_s], call.parameter[GR_FLUIDITY_mu_2]) ||
        gr_refuse_number("dt", call.dt, 0))
        return NULL;
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

enum { GRADIENT, LOG_DENSITY, STRESS, G, SHEAR_RATE, ARRAYS };

/* Arrays that fit each other; the gradient has the dimension. Returned: it, or -1. */
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
        if (!dim) return gr_refuse("axis 0 of gradient has length %zd, but 4 or 9 is needed", PyArray_DIM(arrays[0], 0));
        shape[1] = PyArray_DIM(arrays[0], 1);
    }
    if (gr_refuse_overlap(arrays, names, ARRAYS)) return -1;
    call->n = shape[1];
    for (int i = 0; i < dim * dim; i++) call->gradient[i] = row[GRADIENT] + i * call->n;
    for (int i = 0; i < (dim == 2 ? 4 : 6); i++) call->stress[i] = row[STRESS] + i * call->n;
    call->log_density = row[LOG_DENSITY], call->g = row[G], call->shear_rate = row[SHEAR_RATE];
    return dim;
}

PyObject *gr_python_hencky_update(PyObject *Py_UNUSED(module), PyObject *args)
{
    struct gr_hencky_call call = {0};
    PyObject *parameters, *objects[ARRAYS];
    const char *name, *isa;
    if (!PyArg_ParseTuple(args, "sO!dOOOOOs:hencky_update", &name, &PyDict_Type, &parameters, &call.dt, &objects[0],
                          &objects[1], &objects[2], &objects[3], &objects[4], &isa))
        return NULL;
    const struct gr_kernels *kernels = gr_take_kernels(isa);
    if (!kernels) return NULL;
    const int flow = gr_take_index("flow", name, gr_hencky_flow_names, GR_HENCKY_FLOW_COUNT);
    const unsigned may_be_zero =
        1u << GR_HENCKY_P_reconnect_fluidity | 1u << GR_HENCKY_P_mu_s | 1u << GR_HENCKY_P_p_averaging;
    if (flow < 0 ||
        gr_take_parameters(parameters, gr_hencky_parameter_table, GR_HENCKY_PARAMETER_COUNT, may_be_zero, call.parameter) ||
        refuse_frictions(call.parameter[GR_HENCKY_P_mu_s], call.parameter[GR_HENCKY_P_mu_2]) ||
        gr_refuse_number("dt", call.dt, 0))
        return NULL;
    const int dim = take_arrays(objects, &call);
    if (dim < 0) return NULL;
    Py_BEGIN_ALLOW_THREADS
    kernels->update_hencky(flow, dim, &call);
    Py_END_ALLOW_THREADS
    Py_RETURN_NONE;
}
