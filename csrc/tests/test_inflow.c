/* Tests of mpm/inflow.c: when, where and with which number points enter, memory, and refused input. */
#include "mpm/inflow.h"

#include <string.h>

#include "mpm/migrate.h"
#include "tests/check.h"
#include "tests/faults.h"
#include "tests/scene.h"

enum { SITES = 4, MOST = 300 };
static const double SPACING = 0.05, SPEED = 2, MASS = 3.75;

/* A stream of single points from SITES sites of the left end, 0.05 m from each other; their x, v and mass are put into
 * `record`. */
static struct gr_inlet default_inlet(const struct gr_engine *e, double *record)
{
    memset(record, 0, sizeof *record * (size_t)(SITES * e->points.n_components));
    for (int i = 0; i < SITES; i++) {
        double *point = record + i * e->points.n_components;
        point[0] = -1, point[1] = 2.2 + 0.05 * (i + 0.5);
        point[gr_component_of(e, GR_FIELD_v)] = SPEED;
        point[gr_component_of(e, GR_FIELD_mass)] = MASS;
    }
    return (struct gr_inlet){
        .n_sites = SITES, .velocity = {SPEED}, .spacing = SPACING, .end = INFINITY, .record = record, .yields = 0};
}

/* An empty scene whose right end is open, with slots for `capacity` points, and an inlet at the left end if asked for. */
static void empty(struct scene *s, int64_t capacity, int has_inlet)
{
    double record[SITES * 16];
    scene_default(s, 2, GR_QUADRATIC, GR_AFFINE_NONE, 0);
    s->config.open_high[0] = 1;
    CHECK(scene_build(s, 0, 0, 1) == GR_OK);
    s->capacity = capacity;
    scene_bind(s);
    CHECK(s->engine->points.n_components <= 16);
    const struct gr_inlet inlet = default_inlet(s->engine, record);
    if (has_inlet) CHECK(gr_inflow_add(s->engine, &inlet) == GR_OK);
}

/* Advance to a step, with more memory whenever there is too little.
 * Returned: the number of times that there was. */
static int advance_to(struct scene *s, int64_t step)
{
    int grown = 0, error = GR_OK;
    while (s->engine->clock.step < step) {
        error = gr_advance(s->engine, gr_kernels_select("baseline"), step - s->engine->clock.step, INFINITY, 1);
        if (error && error != GR_ERR_CAPACITY) break;
        if (error) CHECK(!scene_grow(s));
        grown += error != GR_OK;
    }
    CHECK(error == GR_OK || error == GR_ERR_CAPACITY);
    return grown;
}

static double interval(void) { return SPACING / SPEED / SITES; }

TEST(points_enter_when_and_where_they_are_due)
{
    struct scene s;
    empty(&s, 64, 1);
    struct gr_engine *e = s.engine;
    e->inflow->next_id = 17;
    CHECK(gr_regroup(e, NULL) == GR_OK);
    CHECK(gr_reserve_pending(e, 64) == GR_OK);
    faults_at(0);
    for (int n = 0; n < 30; n++) {
        e->clock.time = (n + 0.5) * interval();
        gr_inflow_enter(e);
        CHECK(e->migration.n_pending == n && e->points.n == n && e->inflow->inlet[0].due == n);
    }
    CHECK(faults_calls() == 0); /* nothing is allocated */
    for (int j = 0; j < 29; j++) {
        const double *record = e->migration.pending + j * e->points.n_components;
        CHECK(e->migration.pending_id[j] == 17 + j);
        CHECK_NEAR(record[0], -1 + SPEED * 0.5 * interval(), 1e-14); /* entered half an interval after it was due */
        CHECK_NEAR(record[1], 2.2 + 0.05 * (j % SITES + 0.5), 1e-14);
    }
    scene_free(&s);
}

/* At each number of steps the mass is the rate times the time to within one point, and all of it is accounted for. */
TEST(mass_is_exact_to_a_point)
{
    struct scene s;
    empty(&s, 2560, 1);
    struct gr_engine *e = s.engine;
    for (int step = 10; step <= 1500; step += 10) {
        advance_to(&s, step);
        const int64_t due = (int64_t)floor(e->clock.time / interval());
        double mass = 0;
        int64_t entered = 0, held = 0;
        for (int i = 0; i < SITES; i++) entered += e->inflow->inlet[0].entered[i];
        for (int64_t k = 0; k < s.capacity; k++)
            if (s.id[k] >= 0) mass += *scene_at(&s, GR_FIELD_mass, 0, k), held++;
        CHECK(entered == due && e->inflow->next_id == due);
        CHECK(held == e->points.n && held == entered - e->dropped);
        CHECK(mass + e->dropped_mass == MASS * (double)entered); /* sums of 3.75 are exact */
    }
    CHECK(e->dropped > 50);
    scene_free(&s);
}

/* Memory grows with the points, and the growth changes no bit. In the steady state slots are used again. */
TEST(places_grow_and_are_used_again)
{
    struct scene small, large;
    empty(&small, 16, 1);
    empty(&large, 2560, 1);
    int grown = advance_to(&small, 1200);
    CHECK(grown > 1 && advance_to(&large, 1200) == 0);
    CHECK(!scene_differs(&large, &small));
    const int64_t dropped = small.engine->dropped, capacity = small.capacity;
    CHECK(dropped > 0);
    grown = advance_to(&small, 3600);
    advance_to(&large, 3600);
    CHECK(small.engine->dropped > dropped + capacity); /* more points than slots have passed */
    CHECK(grown <= 1);
    for (int64_t k = 0; k < small.capacity; k++)
        for (int64_t j = k + 1; small.id[k] >= 0 && j < small.capacity; j++) CHECK(small.id[j] != small.id[k]);
    CHECK(!scene_differs(&large, &small));
    scene_free(&small);
    scene_free(&large);
}

/* One point waits at each site of an inlet that is blocked, and the others are missed. It enters when the way is free. */
TEST(a_blocked_inlet_waits)
{
    struct scene s;
    double record[SITES * 16];
    empty(&s, 64, 0);
    struct gr_engine *e = s.engine;
    struct gr_inlet inlet = default_inlet(e, record);
    inlet.yields = 1;
    CHECK(gr_inflow_add(e, &inlet) == GR_OK);
    CHECK(gr_regroup(e, NULL) == GR_OK && gr_reserve_pending(e, 64) == GR_OK);
    const struct gr_inlet *state = &e->inflow->inlet[0];
    for (int n = 1; n <= 5 * SITES; n++) { /* nothing moves on: the first of each site stands in the way */
        e->clock.time = n * interval() * (1 + 1e-12);
        gr_inflow_enter(e);
    }
    CHECK(e->migration.n_pending == SITES && state->due == 5 * SITES && state->missed == 3 * SITES);
    for (int i = 0; i < SITES; i++) CHECK(state->entered[i] == 1 && state->waits[i] == 1);
    for (int k = 0; k < SITES; k++) e->migration.pending[k * e->points.n_components] += SPACING; /* now it has moved */
    e->clock.time += 0.1 * interval();
    gr_inflow_enter(e);
    for (int i = 0; i < SITES; i++) CHECK(state->entered[i] == 2 && state->waits[i] == 0);
    CHECK(e->migration.n_pending == 2 * SITES && state->due == 5 * SITES && state->missed == 3 * SITES);
    scene_free(&s);
}

TEST(inlets_that_cannot_be_are_refused)
{
    struct scene s;
    double record[SITES * 16];
    empty(&s, 64, 0);
    const int mass = gr_component_of(s.engine, GR_FIELD_mass);
#define REFUSED(change)                                          \
    do {                                                         \
        struct gr_inlet inlet = default_inlet(s.engine, record); \
        change;                                                  \
        CHECK(gr_inflow_add(s.engine, &inlet) == GR_ERR_CONFIG); \
        CHECK(!s.engine->inflow || !s.engine->inflow->n_inlets); \
    } while (0)
    REFUSED(inlet.n_sites = 0);
    REFUSED(inlet.n_sites = -1);
    REFUSED(inlet.axis = -1);
    REFUSED(inlet.axis = 2);
    REFUSED(inlet.axis = 1); /* no velocity along it */
    REFUSED(inlet.spacing = 0);
    REFUSED(inlet.spacing = NAN);
    REFUSED(inlet.velocity[0] = INFINITY);
    REFUSED(inlet.velocity[2] = NAN);
    REFUSED(inlet.velocity[0] = 1e-320); /* the time between two points is not finite */
    REFUSED(inlet.begin = -1);
    REFUSED(inlet.begin = NAN);
    REFUSED((inlet.begin = 2, inlet.end = 1));
    REFUSED(inlet.end = NAN);
    REFUSED(record[0] = -1.001);
    REFUSED(record[1] = NAN);
    REFUSED(record[mass] = 0);
#undef REFUSED
    scene_free(&s);
}

TEST(a_run_takes_no_more_inlets)
{
    struct scene s;
    double record[SITES * 16];
    empty(&s, 2560, 1);
    advance_to(&s, 50);
    const struct gr_inlet inlet = default_inlet(s.engine, record);
    CHECK(gr_inflow_add(s.engine, &inlet) == GR_ERR_CONFIG && s.engine->inflow->n_inlets == 1);
    scene_free(&s);
}

/* A state is given back as it was; one that cannot be changes nothing. */
TEST(state_is_restored)
{
    enum { SIZE = 3 + 2 * SITES };
    struct scene s;
    int64_t state[SIZE], other[SIZE], after[SIZE];
    empty(&s, 2560, 1);
    advance_to(&s, 100);
    struct gr_inlets *inflow = s.engine->inflow;
    CHECK(gr_inlets_size(inflow) == SIZE);
    gr_inlets_state(inflow, state);
    CHECK(state[0] == state[1] && state[1] > SITES && state[2] == 0);
    for (int k = 0; k < SIZE; k++)
        for (int v = 0; v < 2; v++) {
            memcpy(other, state, sizeof state);
            other[k] = v ? -1 : k ? state[k] + 1 : INT64_MAX;
            CHECK(gr_inlets_restore(inflow, other) == GR_ERR_CONFIG);
            gr_inlets_state(inflow, after);
            CHECK(!memcmp(after, state, sizeof state));
        }
    memset(other, 0, sizeof other);
    CHECK(gr_inlets_restore(inflow, other) == GR_OK && inflow->next_id == 0 && inflow->inlet[0].due == 0);
    CHECK(gr_inlets_restore(inflow, state) == GR_OK);
    gr_inlets_state(inflow, after);
    CHECK(!memcmp(after, state, sizeof state));
    scene_free(&s);
}

/* An inlet that cannot be added for want of memory leaves the others as they were. */
TEST(adding_fails)
{
    for (int present = 0; present < 2; present++) {
        struct scene s;
        double record[SITES * 16];
        empty(&s, 64, present);
        const struct gr_inlet inlet = default_inlet(s.engine, record);
        long n = 0;
        int error;
        do {
            faults_at(++n);
            error = gr_inflow_add(s.engine, &inlet);
            const int hit = faults_end();
            CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
            const int inlets = s.engine->inflow ? s.engine->inflow->n_inlets : 0;
            CHECK(inlets == present + !error);
            if (present) CHECK(s.engine->inflow->inlet[0].record && s.engine->inflow->inlet[0].n_sites == SITES);
        } while (error && n < MOST);
        CHECK(n > 3 && n < MOST);
        scene_free(&s);
    }
}

/* Each allocation of a run fails once, while the stream grows: the error is reported, no point is lost or comes twice, and
 * the run goes on with the bits of one that never failed. */
TEST(advancing_fails)
{
    enum { STEPS = 300 };
    long n = 0;
    int hit, within = 0;
    struct scene good;
    empty(&good, 2560, 1);
    advance_to(&good, STEPS);
    CHECK(good.engine->points.n > 8 * SITES);
    do {
        struct scene s;
        empty(&s, 2560, 1);
        faults_at(++n);
        const int error = gr_advance(s.engine, gr_kernels_select("baseline"), STEPS, INFINITY, 1);
        hit = faults_end();
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        within += hit && s.engine->clock.step > 0;
        advance_to(&s, STEPS);
        CHECK(s.engine->clock.step == STEPS && s.engine->clock.time == good.engine->clock.time);
        CHECK(s.engine->inflow->next_id == good.engine->inflow->next_id);
        CHECK(!scene_differs(&good, &s));
        scene_free(&s);
    } while (hit && n < MOST);
    CHECK(n > 6 && n < MOST && within > 0);
    scene_free(&good);
}

/* The reserve of points is one more than the largest number that can enter in a step: the one that waits, and the points of
 * nearly two intervals, the last of which is nearly a spacing away from its site. */
TEST(reserve_is_enough)
{
    struct scene s;
    double record[SITES * 16];
    empty(&s, 64, 0);
    struct gr_engine *e = s.engine;
    struct gr_inlet inlet = default_inlet(e, record);
    const double dt = gr_longest_dt(&e->config), every = dt / 1.993;
    inlet.n_sites = inlet.yields = 1;
    inlet.spacing = SPEED * every;
    CHECK(gr_inflow_add(e, &inlet) == GR_OK);
    CHECK(gr_regroup(e, NULL) == GR_OK && gr_reserve_pending(e, 64) == GR_OK);
    e->clock.time = 1.5 * every;
    gr_inflow_enter(e);
    e->clock.time = 2.995 * every; /* the way is taken */
    gr_inflow_enter(e);
    CHECK(e->migration.n_pending == 1 && e->inflow->inlet[0].waits[0] == 1);
    e->migration.pending[0] = -0.5; /* it is free */
    e->clock.time += dt;
    gr_inflow_enter(e);
    CHECK(e->migration.n_pending - 1 == 3 && e->inflow->inlet[0].waits[0] == 0);
    CHECK(gr_inflow_most(e) == 3 + 1);
    scene_free(&s);
}

/* A time that was set makes many points due at once: they enter later, and none is written beyond the reserve. */
TEST(points_that_are_late_enter_later)
{
    struct scene s;
    empty(&s, 64, 1);
    struct gr_engine *e = s.engine;
    CHECK(gr_regroup(e, NULL) == GR_OK && gr_reserve_pending(e, 64) == GR_OK);
    e->clock.time = 1e9;
    gr_inflow_enter(e);
    CHECK(e->inflow->inlet[0].due == gr_inflow_most(e) && e->migration.n_pending <= gr_inflow_most(e));
    scene_free(&s);
}
