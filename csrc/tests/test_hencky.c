/* Tests of law/strain.h, law/hencky.h and law/flow_rules.h: against values computed by hand, with every instruction
 * set. */
#include <string.h>

#include "law/law.h"
#include "mpm/engine.h"
#include "tests/check.h"
#include "tests/scene.h"

enum { MOST = 29 }; /* not a multiple of any number of lanes */

static const double DT = 1e-4;
static const double PARAMETER[GR_HENCKY_PARAMETER_COUNT] = {1e6, 1, 5e5, 0.38, 0.64, 0.28, 2500, 4e-3, 1e-3, 0};

struct points {
    double gradient[9][MOST], log_density[MOST], stress[6][MOST], g[MOST], shear_rate[MOST];
};

static void random_points(struct points *p, double strain)
{
    for (int k = 0; k < MOST; k++) {
        const double pressure = scene_random(100, 2000);
        for (int c = 0; c < 9; c++) p->gradient[c][k] = strain * scene_random(-1, 1);
        for (int c = 0; c < 6; c++) p->stress[c][k] = 0.3 * pressure * scene_random(-1, 1) - (c < 3 ? pressure : 0);
        p->log_density[k] = (k % 7 ? 1 : -1) * pressure / PARAMETER[GR_HENCKY_P_K];
        p->g[k] = scene_random(0, 10);
        p->shear_rate[k] = scene_random(0, 5);
    }
}

static void update(const char *isa, int flow, int dim, struct points *p, int n)
{
    struct gr_hencky_call call = {.n = n, .dt = DT, .log_density = p->log_density, .g = p->g, .shear_rate = p->shear_rate};
    memcpy(call.parameter, PARAMETER, sizeof PARAMETER);
    for (int c = 0; c < 9; c++) call.gradient[c] = p->gradient[c];
    for (int c = 0; c < 6; c++) call.stress[c] = p->stress[c];
    gr_kernels_select(isa)->update_hencky(flow, dim, &call);
}

/* Stretches along the axes: h is the sum of the strains. */
TEST(a_stretch_adds_up)
{
    struct points p = {0};
    const double first[3] = {0.02, -0.01, -0.01}, then[3] = {0.1, 0.3, -0.4}; /* the short series, and the eigenvalues */
    for (int c = 0; c < 3; c++) p.stress[c][0] = 2 * PARAMETER[GR_HENCKY_P_G] * first[c], p.gradient[4 * c][0] = then[c];
    update("", GR_HENCKY_elastic, 3, &p, 1);
    for (int c = 0; c < 3; c++) CHECK_NEAR(p.stress[c][0] / (2 * PARAMETER[GR_HENCKY_P_G]), first[c] + then[c], 1e-15 * 8);
    for (int c = 3; c < 6; c++) CHECK(p.stress[c][0] == 0);
}

/* The instruction sets agree for any number of points, and nothing is written beyond them. */
TEST(sets_and_numbers_agree)
{
    scene_seed(3);
    for (int flow = 0; flow < GR_HENCKY_FLOW_COUNT; flow++)
        for (int dim = 2; dim <= 3; dim++)
            for (int large = 0; large < 2; large++) {
                struct points start, base, best, few;
                random_points(&start, large ? 0.4 : 1e-4);
                base = best = few = start;
                update("baseline", flow, dim, &base, MOST);
                update("", flow, dim, &best, MOST);
                update("", flow, dim, &few, 5);
                for (int k = 0; k < MOST; k++) {
                    const double size = 2 * PARAMETER[GR_HENCKY_P_G] * (large ? 1 : 1e-3);
                    for (int c = 0; c < (dim == 2 ? 4 : 6); c++) {
                        CHECK_NEAR(base.stress[c][k], best.stress[c][k], 1e-14 * size);
                        CHECK(few.stress[c][k] == (k < 5 ? best.stress[c][k] : start.stress[c][k]));
                    }
                    CHECK(few.g[k] == (k < 5 ? best.g[k] : start.g[k]));
                    CHECK(best.g[k] >= 0 && best.shear_rate[k] >= 0);
                    if (flow != GR_HENCKY_elastic && start.log_density[k] < 0)
                        CHECK(best.stress[0][k] == 0 && best.g[k] == 0 && best.shear_rate[k] == 0);
                }
            }
}

/* A NaN stays visible, and in its lane. */
TEST(nan_is_kept)
{
    scene_seed(4);
    for (int what = 0; what < 3; what++)
        for (int flow = 1; flow < GR_HENCKY_FLOW_COUNT; flow++) {
            struct points good, p;
            random_points(&good, 1e-3);
            p = good;
            (what == 0 ? p.gradient[1] : what == 1 ? p.log_density : p.stress[0])[2] = NAN;
            update("", flow, 3, &p, MOST);
            update("", flow, 3, &good, MOST);
            CHECK(isnan(p.stress[0][2]));
            for (int k = 0; k < MOST; k++)
                if (k != 2) CHECK(p.stress[0][k] == good.stress[0][k] && p.g[k] == good.g[k]);
        }
}
