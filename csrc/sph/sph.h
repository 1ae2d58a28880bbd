/* SPH of a dilative viscoplastic material (Hurley, thesis, chapter 5).
 *
 * The borrowed arrays hold the particles of the material in the rows [0, n_particles), the points that walls consist of
 * in n_walls rows from wall_first on, and the points of a gas in n_gas rows from gas_first on. All other rows are
 * spare: they have zero mass and are far away.
 *
 * Points are sorted by cell, so that the neighbours of a point lie in a few short runs of rows. The Verlet list
 * consists of blocks of as many rows as a vector has lanes. They are loaded as vectors, without indices; rows of a
 * block that are not neighbours have zero weight. Each point sums over its own neighbours in the order of its list, so
 * that the bits do not depend on the number of threads. */
#pragma once

#include <stdint.h>

#include "core/team.h"
#include "core/error.h"
#include "core/field.h"
#include "law/law.h"

/* X(name, kind, needed by, unit, description). First the fields that persist from step to step, then those of wall points
 * and gas alone, then those that each step computes anew and that are not sorted. */
#define GR_SPH_FIELDS(X)                                                                                        \
    X(x, GR_VECTOR, GR_ALWAYS, "m", "position; wrapped into the period when the list is made")                  \
    X(v, GR_VECTOR, GR_ALWAYS, "m/s", "velocity; prescribed for wall points")                                   \
    X(anchor, GR_VECTOR, GR_ALWAYS, "m", "position for which the neighbour list was made")                      \
    X(mass, GR_SCALAR, GR_ALWAYS, "kg", "mass (in 2D per metre of depth)")                                      \
    X(elastic_stress, GR_STRESS, GR_ELASTIC, "Pa", "elastic part of the shear stress, without trace")           \
    X(normal, GR_VECTOR, GR_ALWAYS, "1", "unit vector from a wall point into the material")                     \
    X(depth, GR_SCALAR, GR_ALWAYS, "m", "depth of a wall point below the surface of its wall")                  \
    X(wall, GR_SCALAR, GR_ALWAYS, "1", "number of the wall that a wall point belongs to")                       \
    X(porosity, GR_SCALAR, GR_ALWAYS, "1", "porosity at a point of gas; of a wall point, 1 if it is permeable") \
    X(a, GR_VECTOR, GR_ALWAYS, "m/s^2", "acceleration")                                                         \
    X(rho, GR_SCALAR, GR_ALWAYS, "kg/m^3", "density")                                                           \
    X(shear_rate, GR_SCALAR, GR_ALWAYS, "1/s", "|D| = sqrt(D:D/2), D = L + L^T")                                \
    X(stress, GR_STRESS, GR_ALWAYS, "Pa", "Cauchy stress, tension positive")

#define GR_X(name, kind, need, unit, doc) GR_SPH_FIELD_##name,
enum gr_sph_field { GR_SPH_FIELDS(GR_X) GR_SPH_FIELD_COUNT };
#undef GR_X
enum { GR_SPH_MAX_ROWS = GR_SPH_FIELD_COUNT * 6, GR_SPH_SHIFTS = 27, GR_SPH_CELLS_IN_REACH = 2, GR_SPH_MAX_WALLS = 64 };

extern const struct gr_field_info gr_sph_field_table[GR_SPH_FIELD_COUNT];

/* X(name, may be zero, unit, description) */
#define GR_SPH_PARAMETERS(X)                                                                       \
    X(h, 0, "m", "smoothing length; the kernel reaches 2 h")                                       \
    X(skin, 0, "m", "reach of the neighbour list beyond the kernel")                               \
    X(rho0, 0, "kg/m^3", "density above which there is pressure")                                  \
    X(rho0_wall, 0, "kg/m^3", "the same for wall points")                                          \
    X(kappa, 0, "Pa", "stiffness of the equation of state")                                        \
    X(mu_l, 1, "1", "friction at rest")                                                            \
    X(mu_h, 1, "1", "friction at high rates")                                                      \
    X(D_star, 0, "1/s", "shear rate at which friction is halfway between the two")                 \
    X(cohesion, 1, "Pa", "shear strength without pressure")                                        \
    X(shear_modulus, 1, "Pa", "elastic shear modulus; 0: viscous below the strength")              \
    X(mu_wall, 1, "1", "friction on walls, if it is lower than in the material")                   \
    X(dilation, 1, "1", "largest dilation rate that is added to the friction")                     \
    X(regularisation, 0, "1", "largest viscosity, in rho h^2/dt")                                  \
    X(z_max, 0, "1", "largest factor of the artificial velocity of walls")                         \
    X(gradient, 0, "1", "gradient that the kernel finds of a linear field on the seeding lattice") \
    X(cfl, 0, "1", "time step over the stability limit")                                           \
    X(dt, 1, "s", "time step; 0: by the stability limit")

#define GR_X(name, zero, unit, doc) GR_SPH_P_##name,
enum gr_sph_parameter { GR_SPH_PARAMETERS(GR_X) GR_SPH_PARAMETER_COUNT };
#undef GR_X

extern const struct gr_parameter_info gr_sph_parameter_table[GR_SPH_PARAMETER_COUNT];
extern const unsigned gr_sph_may_be_zero; /* bit mask over the parameters */

/* A wall: a box, given at the start. Its points move with v from one time on, and are removed at another. */
struct gr_sph_wall {
    double lower[3], upper[3]; /* ends, m; infinite along a period */
    double v[3];               /* m/s */
    double from, until;        /* s; infinite: never */
    int axis;                  /* across it */
};

struct gr_sph_config {
    int dim;
    int periodic[3];
    double lower[3], upper[3]; /* of the domain, m; particles that leave it are dropped */
    int wall_friction;         /* 1 if mu_wall is the friction on walls, 0 if it is the friction of the material */
    double parameter[GR_SPH_PARAMETER_COUNT];
    int n_gravity;
    const double *gravity_times, *gravity_vectors; /* s; m/s^2, n_gravity x dim: copied */
    int n_walls;                                   /* without any, wall points keep the velocity they are given */
    struct gr_sph_wall wall[GR_SPH_MAX_WALLS];
};

/* Stages of a step, in their order. Each sums over the neighbours of particles and wall points, or of points of gas. */
enum gr_sph_stage {
    GR_SPH_DENSITIES,
    GR_SPH_FILTER,
    GR_SPH_STRESSES,
    GR_SPH_FORCES,       /* particles */
    GR_SPH_GAS_VOLUMES,  /* gas: volume, porosity, density, pressure */
    GR_SPH_GAS_FORCES,   /* gas: push */
    GR_SPH_GAS_LOADS,    /* particles: load */
    GR_SPH_GAS_SHARES,   /* particles: add their share of the pressure forces to the accelerations */
    GR_SPH_GAS_EXCHANGE, /* gas: gain, carry */
    GR_SPH_GAS_DRAG,     /* gas: drag, acceleration */
    GR_SPH_GAS_REACTIONS /* particles: subtract the drag forces from the accelerations */
};

/* A block of neighbours: as many rows as a vector has lanes, from `row` on, as images moved by shift[]. */
struct gr_block {
    int32_t row, shift;
};

/* Results of a thread for its share of the points. */
struct gr_sph_extremes {
    double speed2, acceleration2;   /* largest squares of the speeds of sound and of particles, and of the acceleration */
    double gas_speed2;              /* largest square of the speed of the gas */
    double moved2, low[3], high[3]; /* since the list was made: largest square of a displacement, and its extrema along
                                       each axis */
    int64_t bad, blocks;            /* first row that is not finite or ran away, or -1; largest number of blocks of a row */
    int64_t stopped;                /* number of particles stopped by walls */
    char line[64];
};

struct gr_sph {
    struct gr_sph_config config;
    double reach, shift[GR_SPH_SHIFTS][3];
    int shape[3];
    double per_cell[3]; /* 1/m */
    int64_t n_cells, capacity, n_particles, wall_first, n_walls, gas_first, n_gas;
    /* borrowed */
    double *row[GR_SPH_MAX_ROWS]; /* components of all fields, one after the other */
    int64_t *id;
    /* owned arrays, with an entry for each row */
    /* m/rho~; m/rho; rho~; sigma/rho^2; scratch of the sort */
    double *lump, *volume, *rho_plain, *pull[6], *sorted;
    int64_t *sorted_id, *begin, *middle, *end; /* first block: of particles, of walls, and the end of both */
    int32_t *cell, *order, *start[3];
    struct gr_block *block;
    int64_t stride;               /* capacity of blocks per row */
    struct gr_sph_gas *gas;       /* or NULL */
    struct gr_sph_inflow *inflow; /* or NULL */
    /* clock and counters; a restart needs all of them */
    double time, dt, speed2, acceleration2, dropped_mass, gas_speed2;
    int64_t step, dropped, rebuilds, started, stopped, gas_dropped;
    double gravity[3], wall_dt[GR_SPH_MAX_WALLS]; /* of the step: time for which each wall moves, s */
    int lanes, refused_threads, error;            /* refused by the system of those that the last gr_sph_advance asked for */
    int64_t error_id;
    double error_x[3];
    struct gr_sph_extremes extremes[GR_MAX_THREADS];
};

/* Number of components of a field; 0 if nothing needs it. */
static inline int gr_sph_components(const struct gr_sph *s, int field)
{
    const struct gr_field_info *info = &gr_sph_field_table[field];
    const int needed = info->need == GR_ALWAYS || s->config.parameter[GR_SPH_P_shear_modulus] > 0;
    return needed ? gr_kind_components(info->kind, s->config.dim) : 0;
}

/* Number of component arrays of all fields. */
static inline int gr_sph_row_count(const struct gr_sph *s)
{
    int n = 0;
    for (int f = 0; f < GR_SPH_FIELD_COUNT; f++) n += gr_sph_components(s, f);
    return n;
}

/* The component arrays of a field, one after the other. */
static inline double *const *gr_sph_rows(const struct gr_sph *s, int field)
{
    int first = 0;
    for (int f = 0; f < field; f++) first += gr_sph_components(s, f);
    return s->row + first;
}

/* The kernel of SPH: make a stage for the rows [first, last), all of one kind; see sums.inl, stress.inl, gas_sums.inl. */
typedef void gr_sph_kernel(struct gr_sph *s, enum gr_sph_stage stage, int64_t first, int64_t last,
                           struct gr_sph_extremes *extremes);

/* Make an engine with a copy of the configuration.
 * Returned: 0, GR_ERR_MEMORY, or GR_ERR_CONFIG if a period is shorter than the list reaches or there are too many
 * cells. */
int gr_sph_new(struct gr_sph **out, const struct gr_sph_config *config, int lanes);
void gr_sph_free(struct gr_sph *s);

/* Set the rows of the points of gas, in the arrays that gr_sph_bind then borrows. */
void gr_sph_place_gas(struct gr_sph *s, int64_t gas_first, int64_t n_gas);

/* Set the borrowed arrays. With `fresh` the neighbour list is made for the positions x; else for the anchors, as it was
 * before a restart. At least GR_LANES spare rows must follow the particles, the wall points and the points of gas. */
int gr_sph_bind(struct gr_sph *s, double *const *row, int64_t *id, int64_t capacity, int64_t n_particles, int64_t wall_first,
                int64_t n_walls, int fresh);

/* Make steps until their number or the time is reached; the last one ends at or beyond `until`.
 * Returned: 0, an error that stays, or GR_ERR_CAPACITY if points that enter need larger arrays, not bound as `fresh`, for
 * the next step. */
int gr_sph_advance(struct gr_sph *s, gr_sph_kernel *kernel, int64_t max_steps, double until, int threads);

double gr_sph_stable_dt(const struct gr_sph *s); /* s, for the present state */

/* walls.c */
int gr_sph_is_gone(const struct gr_sph *s, int64_t row);               /* whether the wall of a wall point was removed */
int gr_sph_begin_walls(struct gr_sph *s);                              /* of a step. Returned: whether one is removed */
void gr_sph_move_walls(struct gr_sph *s, int64_t first, int64_t last); /* for rows of wall points */
int64_t gr_sph_stop(struct gr_sph *s, int64_t first, int64_t last);    /* for rows of particles. Returned: how many */

/* neighbours.c */
void gr_sph_sort(struct gr_sph *s, int fresh); /* fresh: set the anchors to x, and drop particles outside the domain */
/* List the blocks of the rows [first, last).
 * Returned: the largest number that a row needs; those beyond s->stride are not stored. */
int64_t gr_sph_list_blocks(struct gr_sph *s, int64_t first, int64_t last);
int gr_sph_widen(struct gr_sph *s, int64_t needed); /* capacity for this many blocks per row */
