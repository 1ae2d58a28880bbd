/* Construction and destruction of an engine, and checks of its configuration. */
#include "mpm/engine.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/memory.h"
#include "kernels.h"
#include "mpm/contact.h"
#include "mpm/feet.h"
#include "mpm/inflow.h"
#include "mpm/numbers.h"
#include "mpm/open_volume.h"
#include "mpm/rigid.h"
#include "mpm/sleep.h"
#include "mpm/thin_bodies.h"
#include "mpm/wall_impulse.h"

int gr_nonlocal_material(const struct gr_config *config)
{
    for (int k = 0; k < config->n_materials; k++)
        if (gr_law_at(config->material[k].law)->reaction) return k;
    return -1;
}

static double parameter_of(const struct gr_material *material, const char *name)
{
    const struct gr_law *law = gr_law_at(material->law);
    for (int k = 0; k < gr_law_parameters(law); k++)
        if (!strcmp(law->parameter[k].name, name)) return material->parameter[k];
    return 0;
}

int gr_engine_uses(const struct gr_config *config, int field)
{
    int hardens = 0, remembers = 0, coheres = 0;
    const int nonlocal = gr_nonlocal_material(config) >= 0;
    for (int k = 0; k < config->n_materials; k++) {
        hardens |= gr_law_at(config->material[k].law)->hardens;
        remembers |= config->material[k].remembers;
        coheres |= parameter_of(&config->material[k], "cohesion") > 0;
    }
    const int needed[] = {[GR_ALWAYS] = 1,
                          [GR_AFFINE] = config->affine != GR_AFFINE_NONE,
                          [GR_SMOOTHED] = config->smoothed,
                          [GR_DAMPED] = config->smoothed && config->flutter_time > 0,
                          [GR_NONLOCAL] = nonlocal,
                          [GR_BALANCED] = nonlocal && config->nonlocal.method == GR_DIFFUSION_implicit,
                          [GR_SIDED] = gr_list_thin(config, 0) > 0,
                          [GR_TOUCHED] = config->n_bodies > 0,
                          [GR_HARDENING] = hardens,
                          [GR_COHESIVE] = coheres,
                          [GR_SEVERAL] = config->n_materials > 1,
                          [GR_REMEMBERS] = remembers,
                          [GR_ELASTIC] = config->damping_time > 0};
    return needed[gr_field_table[field].need];
}

static int copy_bodies(struct gr_config *c)
{
    struct gr_body *bodies = 0;
    int error = gr_own((const void **)&c->bodies, sizeof *bodies * (size_t)c->n_bodies);
    bodies = (struct gr_body *)c->bodies;
    for (int b = 0; bodies && b < c->n_bodies; b++)
        error |= gr_own((const void **)&bodies[b].motion, 7 * sizeof(double) * (size_t)bodies[b].n_motion);
    return error;
}

static int copy_config(struct gr_engine *e)
{
    struct gr_config *c = &e->config;
    int error = gr_own((const void **)&c->gravity_times, sizeof(double) * (size_t)c->n_gravity);
    error |= gr_own((const void **)&c->gravity_vectors, sizeof(double) * (size_t)(c->n_gravity * c->dim));
    error |= gr_own((const void **)&c->walls, sizeof(struct gr_wall) * (size_t)c->n_walls);
    error |= gr_own((const void **)&c->parts, sizeof(struct gr_part) * (size_t)c->n_parts);
    error |= copy_bodies(c);
    error |= gr_map_own(&c->node_codes);
    error |= gr_map_own(&c->cell_flags);
    for (int d = 0; d < 3; d++) c->c0_lines[d] = 0;
    c->nonlocal.face = 0;
    return error ? GR_ERR_MEMORY : GR_OK;
}

/* Prepare gr_solid_volume if there are solid cells. */
static int list_solids(struct gr_engine *e)
{
    const struct gr_map *flags = &e->config.cell_flags;
    int any = 0;
    for (int64_t k = 0; flags->value && k < gr_map_size(flags); k++) any |= flags->value[k] & GR_CELL_SOLID;
    for (int d = 0; any && d < e->config.dim; d++) {
        e->node_cells[d] = gr_axis_cells_of_nodes(&e->axis[d], e->config.basis);
        if (!e->node_cells[d]) return GR_ERR_MEMORY;
    }
    return GR_OK;
}

double gr_solid_volume(const struct gr_engine *e, const int32_t at[3])
{
    static const struct gr_node_cells flat = {.count = 1, .integral = {1}};
    const struct gr_map *flags = &e->config.cell_flags;
    if (!e->node_cells[0]) return 0;
    const struct gr_node_cells *x = &e->node_cells[0][at[0]], *y = &e->node_cells[1][at[1]];
    const struct gr_node_cells *z = e->config.dim == 3 ? &e->node_cells[2][at[2]] : &flat;
    double volume = 0;
    int64_t column[GR_MAX_NODES_1D];
    for (int a = 0; a < x->count; a++) column[a] = gr_map_class(flags, 0, x->cell[a]);
    for (int c = 0; c < z->count; c++) {
        const int64_t layer = gr_map_class(flags, 2, z->cell[c]) * flags->n_classes[1];
        for (int b = 0; b < y->count; b++) {
            const uint8_t *row = flags->value + (layer + gr_map_class(flags, 1, y->cell[b])) * flags->n_classes[0];
            for (int a = 0; a < x->count; a++)
                if (row[column[a]] & GR_CELL_SOLID) volume += x->integral[a] * y->integral[b] * z->integral[c];
        }
    }
    return volume;
}

static int bodies_are_valid(const struct gr_config *c)
{
    if (c->n_bodies < 0 || c->n_bodies > GR_MAX_BODIES || c->n_parts < 0 || c->n_parts > GR_MAX_PARTS) return 0;
    for (int b = 0; b < c->n_bodies; b++) {
        const struct gr_body *body = &c->bodies[b];
        if (body->first_part < 0 || body->n_parts < 1 || body->first_part > c->n_parts - body->n_parts) return 0;
        if (body->contact < 0 || body->contact >= GR_CONTACT_COUNT || body->free < 0 || body->free >> c->dim) return 0;
        if (!(body->friction >= 0) || body->n_motion < 1 || (body->free && !(body->mass > 0))) return 0;
        for (int k = 0; body->turns && k < 3; k++)
            if (!(body->inertia[k] > 0)) return 0;
    }
    return 1;
}

static int law_exists(int law)
{
    int n = 0;
    while (gr_law_at(n)) n++;
    return law >= 0 && law < n;
}

/* What is not for several materials: two with a fluidity, substeps of it, cells with one density, and walls that keep a
 * pressure (servo.h), which the scene refuses. */
static int materials_are_valid(const struct gr_config *c)
{
    int nonlocal = 0;
    if (c->n_materials < 1 || c->n_materials > GR_MAX_MATERIALS) return 0;
    for (int k = 0; k < c->n_materials; k++) {
        const struct gr_material *m = &c->material[k];
        if (!law_exists(m->law) || !(m->rho_c > 0) || !(m->K > 0) || !(m->separation_strain >= 0) ||
            !isfinite(m->separation))
            return 0;
        if (!(m->damping_time >= 0) || !isfinite(m->damping_time)) return 0;
        if (!(m->flutter_time >= 0) || !(m->flutter_memory >= 0) || !(m->flutter_end >= 0)) return 0;
        if (!(m->flutter_depth >= 0)) return 0;
        if (!isfinite(m->flutter_time + m->flutter_memory + m->flutter_end + m->flutter_depth)) return 0;
        nonlocal += gr_law_at(m->law)->reaction != GR_LOCAL;
    }
    if (c->n_materials == 1) return 1;
    return nonlocal < 2 && !c->cell_averaged && !(nonlocal && c->nonlocal.substeps > 1);
}

/* Kernels in single precision exist for these combinations only. */
static int single_is_valid(const struct gr_config *c)
{
    for (int k = 0; k < c->n_materials; k++)
        if (!gr_single_has_law(c->material[k].law)) return 0;
    return c->smoothed || (c->basis == GR_QUADRATIC && c->affine == GR_AFFINE_MOMENT);
}

static int config_is_valid(const struct gr_config *c)
{
    if (c->dim < 2 || c->dim > 3 || c->basis < 0 || c->basis >= GR_BASIS_COUNT) return 0;
    if (c->affine < 0 || c->affine >= GR_AFFINE_COUNT || !materials_are_valid(c)) return 0;
    const int nonlocal = gr_nonlocal_material(c) >= 0;
    if (c->smoothed && (c->basis != GR_QUADRATIC || c->affine != GR_AFFINE_GRADIENT)) return 0;
    if (c->smoothed && (c->averaging_interval < 1 || c->flutter_interval < 1)) return 0;
    if (c->cell_averaged && (c->basis != GR_LINEAR || c->affine != GR_AFFINE_GRADIENT)) return 0;
    if (c->single && !single_is_valid(c)) return 0;
    if (c->xpic_order < 0 || c->xpic_order > 10 || (c->xpic_order && c->affine)) return 0;
    if (!(c->dx > 0) || !(c->wave_speed > 0) || !(c->mass_cutoff >= 0)) return 0;
    if (nonlocal && (c->basis == GR_UGIMP || !c->nonlocal.face || c->nonlocal.substeps < 1)) return 0;
    if (!(c->scheme.sleep_speed >= 0)) return 0;
    /* material at rest creeps with its fluidity; the passes of XPIC overwrite the sums */
    if (c->scheme.sleep_speed > 0 && (nonlocal || c->xpic_order)) return 0;
    if (!(c->cfl > 0) || !(c->dt >= 0) || !isfinite(c->dt) || c->n_gravity < 1 || c->n_walls < 1) return 0;
    for (int k = 0; k < c->n_walls; k++) {
        const struct gr_wall *w = &c->walls[k];
        for (int d = 0; d < 3; d++)
            if (!isfinite(w->velocity[d]) || w->away[d] < -1 || w->away[d] > 1) return 0;
        if (w->after < 0 || w->after >= c->n_walls) return 0;
        /* chains of opening walls must end */
        if (isfinite(w->opens_at) && !(c->walls[w->after].opens_at > w->opens_at)) return 0;
        if (!isfinite(w->opens_at) && !(w->opens_at > 0)) return 0;
    }
    return bodies_are_valid(c);
}

/* Bound of a number without one that kernels in single precision look up: its products with others are finite. */
#define LARGEST_IN_SINGLE 1e30

/* Prepare the numbers of the materials that the kernels look up. */
static void prepare_materials(struct gr_engine *e)
{
    const struct gr_material *first = e->config.material;
    e->cell_mass = first->rho_c * pow(e->config.dx, e->config.dim);
    e->mass_scale = 1.0 / e->cell_mass;
    for (int k = 0; k < e->config.n_materials; k++) {
        const struct gr_material *m = &first[k];
        const int bears_tension = m->separation_strain >= NO_SEPARATION;
        const double number[] = {
            [GR_MATERIAL_FORCE_SCALE] = -1.0 / (m->rho_c * e->config.dx),
            [GR_MATERIAL_FILLING] = first->rho_c / m->rho_c,
            [GR_MATERIAL_STIFFNESS] = m->K / first->K,
            [GR_MATERIAL_SOFTNESS] = first->K / m->K,
            [GR_MATERIAL_SEPARATION] = m->separation - m->separation_strain,
            [GR_MATERIAL_ORIGIN] = m->separation,
            [GR_MATERIAL_STRESSED] =
                bears_tension ? -m->separation_strain : m->separation - parameter_of(m, "tensile_strength") / m->K,
            [GR_MATERIAL_SLOW] = m->slow_rate * m->slow_rate,
            [GR_MATERIAL_FLUTTER_TIME] = m->flutter_time,
            [GR_MATERIAL_FLUTTER_MEMORY] = m->flutter_memory,
            [GR_MATERIAL_FLUTTER_END] = m->flutter_end,
            [GR_MATERIAL_FLUTTER_DEPTH] = first->K * m->flutter_depth,
            [GR_MATERIAL_DAMPING_TIME] = m->damping_time,
            [GR_MATERIAL_BULK_MODULUS] = m->K,
            [GR_MATERIAL_SHEAR_MODULUS] = parameter_of(m, "G"),
        };
        const double most = e->config.single ? LARGEST_IN_SINGLE : INFINITY;
        for (int q = 0; q < GR_MATERIAL_NUMBER_COUNT; q++) e->material_number[q][k] = fmin(fmax(number[q], -most), most);
    }
}

/* Make the fluidity grid; its cells are those of the MPM grid. */
static int build_fluidity(struct gr_engine *e)
{
    enum { MAX_ITERATIONS = 10000 };
    const struct gr_material *material = &e->config.material[gr_nonlocal_material(&e->config)];
    struct gr_nonlocal *nonlocal = &e->config.nonlocal;
    struct gr_fluidity_config config = {.dim = e->config.dim,
                                        .stencil = nonlocal->stencil,
                                        .dx = e->config.dx,
                                        .A = parameter_of(material, "A"),
                                        .d = parameter_of(material, "d"),
                                        .t0 = parameter_of(material, "t0"),
                                        .tolerance = nonlocal->tolerance,
                                        .max_iterations = MAX_ITERATIONS,
                                        .two_sided = gr_list_thin(&e->config, 0) > 0,
                                        .face = nonlocal->face};
    for (int b = 0; b < e->config.n_bodies; b++) config.rough_bodies |= e->config.bodies[b].rough;
    for (int d = 0; d < config.dim; d++) config.shape[d] = e->axis[d].n_cells, config.periodic[d] = e->axis[d].periodic;
    const int error = gr_fluidity_new(&e->fluidity, &config);
    if (error) return error;
    e->fluidity->has_inside = config.rough_bodies || config.two_sided;
    if (nonlocal->method == GR_DIFFUSION_COUNT) {
        const double limit = gr_fluidity_limit(e->fluidity, GR_DIFFUSION_explicit);
        nonlocal->method =
            gr_longest_dt(&e->config) / nonlocal->substeps < limit ? GR_DIFFUSION_explicit : GR_DIFFUSION_implicit;
    }
    return GR_OK;
}

static int build_bodies(struct gr_engine *e, int64_t n_cells, int64_t n_nodes)
{
    e->body = calloc((size_t)e->config.n_bodies, sizeof *e->body);
    e->body_next = calloc((size_t)e->config.n_bodies, sizeof *e->body_next);
    e->n_thin = gr_list_thin(&e->config, 0);
    e->thin = calloc((size_t)e->n_thin + 1, sizeof *e->thin);
    e->split = calloc((size_t)e->config.n_bodies, sizeof *e->split);
    if (!e->body || !e->body_next || !e->thin || !e->split) return GR_ERR_MEMORY;
    (void)gr_list_thin(&e->config, e->thin);
    gr_bodies_start(e);
    const int uses_volume = e->config.smoothed || e->config.cell_averaged;
    return gr_feet_new(e) || (uses_volume && gr_open_volume_new(e, n_cells, n_nodes)) ? GR_ERR_MEMORY : GR_OK;
}

int gr_engine_new(struct gr_engine **out, const struct gr_config *config)
{
    int error = GR_ERR_CONFIG;
    *out = 0;
    struct gr_engine *e = calloc(1, sizeof *e);
    if (!e) return GR_ERR_MEMORY;
    if (!config_is_valid(config)) goto out;
    e->config = *config;
    int64_t n_cells = 1, n_nodes = 1;
    for (int d = 0; d < config->dim; d++) {
        error = gr_axis_build(&e->axis[d], config->basis, config->shape[d], config->periodic[d], config->c0_lines[d],
                              config->n_c0_lines[d], config->lambda, config->lower[d], config->dx);
        if (error) goto shallow;
        n_cells *= e->axis[d].n_cells;
        n_nodes *= e->axis[d].n_nodes;
    }
    if (gr_nonlocal_material(config) >= 0) error = build_fluidity(e);
    if (error) goto shallow;
    const int k = gr_basis_nodes_1d(config->basis);
    e->K = config->dim == 2 ? k * k : k * k * k;
    e->sum_stride = GR_SUM_DAMPED(config->dim) * e->K;
    if (config->cell_averaged) e->sum_stride += GR_CELL_AVERAGED_SUMS(config->dim);
    e->density_sums = e->sum_stride *= GR_LANES;
    if (config->smoothed) e->sum_stride += GR_DENSITY_SUMS(config->dim) * e->K * GR_LANES;
    e->volume_sums = e->sum_stride;
    if (config->smoothed && config->n_materials > 1) e->sum_stride += GR_VOLUME_SUMS * e->K * GR_LANES;
    e->node_fields = GR_NODE_FIELDS(config->dim, config->smoothed);
    e->node_fields += config->smoothed || config->cell_averaged; /* the gap of the node itself; its damping */
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        if (gr_engine_uses(&e->config, f)) e->n_components += gr_field_components(f, config->dim);
    e->n_doubles = config->single ? config->dim : e->n_components; /* x comes first */
    e->column = calloc((size_t)e->n_components, sizeof *e->column);
    error = copy_config(e);
    if (error) goto out;
    error = GR_ERR_MEMORY;
    if (!e->column) goto out;
    if (gr_table_new(&e->mesh.cell_of, n_cells) || gr_table_new(&e->mesh.next_of, n_cells)) goto out;
    if (gr_table_new(&e->mesh.node_of, n_nodes)) goto out;
    error = list_solids(e);
    if (!error) error = gr_sleep_new(e);
    if (!error && config->n_bodies) error = build_bodies(e, n_cells, n_nodes);
    e->dt = config->dt;
    e->shift_dt = 1; /* until the first shift */
    e->shift_scale = -1;
    e->tally.time = -1;
    e->inv_dx = 1.0 / config->dx;
    prepare_materials(e);
    *out = e;
    e = 0;
    goto out;
shallow: /* the config still belongs to the caller */
    memset(&e->config, 0, sizeof e->config);
out:
    if (error == GR_ERR_CONFIG && e) memset(&e->config, 0, sizeof e->config);
    gr_engine_free(e);
    if (error) {
        gr_engine_free(*out);
        *out = 0;
    }
    return error;
}

void gr_engine_free(struct gr_engine *e)
{
    if (!e) return;
    for (int d = 0; d < 3; d++) gr_axis_free(&e->axis[d]);
    gr_fluidity_free(e->fluidity);
    gr_watch_free(e->watch);
    gr_inlets_free(e->inflow);
    gr_feet_free(e->feet);
    gr_rigid_free(e->rigid);
    gr_open_volume_free(e->open);
    gr_sleep_free(e->sleep);
    for (int b = 0; e->config.bodies && b < e->config.n_bodies; b++) free((void *)e->config.bodies[b].motion);
    const void *owned[] = {e->config.gravity_times,
                           e->config.gravity_vectors,
                           e->config.walls,
                           e->config.bodies,
                           e->config.parts,
                           e->column,
                           e->mesh.cell,
                           e->mesh.cell_node,
                           e->mesh.place,
                           e->mesh.node_source,
                           e->mesh.node_run,
                           e->mesh.node_code,
                           e->mesh.node_about,
                           e->mesh.node_at,
                           e->mesh.node_volume,
                           e->mesh.node_id,
                           e->sums,
                           e->average,
                           e->substep_mass,
                           e->substep_flow,
                           e->substep_gain,
                           e->mesh.tile_state,
                           e->mesh.tile_in_row,
                           e->mesh.beside,
                           e->node_data,
                           e->node_single,
                           e->node_mass,
                           e->node_v,
                           e->node_cells[0],
                           e->node_cells[1],
                           e->node_cells[2],
                           e->substeps,
                           e->body,
                           e->body_next,
                           e->thin,
                           e->split,
                           e->mesh.duplicate,
                           e->mesh.separated,
                           e->mesh.paired,
                           e->migrant,
                           e->migrants,
                           e->cut,
                           e->pending,
                           e->pending_id,
                           e->dirty,
                           e->tally.cell};
    struct gr_table *const tables[] = {&e->mesh.cell_of, &e->mesh.next_of, &e->mesh.node_of};
    for (int k = 0; k < 3; k++) gr_table_free(tables[k]);
    gr_map_free(&e->config.node_codes);
    gr_map_free(&e->config.cell_flags);
    for (size_t k = 0; k < sizeof owned / sizeof *owned; k++) free((void *)owned[k]);
    free(e);
}

void gr_engine_bind(struct gr_engine *e, void *const field[GR_FIELD_COUNT], int64_t *id, int64_t capacity)
{
    int n = 0;
    e->id = id;
    e->capacity = capacity;
    for (int f = 0; f < GR_FIELD_COUNT; f++) {
        const size_t size = gr_is_double(&e->config, f) ? sizeof(double) : sizeof(float);
        e->field[f] = field[f];
        for (int c = 0; field[f] && c < gr_field_components(f, e->config.dim); c++)
            e->column[n++] = (char *)field[f] + (size_t)(c * capacity) * size;
    }
}
