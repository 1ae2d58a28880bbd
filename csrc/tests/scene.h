/* Small scenes for the tests: a box of cells with a random heap of points in it. */
#pragma once

#include "engine/build.h"
#include "engine/step.h"
#include "kernels.h"
#include "mpm/grouping.h"
#include "mpm/numbers.h"

enum { SCENE_WALLS = 8 };

/* A scene. Tests may change its configuration before it is built; zero is a plain choice everywhere (see
 * scene_default). */
struct scene {
    struct gr_config config;
    struct gr_wall walls[SCENE_WALLS];
    double gravity_times[2], gravity_vectors[6];
    uint8_t *codes;
    struct gr_engine *engine;
    double *field[GR_FIELD_COUNT];
    int64_t *id, capacity;
};

/* A valid configuration: 6 cells of 0.1 m along each axis from (-1, 2, 0.5), mu(I) material, no walls, no gravity. */
void scene_default(struct scene *s, int dim, int basis, int affine, int smoothed);
/* The nonlocal law, with three substeps, in the 6 x 6 cells of 2D. */
void scene_nonlocal(struct scene *s);
/* Number of nodes of the whole grid for the present configuration. */
int64_t scene_grid_nodes(const struct scene *s);
/* Put wall row `row` on all nodes of the lower (upper: high = 1) face of an axis. Call scene_codes first. */
void scene_codes(struct scene *s);
void scene_face(struct scene *s, int axis, int high, uint8_t row);
/* Map of bytes for each node, or for each cell of the grid, x fastest. */
struct gr_map scene_map(const struct scene *s, const uint8_t *value, int nodes);
/* Build the engine and bind `n` points at random positions inside the box [low, high] (shares of the domain), with
 * random mass, velocity, stress and log_density.
 * Returned: the error of the core. */
int scene_build(struct scene *s, int64_t n, double low, double high);
void scene_free(struct scene *s);

/* Uniform random number in [a, b), the same sequence in every run of a program. */
double scene_random(double a, double b);
void scene_seed(uint64_t seed);

/* Let the engine borrow the arrays of a scene. */
void scene_bind(struct scene *s);

/* Component c of a field in a slot, in double precision. */
double *scene_at(const struct scene *s, int field, int c, int64_t slot);
/* Sums of a node in row q (see mpm/p2g.inl), and its position in m. */
double scene_sum(const struct scene *s, int64_t node, int q);
double scene_node_x(const struct scene *s, int64_t node, int d);
/* Sum over the nodes of row q, or of its moment about 0 along the axis `moment` if that is not negative. */
double scene_total(const struct scene *s, int q, int moment);
/* Place of the point with this id, -1 if there is none. */
int64_t scene_find(const struct scene *s, int64_t id);
/* Compare the points of two scenes by id, whatever their order: 0 if and only if they agree to the last bit. */
int scene_differs(const struct scene *a, const struct scene *b);
/* Move the points to larger buffers, as GR_ERR_CAPACITY requires.
 * Returned: 0, or 1 without memory. */
int scene_grow(struct scene *s);
