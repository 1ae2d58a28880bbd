/* Tally of a run (tally.h). */
#include "mpm/tally.h"

#include <math.h>

#include "core/exact.h"
#include "core/memory.h"
#include "core/piecewise.h"
#include "mpm/materials.h"
#include "mpm/numbers.h"
#include "mpm/of_material.h"
#include "mpm/ranks.h"

/* Sums over the points of a cell, and the largest of each number. */
struct gr_tally_of_cell {
    double energy, power, moment[3], densest, loosest, square, gradient;
};

/* The numbers of a row of GR_LANES points, in loops over which compilers use vectors. */
struct row {
    double m[GR_LANES], c[GR_LANES], rate[GR_LANES], weight[GR_LANES];
    double rest_volume[GR_LANES], inverse_2K[GR_LANES], inverse_4G[GR_LANES];
    double square[GR_LANES], stress[6][GR_LANES];
    double energy[GR_LANES], power[GR_LANES];
    struct gr_dissipation {
        const struct gr_material *of;
        double mu_s, rise, xi; /* of material that dilates, whose flow dissipates mu(I) p gdot; xi is 0 of others */
    } dissipation[GR_LANES];
};

#define EACH_LANE(l) for (int l = 0; l < GR_LANES; l++)

/* Component c of a field in the slots from `at` on. */
static void load(const struct gr_engine *e, int field, int c, int64_t at, double out[GR_LANES])
{
    at += c * e->points.capacity;
    if (gr_is_double(&e->config, field)) {
        const double *from = (const double *)e->points.field[field] + at;
        EACH_LANE(l) out[l] = from[l];
    } else {
        const float *from = (const float *)e->points.field[field] + at;
        EACH_LANE(l) out[l] = from[l];
    }
}

/* Add the squares of the components of a field. */
static void add_squares(const struct gr_engine *e, int field, int components, int64_t at, double out[GR_LANES])
{
    double value[GR_LANES];
    for (int c = 0; c < components; c++) {
        load(e, field, c, at, value);
        EACH_LANE(l) out[l] += value[l] * value[l];
    }
}

static struct gr_dissipation dissipation_of(const struct gr_material *material)
{
    struct gr_dissipation numbers = {.of = material};
    if (!gr_law_at(material->law)->dilates) return numbers;
    numbers.mu_s = gr_parameter_of(material, "mu_s");
    numbers.rise = gr_parameter_of(material, "mu_2") - numbers.mu_s;
    numbers.xi = gr_parameter_of(material, "xi");
    return numbers;
}

static void set_material(const struct gr_engine *e, int k, int l, struct row *row)
{
    const double G = e->material_number[GR_MATERIAL_SHEAR_MODULUS][k];
    const struct gr_material *material = &e->config.material[k];
    row->rest_volume[l] = row->m[l] / material->rho_c;
    row->inverse_2K[l] = 0.5 / e->material_number[GR_MATERIAL_BULK_MODULUS][k];
    row->inverse_4G[l] = G > 0 ? 0.25 / G : 0;
    if (!e->dilates)
        row->dissipation[l] = (struct gr_dissipation){0};
    else /* numbers of a law are found by name: once for points of one material */
        row->dissipation[l] =
            l && row->dissipation[l - 1].of == material ? row->dissipation[l - 1] : dissipation_of(material);
}

/* Shear stress that dissipates at the pressure p and the plastic shear rate, Pa. */
static double dissipating_stress(const struct gr_dissipation *of, double p, double rate)
{
    const double fast = of->xi * sqrt(p > 0 ? p : 0);
    return p > 0 ? (of->mu_s + of->rise * rate / (fast + rate)) * p : 0;
}

/* exp(-c). Near to rho_c, where nearly all points are, a polynomial is exact to 1e-8 and many times as fast. */
static void inverse_densities(const double c[GR_LANES], double out[GR_LANES])
{
    int far = 0;
    EACH_LANE(l) out[l] = 1 - c[l] * (1 - c[l] * (1.0 / 2) * (1 - c[l] * (1.0 / 3)));
    EACH_LANE(l) far |= fabs(c[l]) > 0.02;
    for (int l = 0; far && l < GR_LANES; l++)
        if (fabs(c[l]) > 0.02) out[l] = exp(-c[l]);
}

/* Kinetic and elastic energy, m v^2/2 + V (s:s/(4 G) + p^2/(2 K)), and plastic power, V tau gdot (Dunatunga & Kamrin 2015,
 * eqs 2.9 and 2.15), of material that dilates V mu(I) p gdot; shears: number of shear stresses. */
static void find_energies(int shears, struct row *row)
{
    double volume[GR_LANES], p[GR_LANES], shear[GR_LANES] = {0};
    inverse_densities(row->c, volume);
    EACH_LANE(l) volume[l] *= row->rest_volume[l] * (1 + row->weight[l]);
    EACH_LANE(l) p[l] = -(row->stress[0][l] + row->stress[1][l] + row->stress[2][l]) * (1.0 / 3);
    for (int d = 0; d < 3; d++) EACH_LANE(l) shear[l] += (row->stress[d][l] + p[l]) * (row->stress[d][l] + p[l]);
    for (int d = 3; d < 3 + shears; d++) EACH_LANE(l) shear[l] += 2 * row->stress[d][l] * row->stress[d][l];
    EACH_LANE(l)
    {
        const double elastic = shear[l] * row->inverse_4G[l] + p[l] * p[l] * row->inverse_2K[l];
        row->energy[l] = 0.5 * row->m[l] * row->square[l] + volume[l] * elastic;
        const double tau =
            row->dissipation[l].xi > 0 ? dissipating_stress(&row->dissipation[l], p[l], row->rate[l]) : sqrt(0.5 * shear[l]);
        row->power[l] = volume[l] * tau * row->rate[l];
    }
}

static int shears(const struct gr_engine *e) { return e->config.dim == 2 ? 1 : 3; }

/* Add a row of the cells of a tile to their sums; spare slots beyond the `points` of a cell do not count. */
static void add_row(const struct gr_engine *e, int64_t at, const unsigned char counts[GR_LANES],
                    struct gr_tally_of_cell sum[GR_LANES])
{
    const int dim = e->config.dim;
    double x[3][GR_LANES], gradient[GR_LANES] = {0};
    struct row row = {.weight = {0}, .square = {0}};
    load(e, GR_FIELD_mass, 0, at, row.m);
    load(e, GR_FIELD_log_density, 0, at, row.c);
    load(e, GR_FIELD_shear_rate, 0, at, row.rate);
    if (e->points.field[GR_FIELD_weight_correction]) load(e, GR_FIELD_weight_correction, 0, at, row.weight);
    for (int c = 0; c < 3 + shears(e); c++) load(e, GR_FIELD_stress, c, at, row.stress[c]);
    for (int d = 0; d < dim; d++) load(e, GR_FIELD_x, d, at, x[d]);
    add_squares(e, GR_FIELD_v, dim, at, row.square);
    if (e->points.field[GR_FIELD_affine])
        add_squares(e, GR_FIELD_affine, dim * dim, at, gradient);
    else
        EACH_LANE(l) gradient[l] = row.rate[l] * row.rate[l];
    EACH_LANE(l) set_material(e, gr_material_at(e, at + l), l, &row);
    for (int l = 0; e->dilates && l < GR_LANES; l++) row.rest_volume[l] *= gr_bulking(e, at + l);
    find_energies(shears(e), &row);
    EACH_LANE(l)
    {
        if (!counts[l]) continue;
        sum[l].energy += row.energy[l];
        sum[l].power += row.power[l];
        for (int d = 0; d < dim; d++) sum[l].moment[d] += row.m[l] * x[d][l];
        sum[l].densest = row.c[l] > sum[l].densest ? row.c[l] : sum[l].densest;
        sum[l].loosest = row.c[l] < sum[l].loosest ? row.c[l] : sum[l].loosest;
        sum[l].square = row.square[l] > sum[l].square ? row.square[l] : sum[l].square;
        sum[l].gradient = gradient[l] > sum[l].gradient ? gradient[l] : sum[l].gradient;
    }
}

struct pass {
    const struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks;
};

GR_SHARED(add_tiles, struct pass, w->e->mesh.n_tiles, w)
{
    (void)chunk;
    for (int64_t tile = first; tile < last; tile++) {
        const struct gr_cell *cell = &w->e->mesh.cell[tile * GR_LANES];
        struct gr_tally_of_cell *sum = &w->e->tally.cell[tile * GR_LANES];
        int32_t rows = 0;
        EACH_LANE(l) sum[l] = (struct gr_tally_of_cell){0};
        EACH_LANE(l) rows = cell[l].count > rows ? cell[l].count : rows;
        for (int32_t k = 0; k < rows; k++) {
            unsigned char counts[GR_LANES];
            EACH_LANE(l) counts[l] = k < cell[l].count;
            add_row(w->e, gr_slot(cell, k), counts, sum);
        }
    }
}

static int reserve(struct gr_tally *tally, int64_t cells)
{
    if (cells <= tally->capacity) return GR_OK;
    GR_RESIZE(tally->cell, cells);
    tally->capacity = cells;
    return GR_OK;
}

int gr_tally_is_due(const struct gr_engine *e)
{
    return e->tally.time < 0 || (e->clock.step % GR_TALLY_INTERVAL == 0 && e->tally.time < e->clock.time);
}

/* Mean gravity between two times, between which it varies linearly. */
static void mean_gravity(const struct gr_engine *e, double begin, double end, double g[3])
{
    const struct gr_config *c = &e->config;
    double other[3] = {0};
    gr_piecewise(c->dim, c->n_gravity, c->gravity_times, 1, c->gravity_vectors, c->dim, begin, g);
    gr_piecewise(c->dim, c->n_gravity, c->gravity_times, 1, c->gravity_vectors, c->dim, end, other);
    for (int d = 0; d < c->dim; d++) g[d] = 0.5 * (g[d] + other[d]);
}

/* Sums over all cells, and the largest numbers. */
struct all_cells {
    struct gr_exact sum[GR_TALLY_SUMS];
    double densest, dilution, square, gradient;
};

static void add_cells(const struct gr_engine *e, struct all_cells *all)
{
    for (int64_t c = 0; c < e->mesh.n_cells; c++) {
        const struct gr_tally_of_cell *cell = &e->tally.cell[c];
        if (!e->mesh.cell[c].count) continue;
        gr_exact_add(&all->sum[GR_TALLY_ENERGY], cell->energy);
        gr_exact_add(&all->sum[GR_TALLY_OTHER], cell->power);
        for (int d = 0; d < e->config.dim; d++) gr_exact_add(&all->sum[GR_TALLY_MOMENT + d], cell->moment[d]);
        all->densest = fmax(all->densest, cell->densest);
        all->dilution = fmax(all->dilution, -cell->loosest);
        all->square = fmax(all->square, cell->square);
        all->gradient = fmax(all->gradient, cell->gradient);
    }
}

int gr_tally_make(struct gr_engine *e, struct gr_team *team)
{
    struct gr_tally *tally = &e->tally;
    struct pass pass = {.e = e, .team = team, .chunks = gr_chunks(team, e->mesh.n_tiles)};
    struct all_cells all = {.densest = 0};
    double *const moment[3] = {&tally->moment_x, &tally->moment_y, &tally->moment_z}, g[3] = {0};
    int error = reserve(tally, e->mesh.n_tiles * GR_LANES);
    if (!error) add_tiles(&pass);
    if (!error) add_cells(e, &all);
    if (e->ranks) error = gr_ranks_combine(e, error, all.sum, GR_TALLY_SUMS, &all.densest, 4);
    if (error) return error;
    const double energy = gr_exact_value(&all.sum[GR_TALLY_ENERGY]), power = gr_exact_value(&all.sum[GR_TALLY_OTHER]);
    if (tally->time < 0) {
        tally->first_energy = energy;
    } else {
        mean_gravity(e, tally->time, e->clock.time, g);
        for (int d = 0; d < 3; d++)
            tally->gravity_work += g[d] * (gr_exact_value(&all.sum[GR_TALLY_MOMENT + d]) - *moment[d]);
        tally->plastic_work += 0.5 * (tally->power + power) * (e->clock.time - tally->time);
    }
    for (int d = 0; d < 3; d++) *moment[d] = gr_exact_value(&all.sum[GR_TALLY_MOMENT + d]);
    tally->time = e->clock.time;
    tally->energy = energy;
    tally->power = power;
    tally->densest = fmax(tally->densest, all.densest);
    tally->loosest = fmin(tally->loosest, -all.dilution);
    tally->fastest = fmax(tally->fastest, sqrt(all.square));
    tally->strain_step = fmax(tally->strain_step, sqrt(all.gradient) * e->clock.dt);
    return GR_OK;
}

void gr_tally_carry(struct gr_engine *e, const double *record, int sign)
{
    const double m = record[gr_component_of(e, GR_FIELD_mass)];
    e->passage.any = 1;
    for (int d = 0; d < e->config.dim; d++) gr_exact_add(&e->passage.sum[GR_TALLY_MOMENT + d], sign * m * record[d]);
}

int gr_tally_settle(struct gr_engine *e)
{
    struct gr_passage *passage = &e->passage;
    double *const moment[3] = {&e->tally.moment_x, &e->tally.moment_y, &e->tally.moment_z};
    const int error = e->ranks ? gr_ranks_combine(e, GR_OK, passage->sum, GR_TALLY_SUMS, 0, 0) : GR_OK;
    for (int d = 0; d < e->config.dim; d++) *moment[d] += gr_exact_value(&passage->sum[GR_TALLY_MOMENT + d]);
    e->tally.outflow += gr_exact_value(&passage->sum[GR_TALLY_ENERGY]);
    e->dropped_mass += gr_exact_value(&passage->sum[GR_TALLY_OTHER]);
    *passage = (struct gr_passage){.any = 0};
    return error;
}

void gr_tally_outflow(struct gr_engine *e, const double *record)
{
    const double *const v = record + gr_component_of(e, GR_FIELD_v), *stress = record + gr_component_of(e, GR_FIELD_stress);
    struct row row = {.m = {record[gr_component_of(e, GR_FIELD_mass)]}};
    double number = 0;
    row.c[0] = record[gr_component_of(e, GR_FIELD_log_density)];
    if (e->points.field[GR_FIELD_weight_correction]) row.weight[0] = record[gr_component_of(e, GR_FIELD_weight_correction)];
    for (int d = 0; d < e->config.dim; d++) row.square[0] += v[d] * v[d];
    for (int c = 0; c < 3 + shears(e); c++) row.stress[c][0] = stress[c];
    if (e->config.n_materials > 1) number = record[gr_component_of(e, GR_FIELD_material)];
    set_material(e, number > 0 && number < e->config.n_materials ? (int)number : 0, 0, &row);
    if (e->dilates) row.rest_volume[0] *= record[gr_component_of(e, GR_FIELD_bulking)];
    find_energies(shears(e), &row);
    gr_exact_add(&e->passage.sum[GR_TALLY_ENERGY], row.energy[0]);
    gr_exact_add(&e->passage.sum[GR_TALLY_OTHER], row.m[0]);
}
