/* Tests of core/field.c: names and components of the fields. */
#include "core/field.h"

#include <stddef.h>
#include <string.h>

#include "tests/check.h"

TEST(fields_are_named_once)
{
    for (int f = 0; f < GR_FIELD_COUNT; f++) {
        CHECK(*gr_field_table[f].unit && *gr_field_table[f].doc);
        for (int other = 0; other < f; other++) CHECK(strcmp(gr_field_table[f].name, gr_field_table[other].name));
    }
    CHECK(!strcmp(gr_field_table[GR_FIELD_log_density].name, "log_density"));
}

TEST(fields_have_components)
{
    const int expected[][3] = {{GR_FIELD_x, 2, 3},
                               {GR_FIELD_stress, 4, 6},
                               {GR_FIELD_mass, 1, 1},
                               {GR_FIELD_affine, 4, 9},
                               {GR_FIELD_v, 2, 3},
                               {GR_FIELD_shear_rate, 1, 1},
                               {GR_FIELD_density_gradient, 2, 3}};
    for (size_t k = 0; k < sizeof expected / sizeof *expected; k++)
        for (int dim = 2; dim <= 3; dim++) CHECK(gr_field_components(expected[k][0], dim) == expected[k][dim - 1]);
}
