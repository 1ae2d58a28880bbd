/* Points that enter a simulation by the material point method (inflow.h). */
#include "mpm/inflow.h"

#include <math.h>
#include <string.h>

#include "core/memory.h"
#include "mpm/migrate.h"
#include "mpm/ranks.h"

/* gr_component_of before the points are bound. */
static int component_of(const struct gr_engine *e, int field)
{
    int component = 0;
    for (int f = 0; f < field; f++) component += gr_config_uses(&e->config, f) ? gr_field_components(f, e->config.dim) : 0;
    return component;
}

static int is_valid(const struct gr_engine *e, const struct gr_inlet *inlet)
{
    if (e->mesh.node_capacity || !gr_inlet_is_valid(inlet, e->config.dim, e->points.n_components)) return 0;
    const int mass = component_of(e, GR_FIELD_mass), material = component_of(e, GR_FIELD_material);
    for (int64_t i = 0; i < inlet->n_sites; i++) {
        const double *record = inlet->record + i * e->points.n_components;
        if (!(record[mass] > 0)) return 0;
        if (e->config.n_materials > 1 && !(record[material] >= 0 && record[material] < e->config.n_materials)) return 0;
        for (int d = 0; d < e->config.dim; d++) {
            const int64_t at = gr_locate(&e->axis[d], e->inv_dx, record[d]);
            if (at < 0 || at >= e->axis[d].n_cells) return 0;
        }
    }
    return 1;
}

int gr_inflow_add(struct gr_engine *e, const struct gr_inlet *inlet)
{
    return is_valid(e, inlet) ? gr_inlets_add(&e->inflow, inlet, e->points.n_components) : GR_ERR_CONFIG;
}

int64_t gr_inflow_most(const struct gr_engine *e)
{
    const double longest = gr_longest_dt(&e->config);
    int64_t most = 0;
    for (int k = 0; e->inflow && k < e->inflow->n_inlets; k++) most += gr_inlet_most(&e->inflow->inlet[k], longest);
    return most;
}

/* True if positions x and y [component stride `stride`] are nearer than `reach` along each axis. */
static int are_near(int dim, const double *x, const double *y, int64_t stride, const double *reach)
{
    for (int d = 0; d < dim; d++)
        if (!(fabs(y[d * stride] - x[d]) < reach[d])) return 0;
    return 1;
}

/* True if a cell, be it double, has a point near x. */
static int cell_is_near(const struct gr_engine *e, const int32_t at[3], const double *x, const double *reach)
{
    const int64_t first = (int64_t)gr_table_get(&e->mesh.cell_of, gr_cell_id(e, at)) - 1;
    const int64_t both[2] = {first, first >= 0 && e->bodies.n_thin ? e->mesh.other[first] : -1};
    for (int64_t side = 0, c; side < 2 && (c = both[side]) >= 0; side++)
        for (int32_t k = 0; k < e->mesh.cell[c].count; k++)
            if (are_near(e->config.dim, x, gr_x(e, 0) + gr_slot(&e->mesh.cell[c], k), e->points.capacity, reach)) return 1;
    return 0;
}

/* True if a point at x would have another one nearer than distance h along the axis, and than h/2 across it. Points that
 * wait for a slot in their cell count, as they would have one if the points had been grouped at another time. */
static int is_taken(const struct gr_engine *e, const struct gr_inlet *inlet, const double x[3], double distance)
{
    int32_t low[3] = {0}, high[3] = {0}, at[3];
    double reach[3];
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        reach[d] = (d == inlet->axis ? distance : 0.5) * inlet->spacing;
        const int64_t first = gr_locate(axis, e->inv_dx, x[d] - reach[d]);
        const int64_t last = gr_locate(axis, e->inv_dx, x[d] + reach[d]);
        if (first >= axis->n_cells || last < 0) return 0; /* outside, by how much and be it finite or not */
        low[d] = (int32_t)(first < 0 ? 0 : first);
        high[d] = (int32_t)(last < axis->n_cells ? last : axis->n_cells - 1);
    }
    for (at[2] = low[2]; at[2] <= high[2]; at[2]++)
        for (at[1] = low[1]; at[1] <= high[1]; at[1]++)
            for (at[0] = low[0]; at[0] <= high[0]; at[0]++)
                if (cell_is_near(e, at, x, reach)) return 1;
    for (int64_t k = 0; k < e->migration.n_pending; k++)
        if (are_near(e->config.dim, x, e->migration.pending + k * e->points.n_components, 1, reach)) return 1;
    return 0;
}

/* The record of a point that enters, in the space behind the points that wait. */
static double *record_of(struct gr_engine *e, const struct gr_inlet *inlet, int64_t site, double since)
{
    double *record = e->migration.pending + e->migration.n_pending * e->points.n_components;
    memcpy(record, inlet->record + site * e->points.n_components, sizeof(double) * (size_t)e->points.n_components);
    for (int d = 0; d < e->config.dim; d++) record[d] += inlet->velocity[d] * since;
    return record;
}

/* See gr_enter. Nothing is allocated: share_out reserves memory. */
static int enter(void *engine, struct gr_inlet *inlet, int64_t site, double since, double distance)
{
    struct gr_engine *e = engine;
    double *record = record_of(e, inlet, site, since), x[3] = {0};
    for (int d = 0; d < e->config.dim; d++) x[d] = record[d];
    if (inlet->yields && is_taken(e, inlet, x, distance)) return 0;
    gr_insert_new(e, record, e->inflow->next_id++);
    return 1;
}

/* ---- With other ranks ----
 *
 * All ranks have the same schedule. Before points enter, each states which positions are occupied by its own points; those
 * that enter before in the same step are known to all. */

/* See gr_inlets_ask: note whether an own point occupies a position. */
static int note_taken(void *engine, struct gr_inlet *inlet, int64_t site, double since, double distance)
{
    struct gr_engine *e = engine;
    const double *record = record_of(e, inlet, site, since);
    double x[3] = {0};
    for (int d = 0; d < e->config.dim; d++) x[d] = record[d];
    e->ranks->taken[e->inflow->candidate] = inlet->yields && is_taken(e, inlet, x, distance);
    return 0;
}

/* True if a point that has entered in this step, on any rank, occupies a position. */
static int is_taken_by_new(const struct gr_engine *e, const struct gr_inlet *inlet, const double x[3], double distance)
{
    double reach[3];
    for (int d = 0; d < e->config.dim; d++) reach[d] = (d == inlet->axis ? distance : 0.5) * inlet->spacing;
    for (int64_t k = 0; k < e->ranks->n_entered; k++)
        if (are_near(e->config.dim, x, e->ranks->entered + 3 * k, 1, reach)) return 1;
    return 0;
}

/* See gr_enter: the owner of the cell of the point takes it. */
static int enter_shared(void *engine, struct gr_inlet *inlet, int64_t site, double since, double distance)
{
    struct gr_engine *e = engine;
    struct gr_ranks *ranks = e->ranks;
    double *record = record_of(e, inlet, site, since), *x = ranks->entered + 3 * ranks->n_entered;
    int32_t cell[3];
    double wanted[3] = {0};
    for (int d = 0; d < e->config.dim; d++) wanted[d] = record[d];
    if (inlet->yields && (ranks->taken[e->inflow->candidate] || is_taken_by_new(e, inlet, wanted, distance))) return 0;
    ranks->n_entered += gr_place_new(e, record, x, cell);
    const int64_t id = e->inflow->next_id++;
    if (gr_owner(ranks, cell) == ranks->transport.rank) gr_insert_new(e, record, id);
    return 1;
}

int gr_inflow_reserve(struct gr_engine *e)
{
    struct gr_ranks *ranks = e->ranks;
    const int64_t most = gr_inflow_most(e);
    if (!ranks || most <= ranks->entering_capacity) return GR_OK;
    ranks->entering_capacity = 0;
    GR_RESIZE(ranks->taken, most);
    GR_RESIZE(ranks->entered, 3 * most + 3);
    ranks->entering_capacity = most;
    return GR_OK;
}

static int enter_on_ranks(struct gr_engine *e, double longest)
{
    struct gr_ranks *ranks = e->ranks;
    int yields = 0;
    for (int k = 0; k < e->inflow->n_inlets; k++) yields |= e->inflow->inlet[k].yields;
    ranks->n_entered = 0;
    if (yields) {
        const int64_t n = gr_inlets_ask(e->inflow, e->clock.time, longest, note_taken, e);
        if (n && gr_ranks_add_up(ranks, ranks->taken, n)) return GR_ERR_TRANSPORT;
    }
    gr_inlets_enter(e->inflow, e->clock.time, longest, enter_shared, e);
    return GR_OK;
}

int gr_inflow_enter(struct gr_engine *e)
{
    const double longest = gr_longest_dt(&e->config);
    if (e->ranks && e->ranks->transport.size > 1) return enter_on_ranks(e, longest);
    gr_inlets_enter(e->inflow, e->clock.time, longest, enter, e);
    return GR_OK;
}
