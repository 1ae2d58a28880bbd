/* Configuration of the MPM engine (config.h). */
#include "mpm/config.h"

#include "core/axis.h"
#include "core/error.h"
#include "core/memory.h"
#include "kernels.h"
#include "law/law.h"

int gr_nonlocal_material(const struct gr_config *config)
{
    for (int k = 0; k < config->n_materials; k++)
        if (gr_law_at(config->material[k].law)->reaction) return k;
    return -1;
}

static int copy_bodies(struct gr_config *c)
{
    struct gr_body *bodies = 0;
    int error = gr_own((const void **)&c->bodies, sizeof *bodies * (size_t)c->n_bodies);
    bodies = (struct gr_body *)c->bodies;
    for (int b = 0; bodies && b < c->n_bodies; b++)
        error |= gr_own((const void **)&bodies[b].motion, 7 * sizeof(double) * (size_t)bodies[b].n_motion);
    return error;
}

int gr_config_own(struct gr_config *c)
{
    int error = gr_own((const void **)&c->gravity_times, sizeof(double) * (size_t)c->n_gravity);
    error |= gr_own((const void **)&c->gravity_vectors, sizeof(double) * (size_t)(c->n_gravity * c->dim));
    error |= gr_own((const void **)&c->walls, sizeof(struct gr_wall) * (size_t)c->n_walls);
    error |= gr_own((const void **)&c->parts, sizeof(struct gr_part) * (size_t)c->n_parts);
    error |= copy_bodies(c);
    error |= gr_map_own(&c->node_codes);
    error |= gr_map_own(&c->cell_flags);
    for (int d = 0; d < 3; d++) c->c0_lines[d] = 0; /* which remain the caller's, as the faces do */
    c->nonlocal.face = 0;
    c->largest = c->material[0];
    for (int k = 1; k < c->n_materials; k++) {
#define GR_X(name, least, unit, doc) c->largest.name = fmax(c->largest.name, c->material[k].name);
        GR_MATERIAL(GR_X)
#undef GR_X
    }
    return error ? GR_ERR_MEMORY : GR_OK;
}

void gr_config_free(struct gr_config *c)
{
    for (int b = 0; c->bodies && b < c->n_bodies; b++) gr_free(c->bodies[b].motion);
    const void *owned[] = {c->gravity_times, c->gravity_vectors, c->walls, c->bodies, c->parts};
    for (size_t k = 0; k < sizeof owned / sizeof *owned; k++) gr_free(owned[k]);
    gr_map_free(&c->node_codes);
    gr_map_free(&c->cell_flags);
}

static int bodies_are_valid(const struct gr_config *c)
{
    if (c->n_bodies < 0 || c->n_bodies > GR_MAX_BODIES || c->n_parts < 0 || c->n_parts > GR_MAX_PARTS) return 0;
    for (int b = 0; b < c->n_bodies; b++) {
        const struct gr_body *body = &c->bodies[b];
        if (body->first_part < 0 || body->n_parts < 1 || body->first_part > c->n_parts - body->n_parts) return 0;
        if (body->contact < 0 || body->contact >= GR_CONTACT_COUNT || body->free < 0 || body->free >> c->dim) return 0;
        if (!(body->friction >= 0) || body->n_motion < 1 || (body->free && !(body->mass > 0))) return 0;
        for (int k = 0; body->turns && k < 3; k++)
            if (!(body->inertia[k] > 0)) return 0;
    }
    return 1;
}

static int law_exists(int law)
{
    int n = 0;
    while (gr_law_at(n)) n++;
    return law >= 0 && law < n;
}

/* Not available with several materials: two with a fluidity, substeps of it, cells with one density, and walls that keep a
 * pressure (servo.h), which the scene refuses. */
static int materials_are_valid(const struct gr_config *c)
{
    int nonlocal = 0;
    if (c->n_materials < 1 || c->n_materials > GR_MAX_MATERIALS) return 0;
    for (int k = 0; k < c->n_materials; k++) {
        const struct gr_material *m = &c->material[k];
        if (!law_exists(m->law)) return 0;
#define GR_X(name, least, unit, doc) \
    if (!(m->name >= (least)) || !isfinite(m->name)) return 0;
        GR_MATERIAL(GR_X)
#undef GR_X
        nonlocal += gr_law_at(m->law)->reaction != GR_LOCAL;
    }
    if (c->n_materials == 1) return 1;
    return nonlocal < 2 && !c->cell_averaged && !(nonlocal && c->nonlocal.substeps > 1);
}

/* Kernels in single precision exist for these combinations only. */
static int single_is_valid(const struct gr_config *c)
{
    for (int k = 0; k < c->n_materials; k++)
        if (!gr_single_has_law(c->material[k].law)) return 0;
    return c->smoothed || (c->basis == GR_QUADRATIC && c->affine == GR_AFFINE_MOMENT);
}

/* Kernels for rings exist for these combinations only. */
static int axisymmetry_is_valid(const struct gr_config *c)
{
    if (c->dim != 2 || c->basis == GR_UGIMP || c->periodic[0] || !(c->lower[0] >= 0)) return 0;
    for (int b = 0; b < c->n_bodies; b++)
        if (c->bodies[b].free & 1 || c->bodies[b].turns) return 0;
    return 1;
}

int gr_config_is_valid(const struct gr_config *c)
{
    if (c->dim < 2 || c->dim > 3 || c->basis < 0 || c->basis >= GR_BASIS_COUNT) return 0;
    if (c->affine < 0 || c->affine >= GR_AFFINE_COUNT || !materials_are_valid(c)) return 0;
    const int nonlocal = gr_nonlocal_material(c) >= 0;
    if (c->smoothed && (c->basis != GR_QUADRATIC || c->affine != GR_AFFINE_GRADIENT)) return 0;
    if (c->smoothed && (c->averaging_interval < 1 || c->flutter_interval < 1)) return 0;
    if (c->cell_averaged && (c->basis != GR_LINEAR || c->affine != GR_AFFINE_GRADIENT)) return 0;
    if (c->single && !single_is_valid(c)) return 0;
    if (c->axisymmetric && !axisymmetry_is_valid(c)) return 0;
    if (c->xpic_order < 0 || c->xpic_order > 10 || (c->xpic_order && c->affine)) return 0;
    if (!(c->dx > 0) || !(c->wave_speed > 0) || !(c->mass_cutoff >= 0)) return 0;
    if (nonlocal && (c->basis == GR_UGIMP || !c->nonlocal.face || c->nonlocal.substeps < 1)) return 0;
    if (!(c->scheme.sleep_speed >= 0)) return 0;
    /* material at rest creeps with its fluidity; the passes of XPIC overwrite the sums */
    if (c->scheme.sleep_speed > 0 && (nonlocal || c->xpic_order)) return 0;
    if (!(c->cfl > 0) || !(c->dt >= 0) || !isfinite(c->dt) || c->n_gravity < 1 || c->n_walls < 1) return 0;
    for (int k = 0; k < c->n_walls; k++) {
        const struct gr_wall *w = &c->walls[k];
        for (int d = 0; d < 3; d++)
            if (!isfinite(w->velocity[d]) || w->away[d] < -1 || w->away[d] > 1) return 0;
        if (w->after < 0 || w->after >= c->n_walls) return 0;
        /* chains of opening walls must end */
        if (isfinite(w->opens_at) && !(c->walls[w->after].opens_at > w->opens_at)) return 0;
        if (!isfinite(w->opens_at) && !(w->opens_at > 0)) return 0;
    }
    return bodies_are_valid(c);
}
