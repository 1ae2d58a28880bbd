/* The fluidity grid: construction and destruction, stability limits, and a run of the diffusion by a team of threads. */
#include "fluidity/fluidity.h"
#include "core/memory.h"

#include <math.h>

#include "core/simd.h"

_Static_assert(GR_PAGE == GR_LANES, "a page is a run of lanes");

#define GR_X(name) #name,
const char *const gr_stencil_names[GR_STENCIL_COUNT] = {GR_STENCILS(GR_X)};
const char *const gr_diffusion_names[GR_DIFFUSION_COUNT] = {GR_DIFFUSIONS(GR_X)};
#undef GR_X

static int is_valid(const struct gr_fluidity_config *c)
{
    if (c->dim < 2 || c->dim > 3 || c->max_iterations < 1 || c->stencil < 0 || c->stencil >= GR_STENCIL_COUNT) return 0;
    if (c->axisymmetric && (c->dim != 2 || c->periodic[0] || !(c->first_radius >= 0))) return 0;
    for (int a = 0; a < c->dim; a++)
        if (c->shape[a] < 1) return 0;
    return c->dx > 0 && c->A >= 0 && c->d > 0 && c->t0 > 0 && c->tolerance > 0 && c->tolerance < 1 &&
           isfinite(c->A * c->A * c->d * c->d / (c->t0 * c->dx * c->dx));
}

int gr_fluidity_new(struct gr_fluidity **out, const struct gr_fluidity_config *config)
{
    *out = NULL;
    if (!is_valid(config)) return GR_ERR_CONFIG;
    struct gr_fluidity *f = gr_calloc(1, sizeof *f);
    if (!f) return GR_ERR_MEMORY;
    f->dim = config->dim;
    f->stencil = config->stencil;
    f->two_sided = config->two_sided;
    f->rough_bodies = config->rough_bodies;
    f->axisymmetric = config->axisymmetric;
    f->first_radius = config->first_radius;
    f->n_cells = 1;
    for (int a = 0; a < f->dim; a++) {
        f->shape[a] = config->shape[a], f->periodic[a] = config->periodic[a];
        f->stride[a] = f->n_cells, f->n_cells *= config->shape[a];
    }
    f->box_pages = (f->n_cells + GR_PAGE - 1) / GR_PAGE;
    if (config->two_sided) f->box_pages = (f->box_pages + GR_CHUNK_PAGES - 1) / GR_CHUNK_PAGES * GR_CHUNK_PAGES;
    f->dx = config->dx;
    f->diffusivity = config->A * config->A * config->d * config->d / config->t0;
    f->tolerance = config->tolerance;
    f->max_iterations = config->max_iterations;
    const int error = gr_fluidity_describe(f, config->face);
    if (error) {
        gr_fluidity_free(f);
        return error;
    }
    *out = f;
    return GR_OK;
}

void gr_fluidity_free(struct gr_fluidity *f)
{
    if (!f) return;
    gr_table_free(&f->side);
    gr_table_free(&f->page_of);
    gr_free(f->space.doubles);
    gr_free(f->space.bytes);
    gr_free(f->space.integers);
    gr_free(f->space.places);
    gr_free(f->pages.wrap);
    gr_free(f);
}

/* (s^2 + s - 2)/4: the number of explicit steps that s stages of rkl2 can replace. */
static double steps_replaced(double s) { return (s * s + s - 2) / 4; }

double gr_fluidity_limit(const struct gr_fluidity *f, int method)
{
    const double rate = f->stiffest * f->diffusivity / (f->dx * f->dx);
    if (method == GR_DIFFUSION_implicit || !(rate > 0)) return INFINITY;
    return method == GR_DIFFUSION_explicit ? 1 / rate : steps_replaced(GR_RKL2_MAX_STAGES) / rate;
}

int gr_fluidity_stages(const struct gr_fluidity *f, double dt)
{
    const double limit = gr_fluidity_limit(f, GR_DIFFUSION_explicit);
    int s = 3;
    while (s < GR_RKL2_MAX_STAGES && !(dt < steps_replaced(s) * limit)) s += 2;
    return s;
}

int gr_fluidity_check(const struct gr_fluidity *f, const struct gr_diffusion_call *call)
{
    if (call->method < 0 || call->method >= GR_DIFFUSION_COUNT || call->steps < 0 || !(call->dt > 0) || !isfinite(call->dt))
        return GR_ERR_CONFIG;
    return call->dt < gr_fluidity_limit(f, call->method) ? GR_OK : GR_ERR_LIMIT;
}

struct call {
    struct gr_fluidity *f;
    const struct gr_passes *passes;
    const struct gr_diffusion_call *steps;
};

static void run(void *context, struct gr_team *team)
{
    const struct call *call = context;
    (void)gr_fluidity_diffuse(call->f, call->passes, call->steps, team, NULL);
}

int gr_fluidity_run(struct gr_fluidity *f, const struct gr_passes *passes, const struct gr_diffusion_call *call, int threads)
{
    const int error = gr_fluidity_check(f, call);
    if (error) return error;
    gr_team_lead(threads, run, &(struct call){f, passes, call});
    return f->error;
}
