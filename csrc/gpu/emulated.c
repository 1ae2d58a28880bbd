/* Memory of the emulated device (emulated.h): blocks of the process in a list. */
#include "gpu/emulated.h"

#include <pthread.h>
#include <stdalign.h>
#include <stddef.h>

#include "gpu/device.h"
#include "mpm/wall_impulse.h"

/* What stands before a block. */
struct link {
    alignas(max_align_t) struct link *next, *last;
    size_t bytes;
};

static pthread_mutex_t guard = PTHREAD_MUTEX_INITIALIZER;
static struct link *first;

static void *take(size_t bytes)
{
    struct link *link = bytes <= SIZE_MAX - sizeof *link ? malloc(bytes + sizeof *link) : NULL;
    if (!link) return NULL;
    pthread_mutex_lock(&guard);
    *link = (struct link){.next = first, .bytes = bytes};
    if (first) first->last = link;
    first = link;
    pthread_mutex_unlock(&guard);
    return link + 1;
}

static void give(void *block)
{
    struct link *link = (struct link *)block - 1;
    pthread_mutex_lock(&guard);
    if (link->next) link->next->last = link->last;
    if (link->last)
        link->last->next = link->next;
    else
        first = link->next;
    pthread_mutex_unlock(&guard);
    free(link);
}

const struct gr_source gr_emulated_memory = {take, give};

static int is_emulated(const void *address)
{
    int found = 0;
    pthread_mutex_lock(&guard);
    for (const struct link *link = first; link && !found; link = link->next)
        found = (const char *)address >= (const char *)(link + 1) &&
                (const char *)address <= (const char *)(link + 1) + link->bytes;
    pthread_mutex_unlock(&guard);
    return found;
}

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
                                   GR_NAMED(nodes.v),
                                   GR_NAMED(migration.migrant),
                                   GR_NAMED(migration.pending),
                                   GR_NAMED(migration.pending_id),
                                   GR_NAMED(migration.leaving),
                                   GR_NAMED(config.walls),
                                   GR_NAMED(config.cell_flags.value),
                                   GR_NAMED(watch),
                                   GR_NAMED(device),
                                   GR_NAMED(device->leaving),
                                   GR_NAMED(device->leaves),
                                   GR_NAMED(device->place[0]),
                                   GR_NAMED(device->arrivals),
                                   GR_NAMED(device->next),
                                   GR_NAMED(device->fastest)};
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; k++)
        if (arrays[k].array && !is_emulated(arrays[k].array)) return arrays[k].name;
    for (int d = 0; d < e->config.dim; d++) {
        if (!is_emulated(e->axis[d].cell)) return "axis.cell";
        if (e->config.cell_flags.class_of[d] && !is_emulated(e->config.cell_flags.class_of[d])) return "config.cell_flags";
    }
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        if (e->points.field[f] && !is_emulated(e->points.field[f])) return gr_field_table[f].name;
    return e->watch && e->watch->node && !is_emulated(e->watch->node) ? "watch->node" : NULL;
}
