/* The MPM engine: configuration and state of a simulation. The points are stored in buffers of the caller; everything
 * else is here. */
#pragma once

#include <math.h>
#include <stdint.h>

#include "body/body.h"
#include "core/axis.h"
#include "core/simd.h"
#include "core/team.h"
#include "core/error.h"
#include "core/field.h"
#include "core/map.h"
#include "core/table.h"
#include "fluidity/fluidity.h"
#include "mpm/materials.h"
#include "mpm/scheme.h"
#include "mpm/tally_numbers.h"

#define GR_MAX_NODES 27

/* Effect of a wall on the velocity of a node (see granular/mpm/walls.py). */
struct gr_wall {
    int32_t fixed;      /* bit d: component d is that of the wall */
    int32_t away[3];    /* of such a component: +1 or -1, the direction in which the node may leave; 0: held both ways */
    double friction[3]; /* Coulomb coefficient of the wall normal to each axis */
    double opens_at;    /* s; from this time on row `after` applies to the node */
    int32_t after;
    double velocity[3]; /* m/s; along the wall */
};

enum gr_affine { GR_AFFINE_NONE, GR_AFFINE_GRADIENT, GR_AFFINE_MOMENT, GR_AFFINE_COUNT };

/* Diffusion of the fluidity of a nonlocal law. */
struct gr_nonlocal {
    int method;          /* enum gr_diffusion; GR_DIFFUSION_COUNT: explicit if a substep is short enough, else implicit */
    int stencil;         /* enum gr_stencil */
    int substeps;        /* number of substeps of law and diffusion in a step, during which the velocity gradient is
                            constant */
    double begins_at;    /* s; before this time the law is in its local phase */
    double floor;        /* 1/s; lower bound of the fluidity of a cell after the diffusion */
    double tolerance;    /* of the conjugate gradients */
    const uint8_t *face; /* (2 dim, cells): enum gr_face */
};

struct gr_config {
    int dim, basis, affine, smoothed, cell_averaged, xpic_order;
    int single; /* 1: the kernels compute in single precision */
    int shape[3], periodic[3], open_low[3], open_high[3];
    double lower[3], dx, lambda;
    int n_c0_lines[3];
    const int32_t *c0_lines[3];
    struct gr_scheme_numbers scheme; /* as given; what follows is made of them and of the scene */
    double keep_velocity_rate;       /* 1/s: FLIP keeps the share f = exp(-rate dt) in a step; < 0: f = 0 (PIC, APIC) */
    double wave_speed, mass_cutoff, cfl, dt; /* m/s, the largest; kg; 1; s; dt > 0: fixed */
    double damping_rate;                     /* the largest of the materials, 1/s */
    double damping_time;                     /* of elastic waves, the largest of the materials, s */
    double flutter_time;                     /* of its damping, the largest of the materials, s */
    int n_materials;
    struct gr_material material[GR_MAX_MATERIALS];
    struct gr_density_numbers density;
    int averaging_interval; /* steps between two averagings of the density, each of which stands for that many steps */
    int flutter_interval;   /* steps between two updates of the damping of flutter */
    struct gr_nonlocal nonlocal;
    int pressure_from_density;
    int n_gravity;
    const double *gravity_times;   /* s */
    const double *gravity_vectors; /* n_gravity x dim, m/s^2 */
    int n_walls;
    const struct gr_wall *walls; /* row 0 is for free nodes */
    struct gr_map node_codes;    /* of the nodes of the grid: row of the wall */
    int has_sponge; /* bit d: points beyond above[d], m, that rise along axis d are damped at the rate sponge_damping[d],
                       1/s */
    double above[3], sponge_damping[3];
    struct gr_map cell_flags; /* of the cells of the grouping: enum gr_cell_flag */
    int n_bodies, n_parts;
    const struct gr_body *bodies;
    const struct gr_part *parts; /* of all bodies */
};

/* Flags of a cell. GR_CELL_WALL << (2 d + side): a wall stands at the low (side 0) or high (1) face along axis d. */
#define GR_CELL_FLAGS(X) X(GR_CELL_SOLID, solid, 1) X(GR_CELL_NO_SHIFTING, no_shifting, 2) X(GR_CELL_WALL, wall, 4)

#define GR_X(constant, name, value) constant = (value),
enum gr_cell_flag { GR_CELL_FLAGS(GR_X) };
#undef GR_X

struct gr_cell {
    int64_t offset; /* first place in the point arrays; the next ones follow at distances of GR_LANES */
    int64_t apart;  /* what is added to the places from number `rows` on (places.h) */
    int32_t count, capacity, rows;
    int32_t summed; /* number of its first points that are in its sums */
    int32_t calm;   /* checks in a row at which its points were slow, or GR_ASLEEP (mpm/sleep.h) */
    int32_t at[3];  /* indices along the axes */
    int8_t side;    /* of a thin body: 1 (front) or -1 (back) of a double cell, the front listed first; else 2 or -2; 0
                      without thin bodies */
    int16_t flags;
};

/* Place of point k of a cell. */
static inline int64_t gr_slot(const struct gr_cell *cell, int64_t k)
{
    return cell->offset + k * GR_LANES + (k < cell->rows ? 0 : cell->apart);
}

#define GR_IS_DOUBLE(cell) ((cell)->side == 1 || (cell)->side == -1)

/* Where the sums of GR_LANES nodes that follow each other begin. They lie in pieces, as nodes of a row of the grid do in
 * those of the cells of a tile: the sums of node l of piece k, l >= begin[k], are at[k] + l. */
enum { GR_RUN_PIECES = 4, GR_RUN_BROKEN = 0 };
struct gr_node_run {
    int64_t at[GR_RUN_PIECES];
    int8_t pieces, begin[GR_RUN_PIECES]; /* GR_RUN_BROKEN pieces if there are more than fit */
};

/* What is to be done with the sums of a tile after the points have moved. */
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
    int32_t *beside; /* n_cells x 2 dim: neighbours across the faces (enum gr_beside); NULL with a density of each point */
    int32_t *place;  /* of its cells on the fluidity grid; NULL without one */
    int64_t *node_source;         /* n_nodes x K: entry i: where its sums over the cell begin in which it is local node
                               K - 1 - i; in the zero tile where there is no such cell */
    struct gr_node_run *node_run; /* (n_nodes/GR_LANES, rounded up) x K: the same for GR_LANES nodes together */
    /* with a smoothed density: in groups of GR_LANES nodes, gr_about x GR_LANES places of the nodes about each. Entry
     * a + 3 b + 9 c is a - 1, b - 1 and c - 1 nodes further along x, y and z; beyond an end, the node at it; the last place of
     * all where no node is */
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

/* A point that left its cell: the old cell, the place in it, and the new cell (or enum gr_destination). */
struct gr_migrant {
    int64_t cell, slot, to;
};

/* The points that leave a run of cells in a step, in the order of cells and places. They are listed first, then packed
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

struct gr_engine {
    struct gr_config config;
    struct gr_axis axis[3];
    int K; /* number of nodes of a cell */
    /* the points, in borrowed arrays */
    void *field[GR_FIELD_COUNT]; /* numbers.h; component c of field f begins at number c*capacity */
    int64_t *id;
    int64_t capacity, used, n_points; /* places; places used now or before; points in the domain */
    int n_components, n_doubles;      /* of all fields in use together; the first of them are doubles */
    void **column;                    /* where each component begins */
    /* grid */
    struct gr_mesh mesh;
    void *sums;         /* n_tiles + 1 blocks of sum_stride numbers (gr_sums); the last block is zero */
    double *average;    /* gr_averages_of_cell x cell_capacity, see enum gr_average; NULL with a density of each point */
    double *node_data;  /* node_fields x node_places, see GR_NODE_FIELDS */
    float *node_single; /* what kernels in single precision see of it: the same as floats; NULL with double precision */
    double *node_mass;  /* n_nodes, kg */
    double *node_v;     /* n_nodes x dim, m/s: velocity before the forces, filtered by XPIC; NULL without it */
    struct gr_node_cells *node_cells[3]; /* per node of an axis; NULL without solid cells, and along unused axes */
    int sum_stride, density_sums, volume_sums, node_fields;
    int64_t node_places; /* capacity for the nodes, for whole vectors behind the last, and a place of none */
    /* bodies; NULL without any */
    struct gr_body_state *body, *body_next; /* now, and after the current step */
    struct gr_feet *feet;                   /* where the material touches them (mpm/feet.h) */
    struct gr_rigid *rigid;                 /* what free bodies touch besides (mpm/rigid.h); NULL unless asked for */
    struct gr_open_volume *open;            /* what they take of the nodes (mpm/open_volume.h); NULL if nothing uses it */
    int n_thin;
    struct gr_thin_part *thin;
    struct gr_split_pose *split;      /* per body */
    struct gr_sleep *sleep;           /* material that rests (mpm/sleep.h); NULL unless asked for */
    struct gr_inlets *inflow;         /* material that enters (mpm/inflow.h); NULL without inlets */
    struct gr_wall_watch *watch;      /* impulses on the walls (mpm/wall_impulse.h); NULL unless asked for */
    double servo_strain, servo_shift; /* mpm/servo.h: of the domain before this step; of the log-densities in it */
    /* migrants of a step, by thread; the same memory then holds the pending points, which wait for a place */
    struct gr_migrant *migrant;
    int64_t n_pending, pending_capacity, needed_capacity;
    int tiles_grown; /* since the tiles were shared out */
    double *pending; /* n_pending x n_components */
    int64_t *pending_id;
    int64_t *dirty, n_dirty; /* tiles whose sums lack something */
    /* clock and counters */
    double time, dt, time_anchor;       /* time = time_anchor + (step - step_anchor) dt */
    double shift_dt;                    /* dt of the step that computed shift_velocity */
    double inv_dx, inv_dt, shift_scale; /* 1/dx, 1/dt, -1/shift_dt: kernels do not divide */
    double cell_mass, mass_scale;       /* of a full cell of the first material, rho_c dx^dim, kg; its inverse */
    double material_number[GR_MATERIAL_NUMBER_COUNT][GR_MAX_MATERIALS];
    double sponge_factor[3]; /* factor by which the sponge layer multiplies a rising velocity in this step */
    double keep_velocity;    /* share f of the old velocity kept in this step */
    int64_t step, step_anchor, dropped, clamped;
    double dropped_mass;
    struct gr_tally tally; /* for the verdict on the run */
    int sums_valid, record_rates, disconnected;
    int sums_average, sums_correct_shift; /* content of the sums for the next step, see gr_plan_sums */
    /* nonlocal law: the fluidity of the cells, means over their dense points; diffused in place. NULL for a local law */
    struct gr_fluidity *fluidity;
    double *substeps; /* state of the points between substeps (law/substep.h); NULL without substeps */
    int64_t substep_capacity;
    double *substep_mass, *substep_flow,
        *substep_gain;     /* per cell: mass with pressure, sums of m g and m gain in a substep */
    int diffuses;          /* 1 if the local phase of the law is over */
    double deviation_left; /* share of the deviations of g within a cell that a diffusion leaves */
    int64_t cg_iterations, clamped_cells;
    /* failure */
    int error;
    struct gr_own_calls own_calls; /* of laws of the user's own */
    int64_t error_id, error_step;
    double error_x[3];
    /* chunks of tiles of the steps (step.c): where they begin, and the points that leave them */
    int64_t *cut, chunk_capacity;
    int refused_threads; /* of those that the last gr_advance asked for, by the system */
    struct gr_migrants *migrants;
};

/* Part of the volume of a node, in cells, that lies in solid cells; the node is given by its indices. It is worked out
 * when a node gets mass near it, so that neither time nor memory grows with a box that is mostly solid. */
double gr_solid_volume(const struct gr_engine *e, const int32_t at[3]);

/* True if G2P averages the density in this step. */
static inline int gr_averages(const struct gr_engine *e, int64_t step)
{
    return e->config.smoothed && step % e->config.averaging_interval == 0;
}

/* True if G2P updates the damping of flutter in this step. */
static inline int gr_damps_flutter(const struct gr_engine *e, int64_t step)
{
    return e->config.smoothed && e->config.flutter_time > 0 && step % e->config.flutter_interval == 0;
}

/* True if the diffusion is balanced with the law (fluidity_coupling.inl). The increment of the fluidity of a cell by
 * the law then is in fluidity->gain. */
static inline int gr_is_balanced(const struct gr_engine *e) { return e->config.nonlocal.method == GR_DIFFUSION_implicit; }

/* Plan the sums that the next P2G computes, those of `step`. They contain the density if this step averages it. The
 * momentum that the shift gave to the points is subtracted if the step before averaged. */
static inline void gr_plan_sums(struct gr_engine *e, int64_t step)
{
    e->sums_average = gr_averages(e, step);
    e->sums_correct_shift = gr_averages(e, step - 1);
}

/* Sums of a node over the points of a cell: mass, momentum, force. With a cell-averaged density also: mass times the damping
 * of the points, over the largest (damping.inl). In a step that averages a smoothed density, from GR_SUM_DENSITY on: the mass
 * of connected points, the same with quadrature weights, their log-density with these weights, and the residual force.
 *
 * In the sums of the density a point counts by its volume at rho_c, as the mass of as much of the first material. With several
 * materials two more sums follow, at volume_sums: that mass of all points, and with quadrature weights their pressure over K
 * of the first material, which is what neighbours of different materials have in common.
 *
 * The block of a tile is an array of vectors, with a lane for each of its cells. The first GR_SUM_DAMPED sums of the nodes
 * come first, then enum gr_cell_sum, which are the same for all nodes, and at density_sums those of the density, which are
 * left as they are in other steps. Each sum is over the points in their order, so that points that arrive are added to
 * it, with the same bits as in a sum over all. */
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
enum gr_beside { GR_BESIDE_NO_POINTS = -1, GR_BESIDE_CLOSED = -2 };

/* State of a cell (mpm/cell_filling.inl): its mass over that of a full cell; what it has beyond its open volume, or too
 * little inside the material, which points exchange with neighbours. With a cell-averaged density (mpm/cell_averaged.inl)
 * also the log-density of its points; the logarithm of its filling fraction; from 0 at a surface to 1 inside the material;
 * its volume outside of bodies, over dx^dim; then the local coordinates of its quadrature point, and the gradient of the
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

/* The first of the places of the nodes about node n; the next ones follow at distances of GR_LANES. */
static inline int32_t *gr_about_node(const struct gr_engine *e, int64_t n)
{
    return e->mesh.node_about + n / GR_LANES * GR_LANES * gr_about(e->config.dim) + n % GR_LANES;
}

/* Component `field` of node_data. */
static inline double *gr_node_field(const struct gr_engine *e, int field) { return e->node_data + field * e->node_places; }

/* The same as the kernels see it that this is compiled for. */
static inline const gr_real *gr_seen_field(const struct gr_engine *e, int field)
{
#ifdef GR_SINGLE
    return e->node_single + field * e->node_places;
#else
    return gr_node_field(e, field);
#endif
}

/* Local node i of a cell. */
static inline int32_t gr_cell_node(const struct gr_engine *e, int64_t index, int i)
{
    return e->mesh.cell_node[(index / GR_LANES * e->K + i) * GR_LANES + index % GR_LANES];
}

/* The sums, in the precision of the kernels that this is compiled for: double in all other places. */
static inline gr_real *gr_sums(const struct gr_engine *e) { return e->sums; }

/* One of them, in either precision. */
static inline double gr_sum_at(const struct gr_engine *e, int64_t at)
{
    return e->config.single ? ((const float *)e->sums)[at] : ((const double *)e->sums)[at];
}

/* Bytes of n of them. */
static inline size_t gr_bytes_of_sums(const struct gr_engine *e, int64_t n)
{
    return (size_t)n * (e->config.single ? sizeof(float) : sizeof(double));
}

/* Where the sums of a cell begin. */
static inline int64_t gr_sums_of_cell(const struct gr_engine *e, int64_t index)
{
    return index / GR_LANES * e->sum_stride + index % GR_LANES;
}

struct gr_kernels; /* kernels.h */

/* build.c: construction and destruction. The config is copied, together with what it points to. */
int gr_engine_new(struct gr_engine **out, const struct gr_config *config);
void gr_engine_free(struct gr_engine *e);
int gr_engine_uses(const struct gr_config *config, int field); /* 1 if the scene carries the field */
int gr_nonlocal_material(const struct gr_config *config);      /* number of the material with a fluidity, or -1 */
/* Set the borrowed buffers of the points. On the first call rows [0, n_points) hold the points, in any order. */
void gr_engine_bind(struct gr_engine *e, void *const field[GR_FIELD_COUNT], int64_t *id, int64_t capacity);

/* grouping.c: group the points by cell, and keep their order within each. After GR_ERR_CAPACITY needed_capacity is the
 * capacity that is required. */
int gr_regroup(struct gr_engine *e, struct gr_team *team);

/* True, in some steps, if a quarter of the cells that held points at the last grouping hold none. What flows away leaves its
 * cells behind, which are visited in each step until the points are grouped again; that changes no bit. */
int gr_has_emptied(const struct gr_engine *e);
int gr_compare_ids(const void *a, const void *b); /* for qsort: int64_t, ascending */

/* connect.c: list the nodes of the active cells, and connect nodes and cells: for each cell its nodes and its neighbours,
 * and for each node where its sums over each of its cells are, in the order of cells. `cells` are the indices of the active
 * cells in the whole grid, in their order. */
int gr_connect(struct gr_engine *e, const int64_t *cells, struct gr_team *team, int64_t chunks);

/* Volume of a node of the grid over dx^dim, without what solid cells take of it. */
double gr_node_volume(const struct gr_engine *e, int64_t id);

/* step.c: the step and its stages. */
int gr_advance(struct gr_engine *e, const struct gr_kernels *kernels, int64_t max_steps, double until, int threads);
int gr_p2g(struct gr_engine *e, const struct gr_kernels *kernels);
int gr_grid(struct gr_engine *e, const struct gr_kernels *kernels);
int gr_g2p(struct gr_engine *e, const struct gr_kernels *kernels);
double gr_stable_dt(const struct gr_engine *e, struct gr_team *team);

/* The time step with the damping of elastic waves that is as far from its limit as `dt` is without, s. The wave of the
 * largest frequency 2/dt obeys u'' = -(2/dt)^2 (u + T u'), and the explicit step h with it is stable if h^2 + 2 T h <= dt^2. */
static inline double gr_damped_dt(const struct gr_config *c, double dt)
{
    const double T = c->damping_time;
    return T > 0 ? dt * dt / (sqrt(dt * dt + T * T) + T) : dt;
}

/* The longest time step that the engine takes, s. */
static inline double gr_longest_dt(const struct gr_config *c)
{
    return c->dt > 0 ? c->dt : gr_damped_dt(c, c->cfl * c->dx / c->wave_speed);
}

/* Index of a cell in the whole grid. */
static inline int64_t gr_cell_id(const struct gr_engine *e, const int32_t at[3])
{
    int64_t id = 0;
    for (int d = e->config.dim - 1; d >= 0; d--) id = id * e->axis[d].n_cells + at[d];
    return id;
}
