/* What the two engine types, `Engine` and `Sph`, have in common. */
#pragma once

#include "python/arrays.h"

/* Refuse an engine that is not built, has no points where it must be bound, or runs in another thread.
 * Returned: 0, or -1 with RuntimeError set. */
int gr_refuse_state(int exists, int is_bound, int busy);

/* The arguments of advance(max_steps, until, threads). Returned: 0, or -1 with an exception set. */
int gr_take_run(PyObject *args, long long *max_steps, double *until, int *threads);

/* Whether the team of OpenMP died in a fork of this process, so that only one thread can run. Returned: 0, or 1 with
 * RuntimeError set. */
int gr_team_is_lost(int threads);

/* The kernels of an instruction set. Returned: NULL with ValueError set if this machine has not got it. */
const struct gr_kernels *gr_take_kernels(const char *isa);

/* Append (name, components, unit, doc) of a field to a list, which is lost where that fails. */
PyObject *gr_add_field(PyObject *list, const struct gr_field_info *info, int components);

/* A scalar of a restart, from a dict. Returned: 0, or -1 with an exception set. */
int gr_take_float(PyObject *dict, const char *name, double *out);
int gr_take_integer(PyObject *dict, const char *name, int64_t *out);

/* Put a scalar into a dict. Returned: 0, or -1 with an exception set. */
int gr_put_float(PyObject *dict, const char *name, double value);
int gr_put_integer(PyObject *dict, const char *name, int64_t value);
