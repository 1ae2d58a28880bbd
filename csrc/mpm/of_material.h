/* Numbers of the material of a point. */
#pragma once

#include "mpm/numbers.h"

/* The number of the material of the point at a slot. Arrays may hold anything: what names no material is the first. */
static inline int gr_material_at(const struct gr_engine *e, int64_t slot)
{
    if (e->config.n_materials == 1) return 0;
    const double k = gr_number(e, GR_FIELD_material, 0, slot);
    return k > 0 && k < e->config.n_materials ? (int)k : 0;
}

/* Number `which` (GR_MATERIAL_NUMBERS) of the materials of the points at the slots from `at` on. */
GR_INLINE vd gr_of_material(const struct gr_engine *e, int which, int64_t at)
{
    const double *number = e->material_number[which];
    double value[GR_W];
    if (__builtin_expect(e->config.n_materials == 1, 1)) return v_set(number[0]);
    const gr_real *const numbers = gr_numbers(e, GR_FIELD_material, 0, at);
    const vd all = v_load(numbers), first = v_set(numbers[0]);
    if (m_bits(m_and(v_ge(all, first), v_ge(first, all))) == GR_ALL_LANES) return v_set(number[gr_material_at(e, at)]);
    for (int l = 0; l < GR_W; l++) value[l] = number[gr_material_at(e, at + l)];
    return v_load(value);
}

/* The volume of the point at a slot when free of stress, over that at rho_c. */
static inline double gr_bulking(const struct gr_engine *e, int64_t slot)
{
    return e->dilates ? gr_number(e, GR_FIELD_bulking, 0, slot) : 1;
}

/* The mass of the point at a slot if it were of the first material at rho_c, kg: a measure of its volume. */
static inline double gr_volume_as_mass(const struct gr_engine *e, int64_t slot)
{
    const double filling = e->material_number[GR_MATERIAL_FILLING][gr_material_at(e, slot)];
    return gr_number(e, GR_FIELD_mass, 0, slot) * filling * gr_bulking(e, slot);
}
