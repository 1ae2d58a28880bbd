/* Configuration of the MPM engine: the scene and its scheme in numbers. */
#pragma once

#include <math.h>
#include <stdint.h>

#include "body/body.h"
#include "core/map.h"
#include "mpm/materials.h"
#include "mpm/scheme.h"

/* Largest viscosity of the damping of flutter times the time between two updates, over rho_c dx^2: the decrease of the
 * velocity of a wave in an update is this times (k S dx)^2, and must not be more than twice of it. S is the Fourier
 * transform of the splines, and k S dx is 1.19 at most. */
#define GR_MOST_DIFFUSED 1.4

/* Effect of a wall on the velocity of a node (see granular/mpm/walls.py). */
struct gr_wall {
    int32_t fixed;      /* bit d: component d is given by the wall */
    int32_t away[3];    /* of such a component: +1 or -1, the direction in which the node may leave; 0: held both ways */
    double friction[3]; /* Coulomb coefficient of the wall normal to each axis */
    double opens_at;    /* s; from this time on row `after` applies to the node */
    int32_t after;
    double velocity[3]; /* m/s; along the wall */
};

enum gr_affine { GR_AFFINE_NONE, GR_AFFINE_GRADIENT, GR_AFFINE_MOMENT, GR_AFFINE_COUNT };

/* Diffusion of the fluidity of a nonlocal law. */
struct gr_nonlocal {
    int method;          /* enum gr_diffusion; GR_DIFFUSION_COUNT: explicit if a substep is short enough, else implicit */
    int stencil;         /* enum gr_stencil */
    int substeps;        /* number of substeps of law and diffusion in a step, during which the velocity gradient is
                            constant */
    double begins_at;    /* s; before this time the law is in its local phase */
    double floor;        /* 1/s; lower bound of the fluidity of a cell after the diffusion */
    double tolerance;    /* of the conjugate gradients */
    const uint8_t *face; /* (2 dim, cells): enum gr_face */
};

struct gr_config {
    int dim, basis, affine, smoothed, cell_averaged, xpic_order;
    int axisymmetric; /* 1: the plane is one of (r, z); masses, volumes and forces are those of whole rings */
    int single;       /* 1: the kernels compute in single precision */
    int shape[3], periodic[3], open_low[3], open_high[3];
    double lower[3], dx, lambda;
    int n_c0_lines[3];
    const int32_t *c0_lines[3];
    struct gr_scheme_numbers scheme; /* as given; what follows is made of them and of the scene */
    double keep_velocity_rate;       /* 1/s: FLIP keeps the share f = exp(-rate dt) in a step; < 0: f = 0 (PIC, APIC) */
    double wave_speed, mass_cutoff, cfl, dt; /* m/s, the largest; kg; 1; s; dt > 0: fixed */
    int n_materials;
    struct gr_material material[GR_MAX_MATERIALS], largest; /* number by number, set when an engine is built */
    struct gr_density_numbers density;
    int averaging_interval; /* steps between two averagings of the density, each of which stands for that many steps */
    int flutter_interval;   /* steps between two updates of the damping of flutter */
    struct gr_nonlocal nonlocal;
    int pressure_from_density;
    int n_gravity;
    const double *gravity_times;   /* s */
    const double *gravity_vectors; /* n_gravity x dim, m/s^2 */
    int n_walls;
    const struct gr_wall *walls; /* row 0 is for free nodes */
    struct gr_map node_codes;    /* of the nodes of the grid: row of the wall */
    int has_sponge; /* bit d: points beyond above[d], m, that rise along axis d are damped at the rate sponge_damping[d],
                       1/s */
    double above[3], sponge_damping[3];
    struct gr_map cell_flags; /* of the cells of the grouping: enum gr_cell_flag */
    int n_bodies, n_parts;
    const struct gr_body *bodies;
    const struct gr_part *parts; /* of all bodies */
};

/* Flags of a cell. GR_CELL_WALL << (2 d + side): a wall stands at the low (side 0) or high (1) face along axis d. */
#define GR_CELL_FLAGS(X) X(GR_CELL_SOLID, solid, 1) X(GR_CELL_NO_SHIFTING, no_shifting, 2) X(GR_CELL_WALL, wall, 4)

#define GR_X(constant, name, value) constant = (value),
enum gr_cell_flag { GR_CELL_FLAGS(GR_X) };
#undef GR_X

/* Whether the engine takes the configuration. */
int gr_config_is_valid(const struct gr_config *config);

/* Copy the arrays that the configuration points to, and find the largest numbers of its materials. Returned: 0 or
 * GR_ERR_MEMORY. */
int gr_config_own(struct gr_config *config);

void gr_config_free(struct gr_config *config);

/* Number of the material with a fluidity, or -1. */
int gr_nonlocal_material(const struct gr_config *config);

/* The time step with the damping of elastic waves that is as far from its limit as `dt` is without, s. The wave of the
 * largest frequency 2/dt obeys u'' = -(2/dt)^2 (u + T u'), and the explicit step h with it is stable if h^2 + 2 T h <=
 * dt^2. */
static inline double gr_damped_dt(double dt, double T) { return T > 0 ? dt * dt / (sqrt(dt * dt + T * T) + T) : dt; }

/* True if points have a viscous stress (elastic_damping.inl). */
static inline int gr_has_viscous_stress(const struct gr_config *c) { return c->largest.damping_time > 0; }

/* The longest time step that the engine takes, s. */
static inline double gr_longest_dt(const struct gr_config *c)
{
    return c->dt > 0 ? c->dt : gr_damped_dt(c->cfl * c->dx / c->wave_speed, c->largest.damping_time);
}
