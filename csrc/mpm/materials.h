/* Materials of a scene, by the number that a point carries in the field `material` where there are several. The
 * velocity field is one, so that materials stick to each other. */
#pragma once

#include <float.h>
#include <math.h>
#include <string.h>

#include "law/law.h"

enum { GR_MAX_MATERIALS = 8 };

/* The numbers of a material as given, but for the parameters of its law. Each is declared here and nowhere else: the struct
 * below, its checks, what Python gives (granular/mpm/engine.py: the attribute of the material with this name, unless it is
 * computed there) are made from this list. X(name, least, unit, description). */
#define GR_MATERIAL(X)                                                                                              \
    X(rho_c, GR_POSITIVE, "kg/m^3", "density")                                                                      \
    X(K, GR_POSITIVE, "Pa", "bulk modulus")                                                                         \
    X(separation_strain, 0, "1",                                                                                    \
      "points with a log-density below minus this are disconnected; NO_SEPARATION of one that bears tension")       \
    X(separation, -INFINITY, "1", "log-density below which its law bears no stress; both are counted from here")    \
    X(slow_rate, 0, "1/s", "shear rate over sqrt(ln(rho/rho_c)) from which flow in averaged cells is not slow")     \
    X(damping_rate, 0, "1/s", "of slow flow in averaged cells")                                                     \
    X(damping_time, 0, "s", "viscosities of the elastic deformation over the moduli")                               \
    X(flutter_time, 0, "s", "of the damping of flutter (flutter.inl): its viscosity over the pressure")             \
    X(flutter_memory, 0, "s/Pa", "of the damping of flutter: time of the mean of the shear rate over the pressure") \
    X(flutter_end, 0, "s", "of the damping of flutter: friction over the shear rate from which nothing is damped")  \
    X(flutter_depth, 0, "m/Pa", "of the damping of flutter: depth over the pressure in a layer at rest")

#define GR_POSITIVE DBL_MIN

struct gr_material {
    int law;
#define GR_X(name, least, unit, doc) double name;
    GR_MATERIAL(GR_X)
#undef GR_X
    double parameter[GR_LAW_MAX_PARAMETERS];
    gr_own_update *function; /* of a user-defined law */
    double own_parameter[GR_OWN_PARAMETERS];
    int remembers; /* 1 if that law has a history */
};

/* A parameter of the law of a material; 0 if it has none of this name. */
static inline double gr_parameter_of(const struct gr_material *material, const char *name)
{
    const struct gr_law *law = gr_law_at(material->law);
    for (int k = 0; k < gr_law_parameters(law); k++)
        if (!strcmp(law->parameter[k].name, name)) return material->parameter[k];
    return 0;
}

/* Separation strains from this one on are of materials that bear tension. */
#define NO_SEPARATION 1e3

/* Log-density from which points of a material have stress. */
static inline double gr_stressed_from(const struct gr_material *m)
{
    if (m->separation_strain >= NO_SEPARATION) return -m->separation_strain;
    return m->separation - gr_parameter_of(m, "tensile_strength") / m->K;
}

/* A parameter of the law of a material that dilates, whose flow dissipates mu(I) p gdot; 0 of others. */
static inline double gr_of_dilating(const struct gr_material *m, const char *name)
{
    return gr_law_at(m->law)->dilates ? gr_parameter_of(m, name) : 0;
}

/* Numbers of the materials that kernels look up, made when an engine is built of a material m, the first one and the cell
 * size dx. X(name, value, description) */
#define GR_MATERIAL_NUMBERS(X)                                                                              \
    X(FORCE_SCALE, -1.0 / (m->rho_c * dx), "-1/(rho_c dx)")                                                 \
    X(FILLING, first->rho_c / m->rho_c, "rho_c of the first material over its rho_c: volumes as masses")    \
    X(STIFFNESS, m->K / first->K, "its K over the K of the first: log-densities as pressures")              \
    X(SOFTNESS, first->K / m->K, "the inverse")                                                             \
    X(SEPARATION, m->separation - m->separation_strain, "log-density below which points are disconnected")  \
    X(ORIGIN, m->separation, "log-density at which its law separates")                                      \
    X(STRESSED, gr_stressed_from(m), "log-density from which points have stress")                           \
    X(SLOW, m->slow_rate * m->slow_rate, "square of the slow rate")                                         \
    X(FLUTTER_TIME, m->flutter_time, "viscosity of the damping of flutter over the pressure, s")            \
    X(FLUTTER_MEMORY, m->flutter_memory, "time of the mean of its rate over the pressure, s/Pa")            \
    X(FLUTTER_END, m->flutter_end, "friction over the shear rate from which there is none, s")              \
    X(FLUTTER_DEPTH, first->K * m->flutter_depth, "K of the first over rho_c g: depth over log-density, m") \
    X(DAMPING_TIME, m->damping_time, "damping time of elastic waves, s")                                    \
    X(BULK_MODULUS, m->K, "K, Pa")                                                                          \
    X(SHEAR_MODULUS, gr_parameter_of(m, "G"), "G, Pa")                                                      \
    X(DILATING_MU_S, gr_of_dilating(m, "mu_s"), "mu_s of a material that dilates, else 0")                  \
    X(DILATING_RISE, gr_of_dilating(m, "mu_2") - gr_of_dilating(m, "mu_s"), "mu_2 - mu_s of one")           \
    X(DILATING_XI, gr_of_dilating(m, "xi"), "its xi, sqrt(m/kg)")

#define GR_X(name, value, doc) GR_MATERIAL_##name,
enum gr_material_number { GR_MATERIAL_NUMBERS(GR_X) GR_MATERIAL_NUMBER_COUNT };
#undef GR_X
