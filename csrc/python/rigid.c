/* Contacts of free bodies with solids (contact/rigid.h). */
#include "contact/rigid.h"

#include "python/arrays.h"

enum { LOWER, UPPER = 3, VELOCITY = 6, FRICTION = 9, OPENS_AT, AXIS, OBSTACLE_NUMBERS };

static int take_obstacles(const struct gr_engine *e, PyArrayObject *array, struct gr_obstacle *out)
{
    const double *row = PyArray_DATA(array);
    for (npy_intp k = 0; k < PyArray_DIM(array, 0); k++, row += OBSTACLE_NUMBERS) {
        for (int d = 0; d < e->config.dim; d++)
            if (!(row[LOWER + d] <= row[UPPER + d]))
                return gr_refuse("obstacles[%lld]: lower must not exceed upper", (long long)k);
        if (!(row[FRICTION] >= 0)) return gr_refuse("obstacles[%lld]: friction must not be negative", (long long)k);
        if (!(row[AXIS] >= -1 && row[AXIS] < e->config.dim))
            return gr_refuse("obstacles[%lld]: axis must be -1 or one of the grid", (long long)k);
        memcpy(out[k].lower, row + LOWER, sizeof out[k].lower);
        memcpy(out[k].upper, row + UPPER, sizeof out[k].upper);
        memcpy(out[k].velocity, row + VELOCITY, sizeof out[k].velocity);
        out[k].friction = row[FRICTION], out[k].opens_at = row[OPENS_AT], out[k].axis = (int)row[AXIS];
    }
    return 0;
}

static int refuse_counts(const int64_t *first, int n_bodies, npy_intp n_balls)
{
    int right = first[0] == 0 && first[n_bodies] == n_balls;
    for (int b = 0; b < n_bodies; b++) right &= first[b] <= first[b + 1];
    return right ? 0 : gr_refuse("first_ball must ascend from 0 to the number of balls, %lld", (long long)n_balls);
}

PyObject *gr_python_touch_solids(struct gr_engine *e, PyObject *args)
{
    const npy_intp four[2] = {-1, 4}, bodies[1] = {e->config.n_bodies}, ends[1] = {e->config.n_bodies + 1};
    const npy_intp row[2] = {-1, OBSTACLE_NUMBERS};
    PyObject *object[4];
    if (!PyArg_ParseTuple(args, "OOOO:touch_solids", &object[0], &object[1], &object[2], &object[3])) return NULL;
    PyArrayObject *balls = gr_array(object[0], "balls", NPY_DOUBLE, 2, four, 0);
    PyArrayObject *first = balls ? gr_array(object[1], "first_ball", NPY_INT64, 1, ends, 0) : NULL;
    PyArrayObject *restitution = first ? gr_array(object[2], "restitution", NPY_DOUBLE, 1, bodies, 0) : NULL;
    PyArrayObject *obstacles = restitution ? gr_array(object[3], "obstacles", NPY_DOUBLE, 2, row, 0) : NULL;
    if (!obstacles || gr_refuse_values("balls", balls, -GR_LARGEST) || gr_refuse_values("restitution", restitution, 0) ||
        gr_refuse_values("obstacles", obstacles, -GR_LARGEST) ||
        refuse_counts(PyArray_DATA(first), e->config.n_bodies, PyArray_DIM(balls, 0)))
        return NULL;
    const npy_intp n = PyArray_DIM(obstacles, 0);
    if (e->config.n_bodies < 1) return gr_refuse("touch_solids needs bodies"), NULL;
    if (n > 100000 || PyArray_DIM(balls, 0) > 1000000)
        return gr_refuse("there must be 100000 obstacles and 1000000 balls at most"), NULL;
    for (int b = 0; b < e->config.n_bodies; b++)
        if (((const double *)PyArray_DATA(restitution))[b] > 1)
            return gr_refuse("restitution[%d] must be 1 at most", b), NULL;
    for (npy_intp k = 0; k < PyArray_DIM(balls, 0); k++)
        if (!(((const double *)PyArray_DATA(balls))[4 * k + 3] >= 0))
            return gr_refuse("the radius of a ball is negative"), NULL;
    struct gr_obstacle *obstacle = PyMem_Calloc((size_t)n + 1, sizeof *obstacle);
    if (!obstacle) return PyErr_NoMemory();
    int error = take_obstacles(e, obstacles, obstacle);
    if (!error)
        error = gr_rigid_new(e, &(struct gr_rigid_config){(int)n, obstacle, PyArray_DATA(balls), PyArray_DATA(restitution),
                                                          PyArray_DATA(first)});
    PyMem_Free(obstacle);
    if (error > 0) return gr_raise(error, NULL);
    if (error) return NULL;
    Py_RETURN_NONE;
}
