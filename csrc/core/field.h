/* The fields of a material point: one list that defines the arrays, the checks, the records and the docstrings.
 *
 * Field f has gr_field_components(f, dim) rows in the buffer of shape (component, capacity). A scene carries a field
 * only if its law or its scheme needs it. The components of the stress are xx, yy, zz, xy in 2D and xx, yy, zz, xy, yz,
 * xz in 3D; the components of a gradient are in row-major order. */
#pragma once

enum gr_kind { GR_SCALAR, GR_VECTOR, GR_TENSOR, GR_STRESS, GR_FOUR };
enum gr_need {
    GR_ALWAYS,
    GR_AFFINE,
    GR_SMOOTHED,
    GR_DAMPED,
    GR_NONLOCAL,
    GR_BALANCED,
    GR_SIDED,
    GR_TOUCHED,
    GR_HARDENING,
    GR_COHESIVE,
    GR_SEVERAL,
    GR_REMEMBERS,
    GR_ELASTIC,
    GR_STRAINED,
    GR_DILATING
};

/* X(name, kind, needed by, unit, description) */
#define GR_FIELDS(X)                                                                                                  \
    X(x, GR_VECTOR, GR_ALWAYS, "m", "position")                                                                       \
    X(v, GR_VECTOR, GR_ALWAYS, "m/s", "velocity")                                                                     \
    X(stress, GR_STRESS, GR_ALWAYS, "Pa", "Cauchy stress, tension positive")                                          \
    X(log_density, GR_SCALAR, GR_ALWAYS, "1", "ln(rho/rho_c), of material that dilates over its density at rest")     \
    X(mass, GR_SCALAR, GR_ALWAYS, "kg", "mass (in 2D per metre of depth)")                                            \
    X(shear_rate, GR_SCALAR, GR_ALWAYS, "1/s", "equivalent plastic shear rate of the last step")                      \
    X(affine, GR_TENSOR, GR_AFFINE, "1/s", "affine velocity field carried to the grid")                               \
    X(density_gradient, GR_VECTOR, GR_SMOOTHED, "1/m", "gradient of log_density, used by its averaging")              \
    X(shift_velocity, GR_VECTOR, GR_SMOOTHED, "m/s", "change of velocity by particle shifting")                       \
    X(weight_correction, GR_SCALAR, GR_SMOOTHED, "1", "relative excess of the quadrature weight over the volume")     \
    X(overstress, GR_SCALAR, GR_DAMPED, "1", "damping of flutter: share of the deviator of `stress` added in forces") \
    X(mean_shear_rate, GR_SCALAR, GR_DAMPED, "1/s", "running mean of shear_rate, for this damping")                   \
    X(g, GR_SCALAR, GR_NONLOCAL, "1/s", "granular fluidity, shear_rate/mu in flow; 0 where stress-free")              \
    X(g_gain, GR_SCALAR, GR_BALANCED, "1/s", "increment of the fluidity by the law in the last substep")              \
    X(side, GR_SCALAR, GR_SIDED, "1", "side of a thin body, 1 or -1; 0 away from thin bodies")                        \
    X(contact_force, GR_VECTOR, GR_TOUCHED, "N", "force of the bodies in the last step; 0 away from them")            \
    X(plastic_strain, GR_SCALAR, GR_HARDENING, "1", "norm of the plastic strain, summed over the steps")              \
    X(separated, GR_SCALAR, GR_COHESIVE, "1", "1 where cohesive material came apart and has not touched since")       \
    X(material, GR_SCALAR, GR_SEVERAL, "1", "number of the material in `scene.materials`")                            \
    X(history, GR_FOUR, GR_REMEMBERS, "1", "variables of a user-defined law, in the order of its `history`")          \
    X(viscous_stress, GR_STRESS, GR_ELASTIC, "Pa", "viscous stress of elastic deformation, added to `stress`")        \
    X(shear_strain, GR_SCALAR, GR_STRAINED, "1", "equivalent plastic shear strain: shear_rate summed over the time")  \
    X(bulking, GR_SCALAR, GR_DILATING, "1", "volume when free of stress over that at rho_c, of material that dilates")

#define GR_X(name, kind, need, unit, doc) GR_FIELD_##name,
enum gr_field { GR_FIELDS(GR_X) GR_FIELD_COUNT };
#undef GR_X

struct gr_field_info {
    const char *name, *unit, *doc;
    enum gr_kind kind;
    enum gr_need need;
};

extern const struct gr_field_info gr_field_table[GR_FIELD_COUNT];

static inline int gr_kind_components(enum gr_kind kind, int dim)
{
    return kind == GR_VECTOR   ? dim
           : kind == GR_TENSOR ? dim * dim
           : kind == GR_STRESS ? (dim == 2 ? 4 : 6)
           : kind == GR_FOUR   ? 4
                               : 1;
}

static inline int gr_field_components(int field, int dim) { return gr_kind_components(gr_field_table[field].kind, dim); }
