/* The numbers of the points (numbers.h). */
#include "mpm/numbers.h"

#include "mpm/thin_bodies.h"

int gr_config_uses(const struct gr_config *config, int field)
{
    int hardens = 0, dilates = 0, remembers = 0, coheres = 0;
    const int nonlocal = gr_nonlocal_material(config) >= 0;
    for (int k = 0; k < config->n_materials; k++) {
        hardens |= gr_law_at(config->material[k].law)->hardens;
        dilates |= gr_law_at(config->material[k].law)->dilates;
        remembers |= config->material[k].remembers;
        coheres |= gr_parameter_of(&config->material[k], "cohesion") > 0;
    }
    const int needed[] = {[GR_ALWAYS] = 1,
                          [GR_AFFINE] = config->affine != GR_AFFINE_NONE,
                          [GR_SMOOTHED] = config->smoothed,
                          [GR_DAMPED] = config->smoothed && config->largest.flutter_time > 0,
                          [GR_NONLOCAL] = nonlocal,
                          [GR_BALANCED] = nonlocal && config->nonlocal.method == GR_DIFFUSION_implicit,
                          [GR_SIDED] = gr_list_thin(config, 0) > 0,
                          [GR_TOUCHED] = config->n_bodies > 0,
                          [GR_HARDENING] = hardens,
                          [GR_COHESIVE] = coheres,
                          [GR_SEVERAL] = config->n_materials > 1,
                          [GR_REMEMBERS] = remembers,
                          [GR_ELASTIC] = gr_has_viscous_stress(config),
                          [GR_STRAINED] = config->scheme.shear_strain > 0,
                          [GR_DILATING] = dilates};
    return needed[gr_field_table[field].need];
}
