/* From the keyword arguments of Engine to the configuration of the core. */
#include <math.h>

#include "core/index.h"
#include "python/arrays.h"

/* The numbers of each axis, from its row. */
static int take_axes(struct gr_config *c, PyObject *rows)
{
    const npy_intp any[1] = {-1};
    int64_t nodes = 1;
    if (!PyTuple_Check(rows) || PyTuple_GET_SIZE(rows) != c->dim) return gr_refuse("axes must be a tuple of length dim");
    for (int d = 0; d < c->dim; d++) {
        PyObject *row = PyTuple_GET_ITEM(rows, d), *lines;
        if (gr_refuse_row("axes", row) ||
            !PyArg_ParseTuple(
                row, "idpppOdd;a row of axes is (cells, lower, periodic, open_low, open_high, c0_lines, above, damping)",
                &c->shape[d], &c->lower[d], &c->periodic[d], &c->open_low[d], &c->open_high[d], &lines, &c->above[d],
                &c->sponge_damping[d]))
            return -1;
        const int64_t n = c->shape[d];
        if (n < 1 || n > 1000000000 || (nodes *= 2 * n + 2) > ((int64_t)1 << 32))
            return gr_refuse("axes[%d]: %d cells are outside the range of the grid", d, c->shape[d]);
        if (!isfinite(c->lower[d])) return gr_refuse("axes[%d]: lower is not finite", d);
        if (!(c->sponge_damping[d] >= 0)) return gr_refuse("axes[%d]: damping must not be negative", d);
        c->has_sponge |= (c->above[d] < INFINITY) << d; /* not where it is NaN */
        PyArrayObject *array = gr_array(lines, "c0_lines", NPY_INT32, 1, any, 0);
        if (!array) return -1;
        c->n_c0_lines[d] = (int)PyArray_DIM(array, 0);
        c->c0_lines[d] = PyArray_DATA(array);
    }
    return 0;
}

static int take_walls(struct gr_config *c, PyObject *walls, struct gr_wall *table)
{
    if (!PyList_Check(walls) || PyList_GET_SIZE(walls) < 1 || PyList_GET_SIZE(walls) > 256)
        return gr_refuse("walls must be a list of 1 to 256 rows, row 0 the free node");
    c->n_walls = (int)PyList_GET_SIZE(walls);
    for (int k = 0; k < c->n_walls; k++) {
        struct gr_wall *w = &table[k];
        PyObject *row = PyList_GET_ITEM(walls, k);
        if (gr_refuse_row("walls", row) ||
            !PyArg_ParseTuple(row, "i(iii)(ddd)di(ddd);a row of walls is (fixed, away, friction, opens_at, after, velocity)",
                              &w->fixed, &w->away[0], &w->away[1], &w->away[2], &w->friction[0], &w->friction[1],
                              &w->friction[2], &w->opens_at, &w->after, &w->velocity[0], &w->velocity[1], &w->velocity[2]))
            return -1;
        for (int d = 0; d < 3; d++)
            if (w->away[d] < -1 || w->away[d] > 1 || !(w->friction[d] >= 0))
                return gr_refuse("walls[%d]: away must be -1, 0 or 1, and friction not negative", k);
    }
    c->walls = table;
    return 0;
}

/* Numbers of nodes and of grouping cells that the codes and flags must have. */
static int64_t count_along(const struct gr_config *c, int d, int nodes)
{
    const int n = c->shape[d];
    if (c->basis == GR_QUADRATIC) return !nodes || c->periodic[d] ? n : n + 2 + c->n_c0_lines[d];
    return (nodes || c->basis == GR_UGIMP) && !c->periodic[d] ? n + 1 : n;
}

/* A map of bytes from a tuple (classes along each axis, values); None is one of zeros, which flags may be. */
static int take_map(const struct gr_config *c, PyObject *object, const char *name, int nodes, struct gr_map *out)
{
    const npy_intp any[3] = {-1, -1, -1};
    if (!nodes && object == Py_None) return 0;
    if (!PyTuple_Check(object) || PyTuple_GET_SIZE(object) != 2)
        return gr_refuse("%s must be a tuple (classes, values)", name);
    PyObject *classes = PyTuple_GET_ITEM(object, 0);
    if (!PyTuple_Check(classes) || PyTuple_GET_SIZE(classes) != c->dim)
        return gr_refuse("%s must have classes along %d axes", name, c->dim);
    PyArrayObject *array = gr_array(PyTuple_GET_ITEM(object, 1), name, NPY_UINT8, c->dim, any, 0);
    if (!array) return -1;
    struct gr_map map = {.n_index = {1, 1, 1}, .n_classes = {1, 1, 1}, .value = PyArray_DATA(array)};
    for (int d = 0; d < c->dim; d++) {
        const npy_intp count[1] = {(npy_intp)count_along(c, d, nodes)}, most = PyArray_DIM(array, c->dim - 1 - d);
        PyArrayObject *along = gr_array(PyTuple_GET_ITEM(classes, d), name, NPY_INT32, 1, count, 0);
        if (!along) return -1;
        map.class_of[d] = PyArray_DATA(along);
        map.n_index[d] = (int32_t)count[0], map.n_classes[d] = (int32_t)most;
        for (npy_intp k = 0; k < count[0]; k++)
            if (map.class_of[d][k] < 0 || map.class_of[d][k] >= most)
                return gr_refuse("%s: class %d along axis %d must be 0 to %zd", name, (int)map.class_of[d][k], d, most - 1);
    }
    for (npy_intp k = 0; nodes && k < PyArray_SIZE(array); k++)
        if (map.value[k] >= c->n_walls)
            return gr_refuse("%s names wall row %d, but there are %d", name, (int)map.value[k], c->n_walls);
    *out = map;
    return 0;
}

/* The faces of the cells, (2 dim, ..., cells along y, along x), and how the fluidity is diffused. */
static int take_nonlocal(struct gr_config *c, PyObject *faces, const char *method, const char *stencil)
{
    npy_intp shape[4] = {2 * c->dim};
    for (int d = 0; d < c->dim; d++) shape[c->dim - d] = c->shape[d];
    const char *methods[GR_DIFFUSION_COUNT + 1];
    memcpy(methods, gr_diffusion_names, sizeof gr_diffusion_names);
    methods[GR_DIFFUSION_COUNT] = "auto";
    c->nonlocal.method = gr_take_index("fluidity_method", method, methods, GR_DIFFUSION_COUNT + 1);
    c->nonlocal.stencil = gr_take_index("fluidity_stencil", stencil, gr_stencil_names, GR_STENCIL_COUNT);
    if (c->nonlocal.method < 0 || c->nonlocal.stencil < 0) return -1;
    if (gr_nonlocal_material(c) < 0) return 0;
    if (c->basis == GR_UGIMP || c->nonlocal.substeps < 1 || c->nonlocal.substeps > 100000)
        return gr_refuse("a nonlocal law needs basis 0 or 2 and 1 to 100000 substeps");
    PyArrayObject *array = gr_array(faces, "fluidity_faces", NPY_UINT8, c->dim + 1, shape, 0);
    if (!array) return -1;
    const uint8_t *face = c->nonlocal.face = PyArray_DATA(array);
    for (npy_intp k = 0; k < PyArray_SIZE(array); k++)
        if (face[k] >= GR_FACE_COUNT) return gr_refuse("fluidity_faces[%zd] = %d must be 0, 1 or 2", k, (int)face[k]);
    return 0;
}

int gr_take_gravity(int dim, PyObject *times, PyObject *vectors, int *n, const double **time, const double **vector)
{
    const npy_intp any[1] = {-1};
    PyArrayObject *t = gr_array(times, "gravity_times", NPY_DOUBLE, 1, any, 0);
    if (!t) return -1;
    const npy_intp shape[2] = {PyArray_DIM(t, 0), dim};
    PyArrayObject *g = gr_array(vectors, "gravity_vectors", NPY_DOUBLE, 2, shape, 0);
    if (!g) return -1;
    *n = (int)PyArray_DIM(t, 0);
    *time = PyArray_DATA(t);
    *vector = PyArray_DATA(g);
    for (int k = 0; k < *n; k++)
        if (!isfinite((*time)[k]) || (k && !((*time)[k] > (*time)[k - 1])))
            return gr_refuse("gravity_times must be finite and increase");
    return 0;
}

static int take_number(PyObject *dict, const char *name, double *out)
{
    if (gr_take_float(dict, "number", name, out)) return -1;
    return isfinite(*out) ? 0 : gr_refuse("%s = %.9g must be finite", name, *out);
}

/* The numbers of the densities: those that the chosen one has not are 0. */
static int take_density(PyObject *dict, int density, struct gr_density_numbers *out)
{
#define GR_X(name, smoothed, averaged, particle, range, unit, doc)                                                        \
    const double name[] = {                                                                                               \
        [GR_DENSITY_particle] = (particle), [GR_DENSITY_smoothed] = (smoothed), [GR_DENSITY_cell_averaged] = (averaged)}; \
    out->name = 0;                                                                                                        \
    if (!isnan(name[density]) && take_number(dict, #name, &out->name)) return -1;
    GR_DENSITY_SCHEME(GR_X)
#undef GR_X
    return 0;
}

/* Transfer, step and cutoff, from the numbers of the scheme. */
static int take_scheme(struct gr_config *c, PyObject *dict, int transfer, double mean_mass)
{
    struct gr_scheme_numbers q;
#define GR_X(name, value, range, unit, doc) \
    if (take_number(dict, #name, &q.name)) return -1;
    GR_SCHEME(GR_X)
#undef GR_X
    static const int affine[] = {[GR_TRANSFER_flip] = GR_AFFINE_NONE,
                                 [GR_TRANSFER_apic] = GR_AFFINE_MOMENT,
                                 [GR_TRANSFER_tpic] = GR_AFFINE_GRADIENT,
                                 [GR_TRANSFER_xpic] = GR_AFFINE_NONE};
    c->scheme = q;
    c->affine = affine[transfer];
    c->xpic_order = transfer == GR_TRANSFER_xpic ? (int)gr_index(q.xpic_order, -1, 100) : 0;
    if (transfer == GR_TRANSFER_apic) c->keep_velocity_rate = -1;
    c->cfl = q.cfl, c->dt = q.dt, c->mass_cutoff = q.mass_cutoff * mean_mass;
    return 0;
}

static int take_all_numbers(struct gr_config *c, PyObject *numbers, PyObject *fluidity)
{
    double substeps;
    if (take_number(numbers, "dx", &c->dx) || take_number(numbers, "half_extent", &c->lambda) ||
        take_number(numbers, "wave_speed", &c->wave_speed) ||
        take_number(numbers, "velocity_decay", &c->keep_velocity_rate) ||
        take_number(fluidity, "begins_at", &c->nonlocal.begins_at) ||
        take_number(fluidity, "tolerance", &c->nonlocal.tolerance) || take_number(fluidity, "floor", &c->nonlocal.floor) ||
        take_number(fluidity, "substeps", &substeps))
        return -1;
    c->nonlocal.substeps = (int)gr_index(substeps, -1, 1000000000);
    return 0;
}

/* The function of a user-defined law, None or a tuple (capsule of a gr_own_update, its numbers, 1 if it has a history).
 * The capsule is None for an engine that makes no steps. */
static int take_own(struct gr_material *m, PyObject *function)
{
    PyObject *capsule, *numbers;
    if (function == Py_None) return 0;
    if (!PyTuple_Check(function))
        return gr_refuse("the function of a law must be a tuple (capsule, numbers, remembers) or None");
    if (!PyArg_ParseTuple(function, "OO!p", &capsule, &PyTuple_Type, &numbers, &m->remembers)) return -1;
    if (capsule != Py_None && !PyCapsule_IsValid(capsule, "granular.own_law"))
        return gr_refuse("the function of a law must be a capsule named granular.own_law");
    if (PyTuple_GET_SIZE(numbers) > GR_OWN_PARAMETERS)
        return gr_refuse("a law has %zd numbers, must have %d at most", PyTuple_GET_SIZE(numbers), GR_OWN_PARAMETERS);
    for (Py_ssize_t k = 0; k < PyTuple_GET_SIZE(numbers); k++)
        m->own_parameter[k] = PyFloat_AsDouble(PyTuple_GET_ITEM(numbers, k));
    if (capsule != Py_None) m->function = (gr_own_update *)PyCapsule_GetPointer(capsule, "granular.own_law");
    return PyErr_Occurred() ? -1 : 0;
}

/* The materials, a list of tuples (law, numbers, parameters of the law, function of a user-defined law). */
static int take_materials(struct gr_config *c, PyObject *list)
{
    if (!PyList_Check(list) || PyList_GET_SIZE(list) < 1 || PyList_GET_SIZE(list) > GR_MAX_MATERIALS)
        return gr_refuse("materials must be a list of 1 to %d tuples", GR_MAX_MATERIALS);
    c->n_materials = (int)PyList_GET_SIZE(list);
    for (int k = 0; k < c->n_materials; k++) {
        struct gr_material *m = &c->material[k];
        PyObject *numbers, *parameters, *function;
        const char *name;
        if (!PyTuple_Check(PyList_GET_ITEM(list, k)))
            return gr_refuse("materials[%d] must be a tuple (law, numbers, parameters, function)", k);
        if (!PyArg_ParseTuple(PyList_GET_ITEM(list, k), "sO!O!O", &name, &PyDict_Type, &numbers, &PyDict_Type, &parameters,
                              &function))
            return -1;
        m->law = gr_law_index(name);
        if (m->law < 0) return gr_refuse("there is no law \"%s\"", name);
#define GR_X(name, least, unit, doc) \
    if (take_number(numbers, #name, &m->name)) return -1;
        GR_MATERIAL(GR_X)
#undef GR_X
        if (take_own(m, function)) return -1;
        const struct gr_law *law = gr_law_at(m->law);
        for (int q = 0; q < gr_law_parameters(law); q++)
            if (take_number(parameters, law->parameter[q].name, &m->parameter[q])) return -1;
    }
    return 0;
}

int gr_parse_config(PyObject *args, PyObject *kwargs, struct gr_config *out, struct gr_tables *tables, const char **isa,
                    const char **device)
{
    static char *names[] = {"dim",
                            "basis",
                            "transfer",
                            "density",
                            "single",
                            "axisymmetric",
                            "averaging_interval",
                            "flutter_interval",
                            "pressure_from_density",
                            "materials",
                            "isa",
                            "device",
                            "axes",
                            "walls",
                            "node_codes",
                            "cell_flags",
                            "gravity_times",
                            "gravity_vectors",
                            "numbers",
                            "scheme_numbers",
                            "density_numbers",
                            "fluidity_numbers",
                            "fluidity_method",
                            "fluidity_stencil",
                            "fluidity_faces",
                            "bodies",
                            NULL};
    struct gr_config c = {0};
    int transfer, density;
    double mean_mass;
    const char *method, *stencil;
    PyObject *materials, *axes, *walls, *codes, *flags, *times, *vectors;
    PyObject *numbers, *of_scheme, *of_density, *of_fluidity, *faces, *bodies;
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "$iiiiiiiiiOssOOOOOOO!O!O!O!ssOO", names, &c.dim, &c.basis, &transfer,
                                     &density, &c.single, &c.axisymmetric, &c.averaging_interval, &c.flutter_interval,
                                     &c.pressure_from_density, &materials, isa, device, &axes, &walls, &codes, &flags,
                                     &times, &vectors, &PyDict_Type, &numbers, &PyDict_Type, &of_scheme, &PyDict_Type,
                                     &of_density, &PyDict_Type, &of_fluidity, &method, &stencil, &faces, &bodies))
        return -1;
    if (c.dim < 2 || c.dim > 3 || c.basis < 0 || c.basis >= GR_BASIS_COUNT || transfer < 0 ||
        transfer >= GR_TRANSFER_COUNT || density < 0 || density >= GR_DENSITY_COUNT)
        return gr_refuse("dim must be 2 or 3, basis and density 0 to 2, transfer 0 to 3");
    c.smoothed = density == GR_DENSITY_smoothed, c.cell_averaged = density == GR_DENSITY_cell_averaged;
    if (take_materials(&c, materials) || take_axes(&c, axes) || take_walls(&c, walls, tables->wall) ||
        take_map(&c, codes, "node_codes", 1, &c.node_codes) || take_map(&c, flags, "cell_flags", 0, &c.cell_flags) ||
        gr_take_gravity(c.dim, times, vectors, &c.n_gravity, &c.gravity_times, &c.gravity_vectors) ||
        take_all_numbers(&c, numbers, of_fluidity) || take_number(numbers, "mean_mass", &mean_mass) ||
        take_scheme(&c, of_scheme, transfer, mean_mass) || take_density(of_density, density, &c.density) ||
        take_nonlocal(&c, faces, method, stencil) || gr_take_bodies(&c, bodies, tables))
        return -1;
    *out = c;
    return 0;
}
