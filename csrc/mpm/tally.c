/* Tally of a run (tally.h). */
#include "mpm/tally.h"

#include <math.h>

#include "core/exact.h"
#include "core/memory.h"
#include "core/piecewise.h"
#include "mpm/device.h"
#include "mpm/numbers.h"
#include "mpm/ranks.h"
#include "mpm/tally_cells.h"

struct pass {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks;
};

GR_SHARED(add_tiles, struct pass, w->e->mesh.n_tiles, w)
{
    (void)chunk;
    for (int64_t tile = first; tile < last; tile++) gr_tally_cells(w->e, tile * GR_LANES);
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
    if (!error && e->device)
        error = gr_device_tally(e);
    else if (!error)
        add_tiles(&pass);
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
    gr_exact_add(&e->passage.sum[GR_TALLY_ENERGY], gr_tally_packed(e, record));
    gr_exact_add(&e->passage.sum[GR_TALLY_OTHER], record[gr_component_of(e, GR_FIELD_mass)]);
}
