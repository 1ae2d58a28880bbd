/* Points that enter a running simulation (inflow.h). */
#include "mpm/inflow.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/memory.h"
#include "mpm/migrate.h"

/* Nearest distance of points of a column, in spacings. One that waits enters when there is its whole spacing, but for rounding.
 * One that comes in time may be 2 % nearer, as points that fly alone lose a little of their velocity (nodes that they hardly
 * reach have none), and the stream would lose its rhythm: the filling fraction is never more than that too large. */
#define FREE_DISTANCE (1 - 1e-6)
#define TIMELY_DISTANCE 0.98

/* gr_component_of before the points are bound. */
static int component_of(const struct gr_engine *e, int field)
{
    int component = 0;
    for (int f = 0; f < field; f++) component += gr_engine_uses(&e->config, f) ? gr_field_components(f, e->config.dim) : 0;
    return component;
}

static int is_valid(const struct gr_engine *e, const struct gr_inlet *inlet)
{
    if (e->mesh.node_capacity || inlet->n_sites < 1 || inlet->n_sites > INT32_MAX) return 0;
    if (inlet->axis < 0 || inlet->axis >= e->config.dim || !(inlet->spacing > 0) || !isfinite(inlet->spacing)) return 0;
    for (int d = 0; d < 3; d++)
        if (!isfinite(inlet->velocity[d])) return 0;
    const double period = inlet->spacing / fabs(inlet->velocity[inlet->axis]) / (double)inlet->n_sites;
    if (!isfinite(period) || !(period > 0) || !(inlet->begin >= 0) || !isfinite(inlet->begin)) return 0;
    const int mass = component_of(e, GR_FIELD_mass), material = component_of(e, GR_FIELD_material);
    for (int64_t i = 0; i < inlet->n_sites; i++) {
        const double *record = inlet->record + i * e->n_components;
        for (int c = 0; c < e->n_components; c++)
            if (!isfinite(record[c])) return 0;
        if (!(record[mass] > 0)) return 0;
        if (e->config.n_materials > 1 && !(record[material] >= 0 && record[material] < e->config.n_materials)) return 0;
        for (int d = 0; d < e->config.dim; d++) {
            const int64_t at = gr_locate(&e->axis[d], e->inv_dx, record[d]);
            if (at < 0 || at >= e->axis[d].n_cells) return 0;
        }
    }
    return inlet->end >= inlet->begin;
}

static void free_inlet(struct gr_inlet *inlet)
{
    free(inlet->record);
    free(inlet->entered);
    free(inlet->waits);
}

int gr_inflow_add(struct gr_engine *e, const struct gr_inlet *inlet)
{
    const size_t n = (size_t)(inlet->n_sites > 0 ? inlet->n_sites : 0);
    struct gr_inlet new = *inlet;
    if (!e->inflow) e->inflow = calloc(1, sizeof *e->inflow);
    if (!e->inflow) return GR_ERR_MEMORY;
    GR_RESIZE(e->inflow->inlet, e->inflow->n_inlets + 1);
    new.record = malloc(sizeof(double) * (n * (size_t)e->n_components + 1));
    new.entered = calloc(n + 1, sizeof(int64_t));
    new.waits = calloc(n + 1, sizeof(int64_t));
    new.due = new.missed = 0;
    int error = new.record &&new.entered &&new.waits ? GR_OK : GR_ERR_MEMORY;
    if (!error && !is_valid(e, inlet)) error = GR_ERR_CONFIG;
    if (error) {
        free_inlet(&new);
        return error;
    }
    memcpy(new.record, inlet->record, sizeof(double) * n * (size_t)e->n_components);
    e->inflow->inlet[e->inflow->n_inlets++] = new;
    return GR_OK;
}

void gr_inflow_free(struct gr_inflow *inflow)
{
    for (int k = 0; inflow && k < inflow->n_inlets; k++) free_inlet(&inflow->inlet[k]);
    if (inflow) free(inflow->inlet);
    free(inflow);
}

/* Time between two points of an inlet. */
static double interval(const struct gr_inlet *inlet)
{
    return inlet->spacing / (fabs(inlet->velocity[inlet->axis]) * (double)inlet->n_sites);
}

int64_t gr_inflow_most(const struct gr_engine *e)
{
    int64_t most = 0;
    for (int k = 0; e->inflow && k < e->inflow->n_inlets; k++) {
        const struct gr_inlet *inlet = &e->inflow->inlet[k];
        most += (int64_t)(gr_longest_dt(&e->config) / interval(inlet)) + 2 + inlet->n_sites; /* and those that wait */
    }
    return most;
}

double gr_inflow_speed(const struct gr_engine *e)
{
    double largest = 0;
    for (int k = 0; e->inflow && k < e->inflow->n_inlets; k++) {
        const double *v = e->inflow->inlet[k].velocity;
        largest = fmax(largest, sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
    }
    return largest;
}

/* True if places x and y [component stride `stride`] are nearer than `reach` along each axis. */
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
    if (first < 0) return 0;
    for (int64_t c = first; c <= first + (e->mesh.cell[first].side == 1); c++)
        for (int32_t k = 0; k < e->mesh.cell[c].count; k++)
            if (are_near(e->config.dim, x, e->field[GR_FIELD_x] + gr_slot(&e->mesh.cell[c], k), e->capacity, reach))
                return 1;
    return 0;
}

/* True if a point at x would have another one nearer than distance h along the axis, and than h/2
 * across it. Those that wait for a
 * place in their cell count, as they would have one if the points had been grouped at another time. */
static int is_taken(const struct gr_engine *e, const struct gr_inlet *inlet, const double x[3], double distance)
{
    int32_t low[3] = {0}, high[3] = {0}, at[3];
    double reach[3];
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        reach[d] = (d == inlet->axis ? distance : 0.5) * inlet->spacing;
        const int64_t first = gr_locate(axis, e->inv_dx, x[d] - reach[d]);
        const int64_t last = gr_locate(axis, e->inv_dx, x[d] + reach[d]);
        low[d] = (int32_t)(first < 0 ? 0 : first);
        high[d] = (int32_t)(last < axis->n_cells ? last : axis->n_cells - 1);
    }
    for (at[2] = low[2]; at[2] <= high[2]; at[2]++)
        for (at[1] = low[1]; at[1] <= high[1]; at[1]++)
            for (at[0] = low[0]; at[0] <= high[0]; at[0]++)
                if (cell_is_near(e, at, x, reach)) return 1;
    for (int64_t k = 0; k < e->n_pending; k++)
        if (are_near(e->config.dim, x, e->pending + k * e->n_components, 1, reach)) return 1;
    return 0;
}

/* Let the point of a site enter, `since` after it was at the site, if others are farther than `distance`.
 * Returned: 0 if its place is taken. */
static int enter(struct gr_engine *e, struct gr_inlet *inlet, int64_t site, double since, double distance)
{
    double *record = e->pending + e->n_pending * e->n_components, x[3] = {0};
    memcpy(record, inlet->record + site * e->n_components, sizeof(double) * (size_t)e->n_components);
    for (int d = 0; d < e->config.dim; d++) x[d] = record[d] += inlet->velocity[d] * since;
    if (inlet->yields && is_taken(e, inlet, x, distance)) return 0;
    gr_insert_new(e, record, e->inflow->next_id++);
    inlet->entered[site]++;
    return 1;
}

/* Let the points of an inlet enter. Nothing is allocated: share_out reserves memory for gr_inflow_most. */
static void enter_of(struct gr_engine *e, struct gr_inlet *inlet)
{
    const double every = interval(inlet);
    for (int64_t i = 0; e->time <= inlet->end && i < inlet->n_sites; i++)
        if (inlet->waits[i] && enter(e, inlet, i, 0, FREE_DISTANCE)) inlet->waits[i] = 0;
    for (;; inlet->due++) {
        const double at = inlet->begin + (double)(inlet->due + 1) * every;
        const int64_t site = inlet->due % inlet->n_sites;
        if (!(at <= e->time && at <= inlet->end)) break;
        if (inlet->waits[site])
            inlet->missed++;
        else
            inlet->waits[site] = !enter(e, inlet, site, e->time - at, TIMELY_DISTANCE);
    }
}

void gr_inflow_enter(struct gr_engine *e)
{
    for (int k = 0; k < e->inflow->n_inlets; k++) enter_of(e, &e->inflow->inlet[k]);
}

int64_t gr_inflow_size(const struct gr_inflow *inflow)
{
    int64_t size = 1;
    for (int k = 0; k < inflow->n_inlets; k++) size += 2 + 2 * inflow->inlet[k].n_sites;
    return size;
}

void gr_inflow_state(const struct gr_inflow *inflow, int64_t *out)
{
    *out++ = inflow->next_id;
    for (int k = 0; k < inflow->n_inlets; k++) {
        const struct gr_inlet *inlet = &inflow->inlet[k];
        *out++ = inlet->due;
        *out++ = inlet->missed;
        for (int64_t i = 0; i < inlet->n_sites; i++) *out++ = inlet->entered[i];
        for (int64_t i = 0; i < inlet->n_sites; i++) *out++ = inlet->waits[i];
    }
}

/* True if each point of an inlet that was due has entered, waits, or was missed. */
static int state_is_valid(const struct gr_inlet *inlet, const int64_t *state)
{
    const int64_t n = inlet->n_sites, most = INT64_MAX / 4 / n;
    int64_t sum = state[1];
    if (state[0] < 0 || state[0] > INT64_MAX / 4 || state[1] < 0 || state[1] > state[0]) return 0;
    for (int64_t i = 0; i < 2 * n; i++) {
        const int64_t number = state[2 + i];
        if (number < 0 || number > (i < n ? most : inlet->yields)) return 0;
        sum += number;
    }
    return sum == state[0];
}

int gr_inflow_restore(struct gr_inflow *inflow, const int64_t *state)
{
    const int64_t *of = state + 1;
    for (int k = 0; k < inflow->n_inlets; k++, of += 2 + 2 * inflow->inlet[k - 1].n_sites)
        if (!state_is_valid(&inflow->inlet[k], of)) return GR_ERR_CONFIG;
    if (*state < 0 || *state > INT64_MAX / 4) return GR_ERR_CONFIG;
    inflow->next_id = *state++;
    for (int k = 0; k < inflow->n_inlets; k++) {
        struct gr_inlet *inlet = &inflow->inlet[k];
        inlet->due = *state++;
        inlet->missed = *state++;
        memcpy(inlet->entered, state, sizeof *state * (size_t)inlet->n_sites), state += inlet->n_sites;
        memcpy(inlet->waits, state, sizeof *state * (size_t)inlet->n_sites), state += inlet->n_sites;
    }
    return GR_OK;
}
