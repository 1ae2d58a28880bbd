/* The extension module granular._core. */
#define GR_IMPORTS_NUMPY
#include <math.h>

#include "python/arrays.h"

#ifdef _OPENMP
#define GR_OPENMP 1
#else
#define GR_OPENMP 0
#endif
#ifndef GR_FLAGS
#define GR_FLAGS ""
#endif

/* law_update(law, dim, parameters, dt, pressure_from_density, gradient, log_density, stress, shear_rate, isa,
 *            g_star=None, g=None, plastic_strain=None) */
static PyObject *law_update(PyObject *module, PyObject *args)
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
    kernels->update_law(law, dim, &call);
    PyMem_Free(slot);
    Py_RETURN_NONE;
}

/* build_info(isa="") -> what the build is, and the kernels that this name selects. */
static PyObject *build_info(PyObject *module, PyObject *args)
{
    (void)module;
    const char *isa = "";
    if (!PyArg_ParseTuple(args, "|s:build_info", &isa)) return NULL;
    const struct gr_kernels *kernels = gr_kernels_select(isa);
    if (!kernels) return PyErr_Format(PyExc_ValueError, "instruction set \"%s\" is not available on this machine", isa);
    return Py_BuildValue("{s:s,s:i,s:O,s:s,s:s}", "isa", kernels->isa, "lanes", kernels->lanes, "openmp",
                         GR_OPENMP ? Py_True : Py_False, "compiler", __VERSION__, "flags", GR_FLAGS);
}

/* node_positions(basis, n_cells, periodic, c0_lines) -> positions of the nodes along one axis, in cells. */
static PyObject *node_positions(PyObject *module, PyObject *args)
{
    (void)module;
    int basis, n, periodic;
    PyObject *object;
    if (!PyArg_ParseTuple(args, "iipO", &basis, &n, &periodic, &object)) return NULL;
    const npy_intp any[1] = {-1};
    PyArrayObject *c0_lines = gr_array(object, "c0_lines", NPY_INT32, 1, any, 0);
    if (!c0_lines) return NULL;
    if (basis < 0 || basis >= GR_BASIS_COUNT || n < 1 || n > 100000000)
        return PyErr_Format(PyExc_ValueError, "basis = %d or n_cells = %d is not valid", basis, n);
    struct gr_axis axis;
    const int error =
        gr_axis_build(&axis, basis, n, periodic, PyArray_DATA(c0_lines), (int)PyArray_DIM(c0_lines, 0), 0.25, 0, 1);
    if (error) return gr_raise(error, NULL);
    const npy_intp shape[1] = {axis.n_nodes};
    PyObject *out = PyArray_SimpleNew(1, shape, NPY_DOUBLE);
    if (out) memcpy(PyArray_DATA((PyArrayObject *)out), axis.node_position, sizeof(double) * (size_t)axis.n_nodes);
    gr_axis_free(&axis);
    return out;
}

static PyMethodDef functions[] = {
    {"law_update", law_update, METH_VARARGS,
     "law_update(law, dim, parameters, dt, pressure_from_density, gradient, log_density, stress, shear_rate, isa,"
     " g_star=None, g=None)\n--\n\n"
     "One stress update of many points, in place: gradient (blocks, dim*dim, lanes) is L dt, stress (4|6, n).\n"
     "g_star (blocks,): fluidity after its diffusion, for a nonlocal law; without it the law is in its local phase.\n"
     "g (n,): fluidity after the step."},
    {"fluidity_update", gr_python_fluidity_update, METH_VARARGS,
     "fluidity_update(parameters, dt, mu_trial, p, g_star, shear_rate, mu, g, isa)\n--\n\n"
     "Friction mu and fluidity g of n points after a step, from arrays (n,) of the trial friction, pressure, fluidity\n"
     "after diffusion and shear rate before the step."},
    {"fluidity_diffuse", (PyCFunction)(void (*)(void))gr_python_fluidity_diffuse, METH_VARARGS | METH_KEYWORDS,
     "fluidity_diffuse(*, method, dx, A, d, t0, dt, steps, tolerance, max_iterations, periodic, faces, dense, g, threads,"
     " isa)\n--\n\n"
     "Steps of t0 g' = A^2 d^2 lap g over the dense cells of a lattice, in place: g and dense (ny, nx) or (nz, ny, nx),\n"
     "faces (2 dim, ...) at the low and high side of x, y, z: 0 linked, 1 open, 2 rough (g = 0 on it).\n"
     "method: explicit, implicit or rkl2. Returns iterations, clamped (cells), limit (s)."},
    {"hencky_update", gr_python_hencky_update, METH_VARARGS,
     "hencky_update(flow, parameters, dt, gradient, log_density, stress, g, shear_rate, isa)\n--\n\n"
     "One step of the finite-strain law of n points, in place: gradient (dim*dim, n) is L dt, log_density (n,) at its end;\n"
     "the Kirchhoff stress (4|6, n), g (n,), given after diffusion, and the plastic shear_rate (n,) are updated."},
    {"body_distance", gr_python_body_distance, METH_VARARGS,
     "body_distance(parts, x)\n--\n\n(distance (n,), outward normal (n, 3)) of places x (n, 3) to the union of parts: rows (kind, inside, center[3],\n"
     "rotation[9], size[3])."},
    {"scheme_numbers", gr_python_scheme_numbers, METH_NOARGS,
     "scheme_numbers()\n--\n\n{group: [(name, default, range, unit, doc)]}: the numbers of schemes, of the diffusion of the\n"
     "fluidity and of the densities."},
    {"enumerations", gr_python_enumerations, METH_NOARGS,
     "enumerations()\n--\n\n{enumeration: {name: value}} of what is passed to the core as a number."},
    {"laws", gr_python_laws, METH_NOARGS, "laws()\n--\n\n{name: (doc, [(parameter, unit, doc)])} of the constitutive laws."},
    {"build_info", build_info, METH_VARARGS,
     "build_info(isa='')\n--\n\nInstruction set of the kernels, OpenMP, compiler and flags of this build."},
    {"node_positions", node_positions, METH_VARARGS,
     "node_positions(basis, n_cells, periodic, c0_lines)\n--\n\nNodes along one axis, in cells from its lower end."},
    {NULL, NULL, 0, NULL}};

static int exec_module(PyObject *module)
{
    if (PyArray_ImportNumPyAPI() < 0) return -1;
    if (!gr_SimulationError) {
        gr_SimulationError = PyErr_NewExceptionWithDoc(
            "granular.SimulationError",
            "A run failed: a point that is not finite or ran away. `point` is its id, `step` the step.", PyExc_RuntimeError,
            NULL);
        if (!gr_SimulationError) return -1;
    }
    if (PyModule_AddObjectRef(module, "SimulationError", gr_SimulationError)) return -1;
    PyTypeObject *(*const types[])(PyObject *) = {gr_engine_type, gr_sph_type};
    for (int k = 0; k < 2; k++) {
        PyTypeObject *type = types[k](module);
        if (!type) return -1;
        const int failed = PyModule_AddType(module, type);
        Py_DECREF(type);
        if (failed) return -1;
    }
    if (PyModule_AddIntConstant(module, "LANES", GR_LANES)) return -1;
    return PyModule_AddIntConstant(module, "MAX_THREADS", GR_MAX_THREADS);
}

static PyModuleDef_Slot module_slots[] = {{Py_mod_exec, exec_module},
#if PY_VERSION_HEX >= 0x030C0000
                                          {Py_mod_multiple_interpreters, Py_MOD_MULTIPLE_INTERPRETERS_NOT_SUPPORTED},
#endif
#if PY_VERSION_HEX >= 0x030D0000
                                          {Py_mod_gil, Py_MOD_GIL_USED},
#endif
                                          {0, NULL}};

static struct PyModuleDef definition = {.m_base = PyModuleDef_HEAD_INIT,
                                        .m_name = "granular._core",
                                        .m_doc = "The C core of granular.",
                                        .m_methods = functions,
                                        .m_slots = module_slots};

PyMODINIT_FUNC PyInit__core(void);
PyMODINIT_FUNC PyInit__core(void) { return PyModuleDef_Init(&definition); }
