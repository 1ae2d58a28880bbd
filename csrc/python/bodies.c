/* Rigid bodies: from the rows of Python to the tables of the core, their state, and the signed distance alone. */
#include <math.h>

#include "mpm/contact.h"
#include "python/arrays.h"

enum { KIND, INSIDE, CENTER, ROTATION = CENTER + 3, SIZE = ROTATION + 9, PART_NUMBERS = SIZE + 3 };

/* Rows (kind, inside, center[3], rotation[9], size[3]) of an array (n, 17), and the tables of those that are sampled or
 * height maps, a tuple. Returned: n, or -1. */
static int take_parts(PyObject *object, PyObject *samples, int capacity, struct gr_part *out)
{
    Py_ssize_t sampled = 0;
    if (!PyTuple_Check(samples)) return gr_refuse("samples must be a tuple of tuples");
    const npy_intp shape[2] = {-1, PART_NUMBERS};
    PyArrayObject *array = gr_array(object, "parts", NPY_DOUBLE, 2, shape, 0);
    if (!array) return -1;
    const npy_intp n = PyArray_DIM(array, 0);
    if (n < 1 || n > capacity) return gr_refuse("the bodies must have 1 to 256 parts in all, and each at least one");
    const double *row = PyArray_DATA(array);
    for (npy_intp k = 0; k < n; k++, row += PART_NUMBERS) {
        if (!(row[KIND] >= 0 && row[KIND] < GR_PART_COUNT))
            return gr_refuse("the kind of a part must be 0 to %d", GR_PART_COUNT - 1);
        out[k].kind = (int)row[KIND];
        out[k].inside = row[INSIDE] != 0;
        for (int q = CENTER; q < SIZE; q++)
            if (!(fabs(row[q]) < GR_LARGEST)) return gr_refuse("center and rotation of a part must be finite");
        for (int q = SIZE; q < PART_NUMBERS; q++)
            if (!(row[q] >= 0)) return gr_refuse("the size of a part must not be negative");
        memcpy(out[k].center, row + CENTER, sizeof out[k].center);
        memcpy(out[k].rotation, row + ROTATION, sizeof out[k].rotation);
        memcpy(out[k].size, row + SIZE, sizeof out[k].size);
        if (out[k].kind != GR_PART_SAMPLED && out[k].kind != GR_PART_HEIGHT_MAP) continue;
        if (sampled == PyTuple_GET_SIZE(samples)) return gr_refuse("samples must be as many as parts with tables");
        if (gr_take_tables(PyTuple_GET_ITEM(samples, sampled++), &out[k])) return -1;
    }
    if (sampled != PyTuple_GET_SIZE(samples)) return gr_refuse("samples must be as many as parts with tables");
    return (int)n;
}

static int take_motion(PyObject *object, struct gr_body *body)
{
    const npy_intp shape[2] = {-1, 7};
    PyArrayObject *array = gr_array(object, "motion", NPY_DOUBLE, 2, shape, 0);
    if (!array || gr_refuse_values("motion", array, -GR_LARGEST)) return -1;
    const npy_intp n = PyArray_DIM(array, 0);
    body->motion = PyArray_DATA(array);
    body->n_motion = (int)n;
    if (n < 1 || n > 1000000) return gr_refuse("motion must have 1 to 1000000 rows");
    for (npy_intp k = 1; k < n; k++)
        if (!(body->motion[7 * k] > body->motion[7 * k - 7])) return gr_refuse("the times of motion must ascend");
    return 0;
}

static int is_unit(const double orientation[4])
{
    double square = 0;
    for (int k = 0; k < 4; k++) square += orientation[k] * orientation[k];
    return fabs(square - 1) < 1e-6;
}

static int take_body(const struct gr_config *c, PyObject *row, struct gr_body *body, struct gr_part *parts)
{
    PyObject *list, *samples, *pose, *motion, *extent;
    const npy_intp seven[1] = {7}, three[1] = {3};
    if (gr_refuse_row("bodies", row) ||
        !PyArg_ParseTuple(
            row,
            "OOOOOiiidd;a row of bodies is (parts, samples, pose, motion, extent, contact, free, rough, friction, mass)",
            &list, &samples, &pose, &motion, &extent, &body->contact, &body->free, &body->rough, &body->friction,
            &body->mass))
        return -1;
    body->first_part = c->n_parts;
    body->n_parts = take_parts(list, samples, GR_MAX_PARTS - c->n_parts, parts + c->n_parts);
    if (body->n_parts < 0 || take_motion(motion, body)) return -1;
    PyArrayObject *array = gr_array(pose, "pose", NPY_DOUBLE, 1, seven, 0);
    if (!array || gr_refuse_values("pose", array, -GR_LARGEST)) return -1;
    memcpy(body->position, PyArray_DATA(array), sizeof body->position);
    memcpy(body->orientation, (const double *)PyArray_DATA(array) + 3, sizeof body->orientation);
    if (!is_unit(body->orientation)) return gr_refuse("the orientation of a body must be a unit quaternion");
    array = gr_array(extent, "extent", NPY_DOUBLE, 1, three, 0);
    if (!array) return -1;
    memcpy(body->extent, PyArray_DATA(array), sizeof body->extent);
    for (int d = 0; d < 3; d++)
        if (!(body->extent[d] >= 0)) return gr_refuse("the extent of a body must not be negative");
    if (body->contact < 0 || body->contact >= GR_CONTACT_COUNT) return gr_refuse("contact must be 0 to 2");
    if (body->rough != 0 && body->rough != 1) return gr_refuse("rough must be 0 or 1");
    if (body->free < 0 || body->free >> c->dim) return gr_refuse("free must have a bit for each axis at most");
    if (gr_refuse_number("friction", body->friction, 1) || gr_refuse_number("mass", body->mass, !body->free)) return -1;
    body->bound = 0;
    for (int k = 0; k < body->n_parts; k++)
        body->bound = fmax(body->bound, gr_part_bound(&parts[body->first_part + k], c->dim));
    return 0;
}

int gr_take_bodies(struct gr_config *c, PyObject *rows, struct gr_tables *tables)
{
    if (!PyList_Check(rows) || PyList_GET_SIZE(rows) > GR_MAX_BODIES)
        return gr_refuse("bodies must be a list of 64 rows at most");
    for (Py_ssize_t b = 0; b < PyList_GET_SIZE(rows); b++) {
        struct gr_body *body = &tables->body[b];
        if (take_body(c, PyList_GET_ITEM(rows, b), body, tables->part)) return -1;
        c->n_parts += body->n_parts;
    }
    c->n_bodies = (int)PyList_GET_SIZE(rows);
    c->bodies = tables->body;
    c->parts = tables->part;
    return 0;
}

PyObject *gr_python_poses(const struct gr_engine *e, const void *rows, int numbers)
{
    const npy_intp shape[2] = {e->config.n_bodies, numbers};
    PyObject *out = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
    if (out && shape[0]) memcpy(PyArray_DATA((PyArrayObject *)out), rows, (size_t)PyArray_NBYTES((PyArrayObject *)out));
    return out;
}

int gr_take_poses(const struct gr_engine *e, PyObject *object, const char *name, void *rows, int numbers)
{
    const npy_intp shape[2] = {e->config.n_bodies, numbers};
    PyArrayObject *array = gr_array(object, name, NPY_DOUBLE, 2, shape, 0);
    if (!array || gr_refuse_values(name, array, -GR_LARGEST)) return -1;
    const double *from = PyArray_DATA(array);
    for (npy_intp b = 0; b < shape[0]; b++)
        if (!is_unit(from + numbers * b + 3)) return gr_refuse("%s: an orientation must be a unit quaternion", name);
    if (shape[0]) memcpy(rows, from, (size_t)PyArray_NBYTES(array));
    return 0;
}

PyObject *gr_python_body_distance(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *list, *samples, *places;
    struct gr_part parts[GR_MAX_PARTS];
    const npy_intp three[2] = {-1, 3};
    if (!PyArg_ParseTuple(args, "OOO:body_distance", &list, &samples, &places)) return NULL;
    const int count = take_parts(list, samples, GR_MAX_PARTS, parts);
    if (count < 0) return NULL;
    PyArrayObject *x = gr_array(places, "x", NPY_DOUBLE, 2, three, 0);
    if (!x || gr_refuse_values("x", x, -GR_LARGEST)) return NULL;
    const npy_intp n = PyArray_DIM(x, 0), sizes[2] = {n, 3};
    PyObject *distance = PyArray_SimpleNew(1, sizes, NPY_DOUBLE), *normal = PyArray_SimpleNew(2, sizes, NPY_DOUBLE);
    if (!distance || !normal) {
        Py_XDECREF(distance);
        Py_XDECREF(normal);
        return NULL;
    }
    double *phi = PyArray_DATA((PyArrayObject *)distance), *out = PyArray_DATA((PyArrayObject *)normal);
    for (npy_intp k = 0; k < n; k++)
        phi[k] = gr_union_distance(parts, count, (const double *)PyArray_DATA(x) + 3 * k, out + 3 * k);
    return Py_BuildValue("NN", distance, normal);
}
