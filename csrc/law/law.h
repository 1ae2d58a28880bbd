/* Interface of the constitutive laws: the descriptor of a law, and the call that updates blocks of material points.
 *
 * A law is an elasticity combined with a flow rule. One file, law/<name>.inl, holds its equation, its update and its
 * descriptor; a line of law/registry.inl registers it. See docs/contributing.md, "Add a law". */
#pragma once

#include <stdint.h>

#include "core/simd.h"

enum { GR_LAW_MAX_PARAMETERS = 12 };

struct gr_parameter_info {
    const char *name, *unit, *doc;
};

#define GR_INFO(name, unit, doc) {#name, unit, doc},

/* Reaction of the fluidity to the flow at a point, of a nonlocal law (fluidity_update.h). */
enum gr_reaction { GR_LOCAL, GR_NGF, GR_LINEAR_NGF };

struct gr_law_call;
typedef void gr_law_update(const struct gr_law_call *call);
/* Descriptor of a law: all that the rest of the core knows of it. */
struct gr_law {
    const char *name, *doc;
    gr_law_update *update[2]; /* 2D, 3D */
    enum gr_reaction reaction;
    int fluidity; /* of a nonlocal law: index of the first of GR_FLUIDITY_PARAMETERS among its parameters */
    int hardens;  /* 1 if it needs the field plastic_strain */
    int dilates;  /* 1 if it needs the field bulking; it then changes log_density, too */
    struct gr_parameter_info parameter[GR_LAW_MAX_PARAMETERS]; /* all parameters in their order, then one whose name is
                                                                  NULL */
};

static inline int gr_law_parameters(const struct gr_law *law)
{
    int n = 0;
    while (n < GR_LAW_MAX_PARAMETERS && law->parameter[n].name) n++;
    return n;
}

/* Law k of the registry, for whatever does not depend on the instruction set; NULL beyond the last (dispatch.c). */
const struct gr_law *gr_law_at(int k);

/* Index of the law with this name, or -1. */
int gr_law_index(const char *name);

/* Parameters that several laws have in common. */
#define GR_ELASTIC_PARAMETERS \
    {"K", "Pa", "bulk modulus"}, { "G", "Pa", "shear modulus" }
#define GR_MU_I_PARAMETERS                                                                                               \
    GR_ELASTIC_PARAMETERS, {"mu_s", "1", "static friction coefficient"}, {"mu_2", "1", "limiting friction coefficient"}, \
    {                                                                                                                    \
        "xi", "sqrt(m/kg)", "rate constant I0/(d sqrt(rho_s))"                                                           \
    }
#define GR_COHESION_PARAMETERS                                                 \
    {"cohesion", "Pa", "shear stress at yield without pressure"},              \
    {                                                                          \
        "tensile_strength", "Pa", "tension -p at which the material separates" \
    }

/* Variables of the history of a point that a user-defined law may have, and numbers that it may have. */
enum { GR_HISTORY_COUNT = 4, GR_OWN_PARAMETERS = 32 };

/* Update of n points by a user-defined law, in arrays of n numbers, one component after the other.
 * Given: dim, 2 or 3; dt, s; the parameters: K and G, Pa, then the user's; gradient (dim*dim), L dt, row-major, and in 2D
 * its component out of the plane, v_r dt/r of an axisymmetric one, else 0;
 * log_density at the end of the step; in `stress` (4 or 6: xx, yy, zz, xy, yz, xz) the trial stress, Pa.
 * Updated: stress at the end of the step; history (GR_HISTORY_COUNT). Returned: shear_rate, 1/s, 0 before. Spare slots are
 * among the points: their numbers are finite, and their results are not used. Returned: done, 1 in the end, 0 before: an
 * exception that ends a function of Python earlier cannot pass through the core. */
typedef void gr_own_update(int64_t n, int64_t dim, double dt, const double *parameters, const double *gradient,
                           const double *log_density, double *stress, double *shear_rate, double *history, int64_t *done);

/* Calls of such a law that were not done: 1 if there were any that were repeated; 1 if one failed again. */
struct gr_own_calls {
    int repeated, failed;
};

/* One call of a law for `n_blocks` blocks of GR_W points.
 *
 * Given: slot[k], the first slot of block k in the point arrays; gradient[k*dim*dim*GR_W...], the increment L dt of the
 * velocity gradient over a step, row-major components of GR_W lanes each; hoop[k*GR_W...], in an axisymmetric plane its
 * component out of the plane, v_r dt/r, else NULL; dt, s; log_density at the end of the step, or with
 * `begins` before it; the parameters in the order of the law; g_star[k], the fluidity of block k after its diffusion, 1/s,
 * NULL in the local phase of a nonlocal law.
 * Updated: stress[c], component arrays, Pa; shear_rate, 1/s, where the pointer is not NULL; plastic_strain, 1, of a law
 * with hardening, and `separated`, 0 or 1, of a cohesive law, where the pointer is not NULL: they count as 0 otherwise;
 * bulking, 1, and log_density of a law that dilates.
 * Returned: the fluidity g, 1/s, and gain = g - g_star, 1/s, where the pointers are not NULL. Nonlocal laws need both
 * shear_rate and g.
 *
 * A nonlocal law may divide the step into substeps (law/substep.h). `substeps` then points to the state of the points
 * between substeps; it is NULL if the step is made at once. dt is the length of a substep, and `fraction` its share of
 * the step. A call with `begins` computes this state and makes the first substep; a call without it makes the last one.
 * After the first substep g and gain are undefined where a point is disconnected. */
struct gr_law_call {
    int64_t n_blocks;
    const int64_t *slot;
    const gr_real *gradient, *hoop;
    double dt, fraction;
    int pressure_from_density; /* 1: p = K log_density (consistent with eq. 2.7); 0: p from the trial stress (eq. 3.10) */
    const double *parameter;
    gr_real *log_density;
    const gr_real *g_star;
    double *substeps;
    int begins;
    gr_real *stress[6];
    gr_real *shear_rate, *g, *gain, *plastic_strain, *separated, *bulking;
    gr_own_update *function; /* of a user-defined law, with its numbers; `history` with `capacity` slots per component */
    const double *own_parameter;
    struct gr_own_calls *own_calls;
    gr_real *history;
    int64_t capacity;
};

/* State of a block of points between the substeps of a step, in runs of GR_W (law/substep.h). X(name, description) */
#define GR_SUBSTEP_STATE(X)                                           \
    X(turned, "R:R/2 divided by p^2")                                 \
    X(across, "R:D divided by p^2")                                   \
    X(strained, "D:D/2 divided by p^2")                               \
    X(of_turned, "a, the coefficient of R")                           \
    X(of_strained, "b, the coefficient of D")                         \
    X(p, "pressure at the end of the step, 0 where disconnected, Pa") \
    X(inverse_p, "see gr_inverse_pressure")                           \
    X(sink, "see gr_inverse_pressure")                                \
    X(unit_g, "see gr_inverse_pressure")                              \
    X(weight, "weight of the point in the fluidity of its cell; 0 where disconnected")

#define GR_X(name, doc) GR_SUBSTEP_##name,
enum gr_substep_number { GR_SUBSTEP_STATE(GR_X) GR_SUBSTEP_COUNT };
#undef GR_X

/* Parameters of the update of the fluidity at a point (fluidity_update.h). X(name, unit, description) */
#define GR_FLUIDITY_PARAMETERS(X)                                               \
    X(G, "Pa", "shear modulus")                                                 \
    X(mu_s, "1", "static friction coefficient")                                 \
    X(mu_2, "1", "limiting friction coefficient")                               \
    X(I0, "1", "inertial number at which friction is half way between the two") \
    X(rho_s, "kg/m^3", "density of a grain")                                    \
    X(d, "m", "diameter of a grain")                                            \
    X(t0, "s", "time scale of the fluidity")                                    \
    X(p_averaging, "Pa", "the law uses the mean of 1/sqrt(p) from p - this to p + this; 0: the value at p")

#define GR_X(name, unit, doc) GR_FLUIDITY_##name,
enum gr_fluidity_parameter { GR_FLUIDITY_PARAMETERS(GR_X) GR_FLUIDITY_PARAMETER_COUNT };
#undef GR_X

extern const struct gr_parameter_info gr_fluidity_parameter_table[GR_FLUIDITY_PARAMETER_COUNT];

/* One update of the fluidity at n points, with arrays of n numbers.
 * Given: dt, s; mu_trial = tau_trial/p, 1; p, Pa; g_star, the fluidity after diffusion, 1/s; shear_rate of the step
 * before, 1/s.
 * Returned: mu, 1; g, 1/s. */
struct gr_fluidity_call {
    int64_t n;
    double dt;
    double parameter[GR_FLUIDITY_PARAMETER_COUNT];
    const double *mu_trial, *p, *g_star, *shear_rate;
    double *mu, *g;
};

/* Flow rules of the finite-strain law (hencky.h). X(name, description) */
#define GR_HENCKY_FLOWS(X)                                                                              \
    X(elastic, "no flow; stress in tension too")                                                        \
    X(drucker_prager, "tau <= mu_s p")                                                                  \
    X(linear_mu_I, "mu = mu_s + (mu_2 - mu_s) I/I0")                                                    \
    X(mu_I, "mu(I)")                                                                                    \
    X(linear_ngf, "plastic rate from the fluidity; mu = mu_s + (mu_2 - mu_s) I/I0 where it is uniform") \
    X(ngf, "plastic rate from the fluidity; mu(I) where it is uniform")

#define GR_X(name, doc) GR_HENCKY_##name,
enum gr_hencky_flow { GR_HENCKY_FLOWS(GR_X) GR_HENCKY_FLOW_COUNT };
#undef GR_X

extern const char *const gr_hencky_flow_names[GR_HENCKY_FLOW_COUNT];

/* Parameters of the finite-strain law; the parameters of the fluidity come last, in their order. */
#define GR_HENCKY_PARAMETERS(X)                                                                     \
    X(K, "Pa", "bulk modulus")                                                                      \
    X(reconnect_fluidity, "1",                                                                      \
      "fluidity of reconnecting material: this times the shear rate |2 D:D|^1/2 over mu_2; 0 or 1") \
    GR_FLUIDITY_PARAMETERS(X)

#define GR_X(name, unit, doc) GR_HENCKY_P_##name,
enum gr_hencky_parameter { GR_HENCKY_PARAMETERS(GR_X) GR_HENCKY_PARAMETER_COUNT };
#undef GR_X

extern const struct gr_parameter_info gr_hencky_parameter_table[GR_HENCKY_PARAMETER_COUNT];

/* One update by the finite-strain law at n points, with arrays of n numbers; components in the order of the stress, or
 * row-major.
 * Given: dt, s; gradient[dim*dim], L dt; log_density at the end of the step.
 * Updated: stress[4|6], the Kirchhoff stress, Pa; g, the fluidity, 1/s, from its value after diffusion to its value after
 * the step; shear_rate, the plastic one, 1/s, from the step before to this step. */
struct gr_hencky_call {
    int64_t n;
    double dt;
    double parameter[GR_HENCKY_PARAMETER_COUNT];
    const double *gradient[9], *log_density;
    double *stress[6], *g, *shear_rate;
};
