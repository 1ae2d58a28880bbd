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
    int32_t summed; /* number of its first points that are in its sums */
    int32_t calm;   /* checks in a row at which its points were slow, or GR_ASLEEP (mpm/sleep.h) */
    int32_t at[3];  /* indices along the axes */
    int8_t side;    /* enum gr_side_of_cell; of a double cell the front is listed first */
    int16_t flags;
};

/* Slot of point k of a cell. */
static inline int64_t gr_slot(const struct gr_cell *cell, int64_t k)
{
    return cell->offset + k * GR_LANES + (k < cell->rows ? 0 : cell->apart);
}

#define GR_IS_DOUBLE(cell) ((cell)->side == GR_FRONT || (cell)->side == GR_BACK)

/* Where the sums of GR_LANES nodes that follow each other begin. They lie in pieces, as nodes of a row of the grid do in
 * the sums of the cells of a tile: the sums of node l of piece k, l >= begin[k], are at[k] + l. */
enum { GR_RUN_PIECES = 4, GR_RUN_BROKEN = 0 };
struct gr_node_run {
    int64_t at[GR_RUN_PIECES];
    int8_t pieces, begin[GR_RUN_PIECES]; /* GR_RUN_BROKEN pieces if there are more than fit */
};

/* State of the sums of a tile after the points have moved. */
enum gr_tile_state { GR_TILE_SUMMED, GR_TILE_GAINED, GR_TILE_CHANGED };

/* The active part of the grid: the cells and nodes that material may touch before the next regrouping. GR_LANES cells
 * that follow each other are a tile. The kernels work on a tile at a time: a lane of a vector is a cell, and row k of a tile
 * has the k-th point of each of its cells, so that no sum is over the lanes. The last tile is filled up with cells that
 * have no nodes of their own, nor points. */
struct gr_mesh {
    int64_t n_cells, n_tiles, n_nodes, cell_capacity, node_capacity;
    int64_t n_occupied;    /* cells that held points when it was made */
    struct gr_cell *cell;  /* of all tiles */
    uint8_t *tile_state;   /* enum gr_tile_state */
    uint32_t *tile_in_row; /* bit i: local nodes number i of its cells follow each other */
    int32_t *cell_node;    /* n_tiles x K x GR_LANES */
    int32_t *neighbour;    /* n_cells x 2 dim: across the faces (enum gr_neighbour); NULL with a density of each point */
    int32_t *place;        /* of its cells on the fluidity grid (fluidity.h); NULL without one */
    int64_t *node_source;  /* n_nodes x K: entry i: where its sums over the cell begin in which it is local node
                               K - 1 - i; in the zero tile where there is no such cell */
    struct gr_node_run *node_run; /* (n_nodes/GR_LANES, rounded up) x K: the same for GR_LANES nodes together */
    /* with a smoothed density: in groups of GR_LANES nodes, gr_about x GR_LANES indices of the nodes about each. Entry a
     * + 3 b + 9 c is a - 1, b - 1 and c - 1 nodes further along x, y and z; beyond an end, the node at it; the last index
     * of all where no node is */
    int32_t *node_about;
    uint8_t *node_at; /* the same; bit d: at an end along axis d; bit 3 + d: on a grid line, as on inner walls */
    uint8_t *node_code;
    double *node_volume;              /* fraction of dx^dim that the node stands for */
    int64_t *node_id;                 /* its index in the whole grid */
    struct gr_table cell_of, node_of; /* for the whole grid: index in the active part + 1, 0 for none */
    struct gr_table next_of;          /* cell_of while a regrouping is under way */
    /* with thin bodies, see mpm/thin_bodies.h; cell_of and node_of give the front, the back comes next */
    int32_t *duplicate; /* per node: its duplicate for the other side, or -1 */
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

/* The sums of cells over their points. */
struct gr_cell_sums {
    void *data;      /* n_tiles + 1 blocks of `stride` numbers (gr_sums), aligned to lines; the last block is zero */
    void *block;     /* of memory, that they lie in */
    double *average; /* gr_averages_of_cell x cell_capacity, see enum gr_average; NULL with a density of each point */
    int stride, of_density, of_volume;
    int valid;
    int averages, correct_shift; /* content for the next step, see gr_plan_sums */
    int64_t *dirty, n_dirty;     /* tiles whose sums lack something */
};

/* The values of the nodes. */
struct gr_node_values {
    double *data;  /* n_fields x capacity, see GR_NODE_FIELDS */
    float *single; /* what kernels in single precision see of it: the same as floats; NULL with double precision */
    double *mass;  /* n_nodes, kg */
    double *v;     /* n_nodes x dim, m/s: velocity before the forces, filtered by XPIC; NULL without it */
    int n_fields;
    int64_t capacity; /* for the nodes, for whole vectors behind the last, and one that stands for none */
};

/* The cells near bodies, whose points may touch them; listed by contact/contact_points.c. */
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
    int K; /* number of nodes of a cell */
    struct gr_node_cells
        *cells_of_node[3]; /* per node of an axis (solid_cells.h); NULL without solid cells, and along unused axes */
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
    double inv_dx, shift_scale;   /* 1/dx, -1/shift_dt: kernels do not divide */
    double cell_mass, mass_scale; /* of a full cell of the first material, rho_c dx^dim, kg; its inverse */
    double material_number[GR_MATERIAL_NUMBER_COUNT][GR_MAX_MATERIALS];
    double sponge_factor[3]; /* factor by which the sponge layer multiplies a rising velocity in this step */
    double keep_velocity;    /* share f of the old velocity kept in this step */
    int record_rates, disconnected;
    int64_t dropped, clamped;
    double dropped_mass;
    struct gr_tally tally; /* for the verdict on the run */
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

/* Sums of a node over the points of a cell: mass, momentum, force. With a cell-averaged density also: mass times the
 * damping of the points, over the largest (damping.inl). In a step that averages a smoothed density, from GR_SUM_DENSITY
 * on: the mass of connected points, the same with quadrature weights, their log-density with these weights, and the
 * residual force.
 *
 * In the sums of the density a point counts by its volume at rho_c, as the mass of as much of the first material. With
 * several materials two more sums follow, at volume_sums: that mass of all points, and with quadrature weights their
 * pressure over K of the first material, which neighbours of different materials have in common.
 *
 * The block of a tile is an array of vectors, with a lane for each of its cells. The first GR_SUM_DAMPED sums of the nodes
 * come first, then enum gr_cell_sum, which are the same for all nodes, and at density_sums the sums of the density, which
 * do not change in other steps. Each sum is over the points in their order, so that points that arrive are added to it, with
 * the same bits as in a sum over all. */
enum gr_node_sum { GR_SUM_MASS, GR_SUM_MOMENTUM };
enum gr_cell_sum { GR_CELL_DAMPED, GR_CELL_MC, GR_CELL_M_RATE, GR_CELL_STRESS }; /* with cell_averaged */
#define GR_CELL_AVERAGED_SUMS(dim) (GR_CELL_STRESS + ((dim) == 2 ? 3 : 6))
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

/* Local node i of a cell. */
static inline int32_t gr_cell_node(const struct gr_engine *e, int64_t index, int i)
{
    return e->mesh.cell_node[(index / GR_LANES * e->K + i) * GR_LANES + index % GR_LANES];
}

/* The sums, in the precision of the kernels that this is compiled for: double everywhere else. */
static inline gr_real *gr_sums(const struct gr_engine *e) { return e->sums.data; }

/* One of them, in either precision. */
static inline double gr_sum_at(const struct gr_engine *e, int64_t at)
{
    return e->config.single ? ((const float *)e->sums.data)[at] : ((const double *)e->sums.data)[at];
}

/* Bytes of n of them. */
static inline size_t gr_bytes_of_sums(const struct gr_engine *e, int64_t n)
{
    return (size_t)n * (e->config.single ? sizeof(float) : sizeof(double));
}

/* Where the sums of a cell begin. */
static inline int64_t gr_sums_of_cell(const struct gr_engine *e, int64_t index)
{
    return index / GR_LANES * e->sums.stride + index % GR_LANES;
}

struct gr_kernels; /* kernels.h */

/* Index of a cell in the whole grid. */
static inline int64_t gr_cell_id(const struct gr_engine *e, const int32_t at[3])
{
    int64_t id = 0;
    for (int d = e->config.dim - 1; d >= 0; d--) id = id * e->axis[d].n_cells + at[d];
    return id;
}
