/* Tests of body/: distances, edges, operations, contact rules and motion, against values computed by hand. */
#include "body/body.h"

#include <math.h>
#include <string.h>

#include "tests/check.h"

static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

static struct gr_part part(int kind, double a, double b, double c)
{
    struct gr_part out = {.kind = kind, .size = {a, b, c}};
    memcpy(out.rotation, identity, sizeof identity);
    return out;
}

static void check_distance(const struct gr_part *p, const double x[3], double distance, const double n[3])
{
    double normal[3];
    CHECK_NEAR(gr_part_distance(p, x, normal), distance, 1e-15);
    for (int d = 0; d < 3; d++) CHECK_NEAR(normal[d], n[d], 1e-15);
}

TEST(distances_by_hand)
{
    const struct gr_part box = part(GR_PART_BOX, 1, 2, INFINITY), roller = part(GR_PART_CYLINDER, 2, 1, 0);
    struct gr_part drum = part(GR_PART_CYLINDER, 2, INFINITY, 0), half = part(GR_PART_HALF_SPACE, 0, 0, 0);
    drum.inside = 1;
    half.center[2] = 3;
    check_distance(&box, (double[]){4, 6, 50}, 5, (double[]){0.6, 0.8, 0});
    check_distance(&box, (double[]){-0.75, 0, 0}, -0.25, (double[]){-1, 0, 0});
    check_distance(&roller, (double[]){0, 5, -5}, 5, (double[]){0, 0.6, -0.8});
    check_distance(&roller, (double[]){0, 0, 0.5}, -0.5, (double[]){0, 0, 1});
    check_distance(&drum, (double[]){0, 0, 0}, 2, (double[]){-1, 0, 0});
    check_distance(&drum, (double[]){0, 3, 9}, -1, (double[]){0, -1, 0});
    check_distance(&half, (double[]){7, 8, 1}, -2, (double[]){0, 0, 1});
    CHECK_NEAR(gr_union_bound(&box, 1, 2), sqrt(5), 1e-15);
    CHECK(isinf(gr_union_bound(&box, 1, 3)) && isinf(gr_union_bound(&drum, 1, 2)) && isinf(gr_union_bound(&half, 1, 2)));
}

TEST(union_is_the_nearest)
{
    struct gr_part two[2] = {part(GR_PART_BOX, 1, 1, 1), part(GR_PART_BOX, 1, 1, 1)};
    two[1].center[0] = 5;
    double normal[3];
    CHECK_NEAR(gr_union_distance(two, 2, (double[]){3.5, 0, 0}, normal), 0.5, 1e-15);
    CHECK_NEAR(normal[0], -1, 0);
    CHECK_NEAR(gr_union_distance(two, 2, (double[]){0.5, 0, 0}, normal), -0.5, 1e-15);
    CHECK_NEAR(normal[0], 1, 0);
}

/* A part with vertices: a closed polygon, 1 thick on each side of z = 0, or a revolved chain. */
static struct gr_part chain(int kind, int n, const double *vertices)
{
    struct gr_part out = part(kind, kind == GR_PART_POLYGON ? 1 : 0, 0, 0);
    out.chain = (struct gr_chain){vertices, n, 1, kind == GR_PART_REVOLVED};
    return out;
}

static struct gr_part operation(int kind, double size)
{
    struct gr_part out = part(kind, size, 0, 0);
    out.operands = (int)size;
    return out;
}

static const double notched[] = {0, 0, 4, 0, 4, 4, 2, 1, 0, 4}, cone[] = {0, 0, 3, 0, 0, 4};

TEST(distances_of_round_and_extended_shapes)
{
    const struct gr_part rod = part(GR_PART_CAPSULE, 1, 2, 0), ring = part(GR_PART_TORUS, 3, 1, 0);
    const struct gr_part prism = chain(GR_PART_POLYGON, 5, notched), tent = chain(GR_PART_REVOLVED, 3, cone);
    struct gr_part wall = chain(GR_PART_REVOLVED, 3, cone);
    check_distance(&rod, (double[]){3, 0, 6}, 4, (double[]){0.6, 0, 0.8});
    check_distance(&rod, (double[]){0, 0.5, 1}, -0.5, (double[]){0, 1, 0});
    check_distance(&ring, (double[]){0, 3, 2}, 1, (double[]){0, 0, 1});
    check_distance(&ring, (double[]){0, 0, 4}, 4, (double[]){-0.6, 0, 0.8});
    check_distance(&prism, (double[]){2, -3, 5}, 5, (double[]){0, -0.6, 0.8});
    check_distance(&prism, (double[]){2, 0.625, 0.25}, -0.375, (double[]){0, 1, 0}); /* below the notch */
    check_distance(&prism, (double[]){-3, -4, 0}, 5, (double[]){-0.6, -0.8, 0});
    check_distance(&tent, (double[]){0, 0, 6}, 2, (double[]){0, 0, 1});
    check_distance(&tent, (double[]){0, 0, 0.5}, -0.5, (double[]){0, 0, -1});
    check_distance(&tent, (double[]){0, 5.5, 4}, 4.4, (double[]){0, 0.8, 0.6});
    wall.chain.closed = 0, wall.size[1] = 0.5; /* the line from the middle of the floor to the tip */
    check_distance(&wall, (double[]){0, 0, 2}, 0.7, (double[]){-0.8, 0, -0.6});
    check_distance(&wall, (double[]){0, 2, 0}, -0.5, (double[]){0, 0, -1});
    CHECK_NEAR(gr_union_bound(&rod, 1, 3), 3, 0);
    CHECK_NEAR(gr_union_bound(&ring, 1, 3), 4, 0);
    CHECK_NEAR(gr_union_bound(&wall, 1, 2), 5.5, 0);
}

TEST(operations_on_results)
{
    struct gr_part parts[5] = {part(GR_PART_BOX, 2, 2, 2), part(GR_PART_CAPSULE, 1, 0, 0), operation(GR_PART_UNION, 2),
                               operation(GR_PART_SHELL, 0.25), operation(GR_PART_OFFSET, 0.5)};
    const double x[3] = {1.5, 0, 0};
    double normal[3];
    CHECK(!gr_parts_lack_operands(parts, 5) && gr_parts_lack_operands(parts + 1, 4));
    CHECK(!gr_part_is_whole(parts, 5, 0) && !gr_part_is_whole(parts, 5, 3) && gr_part_is_whole(parts, 5, 4));
    CHECK(gr_part_is_whole(parts, 2, 0) && !gr_part_is_whole(parts, 3, 0));
    CHECK_NEAR(gr_union_distance(parts, 4, x, normal), 0.5, 0);
    CHECK_NEAR(normal[0], -1, 0);
    CHECK_NEAR(gr_union_distance(parts, 5, x, normal), 0, 0);
    CHECK_NEAR(gr_union_bound(parts, 5, 3), sqrt(12) + 1, 1e-15);
    parts[1].inside = 1, parts[2].kind = GR_PART_INTERSECTION; /* the box less the ball */
    CHECK_NEAR(gr_union_distance(parts, 3, (double[]){0.5, 0, 0}, normal), 0.5, 0);
    CHECK_NEAR(normal[0], -1, 0);
    CHECK_NEAR(gr_union_bound(parts, 3, 3), sqrt(12), 1e-15);
    parts[2].inside = 1; /* all else */
    CHECK_NEAR(gr_union_distance(parts, 3, (double[]){0.5, 0, 0}, normal), -0.5, 0);
    CHECK(isinf(gr_union_bound(parts, 3, 3)));
    parts[3].size[0] = 0.25; /* the wall within the box */
    CHECK_NEAR(gr_union_distance(parts, 4, x, normal), 0, 0);
    CHECK_NEAR(gr_union_bound(parts, 4, 3), sqrt(12), 1e-15);
}

TEST(fastest_points_are_those_of_the_solid)
{
    /* a rod without end, cut off by a ball, that turns about another axis; and one that turns about itself */
    struct gr_part parts[3] = {part(GR_PART_CYLINDER, 1, INFINITY, 0), part(GR_PART_CAPSULE, 5, 0, 0),
                               operation(GR_PART_INTERSECTION, 2)};
    const double upright[4] = {1, 0, 0, 0}, rest[3] = {0};
    struct gr_body body = {.n_parts = 3, .bound = gr_union_bound(parts, 3, 3)};
    CHECK_NEAR(body.bound, 5, 0);
    CHECK_NEAR(gr_largest_speed(&body, parts, upright, rest, (double[]){2, 0, 0}, 99), 10, 0);
    CHECK_NEAR(gr_largest_speed(&body, parts, upright, rest, (double[]){0, 0, 2}, 99), 2 * sqrt(2), 1e-15);
    CHECK_NEAR(gr_largest_speed(&body, parts, upright, rest, (double[]){0, 0, 2}, 4), 8, 0);
}

static int at_edge(const struct gr_part *parts, int n, double x, double y, double z)
{
    return gr_union_edge_near(parts, n, (double[]){x, y, z}, 0.1);
}

TEST(convex_edges_of_shapes)
{
    struct gr_part box = part(GR_PART_BOX, 1, 1, 1);
    const struct gr_part rod = part(GR_PART_CYLINDER, 1, 1, 0), ball = part(GR_PART_CAPSULE, 1, 0, 0);
    const struct gr_part prism = chain(GR_PART_POLYGON, 5, notched), tent = chain(GR_PART_REVOLVED, 3, cone);
    struct gr_part wall = chain(GR_PART_REVOLVED, 3, cone);
    CHECK(at_edge(&box, 1, 1, 0.95, 0) && !at_edge(&box, 1, 1, 0.85, 0.5));
    box.inside = 1;
    CHECK(!at_edge(&box, 1, 1, 0.95, 0));
    CHECK(at_edge(&rod, 1, 1, 0, 0.95) && !at_edge(&rod, 1, 1, 0, 0.5) && !at_edge(&ball, 1, 1, 0, 0));
    CHECK(at_edge(&prism, 1, 0.05, 0, 0) && !at_edge(&prism, 1, 2, 0, 0) && at_edge(&prism, 1, 2, 0, 0.95));
    CHECK(!at_edge(&prism, 1, 2, 1, 0) && !at_edge(&prism, 1, 2, 0.5, 1)); /* the notch; the middle of an end */
    CHECK(at_edge(&tent, 1, 0, 0.05, 4 - 0.2 / 3) && at_edge(&tent, 1, 0, 2.95, 0));
    CHECK(!at_edge(&tent, 1, 0, 0, 0) && !at_edge(&tent, 1, 0, 1.5, 2));
    wall.chain.closed = 0, wall.size[1] = 0.05; /* its tip is where it goes on as its mirror image */
    CHECK(at_edge(&wall, 1, 0, 3.05, 0) && !at_edge(&wall, 1, 0, 1, -0.05));
    wall.size[1] = 0.5;
    CHECK(!at_edge(&wall, 1, 0, 3.5, 0));
}

TEST(convex_edges_of_operations)
{
    /* a slab with a hole; a hole that is filled again; rounded shapes; two boxes that meet at a concave edge */
    struct gr_part parts[4] = {part(GR_PART_BOX, 4, 4, 1), part(GR_PART_CYLINDER, 1, INFINITY, 0),
                               operation(GR_PART_INTERSECTION, 2), part(GR_PART_CYLINDER, 1, 1, 0)};
    parts[1].inside = 1;
    CHECK(at_edge(parts, 3, 1, 0, 0.95) && at_edge(parts, 3, 1.05, 0, 1));
    CHECK(!at_edge(parts, 3, 1, 0, 0.5) && !at_edge(parts, 3, 2, 0, 1) && at_edge(parts, 3, 4, 0, 0.95));
    parts[2].inside = 1;
    CHECK(!at_edge(parts, 3, 1, 0, 0.95) && !at_edge(parts, 3, 4, 0, 0.95));
    struct gr_part round[3] = {part(GR_PART_BOX, 1, 1, 1), operation(GR_PART_OFFSET, 0.2), operation(GR_PART_OFFSET, 0.2)};
    CHECK(!at_edge(round, 2, 1 + 0.12, 1 + 0.16, 0));
    round[1].size[0] = 0.05; /* a radius that is less than the distance `near` */
    CHECK(at_edge(round, 2, 1 + 0.03, 1 + 0.04, 0) && !at_edge(round, 2, 1.05, 0, 0));
    round[0].inside = 1, round[1].inside = 1, round[1].size[0] = 0.2; /* inwards: sharp as before */
    CHECK(at_edge(round, 2, 0.8, 0.75, 0) && !at_edge(round, 2, 0.8, 0.5, 0));
    struct gr_part corner[3] = {part(GR_PART_BOX, 4, 1, 4), part(GR_PART_BOX, 1, 4, 4), operation(GR_PART_UNION, 2)};
    CHECK(!at_edge(corner, 3, 1, 1.02, 0) && at_edge(corner, 3, 1, 3.95, 0));
    corner[2].inside = 1; /* the material is in the cross, and the corner points into it */
    CHECK(at_edge(corner, 3, 1, 1.02, 0) && !at_edge(corner, 3, 1, 3.95, 0));
}

TEST(what_is_round_about_an_axis)
{
    const double z[3] = {0, 0, 1e-3}, x[3] = {1, 0, 0};
    struct gr_part parts[3] = {part(GR_PART_CYLINDER, 1, 1, 0), part(GR_PART_CAPSULE, 1, 2, 0), operation(GR_PART_UNION, 2)};
    memset(parts[0].center, 0, sizeof parts[0].center);
    memset(parts[1].center, 0, sizeof parts[1].center);
    CHECK(gr_union_is_round(parts, 3, z) && !gr_union_is_round(parts, 3, x));
    parts[1].center[2] = 7; /* on the axis */
    CHECK(gr_union_is_round(parts, 3, z));
    parts[1].center[0] = 1e-3;
    CHECK(!gr_union_is_round(parts, 3, z));
    parts[0] = part(GR_PART_BOX, 1, 1, 1);
    CHECK(!gr_union_is_round(parts, 1, z));
}

TEST(motion_is_integrated_exactly)
{
    const double rows[] = {1, 0, 5, 0, 0, 0, 0, 3, 4, 5, 0, 0, 0, 8, 4, -2, 5, 0, 0, 0, 8};
    const struct gr_body body = {.n_motion = 3, .motion = rows};
    double out[6];
    gr_motion_at(&body, 2, out);
    CHECK_NEAR(out[0], 2, 1e-15);
    CHECK_NEAR(out[5], 4, 1e-15);
    gr_motion_at(&body, 99, out);
    CHECK_NEAR(out[0], -2, 0);
    gr_motion_mean(&body, 0, 5, out); /* 0, 4, 1, -2 over the intervals */
    CHECK_NEAR(out[0], 3.0 / 5, 1e-15);
    CHECK_NEAR(out[1], 5, 1e-14);
    CHECK_NEAR(out[5], 24.0 / 5, 1e-14);
    gr_motion_mean(&body, 2, 1e-3, out);
    CHECK_NEAR(out[0], 2.001, 1e-12);
}

TEST(turning_adds_up)
{
    const double omega[3] = {1, 2, -2}, start[4] = {1, 0, 0, 0};
    double once[4], parts[4] = {1, 0, 0, 0}, m[9];
    gr_turn(start, omega, 0.7, once);
    for (int k = 0; k < 70; k++) gr_turn(parts, omega, 0.01, parts);
    for (int k = 0; k < 4; k++) CHECK_NEAR(parts[k], once[k], 1e-14);
    gr_turn(start, (double[]){0, 0, 1}, acos(0), once);
    gr_rotation_matrix(once, m);
    const double quarter[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1};
    for (int k = 0; k < 9; k++) CHECK_NEAR(m[k], quarter[k], 1e-15);
}
