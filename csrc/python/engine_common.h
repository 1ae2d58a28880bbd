/* Common parts of the two engine types, `Engine` and `Sph`: they borrow the buffers of the points, and step them with the
 * GIL released. */
#pragma once

#include <stddef.h>

#include "python/arrays.h"

#define GR_MAX_FIELDS 24

/* An instance of one of the two types. */
struct gr_object {
    PyObject_HEAD
    void *engine; /* struct gr_engine or struct gr_sph; NULL until it is built */
    const struct gr_kernels *kernels;
    const struct gr_backend *device; /* mpm/device.h; NULL: none */
    const struct gr_field_info *fields;
    int n_fields, components[GR_MAX_FIELDS];   /* 0 components: the engine does not carry the field */
    int type[GR_MAX_FIELDS];                   /* of the numbers of its array, NPY_DOUBLE or NPY_FLOAT */
    PyArrayObject *buffers[GR_MAX_FIELDS + 1]; /* the borrowed arrays, the ids last */
    PyObject *borrowed;                        /* what else the engine borrows from; may be NULL */
    PyObject *link;                            /* by which an engine reaches other processes; may be NULL */
    int is_bound, busy, refused_threads;
};

/* The type, with the parts common to both: deallocation, isa. Returned: NULL with an exception set. */
PyTypeObject *gr_make_type(PyObject *module, const char *name, const char *doc, initproc init, destructor dealloc,
                           PyMethodDef *methods);

/* What dealloc does after the engine has been freed. */
void gr_free_object(struct gr_object *self);

/* Take the kernels of an instruction set for an engine that is to be built; one that exists is refused. Returned: 0, or
 * -1 with an exception set. */
int gr_begin_object(struct gr_object *self, const char *isa);

/* The engine. Returned: NULL with RuntimeError set if it is not built, has no points where it must be bound, or runs in
 * another thread. Arguments of the caller are to be read before, as that may run code. */
void *gr_ready(const struct gr_object *self, int must_be_bound);

/* fields() -> [(name, components, unit, doc, dtype)] that this engine carries. */
PyObject *gr_python_fields(struct gr_object *self, PyObject *unused);

/* The arrays of a dict that the engine needs: of its fields, NULL for one it does not carry, and the ids last. All are
 * checked. Returned: their number of slots, or -1 with an exception set. */
Py_ssize_t gr_take_buffers(const struct gr_object *self, PyObject *dict, PyArrayObject **arrays);

/* Keep arrays alive as long as the engine borrows them. */
void gr_keep_buffers(struct gr_object *self, PyArrayObject *const *arrays);

/* The arguments of advance(max_steps, until, threads). Returned: 0, or -1 with an exception set. */
int gr_take_run(PyObject *args, long long *max_steps, double *until, int *threads);

/* Find the device of this name, none for an empty one, for an engine that is to be built; let this thread take the memory of
 * the engine from it; and give the engine its device. Returned: 0, or -1 with an exception set. */
int gr_find_device(struct gr_object *self, const char *name);
void gr_use_memory(const struct gr_object *self);
int gr_take_device(struct gr_object *self);

/* foreign_array() -> the name of an array that a device must see and that is not of its memory, or None. */
PyObject *gr_python_foreign_array(struct gr_object *self, PyObject *unused);

/* open_gpu(double, single): function of the module. */
PyObject *gr_python_open_gpu(PyObject *module, PyObject *args);

/* zeros(n) -> so many bytes of the memory of the engine, all 0. */
PyObject *gr_python_zeros(struct gr_object *self, PyObject *args);

/* The kernels of an instruction set. Returned: NULL with ValueError set if this machine has not got it. */
const struct gr_kernels *gr_take_kernels(const char *isa);

/* A number of an engine that a restart needs, and where its struct has it. */
struct gr_scalar {
    const char *name;
    size_t place;
    int is_float; /* double, else int64_t */
};

#define GR_SCALAR_OF(type, name, member)                                                      \
    {                                                                                         \
#name, offsetof(type, member), _Generic(((type *)0)->member, double : 1, int64_t : 0) \
    }

/* The n numbers of a table as a dict, or NULL with an exception set. */
PyObject *gr_python_scalars(const struct gr_object *self, const struct gr_scalar *table, int n);

/* Read them from a dict into another struct of the same type, and copy them from that to the engine. Returned: 0, or -1
 * with an exception set. */
int gr_take_scalars(PyObject *dict, const struct gr_scalar *table, int n, void *out);
/* Refuse a number of a restart outside of its range, a count below 0 or so large that a run could exceed 64 bits, and a
 * time that a step of dt does not change. Returned: 0, or -1 with ValueError set. */
int gr_refuse_range(const char *name, double value, double low, double high);
int gr_refuse_count(const char *name, int64_t value);
int gr_refuse_clock(double time, double dt);

void gr_set_scalars(void *engine, const struct gr_scalar *table, int n, const void *from);

/* fluidity.c: refuse a substep of the diffusion that is too long, returned: 0, or -1 with ValueError set; and the numbers of
 * the fluidity, None without. */
int gr_refuse_diffusion(const struct gr_engine *e);
PyObject *gr_python_fluidity(const struct gr_engine *e);

/* ranks.c: methods of an engine that shares its run with other processes. */
PyObject *gr_python_share(struct gr_object *self, struct gr_engine *e, PyObject *args);
PyObject *gr_python_blocks(const struct gr_engine *e, PyObject *args);
PyObject *gr_python_traffic(const struct gr_engine *e);
