/* The extension module granular._core; what its functions do is said in their table. */
#define GR_IMPORTS_NUMPY
#include <math.h>

#include "mpm/tally.h"
#include "python/engine_common.h"

#ifndef GR_FLAGS
#define GR_FLAGS ""
#endif

static PyObject *build_info(PyObject *Py_UNUSED(module), PyObject *args)
{
    const char *isa = "";
    if (!PyArg_ParseTuple(args, "|s:build_info", &isa)) return NULL;
    const struct gr_kernels *kernels = gr_take_kernels(isa);
    if (!kernels) return NULL;
    return Py_BuildValue("{s:s,s:i,s:s,s:s}", "isa", kernels->isa, "lanes", kernels->lanes, "compiler", __VERSION__, "flags",
                         GR_FLAGS);
}

static PyObject *node_positions(PyObject *Py_UNUSED(module), PyObject *args)
{
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
    const npy_intp shape[1] = {axis.n_numbers};
    PyObject *out = PyArray_SimpleNew(1, shape, NPY_DOUBLE);
    for (int i = 0; out && i < axis.n_nodes; i++)
        if (axis.node_position[i] >= 0 && axis.node_position[i] <= n)
            ((double *)PyArray_DATA((PyArrayObject *)out))[axis.node_number[i]] = axis.node_position[i];
    gr_axis_free(&axis);
    return out;
}

static PyObject *damped_dt(PyObject *Py_UNUSED(module), PyObject *args)
{
    double dt, damping_time;
    if (!PyArg_ParseTuple(args, "dd", &dt, &damping_time)) return NULL;
    return PyFloat_FromDouble(gr_damped_dt(dt, damping_time));
}

static PyMethodDef functions[] = {
    {"law_update", gr_python_law_update, METH_VARARGS,
     "law_update(law, dim, parameters, dt, pressure_from_density, gradient, log_density, stress, shear_rate, isa,"
     " g_star=None, g=None, plastic_strain=None, separated=None, bulking=None)\n--\n\n"
     "One stress update of many points, in place: gradient (blocks, dim*dim, lanes) is L dt, stress (4|6, n).\n"
     "g_star (blocks*lanes,): fluidity after its diffusion, for a nonlocal law; without it the law is in its local phase.\n"
     "g (n,): fluidity after the step."},
    {"fluidity_update", gr_python_fluidity_update, METH_VARARGS,
     "fluidity_update(parameters, dt, mu_trial, p, g_star, shear_rate, mu, g, isa)\n--\n\n"
     "Friction mu and fluidity g of n points after a step, from arrays (n,) of the trial friction, pressure, fluidity\n"
     "after diffusion and shear rate before the step."},
    {"fluidity_diffuse", (PyCFunction)(void (*)(void))gr_python_fluidity_diffuse, METH_VARARGS | METH_KEYWORDS,
     "fluidity_diffuse(*, method, stencil, dx, A, d, t0, dt, steps, tolerance, max_iterations, periodic, faces, dense, g,"
     " distance, threads, isa, first_radius)\n--\n\n"
     "Steps of t0 g' = A^2 d^2 lap g over the dense cells of a grid, in place: g and dense (ny, nx) or (nz, ny, nx),\n"
     "faces (2 dim, ...) at the low and high side of x, y, z: 0 linked, 1 open, 2 rough (g = 0 on it).\n"
     "distance (like g): of the centres from a rough surface, m, negative behind it; or None.\n"
     "first_radius: of the low end of x in an axisymmetric plane, in cells; -1 in others.\n"
     "method: explicit, implicit or rkl2. Returns iterations, clamped (cells), limit (s)."},
    {"hencky_update", gr_python_hencky_update, METH_VARARGS,
     "hencky_update(flow, parameters, dt, gradient, log_density, stress, g, shear_rate, isa)\n--\n\n"
     "One step of the finite-strain law of n points, in place: gradient (dim*dim, n) is L dt, log_density (n,) at its end;\n"
     "the Kirchhoff stress (4|6, n), g (n,), given after diffusion, and the plastic shear_rate (n,) are updated."},
    {"body_distance", gr_python_body_distance, METH_VARARGS,
     "body_distance(parts, samples, x)\n--\n\n(distance (n,), outward normal (n, 3)) of points x (n, 3) to the union of parts: rows (kind, inside, center[3],\n"
     "rotation[9], size[3])."},
    {"mesh_tree", gr_python_mesh_tree, METH_VARARGS,
     "mesh_tree(vertices, faces)\n--\n\nTree of triangles (n, 3) of vertices (k, 3)."},
    {"mesh_distance", gr_python_mesh_distance, METH_VARARGS,
     "mesh_distance(tree, x, closed)\n--\n\nExact distance (n,) of points x (n, 3) from triangles; if they are closed, negative\n"
     "where the winding number exceeds a half."},
    {"mesh_winding", gr_python_mesh_winding, METH_VARARGS,
     "mesh_winding(tree, x)\n--\n\nNumber of times that a closed surface goes around points x (n, 3), shape (n,)."},
    {"mesh_clear", gr_python_mesh_clear, METH_VARARGS,
     "mesh_clear(tree, x, radius)\n--\n\nTrue (n,) where no triangle is nearer to a point x (n, 3) than a radius (n,)."},
    {"scheme_numbers", gr_python_scheme_numbers, METH_NOARGS,
     "scheme_numbers()\n--\n\n{group: [(name, default, range, unit, doc)]}: the numbers of schemes, of the diffusion of the\n"
     "fluidity and of the densities."},
    {"material_numbers", gr_python_material_numbers, METH_NOARGS,
     "material_numbers()\n--\n\n{name: (unit, doc)}: the numbers of a material in addition to the parameters of its law."},
    {"enumerations", gr_python_enumerations, METH_NOARGS,
     "enumerations()\n--\n\n{enumeration: {name: value}} of arguments passed to the core as a number."},
    {"laws", gr_python_laws, METH_NOARGS,
     "laws()\n--\n\n{name: (doc, [(parameter, unit, doc)], in_single)} of the constitutive "
     "laws; in_single: kernels in single precision have it."},
    {"damped_dt", damped_dt, METH_VARARGS,
     "damped_dt(dt, damping_time)\n--\n\nTime step, s, with the damping of elastic waves that is as far from its limit as dt is without."},
    {"open_gpu", gr_python_open_gpu, METH_VARARGS,
     "open_gpu(double, single)\n--\n\nLoad the driver of a GPU and the texts of the kernels; returns its name and memory."},
    {"build_info", build_info, METH_VARARGS,
     "build_info(isa='')\n--\n\nInstruction set of the kernels, compiler and flags of this build."},
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
    PyObject *most = PyFloat_FromDouble(GR_MOST_DIFFUSED);
    const int failed = PyModule_AddObjectRef(module, "MOST_DIFFUSED", most);
    Py_XDECREF(most);
    if (failed || PyModule_AddIntConstant(module, "LANES", GR_LANES)) return -1;
    if (PyModule_AddIntConstant(module, "TALLY_INTERVAL", GR_TALLY_INTERVAL)) return -1;
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

PyMODINIT_FUNC PyInit__core(void) { return PyModuleDef_Init(&definition); }
