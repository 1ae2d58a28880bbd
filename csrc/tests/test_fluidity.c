/* Tests of fluidity/ and law/fluidity_update.h: against values computed by hand, with invalid input and without memory. */
#include "fluidity/fluidity.h"

#include <string.h>

#include "core/simd.h"
#include "mpm/engine.h"
#include "tests/check.h"
#include "tests/faults.h"
#include "tests/scene.h"

enum { MOST = 64 * 64 };

static uint8_t faces[6 * MOST];

/* nx x ny (x nz) cells, all faces linked. A^2 d^2/t0 = 1 and dx = 1, so that the explicit limit in 2D is 1/4. */
static struct gr_fluidity_config plain(int64_t nx, int64_t ny, int64_t nz)
{
    memset(faces, GR_FACE_LINK, sizeof faces);
    return (struct gr_fluidity_config){.dim = nz ? 3 : 2,
                                       .shape = {nx, ny, nz},
                                       .dx = 1,
                                       .A = 2,
                                       .d = 0.5,
                                       .t0 = 1,
                                       .tolerance = 1e-13,
                                       .max_iterations = 1000,
                                       .face = faces};
}

static struct gr_fluidity *built(const struct gr_fluidity_config *config)
{
    struct gr_fluidity *f = NULL;
    CHECK(gr_fluidity_new(&f, config) == GR_OK && gr_fluidity_cover(f, NULL, NULL, 0) == GR_OK);
    for (int64_t i = 0; i < f->n_cells; i++) f->dense[i] = 1;
    return f;
}

static int run(struct gr_fluidity *f, const char *isa, int method, double dt, int64_t steps, int threads)
{
    const struct gr_diffusion_call call = {method, dt, steps};
    return gr_fluidity_run(f, gr_kernels_select(isa)->passes, &call, threads);
}

/* Three cells in a row between a no-slip wall on the left and an open end: one explicit step by hand. */
TEST(three_cells)
{
    struct gr_fluidity_config config = plain(3, 1, 0);
    faces[0] = GR_FACE_ROUGH;
    struct gr_fluidity *f = built(&config);
    const double g[] = {1, 3, 2}, k = 0.2;
    memcpy(f->g, g, sizeof g);
    CHECK(run(f, "", GR_DIFFUSION_explicit, k, 1, 1) == GR_OK);
    CHECK_NEAR(f->g[0], 1 + k * (2 - 2), 1e-15);
    CHECK_NEAR(f->g[1], 3 + k * (-2 - 1), 1e-15);
    CHECK_NEAR(f->g[2], 2 + k, 1e-15);
    gr_fluidity_free(f);
}

/* Two cells of a periodic axis exchange across both of their faces; a single cell does not exchange with itself. */
TEST(periodic_ends)
{
    for (int64_t n = 1; n <= 4; n++) {
        struct gr_fluidity_config config = plain(n, 1, 0);
        config.periodic[0] = 1;
        struct gr_fluidity *f = built(&config);
        f->g[0] = 1;
        CHECK(run(f, "", GR_DIFFUSION_explicit, 0.25, 1, 1) == GR_OK);
        CHECK_NEAR(f->g[0], n == 1 ? 1 : 0.5, 0);
        if (n > 1) CHECK_NEAR(f->g[n - 1], n == 2 ? 0.5 : 0.25, 0);
        if (n == 4) CHECK_NEAR(f->g[2], 0, 0);
        gr_fluidity_free(f);
    }
}

/* A link exists only if both cells have it and both are dense. */
TEST(links_are_mutual)
{
    for (int cut = 0; cut < 3; cut++) {
        struct gr_fluidity_config config = plain(2, 1, 0);
        if (cut == 1) faces[1 * 2 + 0] = GR_FACE_OPEN; /* high side of the left cell only */
        struct gr_fluidity *f = built(&config);
        f->g[0] = 1;
        if (cut == 2) f->dense[1] = 0, f->g[1] = 7;
        CHECK(run(f, "", GR_DIFFUSION_implicit, 10, 1, 1) == GR_OK);
        CHECK_NEAR(f->g[0], cut ? 1 : 11.0 / 21.0, 1e-12);
        CHECK_NEAR(f->g[1], cut ? 0 : 10.0 / 21.0, 1e-12);
        gr_fluidity_free(f);
    }
}

/* Three cells in a row with a thin body through the middle one. Each side of that cell exchanges with its own
 * neighbour. Where the body ends, the cell has one value, which exchanges with both. */
TEST(two_sides)
{
    for (int stencil = 0; stencil < GR_STENCIL_COUNT; stencil++)
        for (int apart = 0; apart < 2; apart++) {
            struct gr_fluidity_config config = plain(3, 1, 0);
            const int64_t cells[] = {0, 1, 1, 2};
            const int8_t sides[] = {2, 1, -1, -2};
            struct gr_fluidity *f = NULL;
            const double k = 0.1;
            config.two_sided = 1, config.stencil = stencil;
            CHECK(gr_fluidity_new(&f, &config) == GR_OK && gr_fluidity_cover(f, cells, sides, 4) == GR_OK);
            const int64_t front = gr_fluidity_place(f, 1, 0), back = gr_fluidity_place(f, 1, 1);
            CHECK(f->pages.n == 2 && front != back);
            f->has_inside = 1;
            f->inside[2] = GR_BEHIND;
            f->inside[front] = apart ? GR_SEPARATED : 0;
            f->inside[back] = apart ? GR_SEPARATED | GR_BEHIND : GR_HIDDEN;
            f->dense[0] = f->dense[front] = f->dense[2] = 1, f->dense[back] = (uint8_t)apart;
            f->g[0] = 1, f->g[front] = 4, f->g[back] = apart ? 3 : 0, f->g[2] = 8;
            CHECK(run(f, "", GR_DIFFUSION_explicit, k, 1, 1) == GR_OK);
            CHECK_NEAR(f->g[0], 1 + k * 3, 1e-14);
            CHECK_NEAR(f->g[front], 4 - k * 3 + (apart ? 0 : k * 4), 1e-14);
            CHECK_NEAR(f->g[2], 8 - k * (apart ? 5 : 4), 1e-14);
            if (apart) CHECK_NEAR(f->g[back], 3 + k * 5, 1e-14);
            gr_fluidity_free(f);
        }
}

TEST(limits)
{
    struct gr_fluidity_config config = plain(8, 8, 0);
    struct gr_fluidity *f = built(&config);
    CHECK_NEAR(gr_fluidity_limit(f, GR_DIFFUSION_explicit), 0.25, 1e-16);
    CHECK_NEAR(gr_fluidity_limit(f, GR_DIFFUSION_rkl2), 0.25 * (999.0 * 999 + 997) / 4, 1e-9);
    CHECK(isinf(gr_fluidity_limit(f, GR_DIFFUSION_implicit)));
    CHECK(run(f, "", GR_DIFFUSION_explicit, 0.98 * 0.25, 1, 1) == GR_OK);
    CHECK(run(f, "", GR_DIFFUSION_explicit, 0.25, 1, 1) == GR_ERR_LIMIT);
    CHECK(run(f, "", GR_DIFFUSION_explicit, 1.02 * 0.25, 1, 1) == GR_ERR_LIMIT);
    CHECK(run(f, "", GR_DIFFUSION_rkl2, 1e6, 1, 1) == GR_ERR_LIMIT);
    CHECK(run(f, "", GR_DIFFUSION_implicit, 0, 1, 1) == GR_ERR_CONFIG);
    CHECK(run(f, "", GR_DIFFUSION_implicit, NAN, 1, 1) == GR_ERR_CONFIG);
    CHECK(run(f, "", GR_DIFFUSION_implicit, 1, -1, 1) == GR_ERR_CONFIG);
    CHECK(run(f, "", GR_DIFFUSION_COUNT, 1, 1, 1) == GR_ERR_CONFIG);
    CHECK(gr_fluidity_stages(f, 0.62) == 3 && gr_fluidity_stages(f, 0.63) == 5);
    gr_fluidity_free(f);
}

/* A fluidity whose square is no number has no residual: the search has no end. */
TEST(squares_that_overflow)
{
    struct gr_fluidity_config config = plain(3, 1, 0);
    struct gr_fluidity *f = built(&config);
    f->g[0] = 1e200;
    CHECK(run(f, "", GR_DIFFUSION_implicit, 1, 1, 1) == GR_ERR_DIVERGED);
    gr_fluidity_free(f);
}

TEST(bad_lattices)
{
    struct gr_fluidity *f;
    for (int k = 0; k < 10; k++) {
        struct gr_fluidity_config c = plain(4, 4, 0);
        if (k == 0) c.dim = 1;
        if (k == 1) c.shape[1] = 0;
        if (k == 2) c.dx = 0;
        if (k == 3) c.A = -1;
        if (k == 4) c.d = 0;
        if (k == 5) c.t0 = -1;
        if (k == 6) c.tolerance = 1;
        if (k == 7) c.max_iterations = 0;
        if (k == 8) c.A = 1e300;
        if (k == 9) c.t0 = NAN;
        CHECK(gr_fluidity_new(&f, &c) == GR_ERR_CONFIG && !f);
    }
    gr_fluidity_free(NULL);
}

static void random_state(struct gr_fluidity *f)
{
    scene_seed(7);
    for (int64_t i = 0; i < f->n_cells; i++) {
        f->dense[i] = scene_random(0, 1) < 0.9;
        f->g[i] = scene_random(0, 5);
    }
}

static void random_faces(void)
{
    scene_seed(5);
    for (int64_t i = 0; i < 6 * MOST; i++)
        if (scene_random(0, 1) < 0.1) faces[i] = scene_random(0, 1) < 0.5 ? GR_FACE_OPEN : GR_FACE_ROUGH;
}

/* The result has the same bits for any number of threads, and instruction sets agree to round-off. A step allocates
 * nothing. */
TEST(threads_and_sets_agree)
{
    static const char *const sets[] = {"baseline", "avx2", "avx512"};
    static double first[MOST], reference[MOST];
    for (int dim = 2; dim <= 3; dim++)
        for (int method = 0; method < GR_DIFFUSION_COUNT; method++)
            for (int set = 0; set < 3; set++) {
                if (!gr_kernels_select(sets[set])) continue;
                for (int threads = 1; threads <= 3; threads++) {
                    struct gr_fluidity_config config = dim == 2 ? plain(64, 64, 0) : plain(16, 16, 16);
                    config.periodic[0] = 1;
                    random_faces();
                    struct gr_fluidity *f = built(&config);
                    random_state(f);
                    faults_at(0);
                    CHECK(run(f, sets[set], method, method ? 2.0 : 0.15, 3, threads) == GR_OK);
                    CHECK(threads > 1 || faults_calls() == 0);
                    const size_t bytes = sizeof(double) * (size_t)f->n_cells;
                    if (threads == 1) memcpy(first, f->g, bytes);
                    if (threads == 1 && set == 0) memcpy(reference, f->g, bytes);
                    CHECK(!memcmp(first, f->g, bytes));
                    for (int64_t i = 0; i < f->n_cells; i++) CHECK_NEAR(f->g[i], reference[i], 1e-11);
                    gr_fluidity_free(f);
                }
            }
}

TEST(does_not_converge)
{
    struct gr_fluidity_config config = plain(64, 64, 0);
    config.max_iterations = 2;
    struct gr_fluidity *f = built(&config);
    random_state(f);
    for (int threads = 1; threads <= 3; threads++)
        CHECK(run(f, "", GR_DIFFUSION_implicit, 10, 2, threads) == GR_ERR_DIVERGED);
    f->g[5] = NAN, f->dense[5] = 1, f->max_iterations = 1 << 30;
    CHECK(run(f, "", GR_DIFFUSION_implicit, 10, 1, 1) == GR_ERR_DIVERGED);
    gr_fluidity_free(f);
}

/* Whichever allocation of the grid or of its places fails, no place is left, and a second try succeeds. */
TEST(without_memory)
{
    const struct gr_fluidity_config config = plain(20, 20, 0);
    int of_places = 0;
    for (long n = 1;; n++) {
        struct gr_fluidity *f;
        faults_at(n);
        int error = gr_fluidity_new(&f, &config);
        CHECK(!error || !f);
        if (!error) {
            error = gr_fluidity_cover(f, NULL, NULL, 0);
            of_places += error == GR_ERR_MEMORY;
            CHECK(f->pages.n == (error ? 0 : 50));
            const int hit = faults_end();
            if (hit) CHECK(gr_fluidity_cover(f, NULL, NULL, 0) == GR_OK && f->pages.n == 50);
            gr_fluidity_free(f);
            CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
            if (!hit) break;
        }
        CHECK(error == GR_ERR_MEMORY);
    }
    faults_at(0);
    CHECK(of_places > 3);
}

/* If only some cells of a box have places, their fluidity is the same to the last bit, as the others are not dense. */
TEST(places_do_not_matter)
{
    for (int dim = 2; dim <= 3; dim++)
        for (int method = 0; method < GR_DIFFUSION_COUNT; method++)
            for (int stencil = 0; stencil < GR_STENCIL_COUNT; stencil++) {
                struct gr_fluidity_config config = dim == 2 ? plain(37, 61, 0) : plain(13, 11, 17);
                struct gr_fluidity *all, *few;
                int64_t cells[MOST], n = 0;
                config.periodic[0] = config.periodic[1] = 1;
                config.stencil = stencil;
                random_faces();
                all = built(&config);
                random_state(all);
                for (int64_t i = 0; i < all->n_cells; i++) {
                    all->dense[i] = i % 200 < 70 && all->dense[i];
                    if (all->dense[i] || i % 31 == 0) cells[n++] = i;
                }
                CHECK(gr_fluidity_new(&few, &config) == GR_OK);
                CHECK(gr_fluidity_cover(few, cells, NULL, n / 2) == GR_OK); /* cover another set before */
                CHECK(gr_fluidity_cover(few, cells, NULL, n) == GR_OK && few->pages.n < all->pages.n);
                for (int64_t k = 0; k < n; k++) {
                    const int64_t place = gr_fluidity_place(few, cells[k], 0);
                    few->dense[place] = all->dense[cells[k]], few->g[place] = all->g[cells[k]];
                }
                CHECK(run(all, "", method, method ? 2.0 : 0.15, 3, 1) == GR_OK);
                CHECK(run(few, "", method, method ? 2.0 : 0.15, 3, 2) == GR_OK);
                CHECK(all->iterations == few->iterations && all->clamped == few->clamped);
                for (int64_t k = 0; k < n; k++) {
                    const double g = few->g[gr_fluidity_place(few, cells[k], 0)];
                    CHECK(!memcmp(&g, &all->g[cells[k]], sizeof g));
                }
                gr_fluidity_free(all);
                gr_fluidity_free(few);
            }
}

/* At rest below yield nothing flows. In steady flow at a constant rate the friction follows mu(I). */
TEST(points)
{
    const double G = 3e5, mu_s = 0.38, mu_2 = 0.64, I0 = 0.28, rho_s = 2450, d = 5e-3, t0 = 1e-3, p = 1000, rate = 5;
    double trial[3], mu[3] = {0.4, 0.4, 0.4}, g[3] = {1, 1, 1}, last[3], pressure[3] = {p, p, p};
    struct gr_fluidity_call call = {.n = 3,
                                    .dt = 1e-4,
                                    .parameter = {G, mu_s, mu_2, I0, rho_s, d, t0, 0},
                                    .mu_trial = trial,
                                    .p = pressure,
                                    .g_star = g,
                                    .shear_rate = last,
                                    .mu = mu,
                                    .g = g};
    for (int step = 0; step < 4000; step++) {
        for (int k = 0; k < 3; k++) last[k] = mu[k] * g[k], trial[k] = mu[k] + G * call.dt * rate / p;
        gr_kernels_select("")->update_fluidity(&call);
    }
    const double inertial = rate * d * sqrt(rho_s / p);
    for (int k = 0; k < 3; k++) {
        CHECK_NEAR(mu[k], mu_s + (mu_2 - mu_s) * inertial / (inertial + I0), 1e-9);
        CHECK_NEAR(mu[k] * g[k], rate, 1e-8);
        trial[k] = 0.3, g[k] = last[k] = 0;
    }
    gr_kernels_select("")->update_fluidity(&call);
    for (int k = 0; k < 3; k++) CHECK(mu[k] == 0.3 && g[k] == 0);
}
