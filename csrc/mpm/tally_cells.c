/* Sums of a tally over the points of cells (tally_cells.h). */
#include "mpm/tally_cells.h"

#include <math.h>

#include "mpm/materials.h"
#include "mpm/numbers.h"
#include "mpm/of_material.h"

/* Cells that are summed together: on a processor those of a tile, in loops over which compilers use vectors. */
enum { ROW = GR_SIZE(GR_LANES, 1) };

/* The numbers of a row of points of these cells. */
struct tallied {
    double m[ROW], c[ROW], rate[ROW], weight[ROW];
    double rest_volume[ROW], inverse_2K[ROW], inverse_4G[ROW];
    double square[ROW], stress[6][ROW];
    double energy[ROW], power[ROW];
    double mu_s[ROW], rise[ROW], xi[ROW]; /* of material that dilates; xi is 0 of others */
};

#define EACH_LANE(l) for (int l = 0; l < ROW; l++)

/* Component c of a field in the slots from `at` on. */
static void load_row(const struct gr_engine *e, int field, int c, int64_t at, double out[ROW])
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
static void add_squares(const struct gr_engine *e, int field, int components, int64_t at, double out[ROW])
{
    double value[ROW];
    for (int c = 0; c < components; c++) {
        load_row(e, field, c, at, value);
        EACH_LANE(l) out[l] += value[l] * value[l];
    }
}

static void set_material(const struct gr_engine *e, int k, int l, struct tallied *row)
{
    const double G = e->material_number[GR_MATERIAL_SHEAR_MODULUS][k];
    row->rest_volume[l] = row->m[l] / e->config.material[k].rho_c;
    row->inverse_2K[l] = 0.5 / e->material_number[GR_MATERIAL_BULK_MODULUS][k];
    row->inverse_4G[l] = G > 0 ? 0.25 / G : 0;
    row->mu_s[l] = e->material_number[GR_MATERIAL_DILATING_MU_S][k];
    row->rise[l] = e->material_number[GR_MATERIAL_DILATING_RISE][k];
    row->xi[l] = e->material_number[GR_MATERIAL_DILATING_XI][k];
}

/* Shear stress that dissipates at the pressure p and the plastic shear rate of a point that dilates, Pa. */
static double dissipating_stress(const struct tallied *row, int l, double p)
{
    const double fast = row->xi[l] * sqrt(p > 0 ? p : 0);
    return p > 0 ? (row->mu_s[l] + row->rise[l] * row->rate[l] / (fast + row->rate[l])) * p : 0;
}

/* exp(x) for |x| <= 600 to round-off, without fused operations: v_exp (core/simd.h), with the same bits on all machines. */
static double plain_exp(double x)
{
    union {
        double number;
        uint64_t bits;
    } power = {.number = x * 1.4426950408889634 + 0x1.8p52};
    const double n = power.number - 0x1.8p52, r = (x - n * 6.93147180369123816490e-01) - n * 1.9082149292705877e-10;
    double e = gr_inverse_factorial[13];
    for (int k = 12; k >= 0; k--) e = e * r + gr_inverse_factorial[k];
    power.bits = (power.bits << 52) + ((uint64_t)1023 << 52);
    return e * power.number;
}

/* exp(-c). Near to rho_c, where nearly all points are, a polynomial is exact to 1e-8 and many times as fast. */
static void inverse_densities(const double c[ROW], double out[ROW])
{
    int far = 0;
    EACH_LANE(l) out[l] = 1 - c[l] * (1 - c[l] * (1.0 / 2) * (1 - c[l] * (1.0 / 3)));
    EACH_LANE(l) far |= fabs(c[l]) > 0.02;
    for (int l = 0; far && l < ROW; l++)
        if (fabs(c[l]) > 0.02) out[l] = plain_exp(fmin(fmax(-c[l], -600), 600));
}

/* Kinetic and elastic energy, m v^2/2 + V (s:s/(4 G) + p^2/(2 K)), and plastic power, V tau gdot (Dunatunga & Kamrin 2015,
 * eqs 2.9 and 2.15), of material that dilates V mu(I) p gdot; shears: number of shear stresses. */
static void find_energies(int shears, struct tallied *row)
{
    double volume[ROW], p[ROW], shear[ROW] = {0};
    inverse_densities(row->c, volume);
    EACH_LANE(l) volume[l] *= row->rest_volume[l] * (1 + row->weight[l]);
    EACH_LANE(l) p[l] = -(row->stress[0][l] + row->stress[1][l] + row->stress[2][l]) * (1.0 / 3);
    for (int d = 0; d < 3; d++) EACH_LANE(l) shear[l] += (row->stress[d][l] + p[l]) * (row->stress[d][l] + p[l]);
    for (int d = 3; d < 3 + shears; d++) EACH_LANE(l) shear[l] += 2 * row->stress[d][l] * row->stress[d][l];
    EACH_LANE(l)
    {
        const double elastic = shear[l] * row->inverse_4G[l] + p[l] * p[l] * row->inverse_2K[l];
        row->energy[l] = 0.5 * row->m[l] * row->square[l] + volume[l] * elastic;
        const double tau = row->xi[l] > 0 ? dissipating_stress(row, l, p[l]) : sqrt(0.5 * shear[l]);
        row->power[l] = volume[l] * tau * row->rate[l];
    }
}

static int shears(const struct gr_engine *e) { return e->config.dim == 2 ? 1 : 3; }

/* Add a row of the cells of a tile to their sums; spare slots beyond the `points` of a cell do not count. */
static void add_row(const struct gr_engine *e, int64_t at, const unsigned char counts[ROW], struct gr_tally_of_cell sum[ROW])
{
    const int dim = e->config.dim;
    double x[3][ROW], gradient[ROW] = {0};
    struct tallied row = {.weight = {0}, .square = {0}};
    load_row(e, GR_FIELD_mass, 0, at, row.m);
    load_row(e, GR_FIELD_log_density, 0, at, row.c);
    load_row(e, GR_FIELD_shear_rate, 0, at, row.rate);
    if (e->points.field[GR_FIELD_weight_correction]) load_row(e, GR_FIELD_weight_correction, 0, at, row.weight);
    for (int c = 0; c < 3 + shears(e); c++) load_row(e, GR_FIELD_stress, c, at, row.stress[c]);
    for (int d = 0; d < dim; d++) load_row(e, GR_FIELD_x, d, at, x[d]);
    add_squares(e, GR_FIELD_v, dim, at, row.square);
    if (e->points.field[GR_FIELD_affine])
        add_squares(e, GR_FIELD_affine, dim * dim, at, gradient);
    else
        EACH_LANE(l) gradient[l] = row.rate[l] * row.rate[l];
    EACH_LANE(l) set_material(e, gr_material_at(e, at + l), l, &row);
    for (int l = 0; e->dilates && l < ROW; l++) row.rest_volume[l] *= gr_bulking(e, at + l);
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

void gr_tally_cells(struct gr_engine *e, int64_t first)
{
    const struct gr_cell *cell = &e->mesh.cell[first];
    struct gr_tally_of_cell *sum = &e->tally.cell[first];
    int32_t rows = 0;
    EACH_LANE(l) sum[l] = (struct gr_tally_of_cell){0};
    EACH_LANE(l) rows = cell[l].count > rows ? cell[l].count : rows;
    for (int32_t k = 0; k < rows; k++) {
        unsigned char counts[ROW];
        EACH_LANE(l) counts[l] = k < cell[l].count;
        add_row(e, gr_slot(cell, k), counts, sum);
    }
}

double gr_tally_packed(const struct gr_engine *e, const double *record)
{
    const double *const v = record + gr_component_of(e, GR_FIELD_v), *stress = record + gr_component_of(e, GR_FIELD_stress);
    struct tallied row = {.m = {record[gr_component_of(e, GR_FIELD_mass)]}};
    double number = 0;
    row.c[0] = record[gr_component_of(e, GR_FIELD_log_density)];
    if (e->points.field[GR_FIELD_weight_correction]) row.weight[0] = record[gr_component_of(e, GR_FIELD_weight_correction)];
    for (int d = 0; d < e->config.dim; d++) row.square[0] += v[d] * v[d];
    for (int c = 0; c < 3 + shears(e); c++) row.stress[c][0] = stress[c];
    if (e->config.n_materials > 1) number = record[gr_component_of(e, GR_FIELD_material)];
    set_material(e, number > 0 && number < e->config.n_materials ? (int)number : 0, 0, &row);
    if (e->dilates) row.rest_volume[0] *= record[gr_component_of(e, GR_FIELD_bulking)];
    find_energies(shears(e), &row);
    return row.energy[0];
}
