/* The MPM engine: state of a simulation. The points are stored in buffers of the caller; everything else is here. */
#pragma once

#include <math.h>
#include <stdint.h>

#include "core/axis.h"
#include "core/error.h"
#include "core/field.h"
#include "core/simd.h"
#include "core/table.h"
#include "core/team.h"
#include "fluidity/fluidity.h"
#include "mpm/config.h"
#include "mpm/tally_numbers.h"

#define GR_MAX_NODES 27

/* Where a cell lies at a thin body (mpm/thin_bodies.h): it is one side of a double cell, or in front of the body or
 * behind it as a whole; 0 without thin bodies. The sign tells the side: in front of it, or behind. */
enum gr_side_of_cell { GR_FRONT = 1, GR_BACK = -1, GR_WHOLE_IN_FRONT = 2, GR_WHOLE_BEHIND = -2 };

struct gr_cell {
    int64_t offset; /* first slot in the point arrays; the next ones follow at distances of GR_LANES */
    int64_t apart;  /* added to the slots from number `rows` on (slots.h) */
    int32_t count, capacity, rows;
    int32_t calm;  /* checks in a row at which its points were slow, or GR_ASLEEP (mpm/sleep.h) */
    int32_t at[3]; /* indices along the axes */
    int16_t flags;
    int8_t side; /* enum gr_side_of_cell */
};

/* Slot of point k of a cell. */
static inline int64_t gr_slot(const struct gr_cell *cell, int64_t k)
{
    return cell->offset + k * GR_LANES + (k < cell->rows ? 0 : cell->apart);
}

#define GR_IS_DOUBLE(cell) ((cell)->side == GR_FRONT || (cell)->side == GR_BACK)

/* A number of a tile among the sums: none; of a lane for its first node; of the end of a run for the nodes beyond it (enum
 * gr_node_sum); or of a lane that is a run by itself, for its second and third node. */
enum gr_kind_of_sum { GR_NO_SUM, GR_OF_LANES, GR_TAIL_1, GR_TAIL_3, GR_TAIL_2, GR_SECOND, GR_THIRD, GR_KINDS_OF_SUMS };

/* What a run of cells adds to nodes that follow each other, or only its end: to the n nodes from `node` on
 *
 *   (lanes[0] + first) + before, lanes[1] + second, lanes[2], ...
 *
 * or, where lanes that follow each other are `apart` as runs by themselves, (lanes[l] + first[l]) + before[l] to node l. The
 * positions are those of the block of a tile, or of a run or lane in it (mpm/cell_sums.h); `first` and `second` have that of
 * the `end` of a run. */
struct gr_addend {
    int64_t lanes, end, before;
    int32_t node;
    uint8_t n, apart, kind_of_lanes, first, second, kind_before; /* enum gr_kind_of_sum */
};

#define GR_ONE_RUN ((1 << GR_LANES) - 2) /* of tile_joins: all lanes of a tile are one run */
#define GR_IN_ROW UINT32_MAX             /* of tile_in_order */

/* The active part of the grid: the cells and nodes that material may touch before the next regrouping. A tile is GR_LANES
 * active cells, in the order of the grid, of which those of the last tile may be missing. The kernels work on a tile at a
 * time: a lane of a vector is a cell, and row k of a tile has the k-th point of each of its cells.
 *
 * A run is lanes of a tile that follow each other in a row of the grid, and whose nodes do. The sums over neighbouring cells
 * for a node they have in common are a sum over these lanes.
 *
 * With thin bodies the mesh has two layers, one behind the other: first the cells in front of the bodies and the front of
 * double cells, then those behind and the back of double cells; and the nodes of either. */
struct gr_mesh {
    int64_t n_cells, n_tiles, n_nodes, cell_capacity, node_capacity;
    int64_t n_front;       /* cells of the first layer */
    int64_t n_occupied;    /* cells that held points when it was made */
    struct gr_cell *cell;  /* n_cells, filled up to whole tiles */
    uint8_t *tile_changed; /* 1 where the sums of a tile are to be made again after the points have moved */
    uint8_t *tile_joins;   /* bit l: lane l continues the run of lane l - 1; 0 if each lane is a run by itself */
    uint32_t
        *tile_in_order;  /* bit i: local node i of the lanes of a tile, from the first on, are nodes that follow each other;
                                GR_IN_ROW if so do all in each row */
    int64_t *tile_nodes; /* where the nodes of the lanes of other tiles are in `lane_node` */
    int32_t *lane_node;  /* local node after local node of these lanes */
    int64_t lane_node_capacity;
    int64_t *tile_block; /* n_tiles + 1: where the sums of a tile begin (mpm/cell_sums.h) */
    int32_t *row_node;   /* of tile after tile, n_rows x GR_LANES: the first node of each row of the nodes of a lane */
    int32_t *row_begin;  /* the same: the node at the beginning of that row of the grid, where it is periodic; else NULL */
    int32_t *neighbour;  /* n_cells x 2 dim: across the faces (enum gr_neighbour); NULL with a density of each point */
    int32_t *place;      /* of its cells on the fluidity grid (fluidity.h); NULL without one */
    struct gr_addend *addend; /* by rows of the nodes of cells; for each with ascending nodes, to which it is added once: */
    int64_t row_addends[10];  /* those of row r are from row_addends[r] on, up to row_addends[r + 1] */
    int64_t addend_capacity;
    /* with a smoothed density: in groups of GR_LANES nodes, gr_about x GR_LANES indices of the nodes about each. Entry a
     * + 3 b + 9 c is a - 1, b - 1 and c - 1 nodes further along x, y and z; beyond an end, the node at it; the last index
     * of all where no node is */
    int32_t *node_about;
    uint8_t *node_at; /* the same; bit d: at an end along axis d; bit 3 + d: on a grid line, as on inner walls */
    uint8_t *node_code;
    double *node_volume;              /* fraction of dx^dim that the node stands for; of 2 pi dx^3 in rings */
    double *node_radius;              /* in an axisymmetric plane: gr_axis.node_radius; else NULL */
    int64_t *node_id;                 /* its index in the whole grid */
    struct gr_table cell_of, node_of; /* for the whole grid: index in the active part + 1, 0 for none */
    struct gr_table next_of;          /* cell_of while a regrouping is under way */
    /* with thin bodies, see mpm/thin_bodies.h; cell_of and node_of give the front if there is one */
    int32_t *other;     /* per cell: the other side of a double cell, or -1 */
    int32_t *duplicate; /* per node: the same node in the other layer, or -1 */
    uint8_t *separable; /* per node: 1 for those of double cells */
    uint8_t *separated; /* per node with a duplicate: 1 where the two move separately */
    int64_t *paired;    /* indices of the front cells of the double cells */
    int64_t n_paired;
};

/* A point that left its cell: the old cell, the slot in it, and the new cell (or enum gr_destination). */
struct gr_migrant {
    int64_t cell, slot, to;
};

/* The points that leave a run of cells in a step, in the order of cells and slots. They are listed first, then packed
 * and their new cells found. */
struct gr_migrants {
    struct gr_migrant *from;
    double *record; /* count x n_components */
    int64_t *id, count;
    int64_t lowest, highest; /* of the new cells */
    int64_t invalid;         /* number of points that are not finite or moved too far */
    int64_t outside;         /* number of points that left the domain */
    int64_t homeless;        /* number of points whose new cell is not active */
};

/* The points, in borrowed arrays. */
struct gr_points {
    void *field[GR_FIELD_COUNT]; /* numbers.h; component c of field f begins at number c*capacity */
    int64_t *id;
    int64_t capacity, used, n;   /* slots; slots used now or before; points in the domain */
    int n_components, n_doubles; /* of all fields in use together; the first of them are doubles */
    void **column;               /* where each component begins */
};

/* A group of sums of the nodes of tiles: where they are in the block of a tile, in what a run has behind it, and in what the
 * lanes have behind it where each is a run by itself; and the number of sums of a node. */
struct gr_rows {
    int main, tail, apart, width;
};

/* The sums of tiles over their points (mpm/cell_sums.h). */
struct gr_cell_sums {
    void *data;       /* a line of zeros, then the blocks of the tiles (gr_sums), each aligned to lines */
    void *block;      /* of memory, that they lie in */
    int64_t capacity; /* numbers */
    double *average;  /* gr_averages_of_cell x cell_capacity, see enum gr_average; NULL with a density of each point */
    int of_lanes, of_run,
        of_apart;           /* numbers of a block for its lanes; for each run; for lanes that are runs by themselves */
    struct gr_rows rows[3]; /* enum gr_group_of_sums */
    int of_cells;           /* enum gr_cell_sum, the masses of each local node, own volumes; or GR_CELL_FILLED; vectors */
    int valid;
    int averages, correct_shift; /* content for the next step, see gr_plan_sums */
    int64_t *dirty, n_dirty;     /* tiles whose sums lack something */
};

/* The values of the nodes. */
struct gr_node_values {
    double *data;   /* n_fields x capacity, see GR_NODE_FIELDS */
    float *single;  /* what kernels in single precision see of it: the same as floats; NULL with double precision */
    double *mass;   /* n_nodes, kg */
    double *filled; /* n_nodes: volume of their points, as a mass, kg; NULL unless cells are averaged and own_volumes */
    double *v;      /* n_nodes x dim, m/s: velocity before the forces, filtered by XPIC; NULL without it */
    int n_fields;
    int64_t capacity; /* for the nodes, for whole vectors behind the last, and one that stands for none */
};

/* The cells near bodies, whose points may touch them; listed by contact/near_bodies.c. */
struct gr_near_bodies {
    int64_t *cell;     /* ascending */
    uint64_t *bodies;  /* of these: bit b: body b */
    double *clearance; /* distance of their centres from the nearest of these, m */
    int64_t n, capacity;
};

/* The bodies; NULL without any. */
struct gr_bodies {
    struct gr_body_state *now, *next; /* and after the current step */
    struct gr_near_bodies near;
    struct gr_contact_points *contacts; /* where the material touches them (contact/contact_point.h) */
    struct gr_rigid *rigid;             /* other contacts of free bodies (contact/rigid.h); NULL unless requested */
    struct gr_open_volume *open;        /* their volume at nodes (mpm/open_volume.h); NULL if nothing uses it */
    int n_thin;
    struct gr_thin_part *thin;
    struct gr_split_pose *split; /* per body */
};

/* Points on their way between cells. The memory of the migrants of a step then holds the pending points, which wait for a
 * slot. */
struct gr_migration {
    struct gr_migrant *migrant;
    int64_t n_pending, pending_capacity, needed_capacity;
    double *pending; /* n_pending x n_components */
    int64_t *pending_id;
    int64_t *cut, chunk_capacity; /* where the chunks of tiles of a step begin (engine/sharing.c) */
    struct gr_migrants *leaving;  /* the points that leave each of these */
    int tiles_grown;              /* since the tiles were shared out */
};

struct gr_clock {
    double time, dt, time_anchor; /* s; time = time_anchor + (step - step_anchor) dt */
    double shift_dt;              /* dt of the step that computed shift_velocity */
    double inv_dt;                /* 1/dt: kernels do not divide */
    int64_t step, step_anchor;
};

/* A nonlocal law: the fluidity of the cells, means over their dense points, diffused in place; NULL for a local law. */
struct gr_nonlocal_state {
    struct gr_fluidity *fluidity;
    int material;     /* which has the law */
    double *substeps; /* state of the points between substeps (law/substep.h); NULL without substeps */
    int64_t substep_capacity;
    double *substep_mass, *substep_flow,
        *substep_gain;     /* per cell: mass with pressure, sums of m g and m gain in a substep */
    int diffuses;          /* 1 if the local phase of the law is over */
    double deviation_left; /* share of the deviations of g within a cell that a diffusion leaves */
    int64_t cg_iterations, clamped_cells;
};

/* Why the last call failed, and where. */
struct gr_failure {
    int code;
    int64_t id, step;
    double x[3];
    struct gr_own_calls own_calls; /* of user-defined laws */
};

struct gr_engine {
    struct gr_config config;
    struct gr_axis axis[3];
    int K, n_rows;                          /* number of nodes of a cell, and of rows of nodes along the first axis */
    struct gr_node_cells *cells_of_node[3]; /* per node of an axis; NULL along unused axes */
    int has_solid;                          /* whether there are solid cells */
    struct gr_points points;
    struct gr_mesh mesh;
    struct gr_cell_sums sums;
    int out_of_cache; /* 1 if the caches do not hold points and sums from one step to the next */
    struct gr_node_values nodes;
    struct gr_bodies bodies;
    struct gr_sleep *sleep;           /* material at rest (mpm/sleep.h); NULL unless asked for */
    struct gr_inlets *inflow;         /* material that enters (mpm/inflow.h); NULL without inlets */
    struct gr_wall_watch *watch;      /* impulses on the walls (mpm/wall_impulse.h); NULL unless asked for */
    double servo_strain, servo_shift; /* mpm/servo.h: of the domain before this step; of the log-densities in it */
    struct gr_migration migration;
    struct gr_clock clock;
    struct gr_nonlocal_state nonlocal;
    /* factors that the kernels look up */
    double inv_dx, shift_scale; /* 1/dx, -1/shift_dt: kernels do not divide */
    int dilates, own_volumes;   /* 1 if points have a bulking; 1 then, or with several materials, where volume is not mass */
    double cell_mass, mass_scale; /* of a full cell of the first material, rho_c dx^dim, kg, or in an axisymmetric
                                     plane over its radius in cells, 2 pi rho_c dx^3; its inverse */
    double material_number[GR_MATERIAL_NUMBER_COUNT][GR_MAX_MATERIALS];
    double sponge_factor[3]; /* factor by which the sponge layer multiplies a rising velocity in this step */
    double keep_velocity;    /* share f of the old velocity kept in this step */
    int record_rates, disconnected;
    int64_t dropped, clamped;
    double dropped_mass;
    struct gr_tally tally; /* for the verdict on the run */
    struct gr_passage passage;
    struct gr_device *device; /* that makes the stages of a step (mpm/device.h); NULL: processors do */
    struct gr_ranks *ranks;   /* other processes that work on the same run (mpm/ranks.h); NULL without any */
    struct gr_failure failure;
    int refused_threads; /* of those that the last gr_advance asked for, by the system */
};

/* True if G2P averages the density in this step. */
static inline int gr_averages(const struct gr_engine *e, int64_t step)
{
    return e->config.smoothed && step % e->config.averaging_interval == 0;
}

/* True if G2P updates the damping of flutter in this step. */
static inline int gr_damps_flutter(const struct gr_engine *e, int64_t step)
{
    return e->config.smoothed && e->config.largest.flutter_time > 0 && step % e->config.flutter_interval == 0;
}

/* True if the diffusion is balanced with the law (fluidity_coupling.inl). The increment of the fluidity of a cell by
 * the law then is in fluidity->gain. */
static inline int gr_is_balanced(const struct gr_engine *e) { return e->config.nonlocal.method == GR_DIFFUSION_implicit; }

/* Plan the sums of the next P2G, which belongs to `step`. They contain the density if this step averages it. The momentum
 * that the shift gave to the points is subtracted if the step before averaged. */
static inline void gr_plan_sums(struct gr_engine *e, int64_t step)
{
    e->sums.averages = gr_averages(e, step);
    e->sums.correct_shift = gr_averages(e, step - 1);
}

/* Sums of a node over the points about it: mass, momentum, force. With a cell-averaged density also: mass times the
 * damping of the points, over the largest (damping.inl). In a step that averages a smoothed density, from GR_SUM_DENSITY
 * on: the mass of connected points, the same with quadrature weights, their log-density with these weights, and the
 * residual force.
 *
 * In the sums of the density a point counts by its volume at rho_c, or when free of stress if it dilates, as the mass of as
 * much of the first material. With several materials or one that dilates two more sums follow: that mass of all points, and with quadrature weights their pressure over K of the
 * first material, which neighbours of different materials have in common.
 *
 * The block of a tile has a vector for each row of its nodes and each sum. What the lanes s_a have for node a is added to
 * the lanes above them in the same run,
 *
 *   node l of the row:  (s_0[l] + s_1[l - 1]) + s_2[l - 2],
 *
 * and a run whose last lane is l has a tail: s_1[l], s_2[l], s_2[l - 1] and 0; with linear shape functions s_1[l] alone.
 * It is added to the first lanes of the next run if that follows in the row (struct gr_addend), so that the sum of a node
 * does not depend on where tiles begin. If tails took more memory than s_1 and s_2 themselves, these are stored, and each lane
 * is a run by itself. The sums of the density do not change in steps that do not average. */
enum gr_node_sum { GR_SUM_MASS, GR_SUM_MOMENTUM };
enum gr_group_of_sums { GR_SUMS_OF_MOTION, GR_SUMS_OF_DENSITY, GR_SUMS_OF_VOLUME };
#define GR_TAIL(k) ((k) == 2 ? 1 : 4)
enum gr_cell_sum { GR_CELL_MC, GR_CELL_M_RATE, GR_CELL_STRESS }; /* with cell_averaged */
enum { GR_CELL_FILLED };                                         /* with smoothed: volume of its points, as a mass */
#define GR_CELL_AVERAGED_SUMS(dim) (GR_CELL_STRESS + ((dim) == 2 ? 4 : 6)) /* in 2D xx, yy, xy, and zz of rings */
#define GR_SUM_FORCE(dim) (GR_SUM_MOMENTUM + (dim))
#define GR_SUM_DAMPED(dim) (GR_SUM_FORCE(dim) + (dim))
#define GR_SUM_DENSITY(dim) GR_SUM_DAMPED(dim)
enum gr_density_sum { GR_SUM_CONNECTED, GR_SUM_WEIGHTED, GR_SUM_LOG_DENSITY, GR_SUM_RESIDUAL };
#define GR_DENSITY_SUMS(dim) (GR_SUM_RESIDUAL + (dim))
enum gr_volume_sum { GR_SUM_VOLUME, GR_SUM_PRESSURE, GR_VOLUME_SUMS };
#define GR_NODE_SUMS(dim) (GR_SUM_DENSITY(dim) + GR_DENSITY_SUMS(dim))

/* Neighbours that are not there: a cell outside the active part; beyond a wall or an end. */
enum gr_neighbour { GR_NEIGHBOUR_NO_POINTS = -1, GR_NEIGHBOUR_CLOSED = -2 };

/* State of a cell (mpm/cell_filling.inl): its mass over the mass of a full cell; the excess over its open volume, or the
 * lack inside the material, which points exchange with neighbours. With a cell-averaged density (mpm/cell_averaged.inl) also
 * the log-density of its points; the logarithm of its filling fraction; from 0 at a surface to 1 inside the material; its
 * volume outside of bodies, over dx^dim; then the local coordinates of its quadrature point, and the gradient of the
 * over-compression of its nodes, against which its points shift. */
enum gr_average {
    GR_AVERAGE_FILLED,
    GR_AVERAGE_EXCESS,
    GR_AVERAGE_C,
    GR_AVERAGE_LOG_PHI,
    GR_AVERAGE_INSIDE,
    GR_AVERAGE_OPEN,
    GR_AVERAGE_AT
};
#define GR_AVERAGE_OVER_COMPRESSION(dim) (GR_AVERAGE_AT + (dim))
#define GR_NO_EXCESS INFINITY /* of a cell that a body fills */

/* Number of the entries of enum gr_average that the density of the scheme uses. */
static inline int gr_averages_of_cell(const struct gr_config *c)
{
    return c->cell_averaged ? GR_AVERAGE_AT + 2 * c->dim : c->smoothed ? GR_AVERAGE_C : 0;
}

/* Fields of a node in node_data: v^{n+1} and the update w. With a cell-averaged density also: the share of the difference to
 * its velocity that points lose in this step. In a step that averages, from GR_NODE_DENSITY on: the gap ln phi - c
 * averaged over the nodes around (0 at a surface); the mean log-density c; max(0, phi - 1); the mean quadrature weight in
 * excess of the one that fills the volume; the residual force; and, which points do not see, the gap of the node itself. */
enum gr_node_field { GR_NODE_VELOCITY };
#define GR_NODE_UPDATE(dim) (GR_NODE_VELOCITY + (dim))
#define GR_NODE_DAMPING(dim) (GR_NODE_UPDATE(dim) + (dim))
#define GR_NODE_DENSITY(dim) GR_NODE_DAMPING(dim)
enum gr_density_field { GR_NODE_GAP, GR_NODE_LOG_DENSITY, GR_NODE_EXCESS, GR_NODE_WEIGHT, GR_NODE_RESIDUAL };
#define GR_NODE_OWN_GAP(dim) (GR_NODE_RESIDUAL + (dim))
#define GR_NODE_FIELDS(dim, averages) (GR_NODE_DENSITY(dim) + ((averages) ? GR_NODE_RESIDUAL + (dim) : 0))

/* Number of groups of GR_LANES nodes. */
static inline int64_t gr_groups(const struct gr_engine *e) { return (e->mesh.n_nodes + GR_LANES - 1) / GR_LANES; }

/* Number of nodes about one, with itself. */
static inline int gr_about(int dim) { return dim == 2 ? 9 : 27; }

/* The first of the indices of the nodes about node n; the next ones follow at distances of GR_LANES. */
static inline int32_t *gr_about_node(const struct gr_engine *e, int64_t n)
{
    return e->mesh.node_about + n / GR_LANES * GR_LANES * gr_about(e->config.dim) + n % GR_LANES;
}

/* Component `field` of node_data. */
static inline double *gr_node_field(const struct gr_engine *e, int field)
{
    return e->nodes.data + field * e->nodes.capacity;
}

/* The same as the kernels see it that this is compiled for. */
static inline const gr_real *gr_seen_field(const struct gr_engine *e, int field)
{
#ifdef GR_SINGLE
    return e->nodes.single + field * e->nodes.capacity;
#else
    return gr_node_field(e, field);
#endif
}

/* Node number a in a row of nodes of a cell. */
static inline int32_t gr_node_in_row(const struct gr_engine *e, int64_t index, int row, int a)
{
    const int64_t at = (index / GR_LANES * e->n_rows + row) * GR_LANES + index % GR_LANES;
    const int n = e->axis[0].n_nodes, along = e->mesh.cell[index].at[0] + a;
    if (e->mesh.row_begin && along >= n) return e->mesh.row_begin[at] + (n > 1 ? along - n : 0);
    return e->mesh.row_node[at] + a;
}

/* Local node i of the lanes of a tile whose nodes are not in a row. */
static inline const int32_t *gr_lane_nodes(const struct gr_engine *e, int64_t tile, int i)
{
    return e->mesh.lane_node + e->mesh.tile_nodes[tile] + i * GR_LANES;
}

/* Local node i of a cell. */
static inline int32_t gr_cell_node(const struct gr_engine *e, int64_t index, int i)
{
    const int k = e->K / e->n_rows;
    return gr_node_in_row(e, index, i / k, i % k);
}

/* The sums, in the precision of the kernels that this is compiled for: double everywhere else. */
static inline gr_real *gr_sums(const struct gr_engine *e) { return e->sums.data; }

/* Bytes of n of them. */
static inline size_t gr_bytes_of_sums(const struct gr_engine *e, int64_t n)
{
    return (size_t)n * (e->config.single ? sizeof(float) : sizeof(double));
}

/* The block of a tile. */
static inline gr_real *gr_sums_of_tile(const struct gr_engine *e, int64_t tile)
{
    return gr_sums(e) + e->mesh.tile_block[tile];
}

/* Sum number `sum` of the cells from `first` on. */
static inline gr_real *gr_cell_sums(const struct gr_engine *e, int64_t first, int sum)
{
    return gr_sums_of_tile(e, first / GR_LANES) + e->sums.of_cells + sum * GR_LANES + first % GR_LANES;
}

struct gr_kernels; /* kernels.h */

/* Indices along the axes of a cell of the grid. */
static inline void gr_indices_of_cell(const struct gr_engine *e, int64_t id, int32_t at[3])
{
    at[2] = 0;
    for (int d = 0; d < e->config.dim; d++) {
        at[d] = (int32_t)(id % e->axis[d].n_cells);
        id /= e->axis[d].n_cells;
    }
}

/* Index of a cell in the whole grid. */
static inline int64_t gr_cell_id(const struct gr_engine *e, const int32_t at[3])
{
    int64_t id = 0;
    for (int d = e->config.dim - 1; d >= 0; d--) id = id * e->axis[d].n_cells + at[d];
    return id;
}
