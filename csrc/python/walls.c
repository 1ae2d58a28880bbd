/* Impulses on the walls, and on patches of walls and bodies: from the arrays of Python to the core, and back. */
#include "mpm/patches.h"

#include "python/arrays.h"

PyObject *gr_python_watch_walls(struct gr_engine *e, int n_walls, PyObject *codes, PyObject *owners, PyObject *opens_at,
                                PyObject *after)
{
    npy_intp classes[3];
    const npy_intp any_of_three[2] = {-1, 3};
    for (int d = 0; d < e->config.dim; d++) classes[e->config.dim - 1 - d] = e->config.node_codes.n_classes[d];
    PyArrayObject *code = gr_array(codes, "codes", NPY_INT32, e->config.dim, classes, 0);
    PyArrayObject *owner = code ? gr_array(owners, "owners", NPY_INT32, 2, any_of_three, 0) : NULL;
    if (!owner) return NULL;
    const npy_intp rows[1] = {PyArray_DIM(owner, 0)};
    PyArrayObject *time = gr_array(opens_at, "opens_at", NPY_DOUBLE, 1, rows, 0);
    PyArrayObject *next = time ? gr_array(after, "after", NPY_INT32, 1, rows, 0) : NULL;
    if (!next) return NULL;
    if (rows[0] > 1000000000) return PyErr_Format(PyExc_ValueError, "owners must have at most 1000000000 rows");
    struct gr_wall_share *share = PyMem_Calloc((size_t)rows[0] + 1, sizeof *share);
    if (!share) return PyErr_NoMemory();
    for (npy_intp k = 0; k < rows[0]; k++) {
        memcpy(share[k].owner, (const int32_t *)PyArray_DATA(owner) + 3 * k, sizeof share[k].owner);
        share[k].opens_at = ((const double *)PyArray_DATA(time))[k];
        share[k].after = ((const int32_t *)PyArray_DATA(next))[k];
    }
    const int error = gr_watch_walls(e, n_walls, share, (int)rows[0], PyArray_DATA(code));
    PyMem_Free(share);
    if (error == GR_ERR_CONFIG)
        return PyErr_Format(PyExc_ValueError,
                            "watch_walls: once, before points are bound; owners from -1 to %d, codes and after from 0 to "
                            "the last row, opens_at ascending along after",
                            n_walls - 1);
    if (error) return gr_raise(error, NULL);
    Py_RETURN_NONE;
}

PyObject *gr_python_hold_pressure(struct gr_engine *e, PyObject *args)
{
    struct gr_servo servo = {0};
    if (!PyArg_ParseTuple(args, "iiiddddd:hold_pressure", &servo.wall, &servo.axis, &servo.side, &servo.pressure,
                          &servo.area, &servo.height, &servo.rate, &servo.limit))
        return NULL;
    if (gr_watch_servo(e, &servo))
        return PyErr_Format(PyExc_ValueError,
                            "hold_pressure: for one wall that is watched, at the lower (-1) or upper (1) end of an axis "
                            "that is not periodic, with a density that is averaged; numbers above 0");
    Py_RETURN_NONE;
}

static int refuse_unwatched(const struct gr_engine *e)
{
    if (e->watch) return 0;
    PyErr_SetString(PyExc_ValueError, "the impulses on the walls are not watched");
    return -1;
}

PyObject *gr_python_wall_impulses(const struct gr_engine *e)
{
    if (refuse_unwatched(e)) return NULL;
    const npy_intp shape[2] = {e->watch->n_walls, GR_WALL_NUMBERS};
    PyObject *out = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
    if (out) memcpy(PyArray_DATA((PyArrayObject *)out), e->watch->total, (size_t)PyArray_NBYTES((PyArrayObject *)out));
    return out;
}

PyObject *gr_python_restore_walls(struct gr_engine *e, PyObject *array)
{
    if (refuse_unwatched(e)) return NULL;
    const npy_intp shape[2] = {e->watch->n_walls, GR_WALL_NUMBERS};
    PyArrayObject *from = gr_array(array, "walls", NPY_DOUBLE, 2, shape, 0);
    if (!from || gr_refuse_values("walls", from, -GR_LARGEST)) return NULL;
    memcpy(e->watch->total, PyArray_DATA(from), (size_t)PyArray_NBYTES(from));
    Py_RETURN_NONE;
}

PyObject *gr_python_watch_patches(struct gr_engine *e)
{
    if (refuse_unwatched(e)) return NULL;
    const int error = gr_watch_patches(e);
    if (error == GR_ERR_CONFIG) return PyErr_Format(PyExc_ValueError, "watch_patches: once");
    if (error) return gr_raise(error, NULL);
    Py_RETURN_NONE;
}

static int refuse_without_patches(const struct gr_engine *e)
{
    if (e->watch && e->watch->patches) return 0;
    PyErr_SetString(PyExc_ValueError, "the impulses on patches are not watched");
    return -1;
}

PyObject *gr_python_patches(const struct gr_engine *e)
{
    if (refuse_without_patches(e)) return NULL;
    const struct gr_patches *patches = e->watch->patches;
    int64_t n = 0, at = 0;
    for (int64_t k = 0; k < patches->n; k++) n += gr_has_patch(e, &patches->patch[k]);
    const npy_intp shapes[2][2] = {{n, 4}, {n, GR_PATCH_NUMBERS}};
    PyObject *places = PyArray_SimpleNew(2, shapes[0], NPY_INT64), *numbers = PyArray_SimpleNew(2, shapes[1], NPY_DOUBLE);
    for (int64_t k = 0; places && numbers && k < patches->n; k++) {
        const struct gr_patch *patch = &patches->patch[k];
        if (!gr_has_patch(e, patch)) continue;
        int64_t *place = (int64_t *)PyArray_DATA((PyArrayObject *)places) + 4 * at;
        place[0] = patch->solid;
        for (int d = 0; d < 3; d++) place[1 + d] = patch->at[d];
        memcpy((double *)PyArray_DATA((PyArrayObject *)numbers) + GR_PATCH_NUMBERS * at++, patch->number,
               sizeof patch->number);
    }
    return Py_BuildValue("(NN)", places, numbers);
}

PyObject *gr_python_restore_patches(struct gr_engine *e, PyObject *args)
{
    PyObject *places, *numbers;
    const npy_intp of_places[2] = {-1, 4};
    if (refuse_without_patches(e) || !PyArg_ParseTuple(args, "OO:restore_patches", &places, &numbers)) return NULL;
    PyArrayObject *place = gr_array(places, "places", NPY_INT64, 2, of_places, 0);
    if (!place) return NULL;
    const npy_intp of_numbers[2] = {PyArray_DIM(place, 0), GR_PATCH_NUMBERS};
    PyArrayObject *number = gr_array(numbers, "numbers", NPY_DOUBLE, 2, of_numbers, 0);
    if (!number || gr_refuse_values("numbers", number, -GR_LARGEST)) return NULL;
    const int64_t *row = PyArray_DATA(place);
    const int solids = e->watch->n_walls + e->config.n_bodies;
    for (npy_intp k = 0; k < 4 * of_numbers[0]; k++)
        if (k % 4 ? row[k] < INT32_MIN || row[k] > INT32_MAX : row[k] < 0 || row[k] >= solids)
            return PyErr_Format(PyExc_ValueError, "places must hold a solid from 0 to %d and indices of 32 bits",
                                solids - 1);
    e->watch->patches->n = 0;
    memset(e->watch->patches->place, 0, sizeof(int64_t) * (size_t)e->watch->patches->n_places);
    for (npy_intp k = 0; k < of_numbers[0]; k++) {
        const int32_t at[3] = {(int32_t)row[4 * k + 1], (int32_t)row[4 * k + 2], (int32_t)row[4 * k + 3]};
        struct gr_patch *patch;
        if (gr_patch_at(e->watch->patches, (int32_t)row[4 * k], at, &patch)) return PyErr_NoMemory();
        memcpy(patch->number, (const double *)PyArray_DATA(number) + GR_PATCH_NUMBERS * k, sizeof patch->number);
    }
    Py_RETURN_NONE;
}
