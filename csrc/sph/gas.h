/* Gas in the pores of the granular material and above it: a second set of SPH points; see gas_sums.inl for the
 * equations.
 *
 * Its points are the rows [gas_first, gas_first + n_gas) of the borrowed arrays, sorted and listed like particles and
 * walls. A scene without gas has no such rows, no list of them and none of this memory. */
#pragma once

#include <stdint.h>

/* X(name, may be zero, unit, description) */
#define GR_SPH_GAS_PARAMETERS(X)                                                                     \
    X(sound_speed, 0, "m/s", "isothermal speed of sound c, p = c^2 rho")                             \
    X(pressure, 0, "Pa", "ambient pressure, the reference of the forces between points of gas")      \
    X(viscosity, 0, "Pa s", "viscosity of the gas")                                                  \
    X(permeability, 0, "m^2", "permeability of the grains")                                          \
    X(diameter, 0, "m", "diameter of a grain")                                                       \
    X(grain_density, 0, "kg/m^3", "density of the material of the grains")                           \
    X(darcy_porosity, 0, "1", "porosity up to which the drag obeys Darcy's law")                     \
    X(blend, 0, "1", "range of porosity above it, of the transition to Wen and Yu's law")            \
    X(damping, 1, "1", "factor alpha of the artificial viscosity between approaching points of gas") \
    X(diffusion, 1, "1", "factor psi of the exchange of mass that smooths the pressure")             \
    X(wall_volume, 0, "m^dim", "volume from which a point of an impermeable wall excludes gas")

#define GR_X(name, zero, unit, doc) GR_SPH_GAS_P_##name,
enum gr_sph_gas_parameter { GR_SPH_GAS_PARAMETERS(GR_X) GR_SPH_GAS_PARAMETER_COUNT };
#undef GR_X

enum { GR_SPH_MAX_JETS = 16 };

/* A jet: a box in which the points of gas have a given velocity. */
struct gr_sph_jet {
    double lower[3], upper[3], velocity[3]; /* m; m/s */
};

struct gr_sph_gas {
    double parameter[GR_SPH_GAS_PARAMETER_COUNT];
    int n_jets;
    struct gr_sph_jet jet[GR_SPH_MAX_JETS];
    /* owned arrays with an entry for each row, set for points of gas; `load` and `end` for particles too */
    double *volume;          /* volume of a point, of gas and grains together */
    double *pull, *own_pull; /* gauge pressure over the number of points per volume; that times `volume` */
    double *per_mass;        /* 1/sum_j m_j w over the particles around a point, or 0 without any */
    double *push[3];         /* force of pressure and artificial viscosity, N */
    double *drag[3];         /* drag force of the particles around it, N */
    double *gain, *carry[3]; /* rates of change of mass and momentum by the exchange, kg/s, N */
    double *load;            /* of a particle: mass of the gas assigned to it, over its own mass */
    int64_t *end;            /* end of the blocks of gas, which follow the blocks of walls */
};

struct gr_sph;
struct gr_sph_extremes;

/* Add gas to an engine, before its points are bound. The arguments are copied.
 * Returned: 0, GR_ERR_MEMORY, or GR_ERR_CONFIG for too many jets. */
int gr_sph_take_gas(struct gr_sph *s, const double *parameter, int n_jets, const struct gr_sph_jet *jets);
void gr_sph_free_gas(struct gr_sph *s);

int gr_sph_make_gas_places(struct gr_sph *s, int64_t capacity); /* zeroed memory for `capacity` rows */
void gr_sph_free_gas_places(struct gr_sph *s);

/* The two halves of a step for the points of gas [first, last). After each, the points in a jet have its velocity.
 * gr_sph_drift_gas: v += a dt/2, x += v dt. gr_sph_kick_gas: exchange of mass, v += a dt/2, and the largest speed. */
void gr_sph_drift_gas(struct gr_sph *s, int64_t first, int64_t last);
void gr_sph_kick_gas(struct gr_sph *s, double dt, int64_t first, int64_t last, struct gr_sph_extremes *extremes);
