/* Tests of mpm/build.c: construction and destruction of an engine, and configurations that are refused. */
#include "mpm/solid_cells.h"

#include "tests/check.h"
#include "tests/scene.h"

TEST(lives_and_dies)
{
    for (int dim = 2; dim <= 3; dim++)
        for (int basis = 0; basis < GR_BASIS_COUNT; basis++) {
            struct scene s;
            scene_default(&s, dim, basis, GR_AFFINE_NONE, 0);
            CHECK(scene_build(&s, 50, 0.1, 0.9) == GR_OK);
            CHECK(s.engine->K == (basis == GR_LINEAR ? (dim == 2 ? 4 : 8) : (dim == 2 ? 9 : 27)));
            CHECK(s.engine->points.n_components == (dim == 2 ? 2 + 2 + 4 + 3 : 3 + 3 + 6 + 3));
            scene_free(&s);
        }
    gr_engine_free(NULL);
}

/* The engine owns copies: the caller may change or free the arrays of the configuration. */
TEST(owns_its_config)
{
    struct scene s;
    scene_default(&s, 2, GR_QUADRATIC, GR_AFFINE_GRADIENT, 1);
    CHECK(scene_build(&s, 10, 0.1, 0.9) == GR_OK);
    CHECK(s.engine->config.walls != s.walls && s.engine->config.node_codes.value != s.codes);
    CHECK(s.engine->config.gravity_times != s.gravity_times && s.engine->config.gravity_vectors != s.gravity_vectors);
    CHECK(!s.engine->config.cell_flags.value && !s.engine->config.c0_lines[0]);
    scene_free(&s);
}

TEST(fields_by_need)
{
    struct scene s;
    scene_default(&s, 2, GR_QUADRATIC, GR_AFFINE_NONE, 0);
    CHECK(gr_config_uses(&s.config, GR_FIELD_x) && gr_config_uses(&s.config, GR_FIELD_mass));
    CHECK(!gr_config_uses(&s.config, GR_FIELD_affine) && !gr_config_uses(&s.config, GR_FIELD_shift_velocity));
    s.config.affine = GR_AFFINE_MOMENT;
    CHECK(gr_config_uses(&s.config, GR_FIELD_affine));
    s.config.smoothed = 1;
    CHECK(gr_config_uses(&s.config, GR_FIELD_density_gradient) && gr_config_uses(&s.config, GR_FIELD_shift_velocity));
}

/* Build the default scene with one change; it must be refused and leave no engine. */
#define REFUSED(change)                                       \
    do {                                                      \
        struct scene s;                                       \
        scene_default(&s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);   \
        scene_codes(&s);                                      \
        change;                                               \
        CHECK(scene_build(&s, 1, 0.1, 0.9) == GR_ERR_CONFIG); \
        CHECK(!s.engine);                                     \
        scene_free(&s);                                       \
    } while (0)

TEST(refuses_kinds)
{
    REFUSED(s.config.dim = 1);
    REFUSED(s.config.dim = 4);
    REFUSED(s.config.basis = -1);
    REFUSED(s.config.basis = GR_BASIS_COUNT);
    REFUSED(s.config.affine = GR_AFFINE_COUNT);
    REFUSED(s.config.material[0].law = -1);
    REFUSED(s.config.material[0].law = 1000);
    REFUSED(s.config.n_materials = 0);
    REFUSED(s.config.n_materials = GR_MAX_MATERIALS + 1);
    REFUSED(s.config.n_materials = 2); /* the second one is not set */
    REFUSED(s.config.smoothed = 1);    /* requires splines and the gradient */
    REFUSED(s.config.xpic_order = -1);
    REFUSED((s.config.smoothed = 1, s.config.basis = GR_QUADRATIC, s.config.affine = GR_AFFINE_GRADIENT,
             s.config.averaging_interval = 0));
    REFUSED(s.config.xpic_order = 11);
    REFUSED((s.config.xpic_order = 2, s.config.affine = GR_AFFINE_MOMENT));
    REFUSED(s.config.axisymmetric = 1); /* which begins at r = -1 */
    REFUSED((s.config.axisymmetric = 1, s.config.lower[0] = 0, s.config.periodic[0] = 1));
    REFUSED((s.config.axisymmetric = 1, s.config.lower[0] = 0, s.config.basis = GR_UGIMP));
}

TEST(refuses_numbers)
{
    REFUSED(s.config.dx = 0);
    REFUSED(s.config.dx = NAN);
    REFUSED(s.config.material[0].rho_c = -1);
    REFUSED(s.config.material[0].K = 0);
    REFUSED(s.config.wave_speed = 0);
    REFUSED(s.config.mass_cutoff = -1e-9);
    REFUSED(s.config.mass_cutoff = NAN);
    REFUSED(s.config.cfl = 0);
    REFUSED(s.config.dt = -1);
    REFUSED(s.config.dt = INFINITY);
    REFUSED(s.config.dt = NAN);
    REFUSED(s.config.n_gravity = 0);
    REFUSED(s.config.shape[1] = 0);
    REFUSED((s.config.basis = GR_UGIMP, s.config.lambda = 0.75));
}

TEST(refuses_walls)
{
    REFUSED(s.config.n_walls = 0);
    REFUSED((s.config.n_walls = 2, s.walls[1] = (struct gr_wall){.away = {0, 2, 0}, .opens_at = INFINITY}));
    REFUSED((s.config.n_walls = 2, s.walls[1] = (struct gr_wall){.opens_at = NAN}));
    REFUSED((s.config.n_walls = 2, s.walls[1] = (struct gr_wall){.opens_at = -INFINITY}));
    REFUSED((s.config.n_walls = 2, s.walls[1] = (struct gr_wall){.opens_at = 1, .after = 2}));
    REFUSED((s.config.n_walls = 2, s.walls[1] = (struct gr_wall){.opens_at = 1, .after = -1}));
    /* chains of walls that would never end: a row that opens into itself, or into one that opened before */
    REFUSED((s.config.n_walls = 2, s.walls[1] = (struct gr_wall){.opens_at = 1, .after = 1}));
    REFUSED((s.config.n_walls = 3, s.walls[1] = (struct gr_wall){.opens_at = 1, .after = 2},
             s.walls[2] = (struct gr_wall){.opens_at = 0.5, .after = 1}));
}

/* The volume of a solid block: the nodes lose it, in all the volume of the block. */
TEST(solids_take_volume)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis += 2) {
        struct scene s;
        uint8_t flags[36] = {0};
        scene_default(&s, 2, basis, GR_AFFINE_NONE, 0);
        for (int y = 1; y < 4; y++)
            for (int x = 2; x < 4; x++) flags[x + 6 * y] = GR_CELL_SOLID;
        s.config.cell_flags = scene_map(&s, flags, 0);
        CHECK(scene_build(&s, 1, 0.1, 0.15) == GR_OK);
        double volume = 0;
        for (int32_t y = 0; y < s.engine->axis[1].n_nodes; y++)
            for (int32_t x = 0; x < s.engine->axis[0].n_nodes; x++)
                volume += gr_solid_volume(s.engine, (int32_t[3]){x, y, 0});
        CHECK_NEAR(volume, 6, 1e-14);
        scene_free(&s);
    }
}
