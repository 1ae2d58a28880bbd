/* Particles and points of gas that enter a simulation by SPH (inflow.h). */
#include "sph/inflow.h"

#include <math.h>
#include <string.h>

#include "core/memory.h"
#include "core/simd.h"
#include "sph/sph.h"

static int is_valid(const struct gr_sph *s, const struct gr_inlet *inlet, const struct gr_sph_box *box)
{
    const int n = gr_sph_row_count(s), mass = (int)(gr_sph_rows(s, GR_SPH_FIELD_mass) - s->row);
    if (s->id || (box->is_gas && !s->gas) || inlet->yields || !gr_inlet_is_valid(inlet, s->config.dim, n)) return 0;
    for (int64_t i = 0; i < inlet->n_sites; i++)
        if (!(inlet->record[i * n + mass] > 0)) return 0;
    for (int d = 0; d < s->config.dim && !box->is_gas; d++)
        if (!isfinite(box->lower[d]) || !isfinite(box->upper[d]) || !(box->lower[d] < box->upper[d])) return 0;
    return 1;
}

static int add(struct gr_sph_inflow *inflow, const struct gr_inlet *inlet, const struct gr_sph_box *box, int n_components)
{
    const int n = inflow->inlets ? inflow->inlets->n_inlets : 0;
    GR_RESIZE(inflow->box, n + 1);
    inflow->box[n] = *box;
    return gr_inlets_add(&inflow->inlets, inlet, n_components);
}

int gr_sph_add_inlet(struct gr_sph *s, const struct gr_inlet *inlet, const struct gr_sph_box *box)
{
    if (!is_valid(s, inlet, box)) return GR_ERR_CONFIG;
    if (!s->inflow) s->inflow = gr_calloc(1, sizeof *s->inflow);
    if (!s->inflow) return GR_ERR_MEMORY;
    const int error = add(s->inflow, inlet, box, gr_sph_row_count(s));
    if (error && !(s->inflow->inlets && s->inflow->inlets->n_inlets)) gr_sph_free_inflow(s);
    return error;
}

static void free_places(struct gr_sph_inflow *inflow)
{
    gr_free(inflow->held);
    gr_free(inflow->by);
    inflow->held = inflow->by = NULL, inflow->n_held = 0;
}

void gr_sph_free_inflow(struct gr_sph *s)
{
    if (!s->inflow) return;
    free_places(s->inflow);
    gr_inlets_free(s->inflow->inlets);
    gr_free(s->inflow->box);
    gr_free(s->inflow);
    s->inflow = NULL;
}

int gr_sph_make_inflow_places(struct gr_sph *s, int64_t capacity)
{
    struct gr_sph_inflow *inflow = s->inflow;
    if (!inflow) return GR_OK;
    free_places(inflow);
    inflow->held = gr_malloc(sizeof *inflow->held * (size_t)capacity);
    inflow->by = gr_malloc(sizeof *inflow->by * (size_t)capacity);
    return inflow->held && inflow->by ? GR_OK : GR_ERR_MEMORY;
}

int gr_sph_has_capacity(const struct gr_sph *s, double dt)
{
    const struct gr_inlets *inlets = s->inflow->inlets;
    int64_t most[2] = {0, 0}; /* of particles, of gas */
    for (int k = 0; k < inlets->n_inlets; k++) most[s->inflow->box[k].is_gas] += gr_inlet_most(&inlets->inlet[k], dt);
    const int64_t gas_end = s->gas_first + s->n_gas + (s->gas ? GR_LANES : 0);
    return s->n_particles + most[0] + GR_LANES <= s->wall_first && gas_end + most[1] <= s->capacity;
}

/* See gr_enter; gr_sph_has_capacity was true. */
static int enter(void *engine, struct gr_inlet *inlet, int64_t site, double since, double distance)
{
    struct gr_sph *s = engine;
    struct gr_inlets *inlets = s->inflow->inlets;
    const int is_gas = s->inflow->box[inlet - inlets->inlet].is_gas, n = gr_sph_row_count(s);
    const int64_t row = is_gas ? s->gas_first + s->n_gas++ : s->n_particles++;
    (void)distance; /* nothing waits */
    for (int k = 0; k < n; k++) s->row[k][row] = inlet->record[site * n + k];
    for (int d = 0; d < s->config.dim; d++) gr_sph_rows(s, GR_SPH_FIELD_x)[d][row] += inlet->velocity[d] * since;
    s->id[row] = inlets->next_id++;
    return 1;
}

int gr_sph_enter(struct gr_sph *s)
{
    const int64_t before = s->inflow->inlets->next_id;
    gr_inlets_enter(s->inflow->inlets, s->time, s->dt, enter, s);
    return s->inflow->inlets->next_id > before;
}

static int is_within(const struct gr_sph *s, const struct gr_sph_box *box, int field, int64_t row)
{
    double *const *x = gr_sph_rows(s, field);
    for (int d = 0; d < s->config.dim; d++)
        if (!(x[d][row] >= box->lower[d] && x[d][row] <= box->upper[d])) return 0;
    return 1;
}

void gr_sph_list_held(struct gr_sph *s)
{
    struct gr_sph_inflow *inflow = s->inflow;
    inflow->n_held = 0;
    for (int64_t a = 0; a < s->n_particles; a++)
        for (int k = 0; k < inflow->inlets->n_inlets; k++) {
            if (inflow->box[k].is_gas || !is_within(s, &inflow->box[k], GR_SPH_FIELD_anchor, a)) continue;
            inflow->held[inflow->n_held] = (int32_t)a, inflow->by[inflow->n_held++] = k;
            break;
        }
}

void gr_sph_push(struct gr_sph *s, double dt)
{
    for (int k = 0; k < s->inflow->inlets->n_inlets; k++) {
        struct gr_sph_box *box = &s->inflow->box[k];
        for (int d = 0; d < s->config.dim; d++) {
            const double impulse = 0.5 * dt * box->force[d];
            box->impulse[d] += impulse;
            box->work += impulse * s->inflow->inlets->inlet[k].velocity[d];
        }
    }
}

void gr_sph_hold(struct gr_sph *s, double dt)
{
    struct gr_sph_inflow *inflow = s->inflow;
    double *const *v = gr_sph_rows(s, GR_SPH_FIELD_v), *const *a = gr_sph_rows(s, GR_SPH_FIELD_a);
    const double *mass = gr_sph_rows(s, GR_SPH_FIELD_mass)[0];
    for (int k = 0; k < inflow->inlets->n_inlets; k++) memset(inflow->box[k].force, 0, sizeof inflow->box[k].force);
    for (int64_t i = 0; i < inflow->n_held; i++) {
        const int64_t row = inflow->held[i];
        const struct gr_inlet *inlet = &inflow->inlets->inlet[inflow->by[i]];
        struct gr_sph_box *box = &inflow->box[inflow->by[i]];
        if (!(s->time < inlet->end) || !is_within(s, box, GR_SPH_FIELD_x, row)) continue;
        for (int d = 0; d < s->config.dim; d++) {
            const double to = inlet->velocity[d], from = v[d][row]; /* they differ for one that came from outside */
            box->impulse[d] += mass[row] * (to - from);
            box->work += 0.5 * mass[row] * (to * to - from * from);
            box->force[d] -= mass[row] * a[d][row];
            v[d][row] = to, a[d][row] = 0.0;
        }
    }
    gr_sph_push(s, dt);
}
