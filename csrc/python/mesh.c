/* The mesh of an engine as arrays: its nodes with their sums and velocities, and the points of its cells. */
#include "core/index.h"
#include "kernels.h"
#include "mpm/grid.h"
#include "mpm/ranks.h"
#include "python/engine_common.h"

/* True for the nodes of ugimp beyond the ends of the domain, which have no weight. */
static int is_beyond(const struct gr_engine *e, int64_t id)
{
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        const double position = axis->node_position[id % axis->n_nodes];
        if (position < 0 || position > axis->length / e->config.dx + 0.5) return 1;
        id /= axis->n_nodes;
    }
    return 0;
}

PyObject *gr_python_nodes(const struct gr_engine *e, const struct gr_kernels *kernels)
{
    enum { X, MASS, MOMENTUM, FORCE, V, W, ARRAYS };
    static const char *const names[ARRAYS] = {"x", "mass", "momentum", "force", "v", "w"};
    const npy_intp dim = e->config.dim;
    npy_intp n = 0, i = 0;
    for (int64_t node = 0; node < e->mesh.n_nodes; node++) n += !is_beyond(e, e->mesh.node_id[node]);
    const npy_intp shape[2] = {n, dim};
    double *data[ARRAYS];
    PyObject *out = PyDict_New();
    for (int k = 0; out && k < ARRAYS; k++) {
        PyObject *array = PyArray_SimpleNew(k == MASS ? 1 : 2, shape, NPY_DOUBLE);
        data[k] = array ? PyArray_DATA((PyArrayObject *)array) : NULL;
        out = gr_put(out, names[k], array);
    }
    for (int64_t node = 0; out && node < e->mesh.n_nodes; node++) {
        int64_t id = e->mesh.node_id[node];
        double sum[GR_SUM_DAMPED(3)];
        if (is_beyond(e, id)) continue;
        gr_sum_node(e, kernels, node, sum);
        data[MASS][i] = sum[GR_SUM_MASS];
        for (npy_intp d = 0, at = i * dim; d < dim; d++, at++) {
            const struct gr_axis *axis = &e->axis[d];
            data[X][at] = axis->origin + axis->node_position[id % axis->n_nodes] * e->config.dx;
            id /= axis->n_nodes;
            data[MOMENTUM][at] = sum[GR_SUM_MOMENTUM + d];
            data[FORCE][at] = sum[GR_SUM_FORCE(dim) + d];
            data[V][at] = gr_node_field(e, GR_NODE_VELOCITY + (int)d)[node];
            data[W][at] = gr_node_field(e, GR_NODE_UPDATE((int)dim) + (int)d)[node];
        }
        i++;
    }
    return out;
}

PyObject *gr_python_cells(const struct gr_engine *e)
{
    npy_intp n_points = 0;
    const npy_intp n_cells = e->mesh.n_cells;
    for (npy_intp c = 0; c < n_cells; c++) n_points += e->mesh.cell[c].count;
    PyObject *slots = PyArray_SimpleNew(1, &n_points, NPY_INT64), *counts = PyArray_SimpleNew(1, &n_cells, NPY_INT64),
             *places = PyArray_SimpleNew(1, &n_cells, NPY_INT64);
    if (!slots || !counts || !places) {
        Py_XDECREF(slots);
        Py_XDECREF(counts);
        Py_XDECREF(places);
        return NULL;
    }
    int64_t *next = PyArray_DATA((PyArrayObject *)slots);
    for (npy_intp c = 0; c < n_cells; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        for (int32_t k = 0; k < cell->count; k++) *next++ = gr_slot(cell, k);
        ((int64_t *)PyArray_DATA((PyArrayObject *)counts))[c] = cell->count;
        ((int64_t *)PyArray_DATA((PyArrayObject *)places))[c] = gr_order_of_cell(e, cell);
    }
    return Py_BuildValue("NNN", slots, counts, places);
}

PyObject *gr_python_places(const struct gr_engine *e, PyObject *args)
{
    PyObject *object;
    int edge;
    if (!PyArg_ParseTuple(args, "Oi:places", &object, &edge) || gr_refuse_range("edge", edge, 0, INT32_MAX)) return NULL;
    const npy_intp dim = e->config.dim, shape[2] = {dim, -1};
    PyArrayObject *array = gr_array(object, "x", NPY_DOUBLE, 2, shape, 0);
    if (!array) return NULL;
    const npy_intp n = PyArray_DIM(array, 1);
    const double *x = PyArray_DATA(array);
    PyObject *cells = PyArray_SimpleNew(1, &n, NPY_INT64), *blocks = PyArray_SimpleNew(1, &n, NPY_INT64);
    for (npy_intp p = 0; cells && blocks && p < n; p++) {
        int64_t cell = 0, block = 0;
        for (npy_intp d = dim - 1; d >= 0; d--) {
            const struct gr_axis *axis = &e->axis[d];
            int64_t at = gr_locate(axis, e->inv_dx, x[d * n + p]);
            if (axis->periodic && at == axis->n_cells) at = 0;
            at = at < 0 ? 0 : at < axis->n_cells ? at : axis->n_cells - 1;
            cell = cell * axis->n_cells + at;
            if (edge) block = block * (((int64_t)axis->n_cells + edge - 1) / edge) + at / edge;
        }
        if (!edge) block = cell / GR_RUN_OF_CELLS;
        ((int64_t *)PyArray_DATA((PyArrayObject *)cells))[p] = cell;
        ((int64_t *)PyArray_DATA((PyArrayObject *)blocks))[p] = block;
    }
    if (cells && blocks) return Py_BuildValue("NN", cells, blocks);
    Py_XDECREF(cells);
    Py_XDECREF(blocks);
    return NULL;
}
