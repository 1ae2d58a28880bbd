/* Smoothed particle hydrodynamics of a dilative viscoplastic material (Hurley, thesis, chapter 5).
 *
 * Rows [0, n_particles) of the lent arrays hold the grains, rows from wall_first on the n_walls points that walls are made
 * of, rows from gas_first on the n_gas points of a gas; all others are spare, with zero mass and far away. All are sorted by cell, so that the neighbours of a
 * point lie in a few short runs of rows: the Verlet list names blocks of as many rows as a vector has lanes, which are
 * loaded without gathering, and what in them is no neighbour has no weight. Each point sums its own neighbours, in the
 * order of its list: the bits do not depend on the number of threads. */
#ifndef GR_SPH_SPH_H
#define GR_SPH_SPH_H

#include <stdint.h>

#include "core/barrier.h"
#include "core/error.h"
#include "core/field.h"
#include "law/law.h"
#include "sph/gas.h"

/* X(name, kind, needed by, unit, description): first what grains keep from step to step, then what only wall points need,
 * then what each step makes anew and no sorting moves. */
#define GR_SPH_FIELDS(X)                                                                                        \
    X(x, GR_VECTOR, GR_ALWAYS, "m", "position; within a period only where the list is new")                     \
    X(v, GR_VECTOR, GR_ALWAYS, "m/s", "velocity; that of a wall point is given")                                \
    X(anchor, GR_VECTOR, GR_ALWAYS, "m", "position for which the list of neighbours was made")                  \
    X(mass, GR_SCALAR, GR_ALWAYS, "kg", "mass (per metre of depth in the plane)")                               \
    X(elastic_stress, GR_STRESS, GR_ELASTIC, "Pa", "elastic part of the shear stress, without trace")           \
    X(normal, GR_VECTOR, GR_ALWAYS, "1", "unit vector from a wall point into the material; of grains not used") \
    X(depth, GR_SCALAR, GR_ALWAYS, "m", "depth of a wall point below the surface of its wall")                  \
    X(wall, GR_SCALAR, GR_ALWAYS, "1", "number of the wall that a wall point belongs to")                       \
    X(porosity, GR_SCALAR, GR_ALWAYS, "1",                                                                      \
      "share of space at a point of gas that grains leave; of a wall, 1 if gas goes through")                   \
    X(a, GR_VECTOR, GR_ALWAYS, "m/s^2", "acceleration")                                                         \
    X(rho, GR_SCALAR, GR_ALWAYS, "kg/m^3", "density")                                                           \
    X(shear_rate, GR_SCALAR, GR_ALWAYS, "1/s", "|D| = sqrt(D:D/2), D = L + L^T")                                \
    X(stress, GR_STRESS, GR_ALWAYS, "Pa", "Cauchy stress, tension positive")

enum gr_sph_field {
#define GR_X(name, kind, need, unit, doc) GR_SPH_FIELD_##name,
    GR_SPH_FIELDS(GR_X)
#undef GR_X
        GR_SPH_FIELD_COUNT
};
enum { GR_SPH_MAX_ROWS = GR_SPH_FIELD_COUNT * 6, GR_SPH_SHIFTS = 27, GR_SPH_CELLS_IN_REACH = 2, GR_SPH_MAX_WALLS = 64 };

extern const struct gr_field_info gr_sph_field_table[GR_SPH_FIELD_COUNT];

/* X(name, may be zero, unit, description) */
#define GR_SPH_PARAMETERS(X)                                                                  \
    X(h, 0, "m", "smoothing length; the kernel reaches 2 h")                                  \
    X(skin, 0, "m", "how much farther than the kernel the list of neighbours reaches")        \
    X(rho0, 0, "kg/m^3", "density above which grains bear pressure")                          \
    X(rho0_wall, 0, "kg/m^3", "that of the points of walls")                                  \
    X(kappa, 0, "Pa", "stiffness of the equation of state")                                   \
    X(mu_l, 1, "1", "friction at rest")                                                       \
    X(mu_h, 1, "1", "friction at high rates")                                                 \
    X(D_star, 0, "1/s", "shear rate halfway between them")                                    \
    X(cohesion, 1, "Pa", "shear strength without pressure")                                   \
    X(shear_modulus, 1, "Pa", "elastic shear modulus; 0: none below the strength")            \
    X(mu_wall, 1, "1", "friction between grains and walls, where they have one of their own") \
    X(dilation, 1, "1", "largest rate of dilation that adds to the friction")                 \
    X(regularisation, 0, "1", "largest viscosity, in rho h^2/dt")                             \
    X(z_max, 0, "1", "largest factor of the artificial velocity of walls")                    \
    X(gradient, 0, "1", "gradient that the kernel finds of a linear field on a lattice")      \
    X(cfl, 0, "1", "share of the limits of the time step that is taken")                      \
    X(dt, 1, "s", "time step; 0: the limits choose it")

enum gr_sph_parameter {
#define GR_X(name, zero, unit, doc) GR_SPH_P_##name,
    GR_SPH_PARAMETERS(GR_X)
#undef GR_X
        GR_SPH_PARAMETER_COUNT
};

extern const struct gr_parameter_info gr_sph_parameter_table[GR_SPH_PARAMETER_COUNT];
extern const unsigned gr_sph_may_be_zero; /* one bit for each parameter */

/* A wall as a box, at the start. Its points move with v from a time on, and are taken away at another. */
struct gr_sph_wall {
    double lower[3], upper[3]; /* ends, m; infinite along a period */
    double v[3];               /* m/s */
    double from, until;        /* s; infinite: never */
    int axis;                  /* across it */
};

struct gr_sph_config {
    int dim;
    int periodic[3];
    double lower[3], upper[3]; /* of the domain, m: grains that leave it are dropped */
    int wall_friction;         /* whether mu_wall takes the place of mu_l and mu_h between grains and walls */
    double parameter[GR_SPH_PARAMETER_COUNT];
    int n_gravity;
    const double *gravity_times, *gravity_vectors; /* s; m/s^2, n_gravity x dim: copied */
    int n_walls;                                   /* without any, wall points move as they are told */
    struct gr_sph_wall wall[GR_SPH_MAX_WALLS];
};

/* So many rows as a vector has lanes, from `row` on, as images moved by shift[]. */
struct gr_block {
    int32_t row, shift;
};

/* What a thread has found in its share of the points. */
struct gr_sph_found {
    double speed2, acceleration2;   /* largest squares of speeds, of sound and of grains, and of the acceleration */
    double gas_speed2;              /* largest square of the velocity of gas */
    double moved2, low[3], high[3]; /* square of the longest way since the list was made, and the ends of all ways */
    int64_t bad, blocks;            /* first row that is not finite or ran away, or -1; most blocks of a row */
    int64_t stopped;                /* grains, by walls */
    char line[64];
};

struct gr_sph {
    struct gr_sph_config config;
    double reach, shift[GR_SPH_SHIFTS][3];
    int shape[3];
    double per_cell[3]; /* 1/m */
    int64_t n_cells, capacity, n_particles, wall_first, n_walls, gas_first, n_gas;
    /* lent */
    double *row[GR_SPH_MAX_ROWS]; /* of all fields, one after the other */
    int64_t *id;
    /* owned, a place for each row */
    double *lump, *volume, *rho_plain, *pull[6], *wall_pull[6], *sorted;
    int64_t *sorted_id, *begin, *middle, *end; /* blocks of grains from begin on, of walls from middle on */
    int32_t *cell, *order, *start[3];
    struct gr_block *block;
    int64_t stride;         /* places for the blocks of a row */
    struct gr_sph_gas *gas; /* or NULL */
    /* the clock and what a restart needs */
    double time, dt, speed2, acceleration2, dropped_mass, gas_speed2;
    int64_t step, dropped, rebuilds, started, stopped, gas_dropped;
    double gravity[3], wall_dt[GR_SPH_MAX_WALLS]; /* of the step: how long each wall moves, s */
    int lanes, error;
    int64_t error_id;
    double error_x[3];
    struct gr_sph_found found[GR_MAX_THREADS];
};

/* Components of a field; 0 if nothing needs it. */
static inline int gr_sph_components(const struct gr_sph *s, int field)
{
    const struct gr_field_info *info = &gr_sph_field_table[field];
    const int needed = info->need == GR_ALWAYS || s->config.parameter[GR_SPH_P_shear_modulus] > 0;
    return needed ? gr_kind_components(info->kind, s->config.dim) : 0;
}

/* The rows of a field, its components one after the other. */
static inline double *const *gr_sph_rows(const struct gr_sph *s, int field)
{
    int first = 0;
    for (int f = 0; f < field; f++) first += gr_sph_components(s, f);
    return s->row + first;
}

/* The kernels of one instruction set, for the rows [first, last); see sums.inl. */
struct gr_sph_kernels {
    void (*densities)(struct gr_sph *s, int64_t first, int64_t last);
    void (*filter)(struct gr_sph *s, int64_t first, int64_t last, struct gr_sph_found *found);
    void (*stresses)(struct gr_sph *s, int64_t first, int64_t last);
    void (*forces)(struct gr_sph *s, int64_t first, int64_t last, struct gr_sph_found *found);
    void (*gas)(struct gr_sph *s, int stage, int64_t first, int64_t last, struct gr_sph_found *found);
};

/* Copies the configuration. GR_ERR_CONFIG where a period is shorter than the list reaches, or cells are too many. */
int gr_sph_new(struct gr_sph **out, const struct gr_sph_config *config, int lanes);
void gr_sph_free(struct gr_sph *s);

/* Where the points of the gas are in the arrays that gr_sph_bind then lends. */
void gr_sph_place_gas(struct gr_sph *s, int64_t gas_first, int64_t n_gas);

/* Lend the arrays. fresh: the list is made for the positions x; else for the anchors, as it was before a restart. At
 * least GR_LANES spare rows must follow the grains, the wall points and those of gas. */
int gr_sph_bind(struct gr_sph *s, double *const *row, int64_t *id, int64_t capacity, int64_t n_particles, int64_t wall_first,
                int64_t n_walls, int fresh);

/* Steps up to a number of them or a time, the first step at or past it. */
int gr_sph_advance(struct gr_sph *s, const struct gr_sph_kernels *kernels, int64_t max_steps, double until, int threads);

double gr_sph_stable_dt(const struct gr_sph *s); /* s, by the limits of the present state */

/* walls.c */
int gr_sph_is_gone(const struct gr_sph *s, int64_t row);               /* whether the wall of a wall point is */
int gr_sph_begin_walls(struct gr_sph *s);                              /* of a step. Returned: whether one goes */
void gr_sph_move_walls(struct gr_sph *s, int64_t first, int64_t last); /* rows of wall points */
int64_t gr_sph_stop(struct gr_sph *s, int64_t first, int64_t last);    /* rows of grains. Returned: how many */

/* neighbours.c */
void gr_sph_sort(struct gr_sph *s, int fresh); /* fresh: anchors at x, and grains outside of the domain are dropped */
/* The blocks of the rows [first, last). Returned: the most that a row needs; more than s->stride are not kept. */
int64_t gr_sph_list_blocks(struct gr_sph *s, int64_t first, int64_t last);
int gr_sph_widen(struct gr_sph *s, int64_t needed); /* room for so many blocks of each row */

#endif
