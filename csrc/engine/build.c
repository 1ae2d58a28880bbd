/* Construction and destruction of an engine (build.h). */
#include "engine/build.h"

#include <math.h>
#include <string.h>

#include "contact/contact.h"
#include "contact/contact_points.h"
#include "contact/rigid.h"
#include "contact/shared_contacts.h"
#include "core/memory.h"
#include "mpm/device.h"
#include "kernels.h"
#include "mpm/inflow.h"
#include "mpm/numbers.h"
#include "mpm/open_volume.h"
#include "mpm/patches.h"
#include "mpm/ranks.h"
#include "mpm/sleep.h"
#include "mpm/solid_cells.h"
#include "mpm/thin_bodies.h"

/* Bound of a number without one that kernels in single precision look up: its products with others are finite. */
#define LARGEST_IN_SINGLE 1e30

/* Prepare the numbers of the materials that the kernels look up. */
static void prepare_materials(struct gr_engine *e)
{
    const struct gr_material *first = e->config.material;
    const double dx = e->config.dx;
    e->cell_mass = first->rho_c * (e->config.axisymmetric ? 2 * M_PI * pow(dx, 3) : pow(dx, e->config.dim));
    e->mass_scale = 1.0 / e->cell_mass;
    for (int k = 0; k < e->config.n_materials; k++) {
        const struct gr_material *m = &first[k];
        const double number[] = {
#define GR_X(name, value, doc) [GR_MATERIAL_##name] = (value),
            GR_MATERIAL_NUMBERS(GR_X)
#undef GR_X
        };
        const double most = e->config.single ? LARGEST_IN_SINGLE : INFINITY;
        for (int q = 0; q < GR_MATERIAL_NUMBER_COUNT; q++) e->material_number[q][k] = fmin(fmax(number[q], -most), most);
    }
}

/* Make the fluidity grid, which has the cells of the MPM grid, with the kinds of their faces. */
static int build_fluidity(struct gr_engine *e, const uint8_t *face)
{
    enum { MAX_ITERATIONS = 10000 };
    e->nonlocal.material = gr_nonlocal_material(&e->config);
    const struct gr_material *material = &e->config.material[e->nonlocal.material];
    struct gr_nonlocal *nonlocal = &e->config.nonlocal;
    struct gr_fluidity_config config = {.dim = e->config.dim,
                                        .stencil = nonlocal->stencil,
                                        .dx = e->config.dx,
                                        .A = gr_parameter_of(material, "A"),
                                        .d = gr_parameter_of(material, "d"),
                                        .t0 = gr_parameter_of(material, "t0"),
                                        .tolerance = nonlocal->tolerance,
                                        .max_iterations = MAX_ITERATIONS,
                                        .axisymmetric = e->config.axisymmetric,
                                        .first_radius = e->axis[0].origin / e->config.dx,
                                        .two_sided = gr_list_thin(&e->config, 0) > 0,
                                        .face = face};
    for (int b = 0; b < e->config.n_bodies; b++) config.rough_bodies |= e->config.bodies[b].rough;
    for (int d = 0; d < config.dim; d++) config.shape[d] = e->axis[d].n_cells, config.periodic[d] = e->axis[d].periodic;
    const int error = gr_fluidity_new(&e->nonlocal.fluidity, &config);
    if (error) return error;
    e->nonlocal.fluidity->has_inside = config.rough_bodies || config.two_sided;
    if (nonlocal->method == GR_DIFFUSION_COUNT) {
        const double limit = gr_fluidity_limit(e->nonlocal.fluidity, GR_DIFFUSION_explicit);
        nonlocal->method =
            gr_longest_dt(&e->config) / nonlocal->substeps < limit ? GR_DIFFUSION_explicit : GR_DIFFUSION_implicit;
    }
    return GR_OK;
}

static int build_bodies(struct gr_engine *e, int64_t n_cells, int64_t n_nodes)
{
    e->bodies.now = gr_calloc((size_t)e->config.n_bodies, sizeof *e->bodies.now);
    e->bodies.next = gr_calloc((size_t)e->config.n_bodies, sizeof *e->bodies.next);
    e->bodies.n_thin = gr_list_thin(&e->config, 0);
    e->bodies.thin = gr_calloc((size_t)e->bodies.n_thin + 1, sizeof *e->bodies.thin);
    e->bodies.split = gr_calloc((size_t)e->config.n_bodies, sizeof *e->bodies.split);
    if (!e->bodies.now || !e->bodies.next || !e->bodies.thin || !e->bodies.split) return GR_ERR_MEMORY;
    (void)gr_list_thin(&e->config, e->bodies.thin);
    gr_bodies_start(e);
    const int uses_volume = e->config.smoothed || e->config.cell_averaged;
    return gr_contact_points_new(e) || (uses_volume && gr_open_volume_new(e, n_cells, n_nodes)) ? GR_ERR_MEMORY : GR_OK;
}

/* The axes of the grid, and the tables of the active cells and nodes. The lines of the config belong to the caller. */
static int build_grid(struct gr_engine *e, const struct gr_config *config, int64_t *n_cells, int64_t *n_nodes)
{
    const int k = gr_basis_nodes_1d(config->basis);
    e->n_rows = config->dim == 2 ? k : k * k;
    e->K = k * e->n_rows;
    *n_cells = *n_nodes = 1;
    for (int d = 0; d < config->dim; d++) {
        const int error =
            gr_axis_build(&e->axis[d], config->basis, config->shape[d], config->periodic[d], config->c0_lines[d],
                          config->n_c0_lines[d], config->lambda, config->lower[d], config->dx);
        if (error) return error;
        if (!d && config->axisymmetric) gr_axis_make_radial(&e->axis[d], config->basis, config->dx);
        *n_cells *= e->axis[d].n_cells;
        *n_nodes *= e->axis[d].n_nodes;
        e->cells_of_node[d] = gr_axis_cells_of_nodes(&e->axis[d], config->basis);
        if (!e->cells_of_node[d]) return GR_ERR_MEMORY;
    }
    gr_find_solid_cells(e);
    if (gr_table_new(&e->mesh.cell_of, *n_cells) || gr_table_new(&e->mesh.next_of, *n_cells)) return GR_ERR_MEMORY;
    return gr_table_new(&e->mesh.node_of, *n_nodes) ? GR_ERR_MEMORY : GR_OK;
}

/* Reserve a group of sums of nodes in the block of a tile. */
static void build_rows(struct gr_engine *e, enum gr_group_of_sums group, int width)
{
    const int k = e->K / e->n_rows, n = e->n_rows * width;
    struct gr_cell_sums *sums = &e->sums;
    sums->rows[group] = (struct gr_rows){sums->of_lanes, sums->of_run, sums->of_apart, width};
    sums->of_lanes += n * GR_LANES;
    sums->of_run += (n * GR_TAIL(k) + GR_LANES - 1) / GR_LANES * GR_LANES;
    sums->of_apart += n * (k - 1) * GR_LANES;
}

/* Sizes of the sums of a tile, of the values of a node and of the numbers of a point. */
static int build_layout(struct gr_engine *e)
{
    const struct gr_config *config = &e->config;
    e->dilates = gr_config_uses(config, GR_FIELD_bulking);
    e->own_volumes = config->n_materials > 1 || e->dilates;
    build_rows(e, GR_SUMS_OF_MOTION, GR_SUM_DAMPED(config->dim) + config->cell_averaged);
    e->sums.of_cells = e->sums.of_lanes;
    if (config->cell_averaged) e->sums.of_lanes += (GR_CELL_AVERAGED_SUMS(config->dim) + e->K + e->own_volumes) * GR_LANES;
    if (config->smoothed) e->sums.of_lanes += GR_LANES;
    if (config->smoothed) build_rows(e, GR_SUMS_OF_DENSITY, GR_DENSITY_SUMS(config->dim));
    if ((config->smoothed || config->cell_averaged) && e->own_volumes) build_rows(e, GR_SUMS_OF_VOLUME, GR_VOLUME_SUMS);
    e->nodes.n_fields = GR_NODE_FIELDS(config->dim, config->smoothed);
    e->nodes.n_fields += config->smoothed || config->cell_averaged; /* the gap of the node itself; its damping */
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        if (gr_config_uses(config, f)) e->points.n_components += gr_field_components(f, config->dim);
    e->points.n_doubles = config->single ? config->dim : e->points.n_components; /* x comes first */
    e->points.column = gr_calloc((size_t)e->points.n_components, sizeof *e->points.column);
    return e->points.column ? GR_OK : GR_ERR_MEMORY;
}

/* Set all that is not zero at the start. */
static void start(struct gr_engine *e)
{
    e->clock.dt = e->config.dt;
    e->clock.shift_dt = 1; /* until the first shift */
    e->shift_scale = -1;
    e->tally.time = -1;
    e->inv_dx = 1.0 / e->config.dx;
}

int gr_engine_new(struct gr_engine **out, const struct gr_config *config)
{
    int64_t n_cells, n_nodes;
    *out = 0;
    if (!gr_config_is_valid(config)) return GR_ERR_CONFIG;
    struct gr_engine *e = gr_calloc(1, sizeof *e);
    if (!e) return GR_ERR_MEMORY;
    e->config = *config;
    int error = gr_config_own(&e->config);
    if (!error) error = build_grid(e, config, &n_cells, &n_nodes);
    if (!error) prepare_materials(e);
    if (!error && gr_nonlocal_material(config) >= 0) error = build_fluidity(e, config->nonlocal.face);
    if (!error) error = build_layout(e);
    if (!error) error = gr_sleep_new(e);
    if (!error && config->n_bodies) error = build_bodies(e, n_cells, n_nodes);
    if (error) {
        gr_engine_free(e);
        return error;
    }
    start(e);
    *out = e;
    return GR_OK;
}

void gr_engine_free(struct gr_engine *e)
{
    if (!e) return;
    for (int d = 0; d < 3; d++) gr_axis_free(&e->axis[d]);
    gr_fluidity_free(e->nonlocal.fluidity);
    if (e->watch) gr_patches_free(e->watch->patches);
    gr_watch_free(e->watch);
    gr_inlets_free(e->inflow);
    gr_contact_points_free(e->bodies.contacts);
    gr_rigid_free(e->bodies.rigid);
    gr_open_volume_free(e->bodies.open);
    gr_sleep_free(e->sleep);
    if (e->ranks) gr_shared_contacts_free(e->ranks->contacts);
    gr_ranks_free(e->ranks);
    gr_device_free(e->device);
    const void *owned[] = {e->points.column,
                           e->bodies.near.cell,
                           e->bodies.near.bodies,
                           e->bodies.near.clearance,
                           e->mesh.cell,
                           e->mesh.row_node,
                           e->mesh.row_begin,
                           e->mesh.place,
                           e->mesh.addend,
                           e->mesh.node_code,
                           e->mesh.node_about,
                           e->mesh.node_at,
                           e->mesh.node_volume,
                           e->mesh.node_radius,
                           e->mesh.node_id,
                           e->sums.block,
                           e->sums.average,
                           e->nonlocal.substep_mass,
                           e->nonlocal.substep_flow,
                           e->nonlocal.substep_gain,
                           e->mesh.tile_changed,
                           e->mesh.tile_joins,
                           e->mesh.tile_in_order,
                           e->mesh.tile_nodes,
                           e->mesh.lane_node,
                           e->mesh.tile_block,
                           e->mesh.neighbour,
                           e->nodes.data,
                           e->nodes.single,
                           e->nodes.mass,
                           e->nodes.filled,
                           e->nodes.v,
                           e->cells_of_node[0],
                           e->cells_of_node[1],
                           e->cells_of_node[2],
                           e->nonlocal.substeps,
                           e->bodies.now,
                           e->bodies.next,
                           e->bodies.thin,
                           e->bodies.split,
                           e->mesh.other,
                           e->mesh.duplicate,
                           e->mesh.separable,
                           e->mesh.separated,
                           e->mesh.paired,
                           e->migration.migrant,
                           e->migration.leaving,
                           e->migration.cut,
                           e->migration.pending,
                           e->migration.pending_id,
                           e->sums.dirty,
                           e->tally.cell};
    struct gr_table *const tables[] = {&e->mesh.cell_of, &e->mesh.next_of, &e->mesh.node_of};
    for (int k = 0; k < 3; k++) gr_table_free(tables[k]);
    gr_config_free(&e->config);
    for (size_t k = 0; k < sizeof owned / sizeof *owned; k++) gr_free(owned[k]);
    gr_free(e);
}

void gr_engine_bind(struct gr_engine *e, void *const field[GR_FIELD_COUNT], int64_t *id, int64_t capacity)
{
    int n = 0;
    e->points.id = id;
    e->points.capacity = capacity;
    for (int f = 0; f < GR_FIELD_COUNT; f++) {
        const size_t size = gr_is_double(&e->config, f) ? sizeof(double) : sizeof(float);
        e->points.field[f] = field[f];
        for (int c = 0; field[f] && c < gr_field_components(f, e->config.dim); c++)
            e->points.column[n++] = (char *)field[f] + (size_t)(c * capacity) * size;
    }
}
