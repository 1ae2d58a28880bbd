/* Ranks: the functions of a Python object as a transport of the core (core/transport.h). */
#include "mpm/ranks.h"

#include "contact/shared_contacts.h"
#include "python/engine_common.h"

/* Call a method of the link, which returns whether it has succeeded. Returned: 0, or 1 if it has not. */
static int call(PyObject *link, const char *method, PyObject *argument)
{
    PyObject *done = argument ? PyObject_CallMethod(link, method, "O", argument) : NULL;
    const int failed = !done || PyObject_IsTrue(done) != 1;
    if (PyErr_Occurred()) PyErr_WriteUnraisable(link);
    Py_XDECREF(done);
    Py_XDECREF(argument);
    return failed;
}

static PyObject *view(void *data, int64_t bytes, int flags)
{
    static char nothing[1];
    return PyMemoryView_FromMemory(bytes ? data : nothing, (Py_ssize_t)bytes, flags);
}

static int exchange(void *context, const struct gr_message *message, int n)
{
    const PyGILState_STATE state = PyGILState_Ensure();
    PyObject *list = PyList_New(0);
    for (int k = 0; k < n && list; k++)
        list = gr_append(list, Py_BuildValue("iNN", message[k].rank, view(message[k].out, message[k].out_bytes, PyBUF_READ),
                                             view(message[k].in, message[k].in_bytes, PyBUF_WRITE)));
    const int failed = call(context, "exchange", list);
    PyGILState_Release(state);
    return failed;
}

static int sum(void *context, int64_t *number, int64_t n)
{
    const PyGILState_STATE state = PyGILState_Ensure();
    const int failed = call(context, "sum", view(number, n * (int64_t)sizeof *number, PyBUF_WRITE));
    PyGILState_Release(state);
    return failed;
}

static int largest(void *context, double *number, int64_t n)
{
    const PyGILState_STATE state = PyGILState_Ensure();
    const int failed = call(context, "largest", view(number, n * (int64_t)sizeof *number, PyBUF_WRITE));
    PyGILState_Release(state);
    return failed;
}

PyObject *gr_python_share(struct gr_object *self, struct gr_engine *e, PyObject *args)
{
    static const npy_intp any[1] = {-1};
    PyObject *link, *owners;
    int rank, size, edge;
    if (!PyArg_ParseTuple(args, "OiiiO:share", &link, &rank, &size, &edge, &owners)) return NULL;
    PyArrayObject *array = gr_array(owners, "owners", NPY_INT32, 1, any, 0);
    if (!array) return NULL;
    if (gr_refuse_range("size", size, 1, INT32_MAX) || gr_refuse_range("rank", rank, 0, size - 1) ||
        gr_refuse_range("edge", edge, 0, INT32_MAX))
        return NULL;
    if (e->device) return PyErr_Format(PyExc_ValueError, "an engine with a device cannot be shared");
    int64_t blocks = 1;
    for (int d = 0; d < 3; d++) blocks *= gr_ranks_blocks(e, d, edge);
    if (PyArray_DIM(array, 0) != blocks)
        return PyErr_Format(PyExc_ValueError, "owners must have %lld numbers, one of each block", (long long)blocks);
    const struct gr_transport transport = {link, rank, size, exchange, sum, largest};
    int error = gr_ranks_new(e, &transport, edge, PyArray_DATA(array));
    if (!error) error = gr_shared_contacts_new(e);
    if (error) return gr_raise(error, NULL);
    Py_INCREF(link);
    Py_XSETREF(self->link, link);
    Py_RETURN_NONE;
}

PyObject *gr_python_blocks(const struct gr_engine *e, PyObject *args)
{
    int edge;
    if (!PyArg_ParseTuple(args, "i:blocks", &edge) || gr_refuse_range("edge", edge, 0, INT32_MAX)) return NULL;
    return Py_BuildValue("LLL", (long long)gr_ranks_blocks(e, 0, edge), (long long)gr_ranks_blocks(e, 1, edge),
                         (long long)gr_ranks_blocks(e, 2, edge));
}

PyObject *gr_python_traffic(const struct gr_engine *e)
{
    long long cells = 0, ghosts = 0;
    if (!e->ranks) Py_RETURN_NONE;
    for (int p = 0; p < e->ranks->n_peers; p++) {
        cells += e->ranks->peer[p].n_own;
        ghosts += e->ranks->peer[p].n_ghost;
    }
    return Py_BuildValue("{sisLsLsLsisdsd}", "peers", e->ranks->n_peers, "sent_cells", cells, "ghost_cells", ghosts,
                         "sent_bytes", (long long)e->ranks->sent_bytes, "reach", e->ranks->reach, "seconds_waiting",
                         e->ranks->seconds_waiting, "seconds_copying", e->ranks->seconds_copying);
}
