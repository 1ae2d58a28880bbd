/* The arrays that the threads of a device read or write (mpm/device.h). */
#include "gpu/blocks.h"
#include "mpm/device.h"
#include "mpm/wall_impulse.h"

/* An array, and its name in messages. */
struct named {
    const void *array;
    const char *name;
};

#define GR_NAMED(member)   \
    {                      \
        e->member, #member \
    }

const char *gr_foreign_array(const struct gr_engine *e)
{
    const struct named arrays[] = {GR_NAMED(points.id),
                                   GR_NAMED(points.column),
                                   GR_NAMED(mesh.cell),
                                   GR_NAMED(mesh.tile_changed),
                                   GR_NAMED(mesh.tile_joins),
                                   GR_NAMED(mesh.tile_in_order),
                                   GR_NAMED(mesh.tile_nodes),
                                   GR_NAMED(mesh.lane_node),
                                   GR_NAMED(mesh.tile_block),
                                   GR_NAMED(mesh.row_node),
                                   GR_NAMED(mesh.row_begin),
                                   GR_NAMED(mesh.neighbour),
                                   GR_NAMED(mesh.addend),
                                   GR_NAMED(mesh.node_about),
                                   GR_NAMED(mesh.node_at),
                                   GR_NAMED(mesh.node_code),
                                   GR_NAMED(mesh.node_volume),
                                   GR_NAMED(mesh.node_radius),
                                   GR_NAMED(mesh.node_id),
                                   GR_NAMED(mesh.cell_of.block_of),
                                   GR_NAMED(mesh.cell_of.value),
                                   GR_NAMED(sums.data),
                                   GR_NAMED(sums.average),
                                   GR_NAMED(sums.dirty),
                                   GR_NAMED(nodes.data),
                                   GR_NAMED(nodes.single),
                                   GR_NAMED(nodes.mass),
                                   GR_NAMED(nodes.filled),
                                   GR_NAMED(nodes.v),
                                   GR_NAMED(migration.migrant),
                                   GR_NAMED(migration.pending),
                                   GR_NAMED(migration.pending_id),
                                   GR_NAMED(migration.leaving),
                                   GR_NAMED(config.walls),
                                   GR_NAMED(config.cell_flags.value),
                                   GR_NAMED(watch),
                                   GR_NAMED(tally.cell),
                                   GR_NAMED(device),
                                   GR_NAMED(device->leaving),
                                   GR_NAMED(device->leaves),
                                   GR_NAMED(device->place[0]),
                                   GR_NAMED(device->arrivals),
                                   GR_NAMED(device->next),
                                   GR_NAMED(device->fastest),
                                   GR_NAMED(device->products[0]),
                                   GR_NAMED(device->exact),
                                   GR_NAMED(nonlocal.fluidity),
                                   GR_NAMED(nonlocal.substeps),
                                   GR_NAMED(nonlocal.substep_mass),
                                   GR_NAMED(mesh.place),
                                   GR_NAMED(mesh.paired),
                                   GR_NAMED(mesh.other)};
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; k++)
        if (arrays[k].array && !gr_in_block(arrays[k].array)) return arrays[k].name;
    for (int d = 0; d < e->config.dim; d++) {
        if (!gr_in_block(e->axis[d].cell)) return "axis.cell";
        if (e->config.cell_flags.class_of[d] && !gr_in_block(e->config.cell_flags.class_of[d])) return "config.cell_flags";
    }
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        if (e->points.field[f] && !gr_in_block(e->points.field[f])) return gr_field_table[f].name;
    const struct gr_fluidity *f = e->nonlocal.fluidity;
    const void *const grid[] = {f ? f->space.doubles : NULL, f ? f->space.bytes : NULL, f ? f->space.integers : NULL,
                                f ? f->space.places : NULL,  f ? f->pages.wrap : NULL,  f ? f->side.value : NULL,
                                f ? f->page_of.value : NULL};
    for (size_t k = 0; k < sizeof grid / sizeof *grid; k++)
        if (grid[k] && !gr_in_block(grid[k])) return "nonlocal.fluidity->space";
    return e->watch && e->watch->node && !gr_in_block(e->watch->node) ? "watch->node" : NULL;
}
