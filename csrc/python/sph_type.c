/* The Python type `Sph`, of smoothed particle hydrodynamics (SPH); what its methods do is said in their table below. */
#include <float.h>
#include <math.h>

#include "python/engine_common.h"
#include "sph/gas.h"
#include "sph/inflow.h"
#include "sph/sph.h"

_Static_assert(GR_SPH_FIELD_COUNT <= GR_MAX_FIELDS, "every field has its place in struct gr_object");

/* ---- construction ---- */

static int take_domain(struct gr_sph_config *c, PyObject *lower, PyObject *upper, PyObject *periodic)
{
    PyObject *const lists[] = {lower, upper, periodic};
    if (c->dim < 2 || c->dim > 3) return gr_refuse("dim = %d must be 2 or 3", c->dim);
    for (int k = 0; k < 3; k++)
        if (!PyTuple_Check(lists[k]) || PyTuple_GET_SIZE(lists[k]) != c->dim)
            return gr_refuse("lower, upper and periodic must be tuples of length dim");
    for (int d = 0; d < c->dim; d++) {
        c->lower[d] = PyFloat_AsDouble(PyTuple_GET_ITEM(lower, d));
        c->upper[d] = PyFloat_AsDouble(PyTuple_GET_ITEM(upper, d));
        c->periodic[d] = PyObject_IsTrue(PyTuple_GET_ITEM(periodic, d));
        if (PyErr_Occurred()) return -1;
        if (!(fabs(c->lower[d]) <= GR_LARGEST) || !(fabs(c->upper[d]) <= GR_LARGEST) || !(c->upper[d] > c->lower[d]))
            return gr_refuse("upper[%d] must exceed lower[%d], both finite", d, d);
    }
    return 0;
}

/* Walls from rows (lower, upper, v, from, until, axis), 12 numbers each. */
static int take_walls(struct gr_sph_config *c, PyObject *object)
{
    const npy_intp shape[2] = {-1, 12};
    PyArrayObject *array = gr_array(object, "walls", NPY_DOUBLE, 2, shape, 0);
    if (!array) return -1;
    const npy_intp n = PyArray_DIM(array, 0);
    if (n > GR_SPH_MAX_WALLS) return gr_refuse("walls must be at most %d, not %zd", GR_SPH_MAX_WALLS, n);
    c->n_walls = (int)n;
    for (int k = 0; k < n; k++) {
        const double *row = (const double *)PyArray_DATA(array) + 12 * k;
        struct gr_sph_wall *wall = &c->wall[k];
        memcpy(wall, row, 11 * sizeof *row);
        int valid = wall->from >= 0 && wall->until >= 0 && row[11] >= 0 && row[11] < c->dim;
        for (int d = 0; d < c->dim; d++) valid = valid && wall->lower[d] < wall->upper[d] && fabs(wall->v[d]) <= GR_LARGEST;
        if (!valid) return gr_refuse("walls[%d] must have lower < upper, finite velocities, from and until >= 0", k);
        wall->axis = (int)row[11];
    }
    return 0;
}

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

/* The gas that a tuple (parameters, jets) describes, None for none. */
static int take_gas(struct gr_sph *s, PyObject *object)
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
    if (PyArray_DIM(array, 0) > GR_SPH_MAX_JETS)
        return gr_refuse("%zd jets must be at most %d", PyArray_DIM(array, 0), GR_SPH_MAX_JETS);
    const double *from = PyArray_DATA(array);
    for (int k = 0; k < n; k++, from += 3 * dim)
        for (int d = 0; d < dim; d++)
            jets[k].lower[d] = from[d], jets[k].upper[d] = from[dim + d], jets[k].velocity[d] = from[2 * dim + d];
    const int error = gr_sph_take_gas(s, parameter, n, jets);
    if (error) gr_raise(error, NULL);
    return error ? -1 : 0;
}

static int sph_init(struct gr_object *self, PyObject *args, PyObject *kwargs)
{
    static char *names[] = {"dim",        "lower",         "upper",           "periodic", "isa", "wall_friction",
                            "parameters", "gravity_times", "gravity_vectors", "walls",    "gas", NULL};
    struct gr_sph_config c = {0};
    struct gr_sph *s;
    const char *isa;
    PyObject *lower, *upper, *periodic, *parameters, *times, *vectors, *walls, *gas;
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "$iOOOspO!OOOO:Sph", names, &c.dim, &lower, &upper, &periodic, &isa,
                                     &c.wall_friction, &PyDict_Type, &parameters, &times, &vectors, &walls, &gas) ||
        take_domain(&c, lower, upper, periodic) ||
        gr_take_parameters(parameters, gr_sph_parameter_table, GR_SPH_PARAMETER_COUNT, gr_sph_may_be_zero, c.parameter) ||
        gr_take_gravity(c.dim, times, vectors, &c.n_gravity, &c.gravity_times, &c.gravity_vectors) || take_walls(&c, walls))
        return -1;
    if (c.n_gravity < 1) return gr_refuse("gravity_times must hold at least one time");
    if (gr_begin_object(self, isa)) return -1;
    const int error = gr_sph_new(&s, &c, self->kernels->lanes);
    if (error) gr_raise(error, NULL);
    if (error) return -1;
    self->engine = s, self->fields = gr_sph_field_table, self->n_fields = GR_SPH_FIELD_COUNT;
    for (int f = 0; f < GR_SPH_FIELD_COUNT; f++) {
        self->components[f] = gr_sph_components(s, f);
        self->type[f] = NPY_DOUBLE;
    }
    return take_gas(s, gas);
}

static void sph_dealloc(struct gr_object *self)
{
    gr_sph_free(self->engine);
    gr_free_object(self);
}

/* ---- buffers ---- */

/* Rows for the points of gas that do not fit. */
static int refuse_gas_rows(const struct gr_sph *s, Py_ssize_t walls_end, Py_ssize_t first, Py_ssize_t n, Py_ssize_t capacity)
{
    if (!s->gas && !first && !n) return 0;
    if (s->gas && n >= 0 && first >= walls_end + GR_LANES && first <= capacity && n <= capacity - first - GR_LANES) return 0;
    return gr_refuse("%zd points of gas from row %zd on do not fit %s of %zd slots with %d spare ones", n, first,
                     s->gas ? "buffers" : "a scene without gas, nor buffers", capacity, GR_LANES);
}

static PyObject *sph_bind(struct gr_object *self, PyObject *args)
{
    PyObject *buffers;
    Py_ssize_t n_particles, wall_first, n_walls, gas_first = 0, n_gas = 0;
    int fresh, n_rows = 0;
    PyArrayObject *arrays[GR_SPH_FIELD_COUNT + 1];
    double *row[GR_SPH_MAX_ROWS] = {0};
    if (!PyArg_ParseTuple(args, "O!nnnp|nn", &PyDict_Type, &buffers, &n_particles, &wall_first, &n_walls, &fresh, &gas_first,
                          &n_gas))
        return NULL;
    struct gr_sph *s = gr_ready(self, 0);
    const Py_ssize_t capacity = s ? gr_take_buffers(self, buffers, arrays) : -1;
    if (capacity < 0) return NULL;
    if (n_particles < 0 || n_walls < 0 || capacity > INT32_MAX || wall_first < GR_LANES || wall_first > capacity ||
        n_particles > wall_first - GR_LANES || n_walls > capacity - wall_first - GR_LANES)
        return PyErr_Format(
            PyExc_ValueError,
            "%zd particles and %zd wall points from row %zd on do not fit buffers of %zd slots with %d spare "
            "ones behind each",
            n_particles, n_walls, wall_first, capacity, GR_LANES);
    if (refuse_gas_rows(s, wall_first + n_walls, gas_first, n_gas, capacity)) return NULL;
    gr_keep_buffers(self, arrays);
    for (int f = 0; f < GR_SPH_FIELD_COUNT; f++)
        for (int c = 0; c < self->components[f]; c++) row[n_rows++] = (double *)PyArray_DATA(arrays[f]) + c * capacity;
    gr_sph_place_gas(s, gas_first, n_gas);
    const int error =
        gr_sph_bind(s, row, PyArray_DATA(arrays[GR_SPH_FIELD_COUNT]), capacity, n_particles, wall_first, n_walls, fresh);
    self->is_bound = s->id != NULL;
    if (error) return gr_raise(error, NULL);
    Py_RETURN_NONE;
}

/* ---- stepping ---- */

static PyObject *sph_advance(struct gr_object *self, PyObject *args)
{
    long long max_steps;
    double until;
    int threads, error;
    struct gr_sph *s;
    if (gr_take_run(args, &max_steps, &until, &threads) || !(s = gr_ready(self, 1))) return NULL;
    self->busy = 1;
    Py_BEGIN_ALLOW_THREADS
    error = gr_sph_advance(s, self->kernels->sph, max_steps, until, threads);
    Py_END_ALLOW_THREADS
    self->busy = 0;
    self->refused_threads = s->refused_threads;
    if (!error || error == GR_ERR_CAPACITY) return PyBool_FromLong(error);
    const struct gr_failed_at at = {s->error_id,   s->step,       s->config.dim, s->error_x[0],
                                    s->error_x[1], s->error_x[2], s->time,       NULL};
    const int has_place = error == GR_ERR_NOT_FINITE || error == GR_ERR_RUNAWAY;
    return has_place ? gr_raise_at(error, &at) : gr_raise(error, NULL);
}

/* ---- looking in ---- */

/* The numbers of the engine: first those that a restart needs, then those that the buffers imply. */
static const struct gr_scalar scalars[] = {
#define GR_X(name) GR_SCALAR_OF(struct gr_sph, name, name),
    GR_X(time) GR_X(dt) GR_X(speed2) GR_X(acceleration2) GR_X(dropped_mass) GR_X(gas_speed2) GR_X(step) GR_X(dropped)
        GR_X(started) GR_X(stopped) GR_X(gas_dropped) GR_X(rebuilds) GR_X(n_walls) GR_X(n_gas)
#undef GR_X
            {"n_points", offsetof(struct gr_sph, n_particles), 0}};
enum { SCALARS = sizeof scalars / sizeof *scalars, OF_RESTART = SCALARS - 3 };

static PyObject *sph_scalars(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    return gr_python_scalars(self, scalars, SCALARS);
}

static PyObject *sph_restore(struct gr_object *self, PyObject *dict)
{
    struct gr_sph new, *s;
    if (gr_take_scalars(dict, scalars, OF_RESTART, &new) || !(s = gr_ready(self, 0))) return NULL;
    const double least = s->speed2; /* of sound in the material at rest, since no step has been made */
    if (gr_refuse_range("time", new.time, 0, GR_LARGEST) || gr_refuse_range("dt", new.dt, DBL_MIN, GR_LARGEST) ||
        gr_refuse_range("speed2", new.speed2, DBL_MIN, GR_LARGEST) ||
        gr_refuse_range("acceleration2", new.acceleration2, 0, GR_LARGEST) ||
        gr_refuse_range("gas_speed2", new.gas_speed2, 0, GR_LARGEST) ||
        gr_refuse_range("dropped_mass", new.dropped_mass, 0, GR_LARGEST) || gr_refuse_count("step", new.step) ||
        gr_refuse_count("dropped", new.dropped) || gr_refuse_count("stopped", new.stopped) ||
        gr_refuse_count("gas_dropped", new.gas_dropped) || gr_refuse_count("rebuilds", new.rebuilds) ||
        gr_refuse_clock(new.time, new.dt))
        return NULL;
    if (new.started != 0 && new.started != 1)
        return PyErr_Format(PyExc_ValueError, "started = %lld must be 0 or 1", (long long)new.started);
    new.speed2 = fmax(new.speed2, least);
    gr_set_scalars(s, scalars, OF_RESTART, &new);
    Py_RETURN_NONE;
}

static PyObject *sph_stable_dt(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_sph *s = gr_ready(self, 0);
    return s ? PyFloat_FromDouble(gr_sph_stable_dt(s)) : NULL;
}

static PyObject *sph_add_inlet(struct gr_object *self, PyObject *args)
{
    struct gr_sph *s = gr_ready(self, 0);
    return s ? gr_python_add_sph_inlet(s, args) : NULL;
}

static struct gr_inlets *inlets_of(const struct gr_sph *s) { return s->inflow ? s->inflow->inlets : NULL; }

static PyObject *sph_inflow(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_sph *s = gr_ready(self, 0);
    return s ? gr_python_inflow(inlets_of(s)) : NULL;
}

static PyObject *sph_restore_inflow(struct gr_object *self, PyObject *array)
{
    const struct gr_sph *s = gr_ready(self, 0);
    return s ? gr_python_restore_inflow(inlets_of(s), array) : NULL;
}

static PyObject *sph_inlet_loads(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_sph *s = gr_ready(self, 0);
    return s ? gr_python_inlet_loads(s) : NULL;
}

static PyObject *sph_restore_inlet_loads(struct gr_object *self, PyObject *array)
{
    struct gr_sph *s = gr_ready(self, 0);
    return s ? gr_python_restore_inlet_loads(s, array) : NULL;
}

static PyMethodDef methods[] = {
    {"bind", (PyCFunction)sph_bind, METH_VARARGS,
     "bind(buffers, n_particles, wall_first, n_walls, fresh, gas_first=0, n_gas=0)\n--\n\nLend {name: float64 (component, capacity)} and id: int64 (capacity,). Nothing is copied."},
    {"advance", (PyCFunction)sph_advance, METH_VARARGS,
     "advance(max_steps, until, threads)\n--\n\nRun steps until a count or a time, the GIL released. True if points that enter "
     "need larger buffers,\nnot bound as fresh, before the next step."},
    {"add_inlet", (PyCFunction)sph_add_inlet, METH_VARARGS,
     "add_inlet(records, axis, velocity, spacing, begin, end, is_gas, lower, upper)\n--\n\nLet points enter, from before the "
     "points are bound. records: float64 (sites, components), what\nenters at each site, all fields in the order of "
     "fields(); velocity: 3 numbers, m/s; spacing of the\npoints along the axis, m; times at which they begin and end, s; "
     "ends of the box in which particles,\nnot those of gas, have the velocity."},
    {"inflow", (PyCFunction)sph_inflow, METH_NOARGS, "inflow()\n--\n\nState of the inlets, as of Engine."},
    {"restore_inflow", (PyCFunction)sph_restore_inflow, METH_O,
     "restore_inflow(state)\n--\n\nSet the state of the inlets, as inflow() gave it."},
    {"inlet_loads", (PyCFunction)sph_inlet_loads, METH_NOARGS,
     "inlet_loads()\n--\n\nForce of the box of each inlet on the particles, its impulse and work, float64 (inlets, 7)."},
    {"restore_inlet_loads", (PyCFunction)sph_restore_inlet_loads, METH_O,
     "restore_inlet_loads(loads)\n--\n\nSet them, as inlet_loads() gave them."},
    {"scalars", (PyCFunction)sph_scalars, METH_NOARGS, "scalars()\n--\n\nThe numbers that a restart needs, and counts."},
    {"restore", (PyCFunction)sph_restore, METH_O, "restore(scalars)\n--\n\nSet the numbers of a restart."},
    {"stable_dt", (PyCFunction)sph_stable_dt, METH_NOARGS,
     "stable_dt()\n--\n\ncfl times the smaller of h/(4 c) and sqrt(h/|a|)/4, s."},
    {"zeros", (PyCFunction)gr_python_zeros, METH_VARARGS,
     "zeros(n)\n--\n\nSo many bytes of the memory of the engine, all 0."},
    {"fields", (PyCFunction)gr_python_fields, METH_NOARGS,
     "fields()\n--\n\n[(name, components, unit, doc, dtype)] of the buffers."},
    {NULL, NULL, 0, NULL}};

PyTypeObject *gr_sph_type(PyObject *module)
{
    return gr_make_type(module, "granular._core.Sph", "The engine of SPH; see granular.sph.", (initproc)sph_init,
                        (destructor)sph_dealloc, methods);
}
