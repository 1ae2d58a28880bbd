/* Tests of mpm/thin_bodies.c: which bodies are thin, which side a point is on, and the cells, nodes and points of both
 * sides. */
#include "mpm/thin_bodies.h"

#include <string.h>

#include "mpm/fluidity_bodies.h"
#include "mpm/migrate.h"
#include "tests/check.h"
#include "tests/scene.h"

enum { PARTS = 3 };

/* A body made of boxes, and its scene: 6 x 6 cells of 0.1 m from (-1, 2). */
struct thin {
    struct scene scene;
    struct gr_part part[PARTS];
    struct gr_body body;
    double motion[7];
};

static void begin(struct thin *t, int dim, int basis, int parts)
{
    scene_seed(53);
    memset(t, 0, sizeof *t);
    scene_default(&t->scene, dim, basis, GR_AFFINE_MOMENT, 0);
    for (int k = 0; k < parts; k++)
        t->part[k] =
            (struct gr_part){.kind = GR_PART_BOX, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .size = {0.01, 0.2, INFINITY}};
    t->body = (struct gr_body){.n_parts = parts,
                               .contact = GR_CONTACT_SEPARATING,
                               .bound = 0.3,
                               .extent = {0.3, 0.3, 0.3},
                               .position = {-0.7, 2.3, 0.8},
                               .orientation = {1, 0, 0, 0},
                               .n_motion = 1,
                               .motion = t->motion};
    t->scene.config.n_bodies = 1, t->scene.config.n_parts = parts;
    t->scene.config.bodies = &t->body, t->scene.config.parts = t->part;
}

static int is_thin(const struct thin *t, double half)
{
    struct gr_part part = t->part[0];
    struct gr_config config = t->scene.config;
    part.size[0] = half;
    config.parts = &part;
    return gr_list_thin(&config, 0) > 0;
}

TEST(which_bodies_are_thin)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++) {
        struct thin t;
        const double limit = basis == GR_LINEAR ? 0.1 : 0.15; /* half of 2 or 3 cells */
        begin(&t, 2, basis, 1);
        CHECK(is_thin(&t, 0.99 * limit) && !is_thin(&t, limit) && !is_thin(&t, 1.01 * limit));
        t.part[0].kind = GR_PART_CYLINDER;
        CHECK(!is_thin(&t, 0.01));
        t.part[0].kind = GR_PART_BOX;
        t.scene.config.smoothed = 1;
        CHECK(!is_thin(&t, 0.01));
        t.scene.config.smoothed = 0, t.scene.config.xpic_order = 2;
        CHECK(!is_thin(&t, 0.01));
        t.scene.config.xpic_order = 0, t.scene.config.cell_averaged = 1;
        CHECK(!is_thin(&t, 0.01));
    }
}

/* A bucket made of a floor and two walls: the front of each is away from the centre. */
TEST(fronts_point_outwards)
{
    struct thin t;
    struct gr_thin_part part[PARTS];
    begin(&t, 2, GR_QUADRATIC, 3);
    t.part[0].size[0] = 0.2, t.part[0].size[1] = 0.01;
    t.part[1].center[0] = -0.2, t.part[1].center[1] = 0.2;
    t.part[2].center[0] = 0.2, t.part[2].center[1] = 0.2;
    CHECK(gr_list_thin(&t.scene.config, part) == 3);
    CHECK(part[0].axis == 1 && part[0].front == -1);
    CHECK(part[1].axis == 0 && part[1].front == -1 && part[1].part == 1);
    CHECK(part[2].axis == 0 && part[2].front == 1 && part[2].body == 0);
    t.part[0].size[1] = 0.2; /* a thick floor is not a thin part */
    CHECK(gr_list_thin(&t.scene.config, part) == 2 && part[0].part == 1);
}

/* After a quarter turn the axis across the thickness is y. */
TEST(places_by_hand)
{
    struct thin t;
    struct gr_facing side;
    begin(&t, 2, GR_QUADRATIC, 2);
    t.part[1].center[0] = 1;
    t.body.orientation[0] = t.body.orientation[3] = sqrt(0.5);
    CHECK(scene_build(&t.scene, 50, 0.3, 0.7) == GR_OK);
    gr_nearest_thin(t.scene.engine, (double[]){-0.75, 2.35, 0}, 1, &side);
    CHECK(side.body == 0 && side.facing == 1);
    CHECK_NEAR(side.mid, -0.05, 1e-14); /* its front is away from the other part, which is at y = 3.3 */
    CHECK_NEAR(side.distance, 0.05, 1e-14);
    CHECK_NEAR(side.half, 0.01, 0);
    CHECK_NEAR(side.inset, 0.15, 1e-14);
    CHECK_NEAR(side.next, 0.95, 1e-14);
    CHECK_NEAR(side.normal[1], -1, 1e-14);
    gr_nearest_thin(t.scene.engine, (double[]){-1.0, 2.34, 0}, 1, &side);
    CHECK(side.facing == 0);
    CHECK_NEAR(side.inset, -0.1, 1e-14);
    CHECK_NEAR(side.distance, hypot(0.1, 0.04), 1e-14);
    scene_free(&t.scene);
}

/* A point keeps its side while it faces the thin part; elsewhere its position decides. */
TEST(sides_of_points)
{
    struct thin t;
    begin(&t, 2, GR_QUADRATIC, 1);
    CHECK(scene_build(&t.scene, 50, 0.3, 0.7) == GR_OK);
    const struct gr_engine *e = t.scene.engine;
    const double front[3] = {-0.69, 2.3, 0}, beyond[3] = {-0.69, 2.51, 0};
    CHECK(gr_point_side(e, front, 0) == 1 && gr_point_side(e, front, 1) == 1 && gr_point_side(e, front, -1) == -1);
    CHECK(gr_point_side(e, beyond, 0) == 1 && gr_point_side(e, beyond, -1) == 1);
    scene_free(&t.scene);
}

/* Cells within 2.75 dx are double. Their points have sides, and their nodes duplicates, which are separated where they face
 * the thin part. */
TEST(mesh_has_two_sides)
{
    for (int dim = 2; dim <= 3; dim++) {
        struct thin t;
        int64_t doubles = 0, points = 0;
        begin(&t, dim, GR_QUADRATIC, 1);
        t.part[0].size[1] = 0.1;
        CHECK(scene_build(&t.scene, 600, 0.01, 0.99) == GR_OK && gr_regroup(t.scene.engine, NULL) == GR_OK);
        struct gr_engine *e = t.scene.engine;
        for (int64_t c = 0; c < e->mesh.n_cells; c++) {
            const struct gr_cell *cell = &e->mesh.cell[c];
            const int side = gr_cell_side(e, cell->at), is_double = side == 1 || side == -1;
            CHECK(is_double == GR_IS_DOUBLE(cell));
            points += cell->count;
            doubles += is_double;
            if (!is_double) CHECK(side == cell->side);
            CHECK((e->mesh.other[c] >= 0) == is_double);
            if (is_double) {
                const struct gr_cell *other = gr_other_side(e, cell);
                CHECK(other->side == -cell->side && gr_cell_id(e, cell->at) == gr_cell_id(e, other->at));
                CHECK(gr_other_side(e, other) == cell);
            }
            for (int32_t k = 0; k < cell->count; k++)
                CHECK(*scene_at(&t.scene, GR_FIELD_side, 0, gr_slot(cell, k)) == (is_double ? cell->side : 0));
        }
        CHECK(points == 600 && doubles == 2 * e->mesh.n_paired && doubles > 0);
        gr_split_nodes(e, 0, e->mesh.n_nodes);
        int64_t separated = 0, together = 0;
        for (int64_t n = 0; n < e->mesh.n_nodes; n++) {
            const int32_t duplicate = e->mesh.duplicate[n];
            if (duplicate < 0) continue;
            CHECK(e->mesh.duplicate[duplicate] == n && e->mesh.node_id[duplicate] == e->mesh.node_id[n]);
            CHECK(e->mesh.separated[duplicate] == e->mesh.separated[n]);
            const int facing = e->mesh.separable[n] && fabs(scene_node_x(&t.scene, n, 1) - 2.3) <= 0.1;
            CHECK(e->mesh.separated[n] == facing);
            separated += facing, together += !facing;
        }
        CHECK(separated > 0 && together > 0);
        scene_free(&t.scene);
    }
}

/* The split poses stay until the body has moved by a cell, or turned so far at its greatest radius. */
TEST(split_follows)
{
    struct thin t;
    begin(&t, 2, GR_QUADRATIC, 1);
    CHECK(scene_build(&t.scene, 50, 0.3, 0.7) == GR_OK);
    struct gr_engine *e = t.scene.engine;
    e->bodies.now[0].x[1] += 0.099;
    CHECK(!gr_follow_bodies(e));
    CHECK_NEAR(e->bodies.split[0].x[1], 2.3, 0);
    e->bodies.now[0].x[1] += 0.002;
    CHECK(gr_follow_bodies(e) && !gr_follow_bodies(e));
    CHECK_NEAR(e->bodies.split[0].x[1], 2.401, 1e-15);
    const double start[4] = {1, 0, 0, 0};
    gr_turn(start, (double[]){0, 0, 1}, 0.32, e->bodies.now[0].orientation); /* 0.3 m x 0.32 < a cell */
    CHECK(!gr_follow_bodies(e));
    gr_turn(start, (double[]){0, 0, 1}, 0.35, e->bodies.now[0].orientation);
    CHECK(gr_follow_bodies(e));
    scene_free(&t.scene);
}

/* The copies of the double cells whose centres face the thin part have a fluidity of their own, with distances from the
 * face on their side: at -0.70 of the front and at -0.72 of the back. */
TEST(fluidity_has_two_sides)
{
    struct thin t;
    begin(&t, 2, GR_QUADRATIC, 1);
    scene_nonlocal(&t.scene);
    t.part[0].size[1] = 0.1;
    t.body.position[0] = -0.71, t.body.rough = 1;
    CHECK(scene_build(&t.scene, 600, 0.01, 0.99) == GR_OK && gr_regroup(t.scene.engine, NULL) == GR_OK);
    struct gr_engine *e = t.scene.engine;
    gr_bodies_mark(e, 0, e->mesh.n_cells);
    for (int64_t c = 0; c < e->mesh.n_cells; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        if (cell->side != 1) continue;
        const int facing = cell->at[1] == 2 || cell->at[1] == 3, front = cell->at[0] > 2; /* centres at 0.05 and 0.15 */
        const struct gr_cell *other = gr_other_side(e, cell);
        const int64_t first = gr_place_of_cell(e, cell), second = gr_place_of_cell(e, other);
        CHECK((first != second) == facing);
        int shared = 0, of_other = 0;
        GR_EACH_OF_FLUIDITY(e, cell, side) shared++;
        GR_EACH_OF_FLUIDITY(e, other, side) of_other++;
        CHECK(shared == (facing ? 1 : 2) && of_other == facing);
        if (!facing) continue;
        CHECK(!(e->nonlocal.fluidity->inside[first] & GR_BEHIND) && (e->nonlocal.fluidity->inside[second] & GR_BEHIND));
        CHECK(!!(e->nonlocal.fluidity->inside[first] & GR_BORDER) == !front);
        CHECK(!!(e->nonlocal.fluidity->inside[second] & GR_BORDER) == (cell->at[0] >= 2));
        if (cell->at[0] == 1) CHECK_NEAR(gr_fluidity_drop(e->nonlocal.fluidity, second, 1), 0.1 / 0.13, 1e-12);
        if (cell->at[0] == 3) CHECK_NEAR(gr_fluidity_drop(e->nonlocal.fluidity, first, 0), 2, 1e-12);
        if (cell->at[0] == 4) CHECK_NEAR(gr_fluidity_drop(e->nonlocal.fluidity, first, 0), 0, 0);
    }
    scene_free(&t.scene);
}

/* Steps of a scene with a body and without points, hence without nodes: under the sanitizers. */
TEST(bodies_in_empty_space)
{
    struct thin t;
    begin(&t, 2, GR_QUADRATIC, 1);
    t.part[0].size[0] = 0.2;
    t.motion[1] = 1;
    CHECK(scene_build(&t.scene, 0, 0.1, 0.9) == GR_OK);
    CHECK(gr_regroup(t.scene.engine, NULL) == GR_OK && t.scene.engine->mesh.n_nodes == 0);
    t.scene.engine->config.dt = t.scene.engine->clock.dt = 0.01;
    CHECK(gr_advance(t.scene.engine, gr_kernels_select(""), 10, INFINITY, 1) == GR_OK);
    CHECK_NEAR(t.scene.engine->bodies.now[0].x[0], -0.6, 1e-12);
    CHECK(gr_p2g(t.scene.engine, gr_kernels_select("")) == GR_OK);
    CHECK(gr_grid(t.scene.engine, gr_kernels_select("")) == GR_OK);
    scene_free(&t.scene);
}
