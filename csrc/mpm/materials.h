/* Materials of a scene, by the number that a point carries in the field `material` where there are several. The
 * velocity field is one, so that materials stick to each other. */
#pragma once

#include "law/law.h"

enum { GR_MAX_MATERIALS = 8 };

/* A material as given. */
struct gr_material {
    int law;
    double rho_c, K;          /* kg/m^3; bulk modulus, Pa */
    double separation_strain; /* points with a log-density below minus this are disconnected; NO_SEPARATION of one that
                                 bears tension */
    double separation;        /* log-density below which its law bears no stress; both are counted from here */
    double slow_rate;         /* shear rate over sqrt(ln(rho/rho_c)) from which flow in averaged cells is not slow, 1/s */
    double damping_rate;      /* of slow flow in averaged cells, 1/s */
    double damping_time;      /* viscosities of the elastic deformation over the moduli, s */
    double flutter_time;      /* of the damping of flutter (flutter.inl): its viscosity over the pressure, s; */
    double flutter_memory;    /* time of the mean of the shear rate over the pressure, s/Pa; */
    double flutter_end;       /* friction over the shear rate from which nothing is damped, s; */
    double flutter_depth;     /* depth over the pressure in a layer at rest, m/Pa */
    double parameter[GR_LAW_MAX_PARAMETERS];
    gr_own_update *own; /* of a law of the user's own */
    double own_parameter[GR_OWN_PARAMETERS];
    int remembers; /* 1 if that law has a history */
};

/* Separation strains from this one on are of materials that bear tension. */
#define NO_SEPARATION 1e3

/* Numbers of the materials that kernels look up, prepared by gr_prepare_materials. X(name, description) */
#define GR_MATERIAL_NUMBERS(X)                                                  \
    X(FORCE_SCALE, "-1/(rho_c dx)")                                             \
    X(FILLING, "rho_c of the first material over its own: volumes as masses")   \
    X(STIFFNESS, "its K over that of the first: log-densities as pressures")    \
    X(SOFTNESS, "the inverse")                                                  \
    X(SEPARATION, "log-density below which points are disconnected")            \
    X(ORIGIN, "log-density at which its law separates")                         \
    X(STRESSED, "log-density from which points have stress")                    \
    X(SLOW, "square of the slow rate")                                          \
    X(FLUTTER_TIME, "viscosity of the damping of flutter over the pressure, s") \
    X(FLUTTER_MEMORY, "time of the mean of its rate over the pressure, s/Pa")   \
    X(FLUTTER_END, "friction over the shear rate from which there is none, s")  \
    X(FLUTTER_DEPTH, "K of the first over rho_c g: depth over log-density, m")  \
    X(DAMPING_TIME, "damping time of elastic waves, s")                         \
    X(BULK_MODULUS, "K, Pa")                                                    \
    X(SHEAR_MODULUS, "G, Pa")

#define GR_X(name, doc) GR_MATERIAL_##name,
enum gr_material_number { GR_MATERIAL_NUMBERS(GR_X) GR_MATERIAL_NUMBER_COUNT };
#undef GR_X
