/* Tests of mpm/migrate.c: points that cross cells, periodic ends, and closed and open sides. */
#include "mpm/migrate.h"
#include "core/memory.h"

#include <string.h>

#include "mpm/tally.h"
#include "tests/check.h"
#include "tests/scene.h"

/* Confine a point that moved from cell `from` to x along axis 0. */
static int confine(struct scene *s, double x[3], const int32_t from[3])
{
    int64_t at[3] = {0};
    for (int d = 0; d < s->config.dim; d++) at[d] = gr_locate(&s->engine->axis[d], 1 / s->config.dx, x[d]);
    const int inside = gr_confine(s->engine, x, at, from);
    for (int d = 0; inside && d < s->config.dim; d++) {
        const struct gr_axis *axis = &s->engine->axis[d];
        CHECK(at[d] >= 0 && at[d] < axis->n_cells && at[d] == gr_locate(axis, 1 / s->config.dx, x[d]));
        CHECK(x[d] >= axis->cell[at[d]].begin && x[d] < axis->cell[at[d]].end);
    }
    return inside;
}

TEST(periodic_ends)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++) {
        struct scene s;
        scene_default(&s, 2, basis, GR_AFFINE_NONE, 0);
        s.config.periodic[0] = 1;
        CHECK(scene_build(&s, 1, 0.4, 0.6) == GR_OK);
        const double low = -1 - 0.5 * s.config.dx * (basis == GR_UGIMP), length = 0.6;
        const double past[] = {1e-3, 1e-9, 1e-17};
        for (int k = 0; k < 3; k++) {
            double x[3] = {low - past[k], 2.3}, y[3] = {low + length + past[k], 2.3};
            CHECK(confine(&s, x, (int32_t[3]){0, 2}));
            CHECK(confine(&s, y, (int32_t[3]){5, 2}));
            if (k == 2) continue; /* lost in rounding: it only has to be inside */
            CHECK_NEAR(x[0], low - past[k] + length, 1e-15);
            CHECK_NEAR(y[0], low + past[k], 1e-15);
        }
        CHECK(s.engine->clamped == 0);
        scene_free(&s);
    }
}

TEST(closed_sides)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int scale = 0; scale < 2; scale++) {
            struct scene s;
            scene_default(&s, 2, basis, GR_AFFINE_NONE, 0);
            if (scale) s.config.lower[0] = 1e6; /* a grid far from zero, where few bits are left for a cell */
            CHECK(scene_build(&s, 1, 0.4, 0.6) == GR_OK);
            const double low = s.config.lower[0], high = s.engine->axis[0].origin + s.engine->axis[0].length;
            const double past[] = {0.05, 1e-9, 0};
            for (int k = 0; k < 3; k++) {
                double x[3] = {low - past[k], 2.3}, y[3] = {high + past[k], 2.3}, z[3] = {high + past[k], 2.6 + past[k]};
                CHECK(confine(&s, x, (int32_t[3]){0, 2}));
                CHECK(confine(&s, y, (int32_t[3]){s.engine->axis[0].n_cells - 1, 2}));
                CHECK(confine(&s, z, (int32_t[3]){s.engine->axis[0].n_cells - 1, s.engine->axis[1].n_cells - 1}));
                CHECK_NEAR(x[0], low, 1e-9);
                CHECK_NEAR(y[0], high, 1e-9);
                CHECK_NEAR(z[1], 2.6, 1e-9);
            }
            CHECK(s.engine->clamped > 0);
            scene_free(&s);
        }
}

/* Points leave through an open side, but not where all nodes of its face are walls. */
TEST(open_sides)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int axis = 0; axis < 2; axis++)
            for (int high = 0; high < 2; high++)
                for (int walled = 0; walled < 2; walled++) {
                    struct scene s;
                    scene_default(&s, 2, basis, GR_AFFINE_NONE, 0);
                    (high ? s.config.open_high : s.config.open_low)[axis] = 1;
                    s.walls[1] = (struct gr_wall){.fixed = 3, .opens_at = 2};
                    s.config.n_walls = 2;
                    scene_codes(&s);
                    if (walled) scene_face(&s, axis, high, 1);
                    CHECK(scene_build(&s, 1, 0.4, 0.6) == GR_OK);
                    const int32_t last = s.engine->axis[axis].n_cells - 1;
                    int32_t from[3] = {2, 2};
                    from[axis] = high ? last : 0;
                    double x[3] = {-0.7, 2.3}, y[3];
                    x[axis] = s.config.lower[axis] + (high ? 0.6 + 1e-4 : -1e-4);
                    memcpy(y, x, sizeof y);
                    CHECK(confine(&s, y, from) == walled);
                    s.engine->clock.time = 2; /* the wall opens */
                    memcpy(y, x, sizeof y);
                    CHECK(confine(&s, y, from) == 0);
                    memcpy(y, x, sizeof y); /* the other side stays closed */
                    y[axis] = s.config.lower[axis] + (high ? -1e-4 : 0.6 + 1e-4);
                    from[axis] = high ? 0 : last;
                    CHECK(confine(&s, y, from) == 1);
                    scene_free(&s);
                }
}

enum { LIST = 400 };

/* A list with the capacity for LIST points of the scene. */
static struct gr_migrants list_new(const struct scene *s)
{
    struct gr_migrants list = {.from = gr_malloc(sizeof(struct gr_migrant) * LIST),
                               .record = gr_malloc(sizeof(double) * (size_t)((LIST + 1) * s->engine->points.n_components)),
                               .id = gr_malloc(sizeof(int64_t) * (LIST + 1))};
    gr_clear_migrants(&list);
    return list;
}

static void list_free(struct gr_migrants *list)
{
    gr_free(list->from);
    gr_free(list->record);
    gr_free(list->id);
}

/* Put the listed points into other cells by hand, and migrate. */
TEST(moves_between_cells)
{
    struct scene s, before;
    for (int copy = 0; copy < 2; copy++) {
        struct scene *one = copy ? &before : &s;
        scene_seed(11);
        scene_default(one, 2, GR_QUADRATIC, GR_AFFINE_GRADIENT, 1);
        one->config.open_high[1] = 1;
        CHECK(scene_build(one, 300, 0.05, 0.95) == GR_OK);
        CHECK(gr_regroup(one->engine, NULL) == GR_OK);
    }
    struct gr_migrants list[2] = {list_new(&s), list_new(&s)};
    int64_t gone = 0;
    double mass = 0;
    struct gr_engine *e = s.engine;
    CHECK(gr_reserve_pending(e, 2 * (LIST + 1)) == GR_OK);
    for (int64_t c = 0; c < e->mesh.n_cells; c++)
        for (int32_t place = 0; place < e->mesh.cell[c].count; place++) {
            const int64_t k = gr_slot(&e->mesh.cell[c], place);
            if (s.id[k] % 3) continue;
            double *y = scene_at(&s, GR_FIELD_x, 1, k);
            *y += s.config.dx;
            *scene_at(&before, GR_FIELD_x, 1, scene_find(&before, s.id[k])) = *y;
            if (*y >= 2.6) gone++, mass += *scene_at(&s, GR_FIELD_mass, 0, k), before.id[scene_find(&before, s.id[k])] = -1;
            const int t = c >= e->mesh.n_cells / 2;
            list[t].from[list[t].count++] = (struct gr_migrant){.cell = c, .slot = k};
        }
    CHECK(gone > 0);
    for (int t = 0; t < 2; t++) gr_pack_migrants(e, &list[t], 0);
    CHECK(gr_migrate(e, list, 2, NULL) == GR_OK);
    CHECK(gr_tally_settle(e) == GR_OK);
    CHECK(e->dropped == gone && e->points.n == 300 - gone);
    CHECK_NEAR(e->dropped_mass, mass, 1e-12);
    if (e->migration.n_pending) CHECK(gr_regroup(e, NULL) == GR_OK);
    before.engine->points.n = 300 - gone;
    CHECK(!scene_differs(&before, &s));
    for (int64_t c = 0; c < e->mesh.n_cells; c++)
        for (int32_t place = 0; place < e->mesh.cell[c].capacity; place++) {
            const int64_t k = gr_slot(&e->mesh.cell[c], place);
            CHECK((s.id[k] < 0) == (place >= e->mesh.cell[c].count));
            for (int d = 0; d < 2; d++)
                CHECK(gr_locate(&e->axis[d], 1 / s.config.dx, *scene_at(&s, GR_FIELD_x, d, k)) == e->mesh.cell[c].at[d]);
        }
    for (int t = 0; t < 2; t++) list_free(&list[t]);
    scene_free(&s);
    scene_free(&before);
}

/* An invalid point is refused with its id. All points are back in their cells, and their number is unchanged. */
TEST(refuses_bad_points)
{
    const double bad[] = {NAN, INFINITY, 1e30, 0.35}; /* the last: two cells in one step */
    for (int k = 0; k < 4; k++) {
        struct scene s;
        scene_seed(3);
        scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
        CHECK(scene_build(&s, 20, 0.3, 0.5) == GR_OK);
        CHECK(gr_regroup(s.engine, NULL) == GR_OK);
        struct gr_migrants list = list_new(&s);
        const int64_t victim = 7;
        *scene_at(&s, GR_FIELD_x, 1, scene_find(&s, victim)) += bad[k];
        for (int again = 0; again < 40; again++) {
            gr_clear_migrants(&list);
            for (int64_t c = 0; c < s.engine->mesh.n_cells; c++)
                for (int32_t i = 0; i < s.engine->mesh.cell[c].count; i++)
                    list.from[list.count++] = (struct gr_migrant){.cell = c, .slot = gr_slot(&s.engine->mesh.cell[c], i)};
            CHECK(list.count == 20);
            gr_pack_migrants(s.engine, &list, 0);
            CHECK(gr_migrate(s.engine, &list, 1, NULL) == (k < 2 ? GR_ERR_NOT_FINITE : GR_ERR_RUNAWAY));
            CHECK(s.engine->failure.id == victim);
        }
        CHECK(s.engine->migration.n_pending == 0 && s.engine->points.n == 20);
        list_free(&list);
        scene_free(&s);
    }
}
