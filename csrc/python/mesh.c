/* The mesh of an engine as arrays: its nodes with their sums and velocities, and the points of its cells. */
#include "mpm/engine.h"
#include "python/arrays.h"

PyObject *gr_python_nodes(const struct gr_engine *e)
{
    enum { X, MASS, MOMENTUM, FORCE, V, W, ARRAYS };
    static const char *const names[ARRAYS] = {"x", "mass", "momentum", "force", "v", "w"};
    const npy_intp n = e->mesh.n_nodes, dim = e->config.dim, shape[2] = {n, dim};
    double *data[ARRAYS];
    PyObject *out = PyDict_New();
    for (int k = 0; out && k < ARRAYS; k++) {
        PyObject *array = PyArray_SimpleNew(k == MASS ? 1 : 2, shape, NPY_DOUBLE);
        data[k] = array ? PyArray_DATA((PyArrayObject *)array) : NULL;
        out = gr_put(out, names[k], array);
    }
    for (npy_intp i = 0; out && i < n; i++) {
        int64_t id = e->mesh.node_id[i];
        double sum[7] = {0};
        for (int k = 0; k < e->K; k++) {
            const int64_t part = e->mesh.node_source[i * e->K + k];
            for (int q = 0; q < 1 + 2 * dim; q++) sum[q] += gr_sum_at(e, part + q * GR_LANES);
        }
        data[MASS][i] = sum[GR_SUM_MASS];
        for (npy_intp d = 0, at = i * dim; d < dim; d++, at++) {
            const struct gr_axis *axis = &e->axis[d];
            data[X][at] = axis->origin + axis->node_position[id % axis->n_nodes] * e->config.dx;
            id /= axis->n_nodes;
            data[MOMENTUM][at] = sum[GR_SUM_MOMENTUM + d];
            data[FORCE][at] = sum[GR_SUM_FORCE(dim) + d];
            data[V][at] = gr_node_field(e, GR_NODE_VELOCITY + (int)d)[i];
            data[W][at] = gr_node_field(e, GR_NODE_UPDATE((int)dim) + (int)d)[i];
        }
    }
    return out;
}

PyObject *gr_python_cells(const struct gr_engine *e)
{
    npy_intp n_points = 0;
    const npy_intp n_cells = e->mesh.n_cells;
    for (npy_intp c = 0; c < n_cells; c++) n_points += e->mesh.cell[c].count;
    PyObject *place = PyArray_SimpleNew(1, &n_points, NPY_INT64), *count = PyArray_SimpleNew(1, &n_cells, NPY_INT64);
    if (!place || !count) {
        Py_XDECREF(place);
        Py_XDECREF(count);
        return NULL;
    }
    int64_t *next = PyArray_DATA((PyArrayObject *)place);
    for (npy_intp c = 0; c < n_cells; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        for (int32_t k = 0; k < cell->count; k++) *next++ = gr_slot(cell, k);
        ((int64_t *)PyArray_DATA((PyArrayObject *)count))[c] = cell->count;
    }
    return Py_BuildValue("NN", place, count);
}
