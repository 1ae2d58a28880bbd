/* A device: a machine on which each stage of a time step is a launch of many threads, one for each cell or node. A thread
 * computes what a lane of a vector does on a processor (core/simd_one_lane.h), so that the bits are the same.
 *
 * The lanes of a tile are runs by themselves there (engine.h), since no thread waits for another. Points that leave their
 * cells are packed in the order of the processor, by cells and slots, whose places are prefix sums over the cells; each
 * cell then takes the points that come to it in that order. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

/* X(stage, one of what its threads are): the stages of a step. */
#define GR_DEVICE_STAGES(X)   \
    X(p2g, cell)              \
    X(p2g_dirty, cell)        \
    X(masses, node)           \
    X(cell_forces, cell)      \
    X(nodes, node)            \
    X(surroundings, node)     \
    X(fillings, cell)         \
    X(smooth, cell)           \
    X(smooth_nodes, node)     \
    X(narrow, node)           \
    X(sweep, cell)            \
    X(place_of_cells, group)  \
    X(place_of_groups, group) \
    X(place_of_all, once)     \
    X(pack, cell)             \
    X(post, migrant)          \
    X(arrive, cell)           \
    X(fastest, group)

#define GR_X(stage, unit) GR_STAGE_##stage,
enum gr_device_stage { GR_DEVICE_STAGES(GR_X) GR_STAGE_COUNT };
#undef GR_X

/* What the threads of a launch are given. */
struct gr_launch {
    struct gr_engine *e;
    double gravity[3];
    int pass; /* of XPIC */
};

/* Thread number i of a stage. */
typedef void gr_thread(const struct gr_launch *launch, int64_t i);

enum { GR_GROUP = 64 }; /* cells, or groups of them, whose sums one thread makes */

/* What a step finds out about the points that leave their cells. */
struct gr_device_counts {
    int64_t leaving, invalid, outside, homeless, full; /* `full`: cells that could not take a point */
};

struct gr_device {
    gr_thread *const *threads;     /* of the emulated device: the one-lane kernels of this machine */
    struct gr_team *team;          /* that runs them, or NULL */
    int64_t n_cells, n_points;     /* for which there is memory */
    int32_t *leaving;              /* per cell: points that leave it in this step */
    uint8_t *leaves;               /* per slot: 1 if its point does */
    int64_t *place[3];             /* of the first migrant of a cell: in its group; of the group; of the group of groups */
    int64_t *of_group, *of_groups; /* migrants of a group of cells, and of a group of these */
    int64_t *arrivals, *next; /* per cell: 1 + a migrant that comes to it; per migrant: the same for the next one, 0: none */
    double *fastest;          /* per group of cells: square of the largest speed, m2/s2 */
    struct gr_device_counts counts;
};

/* The first thing in the configuration of an engine that devices do not have; NULL if they have all. */
const char *gr_device_lacks(const struct gr_config *config);

/* Make the device of an engine, whose kernels are of one lane. Returned: 0 or GR_ERR_MEMORY. */
int gr_device_new(struct gr_device **device, gr_thread *const *threads);
void gr_device_free(struct gr_device *device);

/* Reserve memory for the cells and slots of the mesh. Returned: 0 or GR_ERR_MEMORY. */
int gr_device_reserve(struct gr_engine *e);

/* Run n threads of a stage, and wait for them. */
void gr_device_run(const struct gr_launch *launch, enum gr_device_stage stage, int64_t n);

/* G2P, the law, packing of the points that leave their cells into the first list of the migration, and P2G of the others. */
void gr_device_sweep(const struct gr_launch *launch);

/* Put the listed points into their new cells, in this order, and repeat P2G of these.
 * Returned: whether a cell was full; the slots of its migrants are GR_NOT_PUT. */
int gr_device_insert(struct gr_engine *e, struct gr_migrants *list);

/* Square of the largest speed of the points, m2/s2. */
double gr_device_fastest(const struct gr_engine *e);
