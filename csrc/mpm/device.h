/* A device: a machine on which each stage of a time step is a launch of many threads, one for each cell or node. A thread
 * computes what a lane of a vector does on a processor (core/simd_one_lane.h), so that the bits are the same.
 *
 * The lanes of a tile are runs by themselves there (engine.h), since no thread waits for another. Points that leave their
 * cells are packed in the order of the processor, by cells and slots, whose places are prefix sums over the cells; each
 * cell then takes the points that come to it in that order. */
#pragma once

#include "core/memory.h"
#include "core/team.h"
#include "mpm/engine.h"
#include "mpm/passes.h"

/* X(stage, one of what its threads are): the parts of the passes of the diffusion (fluidity/passes.inl), which are in double
 * precision in any case; `lane`: the places of the pages of a chunk that have the same number. */
#define GR_FLUIDITY_STAGES(X) \
    X(link_cells, place)      \
    X(link_wraps, chunk)      \
    X(begin_cells, place)     \
    X(wraps, chunk)           \
    X(end_cells, place)       \
    X(products, lane)         \
    X(sums, group)            \
    X(end_sums, once)

/* The same of material that sleeps (sleep.h). */
#define GR_SLEEP_STAGES(X) \
    X(check, cell)         \
    X(calm, node)          \
    X(restless, cell)      \
    X(fall, cell)          \
    X(unuse, node)         \
    X(use, cell)           \
    X(use_near, near_cell) \
    X(watch, cell)         \
    X(rest, tile)          \
    X(wake, cell)

/* The same of a step, and of everything. */
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
    X(tally, cell)            \
    X(fastest, group)         \
    X(mean_pairs, pair)       \
    X(store_pairs, pair)      \
    X(begin_substeps, cell)   \
    X(substep, cell)          \
    GR_SLEEP_STAGES(X)        \
    GR_FLUIDITY_STAGES(X)     \
    X(occupied, group)        \
    GR_REGROUP_PASSES(X)

#define GR_X(stage, unit) GR_STAGE_##stage,
enum gr_device_stage { GR_DEVICE_STAGES(GR_X) GR_STAGE_COUNT };
#undef GR_X

/* What the threads of a launch are given. */
struct gr_launch {
    struct gr_engine *e;
    double gravity[3];
    int pass;                           /* of XPIC */
    struct gr_diffusion_work diffusion; /* of the fluidity */
    const void *work; /* of a pass of a regrouping, GR_MOST_WORK bytes at most, which are copied for the launch */
    size_t bytes;
    int64_t items, chunks; /* of the pass: as many chunks as threads */
};

enum { GR_MOST_WORK = 512 };

/* Thread number i of a stage. */
typedef void gr_thread(const struct gr_launch *launch, int64_t i);

enum { GR_GROUP = 64 }; /* cells, or groups of them, whose sums one thread makes */

static inline int64_t gr_groups_of(int64_t n) { return (n + GR_GROUP - 1) / GR_GROUP; }

/* Number of the cells of the tiles, of which the last may be none. */
static inline int64_t gr_lanes_of(const struct gr_engine *e) { return e->mesh.n_tiles * GR_LANES; }

/* What a step finds out about the points that leave their cells; and the number of cells that a stage of sleep counts. */
struct gr_device_counts {
    int64_t leaving, invalid, outside, homeless, full; /* `full`: cells that could not take a point */
    int64_t cells;
};

struct gr_device;

/* A kind of device: its memory, which the processor sees, too, and what runs threads. */
struct gr_backend {
    const char *name;
    struct gr_source memory;
    void (*begin)(struct gr_device *); /* of steps: their memory is brought to the device */
    void (*run)(const struct gr_launch *, enum gr_device_stage, int64_t n); /* n threads, after those of earlier launches */
    void (*wait)(struct gr_device *); /* for all of them; the processor must not read their results before */
};

extern const struct gr_backend gr_emulated, gr_gpu; /* the latter once it is open (driver.h) */

struct gr_device {
    const struct gr_backend *backend;
    char failure[160];             /* of a launch, in words; empty before one fails, after which none is made */
    gr_thread *const *threads;     /* of the emulated device: the one-lane kernels of this machine */
    int makes_steps;               /* 1 between gr_device_begin and gr_device_end */
    struct gr_team *team;          /* that runs the threads of the emulated device then; NULL: the leader alone */
    int64_t n_cells, n_points;     /* for which there is memory */
    int32_t *leaving;              /* per cell: points that leave it in this step */
    uint8_t *leaves;               /* per slot: 1 if its point does */
    int64_t *place[3];             /* of the first migrant of a cell: in its group; of the group; of the group of groups */
    int64_t *of_group, *of_groups; /* migrants of a group of cells, or its cells with points; migrants of a group of these */
    int64_t *arrivals, *next; /* per cell: 1 + a migrant that comes to it; per migrant: the same for the next one, 0: none */
    double *fastest;          /* per group of cells: square of the largest speed, m2/s2 */
    int64_t n_chunks;         /* of the fluidity grid, for which there is memory */
    double *products[2];      /* sums of a pass, of the lanes of each chunk */
    struct gr_exact *exact;   /* two per group of chunks: the sums of it */
    struct gr_device_counts counts;
};

/* The first thing in the configuration of an engine that devices do not have; NULL if they have all. */
const char *gr_device_lacks(const struct gr_config *config);

/* Make the device of an engine, whose kernels are of one lane. Returned: 0 or GR_ERR_MEMORY. */
int gr_device_new(struct gr_device **device, const struct gr_backend *backend, gr_thread *const *threads);
void gr_device_free(struct gr_device *device);

/* Reserve memory for the cells and slots of the mesh, and for the fluidity grid. Returned: 0 or GR_ERR_MEMORY. */
int gr_device_reserve(struct gr_engine *e);
int gr_device_reserve_fluidity(struct gr_engine *e);

/* Begin to make steps, led by a team, and end it. */
void gr_device_begin(struct gr_engine *e, struct gr_team *team);
void gr_device_end(struct gr_engine *e);

/* Run n threads of a stage, which may go on after this returns. */
static inline void gr_device_run(const struct gr_launch *launch, enum gr_device_stage stage, int64_t n)
{
    launch->e->device->backend->run(launch, stage, n);
}

/* Wait for all threads. Returned: 0 or GR_ERR_DEVICE, which then is the failure of the engine; 0 without a device. */
int gr_device_wait(struct gr_engine *e);

/* Make a pass by a team, or by the device of the engine, which may go on after this returns. */
void gr_make_pass(struct gr_team *team, enum gr_device_stage stage, gr_pass *pass, const struct gr_launch *launch);

/* The chunks of a pass of n items that has something for each chunk. */
static inline int64_t gr_pass_chunks(const struct gr_engine *e, int64_t n, int64_t of_team)
{
    return e->device ? gr_groups_of(n) : of_team;
}

/* Make a pass for n items, whose work w has the members e, team and chunks; and in so many chunks for a device, too. */
#define GR_MAKE(pass, w, n) GR_MAKE_IN(pass, w, n, (w)->e->device ? (n) : (w)->chunks)
#define GR_MAKE_IN(pass, w, n, in)                                                                                       \
    do {                                                                                                                 \
        _Static_assert(sizeof *(w) <= GR_MOST_WORK, "the work of a pass is copied");                                     \
        const struct gr_launch of_pass = {.e = (w)->e, .work = (w), .bytes = sizeof *(w), .items = (n), .chunks = (in)}; \
        gr_make_pass((w)->team, GR_STAGE_##pass, gr_pass_##pass, &of_pass);                                              \
    } while (0)

/* G2P, the law, packing of the points that leave their cells into the first list of the migration, and P2G of the others.
 * An error is the failure of the engine. */
void gr_device_sweep(const struct gr_launch *launch);

/* Put the listed points into their new cells, in this order, and repeat P2G of these. `full` is set if a cell was; the slots
 * of its migrants are GR_NOT_PUT.
 * Returned: 0 or GR_ERR_DEVICE. */
int gr_device_insert(struct gr_engine *e, struct gr_migrants *list, int *full);

/* Make the steps of a call of the diffusion (gr_fluidity_diffuse). */
int gr_device_diffuse(struct gr_engine *e, const struct gr_passes *passes, const struct gr_diffusion_call *call,
                      struct gr_team *team);

/* Make the sums of a tally over the points of all cells. Returned: 0 or GR_ERR_DEVICE. */
int gr_device_tally(struct gr_engine *e);

/* Square of the largest speed of the points, m2/s2; 0 after a failure. */
double gr_device_fastest(const struct gr_engine *e);

/* Number of the cells that hold points; all after a failure, which is that of the engine. */
int64_t gr_device_occupied(const struct gr_engine *e);

/* The name of an array of an engine that the threads of a device read or write, and that is not of the memory of a device;
 * NULL if all are. */
const char *gr_foreign_array(const struct gr_engine *e);
