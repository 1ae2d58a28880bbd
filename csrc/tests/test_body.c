/* Tests of body/body.c: distances, contact rules and motion, against values computed by hand. */
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
    CHECK_NEAR(gr_part_bound(&box, 2), sqrt(5), 1e-15);
    CHECK(isinf(gr_part_bound(&box, 3)) && isinf(gr_part_bound(&drum, 2)) && isinf(gr_part_bound(&half, 2)));
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

static void check_contact(int rule, double friction, double un, double ut, double un_after, double ut_after, int held)
{
    const struct gr_body body = {.contact = rule, .friction = friction};
    const double n[3] = {0, 1, 0}, surface[3] = {10, 20, 30};
    double v[3] = {10 + ut, 20 + un, 30};
    CHECK(gr_contact(&body, n, surface, v) == held);
    CHECK_NEAR(v[0], 10 + ut_after, 1e-14);
    CHECK_NEAR(v[1], 20 + un_after, 1e-14);
    CHECK_NEAR(v[2], 30, 1e-14);
}

TEST(rules_of_contact)
{
    check_contact(GR_CONTACT_STICKY, 0, 1, 3, 0, 0, 2);
    check_contact(GR_CONTACT_SEPARATING, 0.5, 1, 3, 1, 3, 0);    /* leaves */
    check_contact(GR_CONTACT_SEPARATING, 0.5, -1, 3, 0, 2.5, 1); /* slides */
    check_contact(GR_CONTACT_SEPARATING, 0.5, -7, 3, 0, 0, 2);   /* is held */
    check_contact(GR_CONTACT_SEPARATING, 0, -7, 3, 0, 3, 1);
    check_contact(GR_CONTACT_SEPARATING, 0, -7, 0, 0, 0, 1);
    check_contact(GR_CONTACT_BILATERAL, 0.5, 1, -3, 0, -2.5, 1);
    check_contact(GR_CONTACT_BILATERAL, 0.5, -1, 3, 0, 2.5, 1);
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
