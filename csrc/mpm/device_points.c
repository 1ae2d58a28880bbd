/* Points between cells on a device: the launches that move them (device.h). */
#include "mpm/device.h"
#include "mpm/packing.h"

void gr_device_sweep(const struct gr_launch *launch)
{
    struct gr_engine *e = launch->e;
    struct gr_device *d = e->device;
    const int64_t lanes = gr_lanes_of(e), groups = gr_groups_of(lanes);
    struct gr_migrants *list = &e->migration.leaving[0];
    d->counts = (struct gr_device_counts){0};
    gr_device_run(launch, GR_STAGE_sweep, lanes);
    gr_device_run(launch, GR_STAGE_place_of_cells, groups);
    gr_device_run(launch, GR_STAGE_place_of_groups, gr_groups_of(groups));
    gr_device_run(launch, GR_STAGE_place_of_all, 1);
    gr_device_run(launch, GR_STAGE_pack, lanes);
    if (gr_device_wait(e)) return;
    gr_clear_migrants(list);
    list->count = d->counts.leaving, list->invalid = d->counts.invalid;
    list->outside = d->counts.outside, list->homeless = d->counts.homeless;
}

int gr_device_insert(struct gr_engine *e, struct gr_migrants *list, int *full)
{
    const struct gr_launch launch = {.e = e};
    e->device->counts.full = 0;
    if (!list->count) return GR_OK;
    gr_device_run(&launch, GR_STAGE_post, list->count);
    gr_device_run(&launch, GR_STAGE_arrive, gr_lanes_of(e));
    const int error = gr_device_wait(e);
    *full = e->device->counts.full > 0;
    return error;
}
