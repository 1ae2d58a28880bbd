/* Tests of mpm/slots.c: tiles that get more rows. */
#include "mpm/slots.h"

#include "mpm/migrate.h"
#include "tests/check.h"
#include "tests/scene.h"

static void build(struct scene *s, int dim)
{
    scene_seed(5);
    scene_default(s, dim, GR_QUADRATIC, GR_AFFINE_GRADIENT, 1);
    CHECK(scene_build(s, 500, 0.2, 0.8) == GR_OK);
    CHECK(gr_regroup(s->engine, NULL) == GR_OK);
}

/* The new rows are spare slots of their own behind all others, and no point moves. */
TEST(rows_are_added_once)
{
    for (int dim = 2; dim <= 3; dim++) {
        struct scene s, before;
        build(&s, dim);
        build(&before, dim);
        struct gr_engine *e = s.engine;
        const int64_t used = e->points.used, tile = e->mesh.n_tiles / 2;
        const struct gr_cell *cell = &e->mesh.cell[tile * GR_LANES];
        const int32_t rows = cell->capacity;
        CHECK(gr_grow_tile(e, tile) == 1 && e->migration.tiles_grown);
        CHECK(e->points.used == used + (int64_t)GR_LANES * (cell->capacity - rows) && cell->capacity > rows);
        for (int l = 0; l < GR_LANES; l++) {
            CHECK(cell[l].capacity == cell->capacity);
            for (int32_t k = 0; k < rows; k++) CHECK(gr_slot(&cell[l], k) < used);
            for (int32_t k = rows; k < cell->capacity; k++) {
                const int64_t slot = gr_slot(&cell[l], k);
                CHECK(slot == used + (int64_t)GR_LANES * (k - rows) + l && s.id[slot] < 0);
                for (int d = 0; d < dim; d++)
                    CHECK(gr_locate(&e->axis[d], 1 / s.config.dx, *scene_at(&s, GR_FIELD_x, d, slot)) == cell[l].at[d]);
            }
        }
        CHECK(!scene_differs(&before, &s));
        CHECK(gr_grow_tile(e, tile) == 0);
        CHECK(gr_regroup(e, NULL) == GR_OK);
        CHECK(e->points.used == used && cell->capacity == rows && cell->rows == rows);
        CHECK(!scene_differs(&before, &s));
        scene_free(&s);
        scene_free(&before);
    }
}

TEST(full_buffers_add_none)
{
    struct scene s;
    build(&s, 2);
    struct gr_engine *e = s.engine;
    int64_t grown = 0;
    for (int64_t tile = 0; tile < e->mesh.n_tiles; tile++) {
        const int32_t rows = e->mesh.cell[tile * GR_LANES].capacity;
        if (gr_grow_tile(e, tile))
            grown++;
        else
            CHECK(e->mesh.cell[tile * GR_LANES].capacity == rows);
        CHECK(e->points.used <= e->points.capacity);
        if (tile == 1) e->points.used = e->points.capacity - GR_LANES * 3;
    }
    CHECK(grown >= 2 && grown < e->mesh.n_tiles);
    scene_free(&s);
}

/* Points that all enter one cell: its tile grows, and when that is not enough they wait until all are grouped anew. */
TEST(one_cell_takes_all)
{
    struct scene s;
    build(&s, 2);
    struct gr_engine *e = s.engine;
    const struct gr_cell *target = NULL;
    for (int64_t c = 0; c < e->mesh.n_cells; c++)
        if (!target || e->mesh.cell[c].count > target->count) target = &e->mesh.cell[c];
    const int32_t count = target->count, capacity = target->capacity;
    const int32_t at[2] = {target->at[0], target->at[1]};
    CHECK(gr_reserve_pending(e, 2 * e->points.capacity) == GR_OK);
    int64_t new = 0;
    for (; !e->migration.n_pending; new ++) {
        double *record = e->migration.pending;
        for (int f = 0; f < GR_FIELD_COUNT; f++)
            for (int c = 0; s.field[f] && c < gr_field_components(f, 2); c++)
                *record++ = *scene_at(&s, f, c, gr_slot(target, 0));
        gr_insert_new(e, e->migration.pending, 1000 + new);
    }
    CHECK(target->count > capacity && target->count == target->capacity && count + new == target->count + 1);
    for (int32_t k = count; k < target->count; k++) CHECK(s.id[gr_slot(target, k)] == 1000 + k - count);
    CHECK(gr_regroup(e, NULL) == GR_OK || (scene_grow(&s) == 0 && gr_regroup(e, NULL) == GR_OK));
    const int64_t cell = (int64_t)gr_table_get(&e->mesh.cell_of, gr_cell_id(e, (int32_t[3]){at[0], at[1]})) - 1;
    CHECK(e->mesh.cell[cell].count == count + new && e->points.n == 500 + new);
    scene_free(&s);
}
