/* Small scenes for the tests (scene.h). */
#include "tests/scene.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

#include "kernels.h"
#include "mpm/grid.h"
#include "mpm/numbers.h"

static uint64_t seed = 1;

void scene_seed(uint64_t value) { seed = value; }

double scene_random(double a, double b)
{
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return a + (b - a) * (double)(seed >> 11) * 0x1p-53;
}

void scene_default(struct scene *s, int dim, int basis, int affine, int smoothed)
{
    memset(s, 0, sizeof *s);
    struct gr_config *c = &s->config;
    c->dim = dim, c->basis = basis, c->affine = affine, c->smoothed = smoothed;
    c->pressure_from_density = smoothed;
    for (int d = 0; d < dim; d++) c->shape[d] = 6;
    c->lower[0] = -1, c->lower[1] = 2, c->lower[2] = 0.5;
    c->dx = 0.1, c->lambda = 0.25;
    c->keep_velocity_rate = affine == GR_AFFINE_MOMENT ? -1 : affine == GR_AFFINE_GRADIENT ? 5 : 0;
    c->cfl = 0.4;
    const double parameter[] = {1e6 / 1.2, 1e6 / 2.6, 0.38, 0.64, 1.12};
    c->n_materials = 1;
    c->material[0] =
        (struct gr_material){.law = gr_law_index("mu_I"), .rho_c = 1500, .K = parameter[0], .separation_strain = 0.02};
    memcpy(c->material[0].parameter, parameter, sizeof parameter);
    c->wave_speed = sqrt((parameter[0] + 4 * parameter[1] / 3) / c->material[0].rho_c);
    c->density = (struct gr_density_numbers){.diffusion = 0.1,
                                             .strain_diffusion = 10,
                                             .relaxation = 0.7,
                                             .relaxation_limit = 0.1,
                                             .dead_band = 0.05,
                                             .compression_rate = 2.0,
                                             .shifting = 5,
                                             .shifting_limit = 0.05,
                                             .separation_strain = 0.02,
                                             .weight_correction = 0.7,
                                             .weight_correction_limit = 0.5,
                                             .weight_correction_decay = 0.02};
    c->averaging_interval = c->flutter_interval = 1;
    s->walls[0] = (struct gr_wall){.opens_at = INFINITY};
    c->n_walls = 1;
    c->n_gravity = 1;
}

void scene_nonlocal(struct scene *s)
{
    static const uint8_t face[4 * 36]; /* all linked */
    const double G = 1e6 / 2.6, parameter[] = {1e6 / 1.2, 0.5, G, 0.38, 0.64, 0.279, 2450, 0.01, 1e-2, 10};
    memcpy(s->config.material[0].parameter, parameter, sizeof parameter);
    s->config.material[0].law = gr_law_index("ngf");
    s->config.nonlocal =
        (struct gr_nonlocal){.method = GR_DIFFUSION_implicit, .substeps = 3, .tolerance = 1e-8, .floor = 1e-6, .face = face};
}

static int64_t axis_nodes(const struct gr_config *c, int d)
{
    const int n = c->shape[d];
    if (c->periodic[d]) return n;
    return c->basis == GR_QUADRATIC ? n + 2 + c->n_c0_lines[d] : n + 1;
}

int64_t scene_grid_nodes(const struct scene *s)
{
    int64_t n = 1;
    for (int d = 0; d < s->config.dim; d++) n *= axis_nodes(&s->config, d);
    return n;
}

void scene_codes(struct scene *s)
{
    if (!s->codes) s->codes = gr_calloc((size_t)scene_grid_nodes(s), 1);
}

void scene_face(struct scene *s, int axis, int high, uint8_t row)
{
    int64_t stride = 1;
    for (int d = 0; d < axis; d++) stride *= axis_nodes(&s->config, d);
    const int64_t m = axis_nodes(&s->config, axis);
    for (int64_t n = 0; s->codes && n < scene_grid_nodes(s); n++)
        if (n / stride % m == (high ? m - 1 : 0)) s->codes[n] = row;
}

static void fill(struct scene *s, int64_t n, double low, double high)
{
    const struct gr_config *c = &s->config;
    for (int64_t k = 0; k < n; k++) {
        for (int d = 0; d < c->dim; d++) {
            *scene_at(s, GR_FIELD_x, d, k) = c->lower[d] + c->shape[d] * c->dx * scene_random(low, high);
            *scene_at(s, GR_FIELD_v, d, k) = scene_random(-1, 1);
            if (c->smoothed) *scene_at(s, GR_FIELD_density_gradient, d, k) = scene_random(-1e-3, 1e-3);
        }
        const double p = scene_random(0, 2000);
        for (int q = 0; q < gr_field_components(GR_FIELD_stress, c->dim); q++)
            *scene_at(s, GR_FIELD_stress, q, k) = (q < 3 ? -p : 0) + 0.2 * p * scene_random(-1, 1);
        for (int q = 0; c->affine && q < c->dim * c->dim; q++) *scene_at(s, GR_FIELD_affine, q, k) = scene_random(-2, 2);
        *scene_at(s, GR_FIELD_log_density, 0, k) = k % 7 ? p / c->material[0].K : scene_random(-0.5, 0);
        *scene_at(s, GR_FIELD_mass, 0, k) = c->material[0].rho_c * pow(c->dx, c->dim) / 9 * scene_random(0.8, 1.2);
        s->id[k] = k;
    }
}

struct gr_map scene_map(const struct scene *s, const uint8_t *value, int nodes)
{
    struct gr_map map = {.n_index = {1, 1, 1}, .n_classes = {1, 1, 1}, .value = value};
    for (int d = 0; d < s->config.dim && d < 3; d++)
        map.n_index[d] = map.n_classes[d] = nodes ? (int32_t)axis_nodes(&s->config, d) : s->config.shape[d];
    return map;
}

/* Store the numbers of the fields as floats where the engine has them so, each in the first half of its array. */
static void narrow(struct scene *s)
{
    for (int f = 0; f < GR_FIELD_COUNT; f++) {
        if (!s->field[f] || gr_is_double(&s->config, f)) continue;
        for (int64_t k = 0; k < s->capacity * gr_field_components(f, s->config.dim); k++) {
            const float number = (float)s->field[f][k];
            memcpy((char *)s->field[f] + (size_t)k * sizeof number, &number, sizeof number);
        }
    }
}

void scene_bind(struct scene *s) { gr_engine_bind(s->engine, (void *const *)s->field, s->id, s->capacity); }

int scene_build(struct scene *s, int64_t n, double low, double high)
{
    struct gr_config *c = &s->config;
    c->walls = s->walls;
    c->gravity_times = s->gravity_times;
    c->gravity_vectors = s->gravity_vectors;
    scene_codes(s);
    c->node_codes = scene_map(s, s->codes, 1);
    const int error = gr_engine_new(&s->engine, c);
    if (error) return error;
    s->capacity = 4 * n + 64 * 40;
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        if (gr_config_uses(c, f))
            s->field[f] = gr_calloc((size_t)(s->capacity * gr_field_components(f, c->dim)), sizeof(double));
    s->id = gr_malloc(sizeof(int64_t) * (size_t)s->capacity);
    for (int64_t k = 0; k < s->capacity; k++) s->id[k] = -1;
    fill(s, n, low, high);
    narrow(s);
    scene_bind(s);
    s->engine->points.n = s->engine->points.used = n;
    return GR_OK;
}

int scene_grow(struct scene *s)
{
    const int64_t capacity = s->engine->migration.needed_capacity;
    double *field[GR_FIELD_COUNT] = {0};
    int short_of = 0;
    int64_t *id = gr_malloc(sizeof(int64_t) * (size_t)capacity);
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        if (s->field[f]) {
            field[f] = gr_calloc((size_t)(capacity * gr_field_components(f, s->config.dim)), sizeof(double));
            short_of |= !field[f];
        }
    for (int f = 0; f < GR_FIELD_COUNT; f++) {
        for (int c = 0; !short_of && s->field[f] && c < gr_field_components(f, s->config.dim); c++)
            memcpy(field[f] + c * capacity, s->field[f] + c * s->capacity, sizeof(double) * (size_t)s->capacity);
        gr_free(s->field[f]);
        s->field[f] = field[f];
    }
    for (int64_t k = 0; id && k < capacity; k++) id[k] = k < s->capacity ? s->id[k] : -1;
    gr_free(s->id);
    s->id = id;
    s->capacity = capacity;
    scene_bind(s);
    return short_of || !id;
}

void scene_free(struct scene *s)
{
    gr_engine_free(s->engine);
    for (int f = 0; f < GR_FIELD_COUNT; f++) gr_free(s->field[f]);
    gr_free(s->id);
    gr_free(s->codes);
    memset(s, 0, sizeof *s);
}

double *scene_at(const struct scene *s, int field, int c, int64_t slot) { return s->field[field] + c * s->capacity + slot; }

double scene_sum(const struct scene *s, int64_t node, int q)
{
    const struct gr_engine *e = s->engine;
    const int first = GR_SUM_DENSITY(e->config.dim);
    double sums[GR_SUM_ROW];
    gr_kernels_select("")->sum_nodes(e, q < first ? GR_SUMS_OF_MOTION : GR_SUMS_OF_DENSITY, q < first ? q : q - first, 1,
                                     node, node + 1, sums + GR_SUM_PAD);
    return sums[GR_SUM_PAD];
}

double scene_node_x(const struct scene *s, int64_t node, int d)
{
    const struct gr_engine *e = s->engine;
    int64_t id = e->mesh.node_id[node];
    for (int j = 0; j < d; j++) id /= e->axis[j].n_nodes;
    return e->axis[d].origin + e->axis[d].node_position[id % e->axis[d].n_nodes] * e->config.dx;
}

double scene_total(const struct scene *s, int q, int moment)
{
    double sum = 0;
    for (int64_t n = 0; n < s->engine->mesh.n_nodes; n++)
        sum += scene_sum(s, n, q) * (moment < 0 ? 1 : scene_node_x(s, n, moment));
    return sum;
}

int64_t scene_find(const struct scene *s, int64_t id)
{
    for (int64_t k = 0; k < s->capacity; k++)
        if (s->id[k] == id) return k;
    return -1;
}

int scene_differs(const struct scene *a, const struct scene *b)
{
    if (a->engine->points.n != b->engine->points.n) return 1;
    for (int64_t k = 0; k < a->capacity; k++) {
        if (a->id[k] < 0) continue;
        const int64_t other = scene_find(b, a->id[k]);
        if (other < 0) return 1;
        for (int f = 0; f < GR_FIELD_COUNT; f++)
            for (int c = 0; a->field[f] && c < gr_field_components(f, a->config.dim); c++)
                if (memcmp(scene_at(a, f, c, k), scene_at(b, f, c, other), sizeof(double))) return 1;
    }
    return 0;
}
