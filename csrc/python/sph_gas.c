/* The gas of SPH, from Python. */
#include <math.h>

#include "python/arrays.h"
#include "sph/sph.h"

static const struct gr_parameter_info gas_parameters[GR_SPH_GAS_PARAMETER_COUNT] = {
#define GR_X(name, zero, unit, doc) {#name, unit, doc},
    GR_SPH_GAS_PARAMETERS(GR_X)
#undef GR_X
};

static const unsigned gas_may_be_zero = 0
#define GR_X(name, zero, unit, doc) | (unsigned)zero << GR_SPH_GAS_P_##name
    GR_SPH_GAS_PARAMETERS(GR_X)
#undef GR_X
    ;

int gr_take_gas(struct gr_sph *s, PyObject *object)
{
    double parameter[GR_SPH_GAS_PARAMETER_COUNT];
    struct gr_sph_jet jets[GR_SPH_MAX_JETS] = {{{0}, {0}, {0}}};
    PyObject *parameters, *rows;
    const npy_intp shape[2] = {-1, 3 * s->config.dim};
    if (object == Py_None) return 0;
    if (!PyTuple_Check(object) || !PyArg_ParseTuple(object, "O!O:gas", &PyDict_Type, &parameters, &rows)) {
        if (!PyErr_Occurred()) PyErr_SetString(PyExc_TypeError, "gas must be None or a tuple (parameters, jets)");
        return -1;
    }
    PyArrayObject *array = gr_array(rows, "jets", NPY_DOUBLE, 2, shape, 0);
    if (!array || gr_refuse_values("jets", array, -GR_LARGEST) ||
        gr_take_parameters(parameters, gas_parameters, GR_SPH_GAS_PARAMETER_COUNT, gas_may_be_zero, parameter))
        return -1;
    const int dim = s->config.dim, n = (int)PyArray_DIM(array, 0);
    if (PyArray_DIM(array, 0) > GR_SPH_MAX_JETS) {
        PyErr_Format(PyExc_ValueError, "%zd jets must be at most %d", (Py_ssize_t)PyArray_DIM(array, 0), GR_SPH_MAX_JETS);
        return -1;
    }
    const double *from = PyArray_DATA(array);
    for (int k = 0; k < n; k++, from += 3 * dim)
        for (int d = 0; d < dim; d++)
            jets[k].lower[d] = from[d], jets[k].upper[d] = from[dim + d], jets[k].velocity[d] = from[2 * dim + d];
    const int error = gr_sph_take_gas(s, parameter, n, jets);
    if (error) gr_raise(error, NULL);
    return error ? -1 : 0;
}

int gr_refuse_gas_rows(const struct gr_sph *s, Py_ssize_t walls_end, Py_ssize_t first, Py_ssize_t n, Py_ssize_t capacity)
{
    if (!s->gas && !first && !n) return 0;
    if (s->gas && n >= 0 && first >= walls_end + GR_LANES && first <= capacity && n <= capacity - first - GR_LANES) return 0;
    PyErr_Format(PyExc_ValueError, "%zd points of gas from row %zd on do not fit %s of %zd places with %d spare ones", n,
                 first, s->gas ? "buffers" : "a scene without gas, nor buffers", capacity, GR_LANES);
    return -1;
}
