/* Surfaces of bodies that are tables: triangles, samples of their distance, and height maps. */
#include <math.h>

#include "body/triangles.h"
#include "core/memory.h"
#include "python/arrays.h"

static const char TREE[] = "granular._core.mesh_tree";

/* Any of n floats that is not finite. */
static int refuse_floats(const char *name, PyArrayObject *array)
{
    const float *value = PyArray_DATA(array);
    const npy_intp n = PyArray_SIZE(array);
    for (npy_intp k = 0; k < n; k++)
        if (!(fabsf(value[k]) < 1e30f))
            return gr_refuse("%s[%lld] = %.9g must be finite", name, (long long)k, (double)value[k]);
    return 0;
}

/* Numbers of a grid: coordinates, then distances > 0. */
static const double *take_grid(PyObject *object, int places, int distances)
{
    const npy_intp shape[1] = {places + distances};
    PyArrayObject *array = gr_array(object, "grid", NPY_DOUBLE, 1, shape, 0);
    if (!array || gr_refuse_values("grid", array, -GR_LARGEST)) return NULL;
    const double *number = PyArray_DATA(array);
    for (int k = places; k < places + distances; k++)
        if (gr_refuse_number("spacing", number[k], 0)) return NULL;
    return number;
}

/* (grid[5], coarse, block, fine, sharp), see body/samples.h; the last number of the grid is a thickness for Python. */
static int take_samples(PyObject *tables, struct gr_samples *s)
{
    const npy_intp any[3] = {-1, -1, -1}, fine_shape[4] = {-1, GR_CUBE_SIDE, GR_CUBE_SIDE, GR_CUBE_SIDE};
    PyObject *object[5];
    if (!PyTuple_Check(tables)) return gr_refuse("samples of a mesh must be a tuple");
    if (!PyArg_ParseTuple(tables, "OOOOO;samples of a mesh are (grid, coarse, block, fine, sharp)", &object[0], &object[1],
                          &object[2], &object[3], &object[4]))
        return -1;
    const double *grid = take_grid(object[0], 3, 2);
    PyArrayObject *block = grid ? gr_array(object[2], "block", NPY_INT32, 3, any, 0) : NULL;
    if (!block) return -1;
    npy_intp coarse_shape[3];
    for (int d = 0; d < 3; d++) {
        const npy_intp n = PyArray_DIM(block, 2 - d);
        if (n < 1 || n > 100000) return gr_refuse("block must have 1 to 100000 cells along each axis");
        s->n[d] = (int32_t)n;
        coarse_shape[2 - d] = n + 1;
    }
    PyArrayObject *coarse = gr_array(object[1], "coarse", NPY_FLOAT, 3, coarse_shape, 0);
    PyArrayObject *fine = coarse ? gr_array(object[3], "fine", NPY_FLOAT, 4, fine_shape, 0) : NULL;
    PyArrayObject *sharp = fine ? gr_array(object[4], "sharp", NPY_UINT8, 4, PyArray_DIMS(fine), 0) : NULL;
    if (!sharp || refuse_floats("coarse", coarse) || refuse_floats("fine", fine)) return -1;
    if (PyArray_DIM(fine, 0) > INT32_MAX) return gr_refuse("fine has too many blocks");
    memcpy(s->low, grid, sizeof s->low);
    s->spacing = grid[3];
    s->n_blocks = (int32_t)PyArray_DIM(fine, 0);
    s->coarse = PyArray_DATA(coarse), s->block = PyArray_DATA(block);
    s->fine = PyArray_DATA(fine), s->sharp = PyArray_DATA(sharp);
    return 0;
}

/* (grid[4], heights, ranges), see body/height_map.h; heights (x,) or (y, x). */
static int take_map(PyObject *tables, struct gr_height_map *map)
{
    PyObject *grid_of, *heights, *ranges;
    const npy_intp any[2] = {-1, -1};
    if (!PyTuple_Check(tables)) return gr_refuse("samples of a height map must be a tuple");
    if (!PyArg_ParseTuple(tables, "OOO;samples of a height map are (grid, heights, ranges)", &grid_of, &heights, &ranges))
        return -1;
    const double *grid = take_grid(grid_of, 2, 2);
    if (!grid) return -1;
    const int is_float = PyArray_CheckExact(heights) && PyArray_TYPE((PyArrayObject *)heights) == NPY_FLOAT;
    const int ndim = PyArray_CheckExact(heights) && PyArray_NDIM((PyArrayObject *)heights) == 1 ? 1 : 2;
    PyArrayObject *z = gr_array(heights, "heights", is_float ? NPY_FLOAT : NPY_DOUBLE, ndim, any, 0);
    if (!z || (is_float ? refuse_floats("heights", z) : gr_refuse_values("heights", z, -GR_LARGEST))) return -1;
    for (int d = 0; d < 2; d++) {
        map->n[d] = d < ndim ? PyArray_DIM(z, ndim - 1 - d) : 2;
        if (map->n[d] < 2 || map->n[d] > INT32_MAX) return gr_refuse("heights must have two posts at least along each axis");
        map->low[d] = grid[d], map->spacing[d] = grid[2 + d];
    }
    map->stride = ndim == 1 ? 0 : map->n[0];
    map->height = is_float ? NULL : PyArray_DATA(z);
    map->height_float = is_float ? PyArray_DATA(z) : NULL;
    const npy_intp shape[2] = {(npy_intp)gr_height_map_ranges(map->n), 2};
    PyArrayObject *range = gr_array(ranges, "ranges", NPY_DOUBLE, 2, shape, 0);
    if (!range || gr_refuse_values("ranges", range, -GR_LARGEST)) return -1;
    map->range = PyArray_DATA(range);
    return 0;
}

int gr_take_tables(PyObject *tables, struct gr_part *part)
{
    return part->kind == GR_PART_SAMPLED ? take_samples(tables, &part->samples) : take_map(tables, &part->map);
}

static int refuse_indices(const char *name, PyArrayObject *array, npy_intp n)
{
    const int32_t *index = PyArray_DATA(array);
    const npy_intp count = PyArray_SIZE(array);
    for (npy_intp k = 0; k < count; k++)
        if (index[k] < 0 || index[k] >= n)
            return gr_refuse("%s[%lld] = %d must be from 0 to %lld", name, (long long)k, (int)index[k], (long long)n - 1);
    return 0;
}

/* A tree, with copies of its arrays: indices that are changed later would be wrong. */
struct owned_tree {
    struct gr_triangles *tree, tables;
};

static void free_owned(struct owned_tree *owned)
{
    gr_triangles_free(owned->tree);
    gr_free(owned->tables.vertex);
    gr_free(owned->tables.face);
    gr_free(owned);
}

static void free_tree(PyObject *capsule) { free_owned(PyCapsule_GetPointer(capsule, TREE)); }

PyObject *gr_python_mesh_tree(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *vertices, *faces;
    const npy_intp three[2] = {-1, 3};
    if (!PyArg_ParseTuple(args, "OO:mesh_tree", &vertices, &faces)) return NULL;
    PyArrayObject *vertex = gr_array(vertices, "vertices", NPY_DOUBLE, 2, three, 0);
    PyArrayObject *face = vertex ? gr_array(faces, "faces", NPY_INT32, 2, three, 0) : NULL;
    if (!face || gr_refuse_values("vertices", vertex, -GR_LARGEST)) return NULL;
    const npy_intp n = PyArray_DIM(face, 0);
    if (n < 1 || n > INT32_MAX / 3) return PyErr_Format(PyExc_ValueError, "faces must be 1 to 7e8, not %zd", n);
    if (refuse_indices("faces", face, PyArray_DIM(vertex, 0))) return NULL;
    struct owned_tree *owned = gr_calloc(1, sizeof *owned);
    if (!owned) return PyErr_NoMemory();
    owned->tables = (struct gr_triangles){
        .n_vertices = PyArray_DIM(vertex, 0), .n_faces = n, .vertex = PyArray_DATA(vertex), .face = PyArray_DATA(face)};
    int error = gr_own((const void **)&owned->tables.vertex, (size_t)PyArray_NBYTES(vertex));
    error |= gr_own((const void **)&owned->tables.face, (size_t)PyArray_NBYTES(face));
    if (!error) {
        Py_BEGIN_ALLOW_THREADS
        error = gr_triangles_new(&owned->tree, &owned->tables);
        Py_END_ALLOW_THREADS
    }
    PyObject *capsule = error ? PyErr_NoMemory() : PyCapsule_New(owned, TREE, free_tree);
    if (!capsule) free_owned(owned);
    return capsule;
}

/* The tree and the points (n, 3) of a call. Returned: the tree, NULL with an exception. */
static const struct gr_triangles *take_places(PyObject *capsule, PyObject *places, PyArrayObject **x)
{
    const npy_intp three[2] = {-1, 3};
    if (!PyCapsule_IsValid(capsule, TREE)) {
        PyErr_SetString(PyExc_TypeError, "tree must be what mesh_tree returns");
        return NULL;
    }
    *x = gr_array(places, "x", NPY_DOUBLE, 2, three, 0);
    if (!*x || gr_refuse_values("x", *x, -GR_LARGEST)) return NULL;
    return ((struct owned_tree *)PyCapsule_GetPointer(capsule, TREE))->tree;
}

PyObject *gr_python_mesh_distance(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *capsule, *places;
    PyArrayObject *x;
    int closed;
    if (!PyArg_ParseTuple(args, "OOp:mesh_distance", &capsule, &places, &closed)) return NULL;
    const struct gr_triangles *tree = take_places(capsule, places, &x);
    PyObject *out = tree ? PyArray_SimpleNew(1, PyArray_DIMS(x), NPY_DOUBLE) : NULL;
    if (!out) return NULL;
    const double *place = PyArray_DATA(x);
    double *distance = PyArray_DATA((PyArrayObject *)out);
    const npy_intp n = PyArray_DIM(x, 0);
    Py_BEGIN_ALLOW_THREADS
    gr_triangles_distances(tree, n, place, closed, distance);
    Py_END_ALLOW_THREADS
    return out;
}

PyObject *gr_python_mesh_winding(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *capsule, *places;
    PyArrayObject *x;
    if (!PyArg_ParseTuple(args, "OO:mesh_winding", &capsule, &places)) return NULL;
    const struct gr_triangles *tree = take_places(capsule, places, &x);
    PyObject *out = tree ? PyArray_SimpleNew(1, PyArray_DIMS(x), NPY_DOUBLE) : NULL;
    if (!out) return NULL;
    const double *place = PyArray_DATA(x);
    double *winding = PyArray_DATA((PyArrayObject *)out);
    const npy_intp n = PyArray_DIM(x, 0);
    Py_BEGIN_ALLOW_THREADS
    for (npy_intp k = 0; k < n; k++) winding[k] = gr_triangles_winding(tree, place + 3 * k);
    Py_END_ALLOW_THREADS
    return out;
}

PyObject *gr_python_mesh_clear(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *capsule, *places, *radii;
    PyArrayObject *x;
    if (!PyArg_ParseTuple(args, "OOO:mesh_clear", &capsule, &places, &radii)) return NULL;
    const struct gr_triangles *tree = take_places(capsule, places, &x);
    PyArrayObject *radius = tree ? gr_array(radii, "radius", NPY_DOUBLE, 1, PyArray_DIMS(x), 0) : NULL;
    if (!radius || gr_refuse_values("radius", radius, 0)) return NULL;
    PyObject *out = PyArray_SimpleNew(1, PyArray_DIMS(x), NPY_BOOL);
    if (!out) return NULL;
    const double *place = PyArray_DATA(x), *within = PyArray_DATA(radius);
    npy_bool *clear = PyArray_DATA((PyArrayObject *)out);
    const npy_intp n = PyArray_DIM(x, 0);
    Py_BEGIN_ALLOW_THREADS
    for (npy_intp k = 0; k < n; k++) clear[k] = gr_triangles_clear(tree, place + 3 * k, within[k]) ? NPY_TRUE : NPY_FALSE;
    Py_END_ALLOW_THREADS
    return out;
}
