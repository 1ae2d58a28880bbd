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

/* The name of the first of n arrays that is not of the memory of a device; NULL if all are. */
static const char *foreign_of(const struct named *arrays, size_t n)
{
    for (size_t k = 0; k < n; k++)
        if (arrays[k].array && !gr_in_block(arrays[k].array)) return arrays[k].name;
    return NULL;
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
                                   GR_NAMED(mesh.cell_of.used),
                                   GR_NAMED(mesh.next_of.block_of),
                                   GR_NAMED(mesh.next_of.value),
                                   GR_NAMED(mesh.next_of.used),
                                   GR_NAMED(mesh.node_of.block_of),
                                   GR_NAMED(mesh.node_of.value),
                                   GR_NAMED(mesh.node_of.used),
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
                                   GR_NAMED(config.node_codes.value),
                                   GR_NAMED(watch),
                                   GR_NAMED(tally.cell),
                                   GR_NAMED(device),
                                   GR_NAMED(device->leaving),
                                   GR_NAMED(device->leaves),
                                   GR_NAMED(device->place[0]),
                                   GR_NAMED(device->arrivals),
                                   GR_NAMED(device->next),
                                   GR_NAMED(device->fastest)};
    const char *const foreign = foreign_of(arrays, sizeof arrays / sizeof *arrays);
    if (foreign) return foreign;
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        const struct named of_axis[] = {{axis->cell, "axis.cell"},
                                        {axis->node_number, "axis.node_number"},
                                        {axis->node_position, "axis.node_position"},
                                        {axis->node_integral, "axis.node_integral"},
                                        {axis->node_radius, "axis.node_radius"},
                                        {e->cells_of_node[d], "cells_of_node"},
                                        {e->config.cell_flags.class_of[d], "config.cell_flags"},
                                        {e->config.node_codes.class_of[d], "config.node_codes"}};
        const char *const other = foreign_of(of_axis, sizeof of_axis / sizeof *of_axis);
        if (other) return other;
    }
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        if (e->points.field[f] && !gr_in_block(e->points.field[f])) return gr_field_table[f].name;
    return e->watch && e->watch->node && !gr_in_block(e->watch->node) ? "watch->node" : NULL;
}
