/* The gas of SPH: its memory, its time step, and the jets that drive it. */
#include "sph/gas.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

#include "sph/sph.h"

int gr_sph_take_gas(struct gr_sph *s, const double *parameter, int n_jets, const struct gr_sph_jet *jets)
{
    if (n_jets < 0 || n_jets > GR_SPH_MAX_JETS || s->gas || s->id) return GR_ERR_CONFIG;
    s->gas = gr_calloc(1, sizeof *s->gas);
    if (!s->gas) return GR_ERR_MEMORY;
    memcpy(s->gas->parameter, parameter, sizeof s->gas->parameter);
    s->gas->n_jets = n_jets;
    if (n_jets) memcpy(s->gas->jet, jets, sizeof *jets * (size_t)n_jets);
    s->dt = gr_sph_stable_dt(s);
    return GR_OK;
}

void gr_sph_free_gas_places(struct gr_sph *s)
{
    if (!s->gas) return;
    gr_free(s->gas->volume);
    gr_free(s->gas->end);
    s->gas->volume = NULL, s->gas->end = NULL;
}

void gr_sph_free_gas(struct gr_sph *s)
{
    gr_sph_free_gas_places(s);
    gr_free(s->gas);
    s->gas = NULL;
}

int gr_sph_make_gas_places(struct gr_sph *s, int64_t capacity)
{
    struct gr_sph_gas *gas = s->gas;
    const size_t n = (size_t)capacity;
    if (!gas) return GR_OK;
    gr_sph_free_gas_places(s);
    double *numbers = gas->volume = gr_calloc(15 * n, sizeof *numbers);
    gas->end = gr_calloc(n, sizeof *gas->end);
    if (!numbers || !gas->end) return GR_ERR_MEMORY;
    gas->pull = numbers + n, gas->own_pull = numbers + 2 * n, gas->per_mass = numbers + 3 * n, gas->load = numbers + 4 * n;
    for (int k = 0; k < 3; k++) gas->push[k] = numbers + (size_t)(5 + k) * n, gas->drag[k] = numbers + (size_t)(8 + k) * n;
    for (int k = 0; k < 3; k++) gas->carry[k] = numbers + (size_t)(11 + k) * n;
    gas->gain = numbers + 14 * n;
    return GR_OK;
}

/* Accelerate the gas for a time, and give the points in a jet its velocity. */
static void accelerate(const struct gr_sph *s, double seconds, int64_t first, int64_t last)
{
    const struct gr_sph_config *c = &s->config;
    double *const *x = gr_sph_rows(s, GR_SPH_FIELD_x), *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    double *const *acceleration = gr_sph_rows(s, GR_SPH_FIELD_a);
    for (int d = 0; d < c->dim; d++)
        for (int64_t a = first; a < last; a++) v[d][a] += seconds * acceleration[d][a];
    for (int k = 0; k < s->gas->n_jets; k++)
        for (int64_t a = first; a < last; a++) {
            const struct gr_sph_jet *jet = &s->gas->jet[k];
            int inside = 1;
            for (int d = 0; d < c->dim; d++) {
                const double length = c->upper[d] - c->lower[d];
                const double at = x[d][a] - (c->periodic[d] ? length * floor((x[d][a] - c->lower[d]) / length) : 0.0);
                inside &= at >= jet->lower[d] && at <= jet->upper[d];
            }
            for (int d = 0; d < c->dim && inside; d++) v[d][a] = jet->velocity[d];
        }
}

void gr_sph_drift_gas(struct gr_sph *s, int64_t first, int64_t last)
{
    double *const *x = gr_sph_rows(s, GR_SPH_FIELD_x), *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    accelerate(s, 0.5 * s->dt, first, last);
    for (int d = 0; d < s->config.dim; d++)
        for (int64_t a = first; a < last; a++) x[d][a] += s->dt * v[d][a];
}

/* Exchange mass, and momentum with it, for a time. The force of an acceleration is unchanged by the change of mass. */
static void exchange(const struct gr_sph *s, double seconds, int64_t first, int64_t last)
{
    double *const *v = gr_sph_rows(s, GR_SPH_FIELD_v), *const *acceleration = gr_sph_rows(s, GR_SPH_FIELD_a);
    double *mass = gr_sph_rows(s, GR_SPH_FIELD_mass)[0];
    for (int64_t a = first; a < last; a++) {
        const double before = mass[a], after = before + seconds * s->gas->gain[a];
        for (int d = 0; d < s->config.dim; d++) {
            v[d][a] = (before * v[d][a] + seconds * s->gas->carry[d][a]) / after;
            acceleration[d][a] = s->gravity[d] + (acceleration[d][a] - s->gravity[d]) * (before / after);
        }
        mass[a] = after;
    }
}

void gr_sph_kick_gas(struct gr_sph *s, double dt, int64_t first, int64_t last, struct gr_sph_extremes *extremes)
{
    double *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    if (dt > 0 && s->gas->parameter[GR_SPH_GAS_P_diffusion] > 0) exchange(s, dt, first, last);
    accelerate(s, 0.5 * dt, first, last);
    for (int64_t a = first; a < last; a++) {
        double square = 0.0;
        for (int d = 0; d < s->config.dim; d++) square += v[d][a] * v[d][a];
        if (square > extremes->gas_speed2) extremes->gas_speed2 = square;
    }
}
