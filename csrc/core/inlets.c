/* The schedule of points that enter a running simulation (inlets.h). */
#include "core/inlets.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/index.h"
#include "core/memory.h"

/* Nearest distance of points of a column, in spacings. One that waits enters when there is its whole spacing, but for
 * rounding. One that comes in time may be 2 % nearer, as points that fly alone lose a little of their velocity (nodes
 * that they hardly reach have none), and the stream would lose its rhythm: the filling fraction is never more than that
 * too large. */
#define FREE_DISTANCE (1 - 1e-6)
#define TIMELY_DISTANCE 0.98
#define MOST_AT_ONCE 1000000000000 /* more than there is memory for */

/* Time between two points of an inlet. */
static double interval(const struct gr_inlet *inlet)
{
    return inlet->spacing / (fabs(inlet->velocity[inlet->axis]) * (double)inlet->n_sites);
}

int gr_inlet_is_valid(const struct gr_inlet *inlet, int dim, int n_components)
{
    if (inlet->n_sites < 1 || inlet->n_sites > INT32_MAX || inlet->axis < 0 || inlet->axis >= dim) return 0;
    if (!(inlet->spacing > 0) || !isfinite(inlet->spacing) || !(inlet->begin >= 0) || !isfinite(inlet->begin)) return 0;
    for (int d = 0; d < 3; d++)
        if (!isfinite(inlet->velocity[d])) return 0;
    const double period = inlet->spacing / fabs(inlet->velocity[inlet->axis]) / (double)inlet->n_sites;
    if (!isfinite(period) || !(period > 0)) return 0;
    for (int64_t i = 0; i < inlet->n_sites * n_components; i++)
        if (!isfinite(inlet->record[i])) return 0;
    return inlet->end >= inlet->begin;
}

static void free_inlet(struct gr_inlet *inlet)
{
    gr_free(inlet->record);
    gr_free(inlet->entered);
    gr_free(inlet->waits);
}

int gr_inlets_add(struct gr_inlets **inlets, const struct gr_inlet *inlet, int n_components)
{
    const size_t n = (size_t)inlet->n_sites, bytes = sizeof(double) * n * (size_t)n_components;
    struct gr_inlet new = *inlet;
    if (!*inlets) *inlets = gr_calloc(1, sizeof **inlets);
    if (!*inlets) return GR_ERR_MEMORY;
    GR_RESIZE((*inlets)->inlet, (*inlets)->n_inlets + 1);
    new.record = gr_malloc(bytes);
    new.entered = gr_calloc(n, sizeof(int64_t));
    new.waits = gr_calloc(n, sizeof(int64_t));
    new.due = new.missed = 0;
    if (!new.record || !new.entered || !new.waits) {
        free_inlet(&new);
        return GR_ERR_MEMORY;
    }
    memcpy(new.record, inlet->record, bytes);
    (*inlets)->inlet[(*inlets)->n_inlets++] = new;
    return GR_OK;
}

void gr_inlets_free(struct gr_inlets *inlets)
{
    for (int k = 0; inlets && k < inlets->n_inlets; k++) free_inlet(&inlets->inlet[k]);
    if (inlets) gr_free(inlets->inlet);
    gr_free(inlets);
}

int64_t gr_inlet_most(const struct gr_inlet *inlet, double seconds)
{
    const int64_t waiting = inlet->yields ? inlet->n_sites : 0;
    /* The points of as many intervals and one more; and another one, for the rounding of times. */
    return gr_index(seconds / interval(inlet), 0, MOST_AT_ONCE) + 2 + waiting;
}

double gr_inlets_speed(const struct gr_inlets *inlets)
{
    double largest = 0;
    for (int k = 0; inlets && k < inlets->n_inlets; k++) {
        const double *v = inlets->inlet[k].velocity;
        largest = fmax(largest, sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
    }
    return largest;
}

/* Let the point of a site enter. Returned: 0 if its position is occupied. */
static int enter_at(struct gr_inlet *inlet, int64_t site, double since, double distance, gr_enter *enter, void *engine)
{
    if (!enter(engine, inlet, site, since, distance)) return 0;
    inlet->entered[site]++;
    return 1;
}

/* What calls `enter`: `asks`: only to ask. */
struct entry {
    struct gr_inlets *inlets;
    double time, seconds;
    gr_enter *enter;
    void *engine;
    int asks;
};

/* Let the points enter that have waited. */
static void enter_waiting(const struct entry *entry, struct gr_inlet *inlet)
{
    if (!inlet->yields || entry->time > inlet->end) return;
    for (int64_t i = 0; i < inlet->n_sites; i++) {
        if (!inlet->waits[i]) continue;
        if (entry->asks)
            (void)entry->enter(entry->engine, inlet, i, 0, FREE_DISTANCE);
        else if (enter_at(inlet, i, 0, FREE_DISTANCE, entry->enter, entry->engine))
            inlet->waits[i] = 0;
        entry->inlets->candidate++;
    }
}

/* Let the points enter that are due. */
static void enter_due(const struct entry *entry, struct gr_inlet *inlet)
{
    const double every = interval(inlet);
    int64_t most = gr_inlet_most(inlet, entry->seconds) - (inlet->yields ? inlet->n_sites : 0), due = inlet->due;
    for (; most > 0; most--, due++) {
        const double at = inlet->begin + (double)(due + 1) * every;
        const int64_t site = due % inlet->n_sites;
        if (!(at <= entry->time && at <= inlet->end)) break;
        if (entry->asks)
            (void)entry->enter(entry->engine, inlet, site, entry->time - at, TIMELY_DISTANCE);
        else if (inlet->waits[site])
            inlet->missed++;
        else
            inlet->waits[site] = !enter_at(inlet, site, entry->time - at, TIMELY_DISTANCE, entry->enter, entry->engine);
        entry->inlets->candidate++;
    }
    if (!entry->asks) inlet->due = due;
}

static int64_t enter_all(const struct entry *entry)
{
    struct gr_inlets *inlets = entry->inlets;
    inlets->candidate = 0;
    for (int k = 0; k < inlets->n_inlets; k++) {
        enter_waiting(entry, &inlets->inlet[k]);
        enter_due(entry, &inlets->inlet[k]);
    }
    return inlets->candidate;
}

void gr_inlets_enter(struct gr_inlets *inlets, double time, double seconds, gr_enter *enter, void *engine)
{
    (void)enter_all(&(struct entry){inlets, time, seconds, enter, engine, 0});
}

int64_t gr_inlets_ask(struct gr_inlets *inlets, double time, double seconds, gr_enter *enter, void *engine)
{
    return enter_all(&(struct entry){inlets, time, seconds, enter, engine, 1});
}

int64_t gr_inlets_size(const struct gr_inlets *inlets)
{
    int64_t size = 1;
    for (int k = 0; k < inlets->n_inlets; k++) size += 2 + 2 * inlets->inlet[k].n_sites;
    return size;
}

void gr_inlets_state(const struct gr_inlets *inlets, int64_t *out)
{
    *out++ = inlets->next_id;
    for (int k = 0; k < inlets->n_inlets; k++) {
        const struct gr_inlet *inlet = &inlets->inlet[k];
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

int gr_inlets_restore(struct gr_inlets *inlets, const int64_t *state)
{
    const int64_t *of = state + 1;
    for (int k = 0; k < inlets->n_inlets; k++, of += 2 + 2 * inlets->inlet[k - 1].n_sites)
        if (!state_is_valid(&inlets->inlet[k], of)) return GR_ERR_CONFIG;
    if (*state < 0 || *state > INT64_MAX / 4) return GR_ERR_CONFIG;
    inlets->next_id = *state++;
    for (int k = 0; k < inlets->n_inlets; k++) {
        struct gr_inlet *inlet = &inlets->inlet[k];
        inlet->due = *state++;
        inlet->missed = *state++;
        memcpy(inlet->entered, state, sizeof *state * (size_t)inlet->n_sites), state += inlet->n_sites;
        memcpy(inlet->waits, state, sizeof *state * (size_t)inlet->n_sites), state += inlet->n_sites;
    }
    return GR_OK;
}
