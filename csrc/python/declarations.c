/* Declarations of the core for Python: the numbers of schemes, enumerations, laws. */
#include <math.h>

#include "kernels.h"
#include "python/arrays.h"

/* Append (name, default, range, unit, doc) to a list; a default that is NaN is None. Returned: the list, or NULL. */
static PyObject *add_number(PyObject *list, const char *name, double value, const char *range, const char *unit,
                            const char *doc)
{
    PyObject *first = isnan(value) ? Py_NewRef(Py_None) : PyFloat_FromDouble(value);
    return gr_append(list, first ? Py_BuildValue("sNsss", name, first, range, unit, doc) : NULL);
}

PyObject *gr_python_scheme_numbers(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(unused))
{
    static const char *const densities[GR_DENSITY_COUNT] = {
#define GR_X(name) #name,
        GR_DENSITIES(GR_X)
#undef GR_X
    };
    PyObject *scheme = PyList_New(0), *fluidity = PyList_New(0), *density[GR_DENSITY_COUNT];
#define GR_X(name, value, range, unit, doc) scheme = add_number(scheme, #name, value, range, unit, doc);
    GR_SCHEME(GR_X)
#undef GR_X
#define GR_X(name, value, range, unit, doc) fluidity = add_number(fluidity, #name, value, range, unit, doc);
    GR_FLUIDITY_SCHEME(GR_X)
#undef GR_X
    for (int k = 0; k < GR_DENSITY_COUNT; k++) density[k] = PyList_New(0);
#define GR_X(name, smoothed, averaged, particle, range, unit, doc)                                                        \
    const double name[] = {                                                                                               \
        [GR_DENSITY_particle] = (particle), [GR_DENSITY_smoothed] = (smoothed), [GR_DENSITY_cell_averaged] = (averaged)}; \
    for (int k = 0; k < GR_DENSITY_COUNT; k++)                                                                            \
        if (!isnan(name[k])) density[k] = add_number(density[k], #name, name[k], range, unit, doc);
    GR_DENSITY_SCHEME(GR_X)
#undef GR_X
    PyObject *out = gr_put(gr_put(PyDict_New(), "scheme", scheme), "fluidity", fluidity);
    for (int k = 0; k < GR_DENSITY_COUNT; k++) out = gr_put(out, densities[k], density[k]);
    return out;
}

PyObject *gr_python_material_numbers(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(unused))
{
    PyObject *out = PyDict_New();
#define GR_X(name, least, unit, doc) out = gr_put(out, #name, Py_BuildValue("ss", unit, doc));
    GR_MATERIAL(GR_X)
#undef GR_X
    return out;
}

/* One enumeration into the dict: {name: value}. Returned: the dict, or NULL. */
static PyObject *add_enumeration(PyObject *dict, const char *name, const char *const *names, const int *values, int n)
{
    PyObject *inner = PyDict_New();
    for (int k = 0; inner && k < n; k++) inner = gr_put(inner, names[k], PyLong_FromLong(values[k]));
    return gr_put(dict, name, inner);
}

PyObject *gr_python_enumerations(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(unused))
{
    PyObject *out = PyDict_New();
    const char *names[16];
    int values[16], n;
#define GR_ADD(name, list) \
    n = 0;                 \
    list(GR_X) out = add_enumeration(out, name, names, values, n);
#define GR_X(constant, text) names[n] = #text, values[n++] = constant;
    GR_ADD("basis", GR_BASES)
    GR_ADD("face", GR_FACES)
    GR_ADD("part", GR_PARTS)
    GR_ADD("contact", GR_CONTACTS)
#undef GR_X
#define GR_X(text) names[n] = #text, values[n] = n, n++;
    GR_ADD("transfer", GR_TRANSFERS)
    GR_ADD("density", GR_DENSITIES)
    GR_ADD("diffusion", GR_DIFFUSIONS)
    GR_ADD("stencil", GR_STENCILS)
#undef GR_X
#define GR_X(constant, text, value) names[n] = #text, values[n++] = constant;
    GR_ADD("cell_flag", GR_CELL_FLAGS)
#undef GR_X
#undef GR_ADD
    return out;
}

PyObject *gr_python_laws(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(unused))
{
    PyObject *out = PyDict_New();
    for (int k = 0; out && gr_law_at(k); k++) {
        const struct gr_law *law = gr_law_at(k);
        PyObject *rows = PyList_New(0);
        for (int q = 0; rows && q < gr_law_parameters(law); q++) {
            const struct gr_parameter_info *info = &law->parameter[q];
            rows = gr_append(rows, Py_BuildValue("sss", info->name, info->unit, info->doc));
        }
        out = gr_put(out, law->name,
                     rows ? Py_BuildValue("sNN", law->doc, rows, PyBool_FromLong(gr_single_has_law(k))) : NULL);
    }
    return out;
}
