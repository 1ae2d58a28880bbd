/* Rigid bodies: from the rows of Python to the tables of the core, their state, and the signed distance alone. */
#include <math.h>

#include "contact/contact.h"
#include "core/index.h"
#include "python/arrays.h"

enum { KIND, INSIDE, CENTER, ROTATION = CENTER + 3, SIZE = ROTATION + 9, PART_NUMBERS = SIZE + 3 };

/* Vertices of a polygon or of a chain that is revolved, (1, n, 2). */
static int take_vertices(PyArrayObject *array, struct gr_part *part)
{
    const npy_intp n = PyArray_DIM(array, 1);
    const double *vertex = PyArray_DATA(array);
    const int closed = !(part->size[1] > 0), revolved = part->kind == GR_PART_REVOLVED;
    int off_axis = 0; /* the axis */
    if (PyArray_DIM(array, 0) != 1 || PyArray_DIM(array, 2) != 2 || n < 2 + closed || n > 4096)
        return gr_refuse("vertices must have the shape (1, n, 2), n from 2 (closed chains 3) to 4096");
    for (npy_intp k = 0; k < n; k++) {
        const double *a = vertex + 2 * k, *b = vertex + 2 * ((k + 1) % n), x = b[0] - a[0], y = b[1] - a[1];
        if ((closed || k + 1 < n) && !(x * x + y * y > 0)) return gr_refuse("vertices that follow must be different");
        if (revolved && !(a[0] >= 0)) return gr_refuse("vertices of a revolved chain must have r >= 0");
        off_axis |= (closed || k + 1 < n) && (a[0] > 0 || b[0] > 0);
    }
    if (revolved && !off_axis) return gr_refuse("vertices of a revolved chain must not all lie on the axis");
    part->chain = (struct gr_chain){vertex, (int)n, closed, revolved};
    return 0;
}

/* Tables of a mesh or a height map, or an array of vertices. */
static int take_array(PyObject *object, struct gr_part *part)
{
    if (part->kind == GR_PART_SAMPLED || part->kind == GR_PART_HEIGHT_MAP) return gr_take_tables(object, part);
    const npy_intp any[3] = {-1, -1, -1};
    PyArrayObject *array = gr_array(object, "samples", NPY_DOUBLE, 3, any, 0);
    if (!array || gr_refuse_values("samples", array, -GR_LARGEST)) return -1;
    return take_vertices(array, part);
}

/* A row (kind, inside, center[3], rotation[9], size[3]). */
static int take_part(const double *row, struct gr_part *part)
{
    if (!(row[KIND] >= 0 && row[KIND] < GR_PART_COUNT))
        return gr_refuse("the kind of a part must be 0 to %d", GR_PART_COUNT - 1);
    part->kind = (int)row[KIND];
    part->inside = row[INSIDE] != 0;
    for (int q = CENTER; q < SIZE; q++)
        if (!(fabs(row[q]) < GR_LARGEST)) return gr_refuse("center and rotation of a part must be finite");
    for (int q = SIZE; q < PART_NUMBERS; q++) {
        const int endless = part->kind < GR_PART_SAMPLED || (part->kind == GR_PART_POLYGON && q == SIZE);
        if (!(row[q] >= 0)) return gr_refuse("the size of a part must not be negative");
        if (!endless && !(row[q] < GR_LARGEST)) return gr_refuse("the size of a part of this kind must be finite");
    }
    memcpy(part->center, row + CENTER, sizeof part->center);
    memcpy(part->rotation, row + ROTATION, sizeof part->rotation);
    memcpy(part->size, row + SIZE, sizeof part->size);
    memset(&part->samples, 0, sizeof part->samples);
    memset(&part->map, 0, sizeof part->map);
    part->chain.vertex = NULL;
    part->operands = 0;
    if (part->kind == GR_PART_UNION || part->kind == GR_PART_INTERSECTION)
        part->operands = (int)gr_index(part->size[0], 0, GR_MAX_PARTS + 1);
    return 0;
}

/* Rows of an array (n, 17), and a tuple of the samples or vertices of those that have some. Returned: n, or -1. */
static int take_parts(PyObject *object, PyObject *samples, int capacity, struct gr_part *out)
{
    Py_ssize_t taken = 0;
    if (!PyTuple_Check(samples)) return gr_refuse("samples must be a tuple");
    const npy_intp shape[2] = {-1, PART_NUMBERS};
    PyArrayObject *array = gr_array(object, "parts", NPY_DOUBLE, 2, shape, 0);
    if (!array) return -1;
    const npy_intp n = PyArray_DIM(array, 0);
    if (n < 1 || n > capacity) return gr_refuse("the bodies must have 1 to 256 parts in all, and each at least one");
    const double *row = PyArray_DATA(array);
    for (npy_intp k = 0; k < n; k++, row += PART_NUMBERS) {
        if (take_part(row, &out[k])) return -1;
        const int kind = out[k].kind;
        if (kind != GR_PART_SAMPLED && kind != GR_PART_HEIGHT_MAP && kind != GR_PART_POLYGON && kind != GR_PART_REVOLVED)
            continue;
        if (taken == PyTuple_GET_SIZE(samples)) return gr_refuse("samples must be as many as parts that have some");
        if (take_array(PyTuple_GET_ITEM(samples, taken++), &out[k])) return -1;
    }
    if (taken != PyTuple_GET_SIZE(samples)) return gr_refuse("samples must be as many as parts that have some");
    if (gr_parts_lack_operands(out, (int)n)) return gr_refuse("an operation must have enough parts before it");
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

/* No number of a body whose rotation is prescribed; else the principal moments, and their axes as a matrix of columns. */
static int take_inertia(PyObject *object, struct gr_body *body)
{
    const npy_intp any[1] = {-1};
    PyArrayObject *array = gr_array(object, "inertia", NPY_DOUBLE, 1, any, 0);
    if (!array || gr_refuse_values("inertia", array, -GR_LARGEST)) return -1;
    const npy_intp n = PyArray_DIM(array, 0);
    const double *number = PyArray_DATA(array);
    body->turns = n > 0;
    if (!n) return 0;
    if (n != 12) return gr_refuse("inertia must have no number, or three moments and the nine of their axes");
    memcpy(body->inertia, number, sizeof body->inertia);
    memcpy(body->principal, number + 3, sizeof body->principal);
    for (int a = 0; a < 3; a++) {
        if (!(body->inertia[a] > 0)) return gr_refuse("moments of inertia must be > 0");
        for (int b = 0; b < 3; b++) {
            double product = 0;
            for (int c = 0; c < 3; c++) product += body->principal[3 * c + a] * body->principal[3 * c + b];
            if (!(fabs(product - (a == b)) < 1e-6)) return gr_refuse("the axes of inertia must be orthonormal");
        }
    }
    return 0;
}

static int take_body(const struct gr_config *c, PyObject *row, struct gr_body *body, struct gr_part *parts)
{
    PyObject *list, *samples, *pose, *motion, *extent, *inertia;
    const npy_intp seven[1] = {7}, three[1] = {3};
    if (gr_refuse_row("bodies", row) ||
        !PyArg_ParseTuple(
            row,
            "OOOOOiiiddO;a row of bodies is (parts, samples, pose, motion, extent, contact, free, rough, friction, mass, inertia)",
            &list, &samples, &pose, &motion, &extent, &body->contact, &body->free, &body->rough, &body->friction,
            &body->mass, &inertia))
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
    if (take_inertia(inertia, body)) return -1;
    body->bound = gr_union_bound(&parts[body->first_part], body->n_parts, c->dim);
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
