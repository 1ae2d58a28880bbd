/* The arrays that the threads of a device read or write (mpm/device.h). */
#include "gpu/blocks.h"
#include "mpm/device.h"
#include "mpm/open_volume.h"
#include "mpm/sleep.h"
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

/* The name of one of n arrays that is not of the memory of a device; NULL if all are. */
static const char *foreign_of(const struct named *arrays, size_t n)
{
    for (size_t k = 0; k < n; k++)
        if (arrays[k].array && !gr_in_block(arrays[k].array)) return arrays[k].name;
    return NULL;
}

/* The same for the arrays of bodies. */
static const char *foreign_of_bodies(const struct gr_engine *e)
{
    const struct gr_open_volume *open = e->bodies.open;
    const struct named arrays[] = {GR_NAMED(config.bodies),    GR_NAMED(config.parts),  GR_NAMED(bodies.now),
                                   GR_NAMED(bodies.split),     GR_NAMED(bodies.thin),   GR_NAMED(bodies.open),
                                   GR_NAMED(bodies.near.cell), GR_NAMED(mesh.other),    GR_NAMED(mesh.duplicate),
                                   GR_NAMED(mesh.separable),   GR_NAMED(mesh.separated)};
    const char *name = foreign_of(arrays, sizeof arrays / sizeof *arrays);
    if (name || !open) return name;
    const void *const of_open[] = {open->place.block_of,   open->place.value,   open->slope,
                                   open->part_of.block_of, open->part_of.value, open->part};
    for (size_t k = 0; k < sizeof of_open / sizeof *of_open; k++)
        if (of_open[k] && !gr_in_block(of_open[k])) return "bodies.open";
    return NULL;
}

/* The same for the arrays of the mesh. */
static const char *foreign_of_mesh(const struct gr_engine *e)
{
    const struct named arrays[] = {
        GR_NAMED(mesh.cell),          GR_NAMED(mesh.tile_changed), GR_NAMED(mesh.tile_joins),
        GR_NAMED(mesh.tile_in_order), GR_NAMED(mesh.tile_nodes),   GR_NAMED(mesh.lane_node),
        GR_NAMED(mesh.tile_block),    GR_NAMED(mesh.row_node),     GR_NAMED(mesh.row_begin),
        GR_NAMED(mesh.neighbour),     GR_NAMED(mesh.addend),       GR_NAMED(mesh.node_about),
        GR_NAMED(mesh.node_at),       GR_NAMED(mesh.node_code),    GR_NAMED(mesh.node_volume),
        GR_NAMED(mesh.node_radius),   GR_NAMED(mesh.node_id),      GR_NAMED(mesh.cell_of.block_of),
        GR_NAMED(mesh.cell_of.value), GR_NAMED(mesh.cell_of.used), GR_NAMED(mesh.next_of.block_of),
        GR_NAMED(mesh.next_of.value), GR_NAMED(mesh.next_of.used), GR_NAMED(mesh.node_of.block_of),
        GR_NAMED(mesh.node_of.value), GR_NAMED(mesh.node_of.used), GR_NAMED(mesh.place),
        GR_NAMED(mesh.paired)};
    return foreign_of(arrays, sizeof arrays / sizeof *arrays);
}

/* The same for those of the device itself. */
static const char *foreign_of_device(const struct gr_engine *e)
{
    const struct named arrays[] = {GR_NAMED(device),
                                   GR_NAMED(device->leaving),
                                   GR_NAMED(device->leaves),
                                   GR_NAMED(device->place[0]),
                                   GR_NAMED(device->place[1]),
                                   GR_NAMED(device->place[2]),
                                   GR_NAMED(device->of_group),
                                   GR_NAMED(device->of_groups),
                                   GR_NAMED(device->arrivals),
                                   GR_NAMED(device->next),
                                   GR_NAMED(device->fastest),
                                   GR_NAMED(device->products[0]),
                                   GR_NAMED(device->products[1]),
                                   GR_NAMED(device->exact)};
    return foreign_of(arrays, sizeof arrays / sizeof *arrays);
}

/* The same for those of the axes. */
static const char *foreign_of_axes(const struct gr_engine *e)
{
    const char *name = NULL;
    for (int d = 0; d < e->config.dim && !name; d++) {
        const struct gr_axis *axis = &e->axis[d];
        const struct named arrays[] = {{axis->cell, "axis.cell"},
                                       {axis->node_number, "axis.node_number"},
                                       {axis->node_position, "axis.node_position"},
                                       {axis->node_integral, "axis.node_integral"},
                                       {axis->node_radius, "axis.node_radius"},
                                       {e->cells_of_node[d], "cells_of_node"},
                                       {e->config.cell_flags.class_of[d], "config.cell_flags"},
                                       {e->config.node_codes.class_of[d], "config.node_codes"}};
        name = foreign_of(arrays, sizeof arrays / sizeof *arrays);
    }
    return name;
}

/* The same for those of the nonlocal law. */
static const char *foreign_of_fluidity(const struct gr_engine *e)
{
    const struct gr_fluidity *f = e->nonlocal.fluidity;
    if (!f) return NULL;
    const struct named arrays[] = {GR_NAMED(nonlocal.fluidity),
                                   GR_NAMED(nonlocal.substeps),
                                   GR_NAMED(nonlocal.substep_mass),
                                   GR_NAMED(nonlocal.substep_flow),
                                   GR_NAMED(nonlocal.substep_gain),
                                   {f->space.doubles, "fluidity.space.doubles"},
                                   {f->space.bytes, "fluidity.space.bytes"},
                                   {f->space.integers, "fluidity.space.integers"},
                                   {f->space.places, "fluidity.space.places"},
                                   {f->pages.wrap, "fluidity.pages.wrap"},
                                   {f->side.value, "fluidity.side.value"},
                                   {f->side.block_of, "fluidity.side.block_of"},
                                   {f->page_of.value, "fluidity.page_of.value"},
                                   {f->page_of.block_of, "fluidity.page_of.block_of"}};
    return foreign_of(arrays, sizeof arrays / sizeof *arrays);
}

/* The same for those of material that sleeps. */
static const char *foreign_of_sleep(const struct gr_engine *e)
{
    if (!e->sleep) return NULL;
    const struct named arrays[] = {GR_NAMED(sleep), GR_NAMED(sleep->use), GR_NAMED(sleep->restless),
                                   GR_NAMED(sleep->tile_rests)};
    return foreign_of(arrays, sizeof arrays / sizeof *arrays);
}

const char *gr_foreign_array(const struct gr_engine *e)
{
    const struct named arrays[] = {GR_NAMED(points.id),
                                   GR_NAMED(points.column),
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
                                   GR_NAMED(tally.cell)};
    const char *name = foreign_of(arrays, sizeof arrays / sizeof *arrays);
    if (!name) name = foreign_of_mesh(e);
    if (!name) name = foreign_of_axes(e);
    if (!name) name = foreign_of_bodies(e);
    if (!name) name = foreign_of_fluidity(e);
    if (!name) name = foreign_of_sleep(e);
    if (!name) name = foreign_of_device(e);
    for (int f = 0; f < GR_FIELD_COUNT && !name; f++)
        if (e->points.field[f] && !gr_in_block(e->points.field[f])) name = gr_field_table[f].name;
    if (!name && e->watch && e->watch->node && !gr_in_block(e->watch->node)) name = "watch->node";
    return name;
}
