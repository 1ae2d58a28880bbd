/* Shared by this folder: checks of NumPy arrays, and the one place where core errors become exceptions. */
#pragma once

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define PY_ARRAY_UNIQUE_SYMBOL granular_core_array_api
#ifndef GR_IMPORTS_NUMPY
#define NO_IMPORT_ARRAY
#endif
#include <numpy/arrayobject.h>

#include "kernels.h"
#include "mpm/engine.h"

/* A C-contiguous, aligned array of `type`, of exactly `ndim` dimensions with the sizes given (-1: any), writeable
 * where asked. Never converts. Returned: borrowed pointer, or NULL with TypeError or ValueError set. */
PyArrayObject *gr_array(PyObject *object, const char *name, int type, int ndim, const npy_intp *shape, int writeable);

/* Refuse arrays that share memory; NULL is none. Returned: 0, or -1 with ValueError set. */
int gr_refuse_overlap(PyArrayObject *const *arrays, const char *const *names, int n);

#define GR_LARGEST 1e60 /* of numbers in arrays: products of smaller numbers stay finite */

/* What follows returns 0, or -1 with an exception set. */

/* ValueError with a message. Always -1. */
int gr_refuse(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* A row of a table that is no tuple. */
int gr_refuse_row(const char *table, PyObject *row);

/* A number that is not finite, or not positive (nor zero where that may be). */
int gr_refuse_number(const char *name, double value, int may_be_zero);

/* Any number of an array of doubles outside of low to GR_LARGEST. */
int gr_refuse_values(const char *name, PyArrayObject *array, double low);

/* A number from a dict; `kind` describes it in a message. */
int gr_take_float(PyObject *dict, const char *kind, const char *name, double *out);

/* The n parameters of a table from a dict of numbers, those checked by gr_refuse_number; may_be_zero: one bit each. */
int gr_take_parameters(PyObject *dict, const struct gr_parameter_info *table, int n, unsigned may_be_zero,
                       double *parameter);

/* Index of a name in a list of n, or -1 with ValueError set; `kind` as above. */
int gr_take_index(const char *kind, const char *name, const char *const *names, int n);

/* Append a row to a list, or put a value into a dict; the row or value is taken over, and NULL where making it failed.
 * Returned: the list or dict; where that failed, NULL, and it is lost. */
PyObject *gr_append(PyObject *list, PyObject *row);
PyObject *gr_put(PyObject *dict, const char *name, PyObject *value);

/* Where and when a run failed. */
struct gr_failed_at {
    int64_t id, step;
    int dim;
    double x, y, z, time;
    const char *words; /* what a device says, or NULL */
};

/* Raise the exception of a core error. Always returns NULL. */
PyObject *gr_raise(int error, const struct gr_engine *engine);
PyObject *gr_raise_at(int error, const struct gr_failed_at *at);

/* A table of gravity; n may be 0. The numbers are not copied. */
int gr_take_gravity(int dim, PyObject *times, PyObject *vectors, int *n, const double **time, const double **vector);

/* Space for the parts of the configuration of an engine. */
struct gr_tables {
    struct gr_wall wall[256];
    struct gr_body body[GR_MAX_BODIES];
    struct gr_part part[GR_MAX_PARTS];
};

/* The configuration that keyword arguments describe; it points into them and into `tables`. Returned: 0, or -1 with
 * an exception set. */
int gr_parse_config(PyObject *args, PyObject *kwargs, struct gr_config *out, struct gr_tables *tables, const char **isa,
                    const char **device);

/* declarations.c: functions of the module. */
PyObject *gr_python_scheme_numbers(PyObject *module, PyObject *unused);
PyObject *gr_python_material_numbers(PyObject *module, PyObject *unused);
PyObject *gr_python_enumerations(PyObject *module, PyObject *unused);
PyObject *gr_python_laws(PyObject *module, PyObject *unused);

/* fluidity.c: function of the module. */
PyObject *gr_python_fluidity_diffuse(PyObject *module, PyObject *args, PyObject *kwargs);

/* bodies.c: the bodies of a configuration, from rows (parts, samples, pose, motion, contact, free, rough, friction, mass,
 * inertia) */
int gr_take_bodies(struct gr_config *c, PyObject *rows, struct gr_tables *tables);

/* surfaces.c: tables of a part that is sampled or a height map; they are borrowed. And functions of the module. */
int gr_take_tables(PyObject *tables, struct gr_part *part);
PyObject *gr_python_mesh_tree(PyObject *module, PyObject *args);
PyObject *gr_python_mesh_distance(PyObject *module, PyObject *args);
PyObject *gr_python_mesh_winding(PyObject *module, PyObject *args);
PyObject *gr_python_mesh_clear(PyObject *module, PyObject *args);

/* A row for each body that begins with its position and orientation: as an array (bodies, numbers), and from one. */
PyObject *gr_python_poses(const struct gr_engine *e, const void *rows, int numbers);
int gr_take_poses(const struct gr_engine *e, PyObject *object, const char *name, void *rows, int numbers);
PyObject *gr_python_body_distance(PyObject *module, PyObject *args);

/* mesh.c: nodes(), cells() and places(x, edge) of an engine. */
PyObject *gr_python_nodes(const struct gr_engine *e, const struct gr_kernels *kernels);
PyObject *gr_python_cells(const struct gr_engine *e);
PyObject *gr_python_places(const struct gr_engine *e, PyObject *args);

/* walls.c: impulses on the walls. */
PyObject *gr_python_hold_pressure(struct gr_engine *e, PyObject *args);
PyObject *gr_python_watch_walls(struct gr_engine *e, int n_walls, PyObject *codes, PyObject *owners, PyObject *opens_at,
                                PyObject *after);
PyObject *gr_python_wall_impulses(const struct gr_engine *e);
PyObject *gr_python_restore_walls(struct gr_engine *e, PyObject *array);
PyObject *gr_python_watch_patches(struct gr_engine *e);
PyObject *gr_python_patches(const struct gr_engine *e);
PyObject *gr_python_restore_patches(struct gr_engine *e, PyObject *args);

/* rigid.c: e->bodies.rigid. */
PyObject *gr_python_touch_solids(struct gr_engine *e, PyObject *args);

/* inlets.c */
struct gr_sph;
PyObject *gr_python_add_inlet(struct gr_engine *e, PyObject *args);
PyObject *gr_python_add_sph_inlet(struct gr_sph *s, PyObject *args);
PyObject *gr_python_inflow(const struct gr_inlets *inlets);
PyObject *gr_python_restore_inflow(struct gr_inlets *inlets, PyObject *array);
PyObject *gr_python_inlet_loads(const struct gr_sph *s);
PyObject *gr_python_restore_inlet_loads(struct gr_sph *s, PyObject *array);

/* testing.c: functions of the module. */
PyObject *gr_python_law_update(PyObject *module, PyObject *args);
PyObject *gr_python_fluidity_update(PyObject *module, PyObject *args);
PyObject *gr_python_hencky_update(PyObject *module, PyObject *args);

extern PyObject *gr_SimulationError;
extern PyTypeObject *gr_engine_type(PyObject *module);
extern PyTypeObject *gr_sph_type(PyObject *module); /* sph_type.c */
