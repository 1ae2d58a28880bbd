/* Gas in the pores of the grains and above them: a second set of points; see gas_sums.inl for its equations.
 *
 * Its points are the rows [gas_first, gas_first + n_gas) of the lent arrays, sorted and listed as grains and walls are.
 * A scene without gas has no such rows, no such list and none of this memory. */
#ifndef GR_SPH_GAS_H
#define GR_SPH_GAS_H

#include <stdint.h>

/* X(name, may be zero, unit, description) */
#define GR_SPH_GAS_PARAMETERS(X)                                                                       \
    X(sound_speed, 0, "m/s", "isothermal speed of sound c, p = c^2 rho")                               \
    X(pressure, 0, "Pa", "ambient pressure, from which that between points of gas is counted")         \
    X(viscosity, 0, "Pa s", "viscosity of the gas")                                                    \
    X(permeability, 0, "m^2", "permeability of the grains")                                            \
    X(diameter, 0, "m", "diameter of a grain")                                                         \
    X(grain_density, 0, "kg/m^3", "density of what grains are made of")                                \
    X(darcy_porosity, 0, "1", "porosity up to which the drag is that of Darcy")                        \
    X(blend, 0, "1", "range of porosity above it in which that of Wen and Yu takes its place")         \
    X(damping, 1, "1", "factor alpha of the artificial viscosity between points of gas that approach") \
    X(diffusion, 1, "1", "factor psi of the exchange of mass that evens out what forces do not feel")  \
    X(wall_volume, 0, "m^dim", "volume that a point of an impermeable wall takes from the gas")

enum gr_sph_gas_parameter {
#define GR_X(name, zero, unit, doc) GR_SPH_GAS_P_##name,
    GR_SPH_GAS_PARAMETERS(GR_X)
#undef GR_X
        GR_SPH_GAS_PARAMETER_COUNT
};

enum { GR_SPH_MAX_JETS = 16 };

/* A box in which the gas is driven: its points have that velocity there. */
struct gr_sph_jet {
    double lower[3], upper[3], velocity[3]; /* m; m/s */
};

struct gr_sph_gas {
    double parameter[GR_SPH_GAS_PARAMETER_COUNT];
    int n_jets;
    struct gr_sph_jet jet[GR_SPH_MAX_JETS];
    /* owned, a place for each row: of points of gas but for the last two */
    double *volume; /* of gas and grains about a point */
    double *pull,
        *own_pull;    /* pressure above the ambient one over the number of points per volume; that times volume of gas */
    double *per_mass; /* 1/sum_j m_j w over the grains about it, or 0 where there are none */
    double *push[3];  /* force of pressures and of the artificial viscosity, N */
    double *drag[3];  /* that of the drag of the grains about it, N */
    double *gain, *carry[3]; /* mass and momentum by the exchange, kg/s, N */
    double *load;            /* of a grain: mass of gas that hangs on it over its own */
    int64_t *end;            /* of the blocks of gas, which follow those of walls */
};

/* The sums of a step, in their order: over the rows of the gas, or of the grains. */
enum gr_sph_gas_stage {
    GR_SPH_GAS_VOLUMES,  /* gas: volume, porosity, density, pressure */
    GR_SPH_GAS_FORCES,   /* gas: push */
    GR_SPH_GAS_LOADS,    /* grains: load */
    GR_SPH_GAS_SHARES,   /* grains: their share of the pushes is added to the accelerations */
    GR_SPH_GAS_EXCHANGE, /* gas: gain, carry */
    GR_SPH_GAS_DRAG,     /* gas: drag, acceleration */
    GR_SPH_GAS_REACTIONS /* grains: the drags are taken from the accelerations */
};

struct gr_sph;
struct gr_sph_found;

/* Give an engine gas, before its points are bound. Copies what is given. GR_ERR_CONFIG for too many jets. */
int gr_sph_take_gas(struct gr_sph *s, const double *parameter, int n_jets, const struct gr_sph_jet *jets);
void gr_sph_free_gas(struct gr_sph *s);

int gr_sph_make_gas_places(struct gr_sph *s, int64_t capacity); /* memory for so many rows, zero */
void gr_sph_free_gas_places(struct gr_sph *s);

/* The halves of a step for the points of gas [first, last), after which those in a jet have its velocity:
 * v += a dt/2, x += v dt; and the exchange of mass and v += a dt/2, which finds the largest speed. */
void gr_sph_drift_gas(struct gr_sph *s, int64_t first, int64_t last);
void gr_sph_kick_gas(struct gr_sph *s, double dt, int64_t first, int64_t last, struct gr_sph_found *found);

#endif
