/* Tests of dispatch.c, kernels.c and core/simd.h: the instruction sets exist and agree. */
#include <string.h>

#include "core/simd.h"
#include "mpm/numbers.h"
#include "tests/check.h"
#include "tests/scene.h"

static const char *const sets[] = {"baseline", "avx2", "avx512"};

TEST(selects_by_name)
{
    CHECK(!strcmp(gr_kernels_select("baseline")->isa, "baseline"));
    CHECK(gr_kernels_select(NULL) == gr_kernels_select(""));
    CHECK(gr_kernels_select(NULL) != NULL);
    CHECK(!gr_kernels_select("sse9"));
    for (int k = 0; k < 3; k++) {
        const struct gr_kernels *kernels = gr_kernels_select(sets[k]);
        if (!kernels) continue;
        CHECK(!strcmp(kernels->isa, sets[k]));
        CHECK(kernels->lanes == 2 << k && GR_LANES % kernels->lanes == 0);
        const struct gr_kernels *single = kernels->single;
        CHECK(!strcmp(single->isa, sets[k]) && single->lanes == (k ? 8 : 4) && GR_LANES % single->lanes == 0);
    }
}

/* Largest difference of a field between two scenes, divided by its largest value. */
static double difference(const struct scene *a, const struct scene *b, int field)
{
    double worst = 0, scale = 1e-300;
    for (int64_t k = 0; k < a->capacity; k++) {
        if (a->id[k] < 0) continue;
        const int64_t other = scene_find(b, a->id[k]);
        for (int c = 0; c < gr_field_components(field, a->config.dim); c++) {
            const double number = gr_number(a->engine, field, c, k);
            worst = fmax(worst, fabs(number - gr_number(b->engine, field, c, other)));
            scale = fmax(scale, fabs(number));
        }
    }
    return worst / scale;
}

/* Three steps of every variant: all instruction sets give the points of the baseline to round-off. */
TEST(sets_agree)
{
    for (int dim = 2; dim <= 3; dim++)
        for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
            for (int affine = 0; affine < GR_AFFINE_COUNT; affine++)
                for (int smoothed = 0; smoothed <= (basis == GR_QUADRATIC && affine == GR_AFFINE_GRADIENT); smoothed++) {
                    struct scene s[3];
                    for (int k = 0; k < 3; k++) {
                        const struct gr_kernels *kernels = gr_kernels_select(sets[k]);
                        scene_seed(47);
                        scene_default(&s[k], dim, basis, affine, smoothed);
                        CHECK(scene_build(&s[k], 150, 0.2, 0.7) == GR_OK);
                        if (kernels) CHECK(gr_advance(s[k].engine, kernels, 3, INFINITY, 1) == GR_OK);
                        if (!k || !kernels) continue;
                        CHECK(s[k].engine->clock.step == 3);
                        CHECK(difference(&s[0], &s[k], GR_FIELD_x) < 1e-13);
                        CHECK(difference(&s[0], &s[k], GR_FIELD_v) < 1e-10);
                        CHECK(difference(&s[0], &s[k], GR_FIELD_stress) < 1e-9);
                        CHECK(difference(&s[0], &s[k], GR_FIELD_log_density) < 1e-10);
                    }
                    for (int k = 0; k < 3; k++) scene_free(&s[k]);
                }
}

/* True if there are kernels in single precision for a combination. */
static int in_single(int basis, int affine, int smoothed)
{
    return smoothed || (basis == GR_QUADRATIC && affine == GR_AFFINE_MOMENT);
}

/* Three steps in single precision give the points of double precision to the rounding of floats; other combinations are
 * refused. */
TEST(single_precision)
{
    for (int variant = 0; variant < 2 * GR_BASIS_COUNT * GR_AFFINE_COUNT * 2; variant++) {
        const int dim = 2 + variant % 2, basis = variant / 2 % GR_BASIS_COUNT, affine = variant / 2 / GR_BASIS_COUNT % 3;
        const int smoothed = variant >= 2 * GR_BASIS_COUNT * GR_AFFINE_COUNT, possible = in_single(basis, affine, smoothed);
        struct scene s[2];
        if (smoothed && (basis != GR_QUADRATIC || affine != GR_AFFINE_GRADIENT)) continue;
        for (int k = 0; k < 3; k++) {
            const struct gr_kernels *kernels = gr_kernels_select(sets[k]);
            if (!kernels) continue;
            for (int single = 0; single < 2; single++) {
                scene_seed(47);
                scene_default(&s[single], dim, basis, affine, smoothed);
                s[single].config.single = single;
                CHECK((scene_build(&s[single], 150, 0.2, 0.7) == GR_OK) == (!single || possible));
                if (!single || possible) CHECK(gr_advance(s[single].engine, kernels, 3, INFINITY, 1) == GR_OK);
            }
            if (possible) {
                CHECK(s[1].engine->clock.step == 3);
                CHECK(difference(&s[0], &s[1], GR_FIELD_x) < 1e-8); /* a shift of up to 0.1 cells is a float */
                CHECK(difference(&s[0], &s[1], GR_FIELD_v) < 1e-5);
                CHECK(difference(&s[0], &s[1], GR_FIELD_stress) < 1e-5);
            }
            for (int single = 0; single < 2; single++) scene_free(&s[single]);
        }
    }
}

/* A step of gr_advance equals the stages one by one, to the last bit. */
TEST(fused_is_separate)
{
    for (int basis = 0; basis < GR_BASIS_COUNT; basis++)
        for (int variant = 0; variant < 5; variant++) {
            const int affine = variant == 4 ? GR_AFFINE_GRADIENT : variant % 3, xpic = variant == 3 ? 2 : 0;
            const int smoothed = variant == 4 && basis == GR_QUADRATIC, cell_averaged = variant == 4 && basis == GR_LINEAR;
            struct scene a, b;
            for (int copy = 0; copy < 2; copy++) {
                struct scene *one = copy ? &b : &a;
                scene_seed(53);
                scene_default(one, 2, basis, affine, smoothed);
                one->config.xpic_order = xpic;
                one->config.cell_averaged = cell_averaged;
                CHECK(scene_build(one, 200, 0.1, 0.9) == GR_OK);
            }
            const struct gr_kernels *kernels = gr_kernels_select("");
            CHECK(gr_advance(a.engine, kernels, 20, INFINITY, 1) == GR_OK);
            for (int step = 0; step < 20; step++) {
                CHECK(gr_p2g(b.engine, kernels) == GR_OK);
                CHECK(gr_grid(b.engine, kernels) == GR_OK);
                CHECK(gr_g2p(b.engine, kernels) == GR_OK);
            }
            CHECK(a.engine->clock.step == 20 && b.engine->clock.step == 20 && a.engine->clock.time == b.engine->clock.time);
            CHECK(!scene_differs(&a, &b));
            scene_free(&a);
            scene_free(&b);
        }
}

TEST(exponential)
{
    for (double x = -690; x < 690; x += 0.37) CHECK_NEAR(v_exp(v_set(x))[0] / exp(x), 1, 4e-16);
    CHECK_NEAR(v_exp(v_zero())[0], 1, 0);
}

TEST(logarithm)
{
    for (double power = -300; power < 300; power += 0.0931) {
        const double x = pow(10, power);
        CHECK_NEAR(v_log(v_set(x))[0], log(x), 4e-16 * fabs(log(x)));
    }
    for (double x = 0.4; x < 2.5; x += 1e-3) CHECK_NEAR(v_log(v_set(x))[0], log(x), 4e-16 * fabs(log(x)) + 1e-16);
    CHECK_NEAR(v_log(v_set(1))[0], 0, 0);
}

TEST(comparisons)
{
    const vd one = v_set(1), two = v_set(2), nan = v_set(NAN);
    CHECK(m_bits(v_gt(two, one)) == GR_ALL_LANES && m_bits(v_gt(one, one)) == 0 && m_bits(v_ge(one, one)) == GR_ALL_LANES);
    CHECK(m_bits(v_ge(nan, one)) == 0 && m_bits(v_gt(one, nan)) == 0);
    CHECK(v_min(one, two)[0] == 1 && v_max(one, two)[0] == 2 && v_abs(v_set(-3))[0] == 3);
    CHECK(v_min(nan, two)[0] == 2 && v_max(nan, two)[0] == 2); /* the second operand, as on x86 */
    CHECK(v_select(v_gt(two, one), one, two)[GR_W - 1] == 1 && v_keep(v_gt(one, two), one)[0] == 0);
    CHECK(v_fma(two, two, one)[0] == 5 && v_fnma(two, two, one)[0] == -3);
}
