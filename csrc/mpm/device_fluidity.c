/* The diffusion of the fluidity on a device: the launches of its passes (device.h). */
#include "core/memory.h"
#include "fluidity/pass.h"
#include "mpm/device.h"

/* Launch the stages of a pass, in the order of its parts (fluidity/passes.inl). */
static void run_pass(void *context, const struct gr_diffusion_work *w)
{
    const struct gr_launch launch = {.e = context, .diffusion = *w};
    const struct gr_pages *pages = &w->f->pages;
    const int64_t places = pages->n * GR_PAGE, chunks = pages->n_chunks, with_wraps = pages->n_wraps ? chunks : 0;
    const int multiplies = w->which == GR_PASS_multiply, sums = gr_sums_of_pass(w->which);
    if (w->which == GR_PASS_connect) {
        gr_device_run(&launch, GR_STAGE_link_cells, places);
        gr_device_run(&launch, GR_STAGE_link_wraps, with_wraps);
        return;
    }
    if (w->which != GR_PASS_clamp) gr_device_run(&launch, GR_STAGE_begin_cells, places);
    if (multiplies) gr_device_run(&launch, GR_STAGE_products, chunks * GR_PAGE);
    if (gr_pass_has_wraps(w->which)) gr_device_run(&launch, GR_STAGE_wraps, with_wraps);
    if (gr_pass_has_end(w->which)) gr_device_run(&launch, GR_STAGE_end_cells, places);
    if (!sums) return;
    if (!multiplies) gr_device_run(&launch, GR_STAGE_products, chunks * GR_PAGE);
    gr_device_run(&launch, GR_STAGE_sums, gr_groups_of(chunks));
    gr_device_run(&launch, GR_STAGE_end_sums, 1);
}

static int wait(void *context) { return gr_device_wait(context); }

int gr_device_reserve_fluidity(struct gr_engine *e)
{
    struct gr_device *d = e->device;
    const int64_t chunks = e->nonlocal.fluidity ? e->nonlocal.fluidity->pages.n_chunks : 0;
    if (chunks <= d->n_chunks) return GR_OK;
    d->n_chunks = 0;
    for (int s = 0; s < 2; s++) GR_RESIZE(d->products[s], chunks * GR_PAGE);
    GR_RESIZE(d->exact, 2 * gr_groups_of(chunks));
    d->n_chunks = chunks;
    return GR_OK;
}

int gr_device_diffuse(struct gr_engine *e, const struct gr_passes *passes, const struct gr_diffusion_call *call,
                      struct gr_team *team)
{
    const struct gr_diffusion_device device = {e, run_pass, wait};
    const int error = gr_fluidity_diffuse(e->nonlocal.fluidity, passes, call, team, &device);
    return *e->device->failure ? GR_ERR_DEVICE : error;
}
