/* Tests of mpm/grouping.c: properties of the mesh and the points after a regrouping. */
#include <stdlib.h>
#include <string.h>

#include "mpm/migrate.h"
#include "mpm/slots.h"
#include "tests/check.h"
#include "tests/scene.h"

/* Every point occurs once, in a slot of its cell; cells of a tile have equally many slots; spare slots are clear; the
 * tables are inverse to each other. */
static void check_mesh(const struct scene *s)
{
    const struct gr_engine *e = s->engine;
    const struct gr_mesh *mesh = &e->mesh;
    const int dim = e->config.dim;
    int64_t points = 0, end = 0;
    for (int64_t c = 0; c < mesh->n_cells; c++) {
        const struct gr_cell *cell = &mesh->cell[c];
        CHECK(cell->offset == end + c % GR_LANES && cell->count <= cell->capacity);
        CHECK(cell->capacity > 0 && cell->capacity == cell[-(c % GR_LANES)].capacity);
        CHECK(gr_table_get(&mesh->cell_of, gr_cell_id(e, cell->at)) == c + 1);
        if (c) CHECK(gr_cell_id(e, mesh->cell[c - 1].at) < gr_cell_id(e, cell->at));
        if ((c + 1) % GR_LANES == 0) end += GR_LANES * cell->capacity;
        points += cell->count;
        for (int32_t place = 0; place < cell->capacity; place++) {
            const int64_t k = gr_slot(cell, place);
            const int spare = place >= cell->count;
            CHECK((s->id[k] < 0) == spare);
            for (int d = 0; d < dim; d++)
                CHECK(gr_locate(&e->axis[d], 1 / e->config.dx, *scene_at(s, GR_FIELD_x, d, k)) == cell->at[d]);
            for (int f = GR_FIELD_x + 1; spare && f < GR_FIELD_COUNT; f++)
                for (int q = 0; s->field[f] && q < gr_field_components(f, dim); q++) CHECK(*scene_at(s, f, q, k) == 0);
        }
    }
    for (int64_t c = mesh->n_cells; c < mesh->n_tiles * GR_LANES; c++) {
        const struct gr_cell *cell = &mesh->cell[c]; /* fills up the last tile */
        CHECK(cell->count == 0 && cell->offset == end + c % GR_LANES);
        for (int32_t place = 0; place < cell->capacity; place++) CHECK(s->id[gr_slot(cell, place)] < 0);
        if ((c + 1) % GR_LANES == 0) end += GR_LANES * cell->capacity;
    }
    CHECK(points == e->points.n && end == e->points.used && end <= s->capacity);
    for (int64_t k = end; k < s->capacity; k++) CHECK(s->id[k] < 0);
    for (int64_t n = 0; n < mesh->n_nodes; n++) CHECK(gr_table_get(&mesh->node_of, mesh->node_id[n]) == n + 1);
    const int64_t sums = GR_SUM_DAMPED(dim);
    int64_t linked = 0;
    for (int64_t n = 0; n < mesh->n_nodes; n++)
        for (int i = 0; i < e->K; i++) {
            const int64_t source = mesh->node_source[n * e->K + i];
            const int64_t tile = source / e->sums.stride, place = source % e->sums.stride / GR_LANES;
            if (tile >= mesh->n_tiles) continue;
            const int64_t cell = tile * GR_LANES + source % GR_LANES;
            CHECK(place % sums == 0 && cell < mesh->n_cells && gr_cell_node(e, cell, (int)(place / sums)) == n);
            CHECK(place / sums == e->K - 1 - i);
            linked++;
        }
    int64_t different = 0; /* ugimp repeats the number of a node at an end of an axis for the one beyond it */
    for (int64_t c = 0; c < mesh->n_cells; c++)
        for (int a = 0; a < e->K; a++) {
            int repeats = 0;
            for (int b = 0; b < a; b++) repeats |= gr_cell_node(e, c, b) == gr_cell_node(e, c, a);
            different += !repeats;
        }
    CHECK(linked == different);
}

/* The neighbours of every occupied cell are active. */
static void check_halo(const struct scene *s)
{
    const struct gr_engine *e = s->engine;
    for (int64_t c = 0; c < e->mesh.n_cells; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        for (int k = 0; cell->count && k < (e->config.dim == 2 ? 9 : 27); k++) {
            int32_t at[3] = {cell->at[0] + k % 3 - 1, cell->at[1] + k / 3 % 3 - 1,
                             e->config.dim == 3 ? cell->at[2] + k / 9 - 1 : 0};
            int inside = 1;
            for (int d = 0; d < e->config.dim; d++) {
                const int n = e->axis[d].n_cells;
                if (e->axis[d].periodic) at[d] = (at[d] + n) % n;
                if (at[d] < 0 || at[d] >= n) inside = 0;
            }
            if (inside) CHECK(gr_table_get(&e->mesh.cell_of, gr_cell_id(e, at)) > 0);
        }
    }
}

TEST(groups_points)
{
    for (int dim = 2; dim <= 3; dim++)
        for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
            for (int periodic = 0; periodic < 2; periodic++) {
                struct scene s;
                scene_default(&s, dim, basis, GR_AFFINE_MOMENT, 0);
                s.config.periodic[0] = periodic;
                CHECK(scene_build(&s, 300, 0.05, 0.6) == GR_OK);
                CHECK(gr_regroup(s.engine, NULL) == GR_OK);
                check_mesh(&s);
                check_halo(&s);
                CHECK(gr_regroup(s.engine, NULL) == GR_OK); /* nothing to do, so nothing changes */
                check_mesh(&s);
                for (int64_t id = 0; id < 300; id++) CHECK(scene_find(&s, id) >= 0);
                scene_free(&s);
            }
}

/* A regrouping keeps all components of every point, and the order within a cell. */
TEST(moves_whole_points)
{
    struct scene s, before;
    for (int copy = 0; copy < 2; copy++) {
        struct scene *one = copy ? &before : &s;
        scene_seed(5);
        scene_default(one, 2, GR_QUADRATIC, GR_AFFINE_GRADIENT, 1);
        CHECK(scene_build(one, 200, 0.1, 0.9) == GR_OK);
    }
    CHECK(gr_regroup(s.engine, NULL) == GR_OK);
    CHECK(!scene_differs(&s, &before));
    for (int64_t c = 0; c < s.engine->mesh.n_cells; c++)
        for (int32_t i = 1; i < s.engine->mesh.cell[c].count; i++)
            CHECK(s.id[gr_slot(&s.engine->mesh.cell[c], i)] > s.id[gr_slot(&s.engine->mesh.cell[c], i - 1)]);
    scene_free(&s);
    scene_free(&before);
}

/* If the whole domain is active, the volumes of the nodes add up to it. */
TEST(nodes_fill_the_domain)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++) {
        struct scene s;
        scene_default(&s, 2, basis, GR_AFFINE_NONE, 0);
        CHECK(scene_build(&s, 2000, 0.001, 0.999) == GR_OK);
        CHECK(gr_regroup(s.engine, NULL) == GR_OK);
        CHECK(s.engine->mesh.n_nodes == scene_grid_nodes(&s));
        double sum = 0;
        for (int64_t n = 0; n < s.engine->mesh.n_nodes; n++) sum += s.engine->mesh.node_volume[n];
        CHECK_NEAR(sum, 36, 1e-12);
        scene_free(&s);
    }
}

/* Pretend a smaller capacity than the buffers have; their components must lie that far apart. */
static void shrink(struct scene *s, int64_t capacity)
{
    const int64_t before = s->capacity;
    CHECK(capacity <= before);
    s->capacity = capacity;
    scene_bind(s);
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        for (int c = 1; s->field[f] && c < gr_field_components(f, 2); c++)
            memmove(s->field[f] + c * capacity, s->field[f] + c * before, sizeof(double) * (size_t)capacity);
}

TEST(asks_for_capacity)
{
    struct scene s;
    scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    CHECK(scene_build(&s, 300, 0.05, 0.95) == GR_OK);
    shrink(&s, 320);
    CHECK(gr_regroup(s.engine, NULL) == GR_ERR_CAPACITY);
    CHECK(s.engine->migration.needed_capacity > 320 && s.engine->points.n == 300);
    CHECK(scene_grow(&s) == 0);
    CHECK(gr_regroup(s.engine, NULL) == GR_OK);
    check_mesh(&s);
    const int64_t used = s.engine->points.used;
    shrink(&s, used + used / 32);
    CHECK(gr_regroup(s.engine, NULL) == GR_OK && s.engine->points.used == used);
    shrink(&s, used); /* a slot for each row, but none for rows to come */
    CHECK(gr_regroup(s.engine, NULL) == GR_ERR_CAPACITY && s.engine->migration.needed_capacity > used + used / 32);
    check_mesh(&s);
    scene_free(&s);
}

TEST(refuses_points_outside)
{
    const double bad[] = {-1.2, -0.3, NAN, INFINITY, -INFINITY, 1e300};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        struct scene s;
        scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
        CHECK(scene_build(&s, 20, 0.1, 0.9) == GR_OK);
        const double good = *scene_at(&s, GR_FIELD_x, 0, 7);
        *scene_at(&s, GR_FIELD_x, 0, 7) = bad[k];
        CHECK(gr_regroup(s.engine, NULL) == GR_ERR_OUTSIDE);
        CHECK(s.engine->failure.id == 7);
        *scene_at(&s, GR_FIELD_x, 0, 7) = good;
        CHECK(gr_regroup(s.engine, NULL) == GR_OK);
        check_mesh(&s);
        scene_free(&s);
    }
}

static void regroup(void *context, struct gr_team *team)
{
    struct scene *s = context;
    CHECK(gr_regroup(s->engine, team) == GR_OK);
}

/* Let points wait that have left the fullest cells, so that they are in no order of cells. */
static void take_out(struct scene *s)
{
    struct gr_engine *e = s->engine;
    CHECK(gr_reserve_pending(e, e->points.capacity) == GR_OK);
    for (int64_t c = e->mesh.n_cells - 1; c >= 0; c -= 3) {
        struct gr_cell *cell = &e->mesh.cell[c];
        for (int k = 0; k < 2 && cell->count > 1; k++) {
            const int64_t slot = gr_slot(cell, --cell->count);
            double *record = e->migration.pending + e->migration.n_pending * e->points.n_components;
            for (int f = 0; f < GR_FIELD_COUNT; f++)
                for (int q = 0; s->field[f] && q < gr_field_components(f, e->config.dim); q++)
                    *record++ = *scene_at(s, f, q, slot);
            e->migration.pending_id[e->migration.n_pending++] = s->id[slot];
            gr_clear_slot(e, cell, slot);
        }
    }
}

/* A team puts all points into the same slots as one thread, and makes the same mesh. */
TEST(by_a_team)
{
    for (int dim = 2; dim <= 3; dim++) {
        struct scene s[2];
        for (int copy = 0; copy < 2; copy++) {
            scene_seed(17);
            scene_default(&s[copy], dim, GR_QUADRATIC, GR_AFFINE_NONE, 0);
            s[copy].config.periodic[1] = 1;
            CHECK(scene_build(&s[copy], 5000, 0.1, 0.7) == GR_OK);
        }
        for (int round = 0; round < 3; round++) { /* points in any order; in cells; in cells and waiting */
            for (int copy = 0; copy < 2; copy++) {
                if (round == 2) take_out(&s[copy]);
                gr_team_lead(copy ? 4 : 1, regroup, &s[copy]);
                check_mesh(&s[copy]);
            }
            const struct gr_engine *a = s[0].engine, *b = s[1].engine;
            const size_t places = (size_t)a->points.used, nodes = (size_t)(a->mesh.n_nodes * a->K);
            CHECK(a->points.used == b->points.used && a->mesh.n_nodes == b->mesh.n_nodes && !a->migration.n_pending &&
                  !b->migration.n_pending);
            CHECK(!memcmp(a->points.id, b->points.id, sizeof *a->points.id * places));
            for (int d = 0; d < dim; d++)
                CHECK(
                    !memcmp(scene_at(&s[0], GR_FIELD_v, d, 0), scene_at(&s[1], GR_FIELD_v, d, 0), sizeof(double) * places));
            CHECK(!memcmp(a->mesh.node_source, b->mesh.node_source, sizeof *a->mesh.node_source * nodes));
            CHECK(!scene_differs(&s[0], &s[1]));
        }
        for (int copy = 0; copy < 2; copy++) scene_free(&s[copy]);
    }
}

TEST(groups_nothing)
{
    struct scene s;
    scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    CHECK(scene_build(&s, 0, 0.1, 0.9) == GR_OK);
    CHECK(gr_regroup(s.engine, NULL) == GR_OK);
    CHECK(s.engine->mesh.n_cells == 0);
    scene_free(&s);
}
