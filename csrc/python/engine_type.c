/* The Python type `Engine`, of the material point method (MPM); what its methods do is said in their table below. */
#include <float.h>

#include "engine/build.h"
#include "engine/drive.h"
#include "engine/stable_dt.h"
#include "engine/step.h"
#include "mpm/grouping.h"
#include "mpm/numbers.h"
#include "mpm/sleep.h"
#include "mpm/tally.h"
#include "python/engine_common.h"

_Static_assert(GR_FIELD_COUNT <= GR_MAX_FIELDS, "every field has its place in struct gr_object");

/* ---- construction ---- */

static int engine_init(struct gr_object *self, PyObject *args, PyObject *kwargs)
{
    struct gr_config config;
    struct gr_tables tables;
    struct gr_engine *e;
    const char *isa, *device;
    if (gr_parse_config(args, kwargs, &config, &tables, &isa, &device)) return -1;
    if (gr_begin_object(self, *device ? "one_lane" : isa) || gr_find_device(self, device)) return -1;
    /* the tables of the shapes of bodies, and the functions of laws */
    Py_XSETREF(self->borrowed, Py_BuildValue("(NN)", PyList_AsTuple(PyDict_GetItemString(kwargs, "bodies")),
                                             PyList_AsTuple(PyDict_GetItemString(kwargs, "materials"))));
    if (!self->borrowed) return -1;
    gr_use_memory(self);
    const int error = gr_engine_new(&e, &config);
    if (error) gr_raise(error, NULL);
    if (error) return -1;
    self->engine = e, self->fields = gr_field_table, self->n_fields = GR_FIELD_COUNT;
    for (int f = 0; f < GR_FIELD_COUNT; f++) {
        self->components[f] = gr_config_uses(&e->config, f) ? gr_field_components(f, config.dim) : 0;
        self->type[f] = gr_is_double(&e->config, f) ? NPY_DOUBLE : NPY_FLOAT;
    }
    return gr_refuse_diffusion(e) || gr_take_device(self) ? -1 : 0;
}

static void engine_dealloc(struct gr_object *self)
{
    gr_engine_free(self->engine);
    gr_free_object(self);
}

static PyObject *engine_bind(struct gr_object *self, PyObject *args)
{
    PyObject *buffers;
    Py_ssize_t n_points;
    int fresh;
    PyArrayObject *arrays[GR_FIELD_COUNT + 1];
    if (!PyArg_ParseTuple(args, "O!np", &PyDict_Type, &buffers, &n_points, &fresh)) return NULL;
    struct gr_engine *e = gr_ready(self, 0);
    const Py_ssize_t capacity = e ? gr_take_buffers(self, buffers, arrays) : -1;
    if (capacity < 0) return NULL;
    if (n_points < 0 || n_points > capacity || (!fresh && capacity < e->points.capacity))
        return PyErr_Format(PyExc_ValueError, "%zd points do not fit buffers of %zd slots", n_points, capacity);
    gr_keep_buffers(self, arrays);
    void *field[GR_FIELD_COUNT];
    for (int f = 0; f < GR_FIELD_COUNT; f++) field[f] = arrays[f] ? PyArray_DATA(arrays[f]) : NULL;
    gr_engine_bind(e, field, PyArray_DATA(arrays[GR_FIELD_COUNT]), capacity);
    self->is_bound = 1;
    if (fresh) {
        e->points.n = e->points.used = n_points;
        e->migration.n_pending = 0;
        for (int64_t c = 0; c < e->mesh.n_cells; c++) e->mesh.cell[c].count = 0;
        if (e->mesh.n_cells) return PyErr_Format(PyExc_RuntimeError, "points can be given once");
    }
    Py_RETURN_NONE;
}

/* ---- stepping ---- */

/* The slots that the buffers need to go on, 0 if there are enough; or NULL with an exception set. */
static PyObject *needed_capacity(const struct gr_engine *e, int error)
{
    if (error && error != GR_ERR_CAPACITY) return gr_raise(error, e);
    return PyLong_FromLongLong(error ? e->migration.needed_capacity : 0);
}

static PyObject *engine_regroup(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    struct gr_engine *e = gr_ready(self, 1);
    if (!e) return NULL;
    const int error = gr_regroup(e, NULL);
    if (!error) e->failure.code = GR_OK;
    return needed_capacity(e, error);
}

static PyObject *engine_advance(struct gr_object *self, PyObject *args)
{
    long long max_steps;
    double until;
    int threads, error;
    struct gr_engine *e;
    if (gr_take_run(args, &max_steps, &until, &threads) || !(e = gr_ready(self, 1))) return NULL;
    self->busy = 1;
    Py_BEGIN_ALLOW_THREADS
    error = gr_advance(e, self->kernels, max_steps, until, threads);
    Py_END_ALLOW_THREADS
    self->busy = 0;
    self->refused_threads = e->refused_threads;
    return needed_capacity(e, error);
}

static PyObject *run_stage(struct gr_object *self, int (*stage)(struct gr_engine *, const struct gr_kernels *))
{
    struct gr_engine *e = gr_ready(self, 1);
    return e ? needed_capacity(e, stage(e, self->kernels)) : NULL;
}

static PyObject *engine_p2g(struct gr_object *self, PyObject *Py_UNUSED(unused)) { return run_stage(self, gr_p2g); }
static PyObject *engine_grid(struct gr_object *self, PyObject *Py_UNUSED(unused)) { return run_stage(self, gr_grid); }
static PyObject *engine_g2p(struct gr_object *self, PyObject *Py_UNUSED(unused)) { return run_stage(self, gr_g2p); }

/* ---- looking in ---- */

static PyObject *engine_nodes(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 1);
    return e ? gr_python_nodes(e, gr_in_precision(self->kernels, e->config.single)) : NULL;
}

static PyObject *engine_cells(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 1);
    return e ? gr_python_cells(e) : NULL;
}

/* The numbers of the engine that a restart needs. */
static const struct gr_scalar scalars[] = {
#define GR_X(name, member) GR_SCALAR_OF(struct gr_engine, name, member),
    GR_X(time, clock.time) GR_X(dt, clock.dt) GR_X(time_anchor, clock.time_anchor) GR_X(shift_dt, clock.shift_dt)
        GR_X(dropped_mass, dropped_mass) GR_X(step, clock.step) GR_X(step_anchor, clock.step_anchor) GR_X(dropped, dropped)
            GR_X(clamped, clamped) GR_X(n_points, points.n)
#undef GR_X
#define GR_X(name, doc) {"tally_" #name, offsetof(struct gr_engine, tally.name), 1},
                GR_TALLY(GR_X)
#undef GR_X
};
enum { SCALARS = sizeof scalars / sizeof *scalars };

static PyObject *engine_scalars(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    return gr_python_scalars(self, scalars, SCALARS);
}

/* Make the tally that is due. */
static PyObject *engine_tally(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    struct gr_engine *e = gr_ready(self, 1);
    if (!e) return NULL;
    const int error = gr_tally_is_due(e) && !e->migration.n_pending ? gr_tally_make(e, NULL) : GR_OK;
    if (error) return gr_raise(error, e);
    Py_RETURN_NONE;
}

#define DT_ROUNDING 1e-9 /* of the longest time step, which a build with other instructions may round otherwise */

static PyObject *engine_restore(struct gr_object *self, PyObject *dict)
{
    struct gr_engine new, *e;
    if (gr_take_scalars(dict, scalars, SCALARS, &new) || !(e = gr_ready(self, 0))) return NULL;
    if (new.points.n != e->points.n)
        return PyErr_Format(PyExc_ValueError, "n_points = %lld does not agree with the points bound",
                            (long long)new.points.n);
    const struct gr_clock *clock = &new.clock;
    const double longest = gr_longest_dt(&e->config);
    if (gr_refuse_range("time", clock->time, 0, GR_LARGEST) ||
        gr_refuse_range("time_anchor", clock->time_anchor, 0, clock->time) ||
        gr_refuse_range("dt", clock->dt, 0, longest * (1 + DT_ROUNDING)) ||
        gr_refuse_range("shift_dt", clock->shift_dt, DBL_MIN, GR_LARGEST) ||
        gr_refuse_range("dropped_mass", new.dropped_mass, 0, GR_LARGEST) || gr_refuse_count("step", clock->step) ||
        gr_refuse_count("step_anchor", clock->step_anchor) || gr_refuse_count("dropped", new.dropped) ||
        gr_refuse_count("clamped", new.clamped) || gr_refuse_clock(clock->time, clock->dt > 0 ? clock->dt : longest))
        return NULL;
#define GR_X(name, doc) \
    if (gr_refuse_range("tally_" #name, new.tally.name, -GR_LARGEST, GR_LARGEST)) return NULL;
    GR_TALLY(GR_X)
#undef GR_X
    if (clock->step < clock->step_anchor)
        return PyErr_Format(PyExc_ValueError, "step_anchor = %lld must not exceed step = %lld",
                            (long long)clock->step_anchor, (long long)clock->step);
    gr_set_scalars(e, scalars, SCALARS, &new);
    e->shift_scale = -1.0 / e->clock.shift_dt;
    e->sums.valid = 0;
    Py_RETURN_NONE;
}

static PyObject *engine_bodies(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_poses(e, e->bodies.now, GR_BODY_NUMBERS) : NULL;
}

static PyObject *engine_restore_bodies(struct gr_object *self, PyObject *array)
{
    struct gr_engine *e = gr_ready(self, 0);
    if (!e || gr_take_poses(e, array, "bodies", e->bodies.now, GR_BODY_NUMBERS)) return NULL;
    if (e->bodies.now) memcpy(e->bodies.next, e->bodies.now, sizeof *e->bodies.now * (size_t)e->config.n_bodies);
    Py_RETURN_NONE;
}

/* The arguments (body, six numbers) of what sets a body from outside. Returned: the engine, or NULL with an exception. */
static struct gr_engine *take_outside(struct gr_object *self, PyObject *args, int *b, double numbers[6])
{
    struct gr_engine *e;
    double *n = numbers;
    if (!PyArg_ParseTuple(args, "i(dddddd)", b, n, n + 1, n + 2, n + 3, n + 4, n + 5) || !(e = gr_ready(self, 0)))
        return NULL;
    if (gr_refuse_range("body", *b, 0, e->config.n_bodies - 1)) return NULL;
    for (int d = 0; d < 6; d++)
        if (gr_refuse_range("a number of a body", n[d], -GR_LARGEST, GR_LARGEST)) return NULL;
    return e;
}

static PyObject *engine_drive(struct gr_object *self, PyObject *args)
{
    int b;
    double rates[6];
    struct gr_engine *e = take_outside(self, args, &b, rates);
    if (!e) return NULL;
    gr_drive(e, b, rates);
    Py_RETURN_NONE;
}

static PyObject *engine_load(struct gr_object *self, PyObject *args)
{
    int b;
    double load[6];
    struct gr_engine *e = take_outside(self, args, &b, load);
    if (!e) return NULL;
    gr_load(e, b, load);
    Py_RETURN_NONE;
}

/* Poses of the bodies at which the cells about thin ones are double. */
static PyObject *engine_split(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_poses(e, e->bodies.split, 7) : NULL;
}

static PyObject *engine_restore_split(struct gr_object *self, PyObject *array)
{
    struct gr_engine *e = gr_ready(self, 0);
    if (!e || gr_take_poses(e, array, "split", e->bodies.split, 7)) return NULL;
    if (e->config.n_bodies) e->disconnected = 1; /* the cells are to be made anew */
    Py_RETURN_NONE;
}

static PyObject *engine_watch_walls(struct gr_object *self, PyObject *args)
{
    PyObject *codes, *owners, *times, *rows_after;
    int n_walls;
    struct gr_engine *e = gr_ready(self, 0);
    if (!e || !PyArg_ParseTuple(args, "iOOOO:watch_walls", &n_walls, &codes, &owners, &times, &rows_after)) return NULL;
    return gr_python_watch_walls(e, n_walls, codes, owners, times, rows_after);
}

static PyObject *engine_hold_pressure(struct gr_object *self, PyObject *args)
{
    struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_hold_pressure(e, args) : NULL;
}

static PyObject *engine_walls(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_wall_impulses(e) : NULL;
}

static PyObject *engine_restore_walls(struct gr_object *self, PyObject *array)
{
    struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_restore_walls(e, array) : NULL;
}

static PyObject *engine_watch_patches(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_watch_patches(e) : NULL;
}

static PyObject *engine_patches(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_patches(e) : NULL;
}

static PyObject *engine_restore_patches(struct gr_object *self, PyObject *args)
{
    struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_restore_patches(e, args) : NULL;
}

static PyObject *engine_add_inlet(struct gr_object *self, PyObject *args)
{
    struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_add_inlet(e, args) : NULL;
}

static PyObject *engine_touch_solids(struct gr_object *self, PyObject *args)
{
    struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_touch_solids(e, args) : NULL;
}

static PyObject *engine_inflow(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_inflow(e->inflow) : NULL;
}

static PyObject *engine_restore_inflow(struct gr_object *self, PyObject *array)
{
    struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_restore_inflow(e->inflow, array) : NULL;
}

/* The calm of cells by their indices in the grid (mpm/sleep.h). */
static PyObject *engine_calm(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 1);
    if (!e) return NULL;
    const npy_intp shape[2] = {2, e->sleep ? gr_sleep_list(e, NULL) : 0};
    PyObject *array = PyArray_SimpleNew(2, shape, NPY_INT64);
    int64_t *data = array ? PyArray_DATA((PyArrayObject *)array) : NULL;
    if (array && e->sleep) (void)gr_sleep_list(e, (int64_t *[2]){data, data + shape[1]});
    return array;
}

static PyObject *engine_restore_calm(struct gr_object *self, PyObject *object)
{
    static const npy_intp shape[2] = {2, -1};
    PyArrayObject *array = gr_array(object, "calm", NPY_INT64, 2, shape, 0);
    struct gr_engine *e = array ? gr_ready(self, 1) : NULL;
    if (!e) return NULL;
    const int64_t *data = PyArray_DATA(array), n = PyArray_DIM(array, 1);
    if (!e->sleep || !gr_sleep_restore(e, n, data, data + n)) Py_RETURN_NONE;
    return PyErr_Format(PyExc_ValueError, "calm must have the indices of cells of the grid, and numbers from 0 to %d or %d",
                        GR_CALM_CHECKS, GR_ASLEEP);
}

static PyObject *engine_share(struct gr_object *self, PyObject *args)
{
    struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_share(self, e, args) : NULL;
}

static PyObject *engine_blocks(struct gr_object *self, PyObject *args)
{
    const struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_blocks(e, args) : NULL;
}

static PyObject *engine_places(struct gr_object *self, PyObject *args)
{
    const struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_places(e, args) : NULL;
}

static PyObject *engine_traffic(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_traffic(e) : NULL;
}

static PyObject *engine_refresh(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    struct gr_engine *e = gr_ready(self, 0);
    if (!e) return NULL;
    e->sums.valid = 0;
    Py_RETURN_NONE;
}

static PyObject *engine_stable_dt(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 1);
    return e ? PyFloat_FromDouble(gr_stable_dt(e, NULL)) : NULL;
}

static PyObject *engine_fluidity(struct gr_object *self, PyObject *Py_UNUSED(unused))
{
    const struct gr_engine *e = gr_ready(self, 0);
    return e ? gr_python_fluidity(e) : NULL;
}

static PyMethodDef methods[] = {
    {"bind", (PyCFunction)engine_bind, METH_VARARGS,
     "bind(buffers, n_points, fresh)\n--\n\nLend {name: float64 (component, capacity)} and id: int64 (capacity,). Nothing is copied."},
    {"regroup", (PyCFunction)engine_regroup, METH_NOARGS,
     "regroup()\n--\n\nGroup the points by cell; returns the capacity needed if the buffers are too small, else 0."},
    {"advance", (PyCFunction)engine_advance, METH_VARARGS,
     "advance(max_steps, until, threads)\n--\n\nRun steps until a count or a time, the GIL released; returns as regroup."},
    {"p2g", (PyCFunction)engine_p2g, METH_NOARGS, "p2g()\n--\n\nP2G alone: the sums of all cells."},
    {"grid", (PyCFunction)engine_grid, METH_NOARGS, "grid()\n--\n\nThe grid stage alone: nodal velocities of this step."},
    {"g2p", (PyCFunction)engine_g2p, METH_NOARGS, "g2p()\n--\n\nG2P and stress update alone; completes the step."},
    {"nodes", (PyCFunction)engine_nodes, METH_NOARGS,
     "nodes()\n--\n\nCopies of the nodal arrays: x, mass, momentum, force, v, w."},
    {"cells", (PyCFunction)engine_cells, METH_NOARGS,
     "cells()\n--\n\n(slots, counts, places): the slots of the points in the buffers, cell by cell; the number of points of each "
     "active cell; and its place in the order of cells, its index in the grid, and those behind thin bodies last."},
    {"scalars", (PyCFunction)engine_scalars, METH_NOARGS, "scalars()\n--\n\nThe numbers that a restart needs."},
    {"tally", (PyCFunction)engine_tally, METH_NOARGS, "tally()\n--\n\nMake the tally that is due: scalars() then has it."},
    {"restore", (PyCFunction)engine_restore, METH_O, "restore(scalars)\n--\n\nSet the numbers of a restart."},
    {"bodies", (PyCFunction)engine_bodies, METH_NOARGS,
     "bodies()\n--\n\nState of the bodies, (n, 40): position, orientation (quaternion), velocity, angular velocity, impulse,\n"
     "angular impulse, work; whether it is driven from outside, and by which velocities; load from outside;\n"
     "time when it was last set from outside, and the impulses until then."},
    {"drive", (PyCFunction)engine_drive, METH_VARARGS,
     "drive(body, rates)\n--\n\nReplace the prescribed motion of a body by a constant velocity and angular velocity."},
    {"load", (PyCFunction)engine_load, METH_VARARGS,
     "load(body, load)\n--\n\nLet a constant force and torque act on what moves freely of a body."},
    {"restore_bodies", (PyCFunction)engine_restore_bodies, METH_O,
     "restore_bodies(state)\n--\n\nSet the state of the bodies, as bodies() gave it."},
    {"split", (PyCFunction)engine_split, METH_NOARGS,
     "split()\n--\n\nPoses at which the cells about thin bodies are double and open volumes are computed, (n, 7): position, orientation (quaternion)."},
    {"restore_split", (PyCFunction)engine_restore_split, METH_O,
     "restore_split(poses)\n--\n\nSet these poses, as split() gave them."},
    {"watch_walls", (PyCFunction)engine_watch_walls, METH_VARARGS,
     "watch_walls(n_walls, codes, owners, opens_at, after)\n--\n\nAdd up the impulses on the walls, from before the points "
     "are bound. codes: int32, a row\nfor each combination of classes of node_codes; rows: owners int32 (n, 3), of each "
     "component, -1\nfor none; opens_at float64 (n,), from when on the row `after`, int32 (n,), holds."},
    {"hold_pressure", (PyCFunction)engine_hold_pressure, METH_VARARGS,
     "hold_pressure(wall, axis, side, pressure, area, height, rate, limit)\n--\n\nLet a wall that is watched keep a "
     "pressure, Pa. side: 1 at the upper end of the axis, -1 at the\nlower; area: of the wall, m or m^2; height: of the "
     "domain, m; rate: strain per pressure and time,\n1/(Pa s); limit: largest strain."},
    {"walls", (PyCFunction)engine_walls, METH_NOARGS,
     "walls()\n--\n\nImpulse and angular impulse about the origin of the material on each wall, its displacement and\nwork, and its excess of pressure, (n, 9)."},
    {"restore_walls", (PyCFunction)engine_restore_walls, METH_O,
     "restore_walls(impulses)\n--\n\nSet the impulses, as walls() gave them."},
    {"watch_patches", (PyCFunction)engine_watch_patches, METH_NOARGS,
     "watch_patches()\n--\n\nAdd up the impulses on patches of walls and bodies, too; after watch_walls."},
    {"patches", (PyCFunction)engine_patches, METH_NOARGS,
     "patches()\n--\n\nThe patches that were touched, int64 (n, 4): index of a wall, or that of a body behind all walls, "
     "and\nindices of its node, or of its cell in coordinates of the body. And their numbers, float64 (n, 7):\nimpulse of "
     "the material; for bodies, its part along the surface and that along the normal."},
    {"restore_patches", (PyCFunction)engine_restore_patches, METH_VARARGS,
     "restore_patches(places, numbers)\n--\n\nSet the patches, as patches() gave them."},
    {"add_inlet", (PyCFunction)engine_add_inlet, METH_VARARGS,
     "add_inlet(records, axis, velocity, spacing, begin, end, yields)\n--\n\nLet points enter, from before the points are "
     "bound. records: float64 (sites, components), what\nenters at each site, all fields in the order of fields(); velocity: "
     "3 numbers, m/s; spacing of the\npoints along the axis, m; times at which they begin and end, s; yields: whether a point "
     "waits while its\nposition is occupied."},
    {"touch_solids", (PyCFunction)engine_touch_solids, METH_VARARGS,
     "touch_solids(balls, first_ball, restitution, obstacles)\n--\n\nLet the bodies that move freely touch each other and "
     "solids. balls: float64 (n, 4), centre in\ncoordinates of the body and radius, m; first_ball: int64 "
     "(bodies + 1,); restitution: float64 (bodies,),\n0 to 1; obstacles: float64 (m, 12): lower, upper, m; velocity, m/s; "
     "friction; opens_at, s; axis of a wall\nwithin the domain, or -1. Sides beyond 1e50 are infinitely far."},
    {"inflow", (PyCFunction)engine_inflow, METH_NOARGS,
     "inflow()\n--\n\nState of the inlets, int64: the next id; for each inlet the points that were due and missed, and of "
     "each\nsite those that have entered, and whether one waits."},
    {"restore_inflow", (PyCFunction)engine_restore_inflow, METH_O,
     "restore_inflow(state)\n--\n\nSet the state of the inlets, as inflow() gave it."},
    {"calm", (PyCFunction)engine_calm, METH_NOARGS,
     "calm()\n--\n\nCells that are calm or asleep: their indices in the grid and for how many checks, int64 (2, n)."},
    {"restore_calm", (PyCFunction)engine_restore_calm, METH_O, "restore_calm(calm)\n--\n\nSet this, as calm() gave it."},
    {"share", (PyCFunction)engine_share, METH_VARARGS,
     "share(link, rank, size, edge, owners)\n--\n\nShare the run with other processes, from before the points are bound. "
     "link: has the methods\nexchange([(rank, out, in), ...]), sum(int64 view), largest(float64 view), which return whether "
     "they\nhave succeeded; edge: cells of a block along each axis, 0 for runs of 512\ncells, which a nonlocal law needs; owners: int32, the rank of each block, x\nfastest."},
    {"blocks", (PyCFunction)engine_blocks, METH_VARARGS,
     "blocks(edge)\n--\n\nNumber of blocks of so many cells along each axis."},
    {"places", (PyCFunction)engine_places, METH_VARARGS,
     "places(x, edge)\n--\n\n(cell, block) of each of the positions, float64 (dim, n), by their indices in the grid, and in that "
     "of\nblocks of so many cells along each axis, x fastest; of positions outside, the nearest."},
    {"traffic", (PyCFunction)engine_traffic, METH_NOARGS,
     "traffic()\n--\n\npeers, sent_cells and ghost_cells of a step; sent_bytes, seconds_waiting, seconds_copying so far;\nreach (cells). None for one process."},
    {"refresh", (PyCFunction)engine_refresh, METH_NOARGS,
     "refresh()\n--\n\nMake the sums of the cells anew: the buffers may have been written to."},
    {"stable_dt", (PyCFunction)engine_stable_dt, METH_NOARGS, "stable_dt()\n--\n\ncfl dx/(c + |v|max), s."},
    {"fluidity", (PyCFunction)engine_fluidity, METH_NOARGS,
     "fluidity()\n--\n\nmethod, substeps, limit (s), iterations, clamped (cells) of a nonlocal law; None without one."},
    {"foreign_array", (PyCFunction)gr_python_foreign_array, METH_NOARGS,
     "foreign_array()\n--\n\nAn array that the emulated device must see and that is not of its memory, or None."},
    {"zeros", (PyCFunction)gr_python_zeros, METH_VARARGS,
     "zeros(n)\n--\n\nSo many bytes of the memory of the engine, all 0."},
    {"fields", (PyCFunction)gr_python_fields, METH_NOARGS,
     "fields()\n--\n\n[(name, components, unit, doc, dtype)] of the buffers."},
    {NULL, NULL, 0, NULL}};

PyTypeObject *gr_engine_type(PyObject *module)
{
    return gr_make_type(module, "granular._core.Engine", "The engine of a simulation; see granular.Simulation.",
                        (initproc)engine_init, (destructor)engine_dealloc, methods);
}
