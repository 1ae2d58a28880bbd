/* Tests of mpm/grouping.c: properties of the mesh and the points after a regrouping. */
#include <stddef.h>
#include <string.h>

#include "mpm/migrate.h"
#include "mpm/slots.h"
#include "tests/check.h"
#include "tests/scene.h"

/* The nodes of a cell; the lanes of a run follow each other in a row of the grid, and their nodes in the mesh. */
static void check_cell(const struct gr_engine *e, int64_t c)
{
    const struct gr_cell *cell = &e->mesh.cell[c];
    const int k = gr_basis_nodes_1d(e->config.basis);
    CHECK(gr_table_get(&e->mesh.cell_of, gr_cell_id(e, cell->at)) == c + 1);
    for (int i = 0; i < e->K; i++) {
        const int part[3] = {i % k, i / k % k, i / (k * k)};
        int64_t id = 0;
        for (int d = e->config.dim - 1; d >= 0; d--)
            id = id * e->axis[d].n_nodes + e->axis[d].cell[cell->at[d]].node[part[d]];
        CHECK(e->mesh.node_id[gr_cell_node(e, c, i)] == id);
    }
    if (!(e->mesh.tile_joins[c / GR_LANES] >> c % GR_LANES & 1)) return;
    CHECK(c % GR_LANES && cell->at[0] == cell[-1].at[0] + 1 && cell->at[1] == cell[-1].at[1] &&
          cell->at[2] == cell[-1].at[2]);
    CHECK(gr_cell_node(e, c, 0) == gr_cell_node(e, c - 1, 0) + 1);
}

/* To a node each row of the nodes of cells is added once at most, and all cells are. */
static void check_addends(const struct gr_engine *e)
{
    const struct gr_mesh *mesh = &e->mesh;
    for (int row = 0; row < e->n_rows; row++) {
        int64_t lanes = 0, end = 0;
        for (int64_t k = mesh->row_addends[row]; k < mesh->row_addends[row + 1]; k++) {
            const struct gr_addend *addend = &mesh->addend[k];
            CHECK(addend->node >= end && addend->node + addend->n <= mesh->n_nodes && addend->n > 0);
            CHECK(addend->n <= GR_LANES);
            end = addend->node + addend->n;
            if (addend->kind_of_lanes == GR_OF_LANES) lanes += addend->n;
        }
        CHECK(lanes == mesh->n_cells);
    }
}

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
        if (c) CHECK(gr_cell_id(e, mesh->cell[c - 1].at) < gr_cell_id(e, cell->at));
        check_cell(e, c);
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
    check_addends(e);
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
        CHECK(s.engine->mesh.n_nodes == s.engine->axis[0].n_nodes * s.engine->axis[1].n_nodes);
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
            const size_t places = (size_t)a->points.used, rows = (size_t)(a->mesh.n_tiles * a->n_rows * GR_LANES);
            CHECK(a->points.used == b->points.used && a->mesh.n_nodes == b->mesh.n_nodes && !a->migration.n_pending &&
                  !b->migration.n_pending);
            CHECK(!memcmp(a->points.id, b->points.id, sizeof *a->points.id * places));
            for (int d = 0; d < dim; d++)
                CHECK(
                    !memcmp(scene_at(&s[0], GR_FIELD_v, d, 0), scene_at(&s[1], GR_FIELD_v, d, 0), sizeof(double) * places));
            CHECK(!memcmp(a->mesh.row_node, b->mesh.row_node, sizeof *a->mesh.row_node * rows));
            for (int r = 0; r <= a->n_rows; r++) CHECK(a->mesh.row_addends[r] == b->mesh.row_addends[r]);
            for (int64_t i = 0; i < a->mesh.row_addends[a->n_rows]; i++)
                CHECK(!memcmp(&a->mesh.addend[i], &b->mesh.addend[i], offsetof(struct gr_addend, kind_before) + 1));
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
