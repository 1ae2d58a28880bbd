/* Tests of the laws in law/: the stress update, with the baseline and the widest instruction set. */
#include "law/law.h"

#include <string.h>

#include "mpm/engine.h"
#include "tests/check.h"
#include "tests/scene.h"

enum { MOST = 64 };

static const double K = 1e6 / 1.2, G = 1e6 / 2.6, MU_S = 0.38, MU_2 = 0.64, XI = 1.12, DT = 1e-4;
static const double MU_INF = 0.05, ALPHA = 1.9, I1 = 0.08;

/* A batch of points for a law. */
struct points {
    int n, dim;
    double gradient[MOST][9], stress[MOST][6], log_density[MOST], shear_rate[MOST];
};

static void random_points(struct points *p, int dim, int n, double strain)
{
    p->n = n, p->dim = dim;
    for (int k = 0; k < n; k++) {
        const double pressure = scene_random(100, 2000);
        const double share = k % 2 ? 1 : 0.02; /* some yield and some do not */
        for (int c = 0; c < dim * dim; c++) p->gradient[k][c] = share * strain * scene_random(-1, 1);
        for (int c = 0; c < 6; c++)
            p->stress[k][c] = (c < 3 ? -pressure : 0) + (k % 3 ? 0.1 : 0.3) * pressure * scene_random(-1, 1);
        p->log_density[k] = pressure / K;
        p->shear_rate[k] = -1;
    }
}

static double parameter_named(const char *name)
{
    static const struct {
        const char *name;
        double value;
    } known[] = {{"K", K},         {"G", G},           {"mu_s", MU_S},   {"mu", MU_S},     {"mu_2", MU_2},
                 {"xi", XI},       {"A", 0.5},         {"I0", XI},       {"rho_s", 1},     {"d", 1},
                 {"t0", 1e-3},     {"p_averaging", 0}, {"h0_deg", 30},   {"h2", 1},        {"mu_inf", MU_INF},
                 {"alpha", ALPHA}, {"I1", I1},         {"dilatancy", 4}, {"phi_c", 0.585}, {"phi_fast", 0.53}};
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (!strcmp(known[k].name, name)) return known[k].value;
    return 0;
}

/* Run a law over the points, in the order and lanes of a kernel; a nonlocal law without a fluidity. */
static void update(const struct gr_kernels *kernels, int law, struct points *p, int from_density)
{
    static double gradient[MOST * 9], stress[6][MOST], log_density[MOST], shear_rate[MOST], g[MOST], g_star[MOST],
        bulking[MOST];
    double parameter[GR_LAW_MAX_PARAMETERS];
    for (int q = 0; q < gr_law_parameters(gr_law_at(law)); q++)
        parameter[q] = parameter_named(gr_law_at(law)->parameter[q].name);
    int64_t slot[MOST];
    const int w = kernels->lanes, blocks = p->n / w, dd = p->dim * p->dim, rows = p->dim == 2 ? 4 : 6;
    struct gr_law_call call = {.n_blocks = blocks,
                               .slot = slot,
                               .gradient = gradient,
                               .dt = DT,
                               .fraction = 1,
                               .pressure_from_density = from_density,
                               .parameter = parameter,
                               .log_density = log_density,
                               .shear_rate = shear_rate};
    if (gr_law_at(law)->reaction) call.g_star = g_star, call.g = g;
    if (gr_law_at(law)->dilates) call.bulking = bulking;
    for (int c = 0; c < rows; c++) call.stress[c] = stress[c];
    for (int k = 0; k < p->n; k++) {
        slot[k / w] = k / w * w;
        for (int c = 0; c < dd; c++) gradient[(k / w * dd + c) * w + k % w] = p->gradient[k][c];
        for (int c = 0; c < rows; c++) stress[c][k] = p->stress[k][c];
        log_density[k] = p->log_density[k];
        bulking[k] = 1;
        shear_rate[k] = gr_law_at(law)->reaction ? 0 : p->shear_rate[k];
    }
    kernels->laws[law]->update[p->dim - 2](&call);
    for (int k = 0; k < p->n; k++) {
        for (int c = 0; c < rows; c++) p->stress[k][c] = stress[c][k];
        p->shear_rate[k] = shear_rate[k];
    }
}

/* The trial stress s + C:D dt + W s - s W, by full 3 x 3 matrices. */
static void trial(const double *L, const double *s, int dim, double out[6])
{
    const int place[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
    double grad[3][3] = {{0}}, full[3][3], trace = 0;
    for (int i = 0; i < dim; i++)
        for (int j = 0; j < dim; j++) grad[i][j] = L[i * dim + j];
    for (int i = 0; i < 3; i++) {
        trace += grad[i][i];
        for (int j = 0; j < 3; j++) full[i][j] = dim == 2 && place[i][j] > 3 ? 0 : s[place[i][j]];
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double sum = full[i][j] + G * (grad[i][j] + grad[j][i]) + (i == j ? (K - 2 * G / 3) * trace : 0);
            for (int k = 0; k < 3; k++)
                sum += 0.5 * (grad[i][k] - grad[k][i]) * full[k][j] - full[i][k] * 0.5 * (grad[k][j] - grad[j][k]);
            out[place[i][j]] = sum;
        }
}

static void invariants(const double *s, int dim, double *p, double *tau)
{
    double square = 0;
    *p = -(s[0] + s[1] + s[2]) / 3;
    for (int c = 0; c < 3; c++) square += 0.5 * (s[c] + *p) * (s[c] + *p);
    for (int c = 3; c < (dim == 2 ? 4 : 6); c++) square += s[c] * s[c];
    *tau = sqrt(square);
}

static void each_isa(void (*check)(const struct gr_kernels *kernels, int dim))
{
    for (int dim = 2; dim <= 3; dim++) {
        scene_seed(41);
        check(gr_kernels_select("baseline"), dim);
        check(gr_kernels_select(NULL), dim);
    }
}

/* Random points, which are put into `old`, after an update. */
static struct points updated(const struct gr_kernels *kernels, const char *law, int dim, double strain, int from_density,
                             struct points *old)
{
    random_points(old, dim, MOST, strain);
    struct points p = *old;
    update(kernels, gr_law_index(law), &p, from_density);
    return p;
}

#define TEST_OF_EACH_ISA(name)                                           \
    static void check_##name(const struct gr_kernels *kernels, int dim); \
    TEST(name) { each_isa(check_##name); }                               \
    static void check_##name(const struct gr_kernels *kernels, int dim)

TEST_OF_EACH_ISA(elastic_is_the_jaumann_rate)
{
    struct points old, p = updated(kernels, "elastic", dim, 1e-3, 0, &old);
    for (int k = 0; k < MOST; k++) {
        double t[6];
        trial(old.gradient[k], old.stress[k], dim, t);
        for (int c = 0; c < (dim == 2 ? 4 : 6); c++) CHECK_NEAR(p.stress[k][c], t[c], 1e-11 * K * 1e-3);
        CHECK(p.shear_rate[k] == 0);
    }
}

/* mu(I): the stress is on the yield surface or inside, and obeys gdot = xi sqrt(p) (mu - mu_s)/(mu_2 - mu) (eq. 2.13). */
TEST_OF_EACH_ISA(mu_I_flows)
{
    for (int from_density = 0; from_density < 2; from_density++) {
        struct points old, q = updated(kernels, "mu_I", dim, 1e-3, from_density, &old);
        int elastic = 0, flowing = 0;
        for (int k = 0; k < MOST; k++) {
            double t[6], p, tau, p_trial, tau_trial;
            trial(old.gradient[k], old.stress[k], dim, t);
            invariants(t, dim, &p_trial, &tau_trial);
            invariants(q.stress[k], dim, &p, &tau);
            if (from_density) p_trial = K * old.log_density[k];
            CHECK_NEAR(p, fmax(0, p_trial), 1e-10 * K * 1e-3);
            CHECK(tau <= MU_2 * p * (1 + 1e-12));
            if (!(p_trial > 0)) {
                CHECK(p == 0 && tau == 0 && q.shear_rate[k] == 0);
            } else if (tau_trial <= MU_S * p) {
                CHECK_NEAR(tau, tau_trial, 1e-9);
                CHECK(q.shear_rate[k] == 0);
                elastic++;
            } else {
                const double mu = tau / p;
                CHECK(mu > MU_S);
                CHECK_NEAR(q.shear_rate[k], XI * sqrt(p) * (mu - MU_S) / (MU_2 - mu), 1e-6 * q.shear_rate[k] + 1e-9);
                CHECK_NEAR(q.shear_rate[k], (tau_trial - tau) / (G * DT), 1e-9 * q.shear_rate[k] + 1e-9);
                flowing++;
            }
        }
        CHECK(elastic > 0 && flowing > 0);
    }
}

TEST_OF_EACH_ISA(drucker_prager_returns)
{
    struct points old, q = updated(kernels, "drucker_prager", dim, 5e-4, 0, &old);
    for (int k = 0; k < MOST; k++) {
        double t[6], p, tau, p_trial, tau_trial;
        trial(old.gradient[k], old.stress[k], dim, t);
        invariants(t, dim, &p_trial, &tau_trial);
        invariants(q.stress[k], dim, &p, &tau);
        CHECK_NEAR(tau, p_trial > 0 ? fmin(tau_trial, MU_S * p_trial) : 0, 1e-9 * (1 + fabs(p_trial)));
        if (p > 0 && tau_trial > MU_S * p) /* the deviator keeps its direction */
            for (int c = 3; c < (dim == 2 ? 4 : 6); c++)
                CHECK_NEAR(q.stress[k][c] * tau_trial, t[c] * tau, 1e-8 * tau_trial * p);
    }
}

/* The regularised mu(I): below x1 the rate is the creep rate, above it the rate of mu(I) with mu_inf; both satisfy the
 * implicit step. */
TEST_OF_EACH_ISA(regularised_mu_I_creeps_and_flows)
{
    struct points old, q = updated(kernels, "regularised_mu_I", dim, 1e-3, 0, &old);
    int creeping = 0, flowing = 0;
    const double x1 = I1 / XI, k = MU_INF * XI, mu_1 = (MU_S + x1 * (MU_2 + k * x1)) / (1 + x1);
    for (int i = 0; i < MOST; i++) {
        double t[6], p, tau, p_trial, tau_trial;
        trial(old.gradient[i], old.stress[i], dim, t);
        invariants(t, dim, &p_trial, &tau_trial);
        invariants(q.stress[i], dim, &p, &tau);
        CHECK_NEAR(p, fmax(0, p_trial), 1e-10 * K * 1e-3);
        if (!(p_trial > 0)) continue;
        const double x = q.shear_rate[i] / (XI * sqrt(p)), mu = tau / p;
        const double expected =
            x > x1 ? (MU_S + x * (MU_2 + k * x)) / (1 + x) : sqrt(ALPHA / (ALPHA / (mu_1 * mu_1) + log(x1 / x)));
        CHECK_NEAR(q.shear_rate[i], (tau_trial - tau) / (G * DT), 1e-9 * q.shear_rate[i] + 1e-9);
        if (x > 1e-7) { /* otherwise the rate is a small difference of stresses */
            CHECK_NEAR(mu, expected, 1e-6 * mu);
            creeping += x <= x1, flowing += x > x1;
        }
    }
    CHECK(creeping > 0 && flowing > 0);
}

/* Below rho_c or in tension the stress is zero, in each lane separately. */
TEST_OF_EACH_ISA(disconnected_is_stress_free)
{
    for (int law = gr_law_index("drucker_prager"); law <= gr_law_index("ngf"); law++) {
        struct points q;
        random_points(&q, dim, MOST, 0);
        for (int k = 0; k < MOST; k += 3) q.log_density[k] = -1e-12;
        for (int k = 1; k < MOST; k += 3)
            for (int c = 0; c < 3; c++) q.stress[k][c] = 10;
        update(kernels, law, &q, 0);
        for (int k = 0; k < MOST; k++)
            for (int c = 0; c < (dim == 2 ? 4 : 6); c++) CHECK((q.stress[k][c] == 0) == (k % 3 < 2));
    }
}

/* Without strain an admissible stress does not change. (The finite-strain laws set the pressure by the density.) */
TEST_OF_EACH_ISA(rest_is_rest)
{
    for (int law = 0; law <= gr_law_index("ngf"); law++) {
        struct points q, old;
        random_points(&q, dim, MOST, 0);
        for (int k = 0; k < MOST; k++)
            for (int c = 0; c < 6; c++) q.stress[k][c] = (c < 3 ? -1000 : 0) + 100 * scene_random(-1, 1);
        old = q;
        update(kernels, law, &q, 0);
        for (int k = 0; k < MOST; k++)
            for (int c = 0; c < (dim == 2 ? 4 : 6); c++) CHECK_NEAR(q.stress[k][c], old.stress[k][c], 1e-12 * 1000);
    }
}

/* A NaN stays in its lane, and does not vanish. */
TEST_OF_EACH_ISA(nan_stays_in_its_lane)
{
    for (int law = 0; gr_law_at(law); law++) {
        struct points q, clean;
        random_points(&q, dim, MOST, 1e-4);
        clean = q;
        q.stress[5][0] = NAN;
        update(kernels, law, &clean, 0);
        update(kernels, law, &q, 0);
        for (int k = 0; k < MOST; k++)
            if (k != 5) CHECK(!memcmp(q.stress[k], clean.stress[k], sizeof(double) * (dim == 2 ? 4 : 6)));
        if (law == gr_law_index("elastic") || law == gr_law_index("hencky_elastic")) CHECK(isnan(q.stress[5][0]));
    }
}

TEST(laws_are_described)
{
    const char *const names[] = {"elastic", "drucker_prager", "mu_I", "ngf", "regularised_mu_I", "own"};
    const int n_names = sizeof names / sizeof *names;
    for (int law = 0; gr_law_at(law); law++) {
        const struct gr_law *info = gr_law_at(law);
        CHECK(gr_law_parameters(info) >= 2 && gr_law_parameters(info) <= GR_LAW_MAX_PARAMETERS);
        if (law < n_names) CHECK(!strcmp(info->name, names[law]));
        for (int q = 0; q < gr_law_parameters(info); q++)
            CHECK(*info->parameter[q].name && *info->parameter[q].unit && *info->parameter[q].doc);
        if (!info->reaction) CHECK(!strcmp(info->parameter[0].name, "K") && !strcmp(info->parameter[1].name, "G"));
    }
}
