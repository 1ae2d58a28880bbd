/* Batch of blocks of points, collected from several cells, that a law updates in one call. */
#pragma once

#include "mpm/shape.h"

#define MODE_STRIDE(fields) (((fields) + GR_W - 1) / GR_W * GR_W) /* rounded up to whole vectors */

enum { BATCH = 256 / GR_W }; /* blocks per call: their data stay in the first-level cache */

struct batch {
    int64_t n;
    int64_t slot[BATCH];
    double g_star[BATCH];
    double scale[MODE_STRIDE(GR_NODE_FIELDS(3, 1))]; /* of the nodal fields: converts velocity to displacement in cells
                                                        per step */
    _Alignas(64) double gradient[BATCH * 9 * GR_W];
};

/* Call the law for a batch: for the whole step, or for the first (`begins`) or last of its substeps. */
static void run_law(const struct gr_engine *e, gr_law_update *update, struct batch *batch, int begins)
{
    const int many = e->diffuses && e->config.nonlocal.substeps > 1;
    const double fraction = many ? 1.0 / e->config.nonlocal.substeps : 1;
    struct gr_law_call call = {.n_blocks = batch->n,
                               .slot = batch->slot,
                               .gradient = batch->gradient,
                               .dt = fraction * e->dt,
                               .fraction = fraction,
                               .substeps = many ? e->substeps : 0,
                               .begins = begins,
                               .pressure_from_density = e->config.pressure_from_density,
                               .parameter = e->config.parameter,
                               .log_density = e->field[GR_FIELD_log_density],
                               .g_star = e->diffuses ? batch->g_star : 0,
                               .shear_rate = e->record_rates ? e->field[GR_FIELD_shear_rate] : 0,
                               .g = e->field[GR_FIELD_g],
                               .gain = e->field[GR_FIELD_g_gain],
                               .plastic_strain = e->field[GR_FIELD_plastic_strain]};
    for (int c = 0; c < (e->config.dim == 2 ? 4 : 6); c++) call.stress[c] = e->field[GR_FIELD_stress] + c * e->capacity;
    update(&call);
    batch->n = 0;
}
