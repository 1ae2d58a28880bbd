/* What the core declares once, for Python: the numbers of schemes, enumerations, laws. */
#include <math.h>

#include "python/arrays.h"

/* Append (name, default, range, unit, doc) to a list; a default that is NaN is None. Returned: the list, or NULL. */
static PyObject *add_number(PyObject *list, const char *name, double value, const char *range, const char *unit,
                            const char *doc)
{
    if (!list) return NULL;
    PyObject *first = isnan(value) ? Py_NewRef(Py_None) : PyFloat_FromDouble(value);
    PyObject *row = first ? Py_BuildValue("sNsss", name, first, range, unit, doc) : NULL;
    if (!row || PyList_Append(list, row)) Py_CLEAR(list);
    Py_XDECREF(row);
    return list;
}

PyObject *gr_python_scheme_numbers(PyObject *module, PyObject *unused)
{
    (void)module, (void)unused;
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
    PyObject *out = Py_BuildValue("{s:O,s:O,s:O,s:O,s:O}", "scheme", scheme, "fluidity", fluidity, "particle",
                                  density[GR_DENSITY_particle], "smoothed", density[GR_DENSITY_smoothed], "cell_averaged",
                                  density[GR_DENSITY_cell_averaged]);
    Py_XDECREF(scheme), Py_XDECREF(fluidity);
    for (int k = 0; k < GR_DENSITY_COUNT; k++) Py_XDECREF(density[k]);
    return out;
}

/* One enumeration into the dict: {name: value}. Returned: the dict, or NULL. */
static PyObject *add_enumeration(PyObject *dict, const char *name, const char *const *names, const int *values, int n)
{
    PyObject *inner = dict ? PyDict_New() : NULL;
    for (int k = 0; inner && k < n; k++) {
        PyObject *value = PyLong_FromLong(values[k]);
        if (!value || PyDict_SetItemString(inner, names[k], value)) Py_CLEAR(inner);
        Py_XDECREF(value);
    }
    if (dict && (!inner || PyDict_SetItemString(dict, name, inner))) Py_CLEAR(dict);
    Py_XDECREF(inner);
    return dict;
}

PyObject *gr_python_enumerations(PyObject *module, PyObject *unused)
{
    (void)module, (void)unused;
    PyObject *out = PyDict_New();
    const char *names[16];
    int values[16], n = 0;
#define GR_ADD(name) out = add_enumeration(out, name, names, values, n), n = 0
#define GR_X(constant, text) names[n] = #text, values[n++] = constant;
    GR_BASES(GR_X);
    GR_ADD("basis");
    GR_FACES(GR_X);
    GR_ADD("face");
    GR_PARTS(GR_X);
    GR_ADD("part");
    GR_CONTACTS(GR_X);
    GR_ADD("contact");
#undef GR_X
#define GR_X(text) names[n] = #text, values[n] = n, n++;
    GR_TRANSFERS(GR_X);
    GR_ADD("transfer");
    GR_DENSITIES(GR_X);
    GR_ADD("density");
    GR_DIFFUSIONS(GR_X);
    GR_ADD("diffusion");
    GR_STENCILS(GR_X);
    GR_ADD("stencil");
#undef GR_X
#define GR_X(constant, text, value) names[n] = #text, values[n++] = constant;
    GR_CELL_FLAGS(GR_X);
    GR_ADD("cell_flag");
#undef GR_X
#undef GR_ADD
    return out;
}

PyObject *gr_python_laws(PyObject *module, PyObject *unused)
{
    (void)module, (void)unused;
    PyObject *out = PyDict_New();
    for (int k = 0; out && gr_law_at(k); k++) {
        const struct gr_law *law = gr_law_at(k);
        PyObject *rows = PyList_New(0);
        for (int q = 0; rows && q < gr_law_parameters(law); q++) {
            const struct gr_parameter_info *info = &law->parameter[q];
            PyObject *row = Py_BuildValue("sss", info->name, info->unit, info->doc);
            if (!row || PyList_Append(rows, row)) Py_CLEAR(rows);
            Py_XDECREF(row);
        }
        PyObject *entry = rows ? Py_BuildValue("sN", law->doc, rows) : NULL;
        if (!entry || PyDict_SetItemString(out, law->name, entry)) Py_CLEAR(out);
        Py_XDECREF(entry);
    }
    return out;
}
