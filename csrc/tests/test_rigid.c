/* Tests of mpm/rigid.c and mpm/rigid_impulse.c: a disc that rebounds from a block, and allocations that fail. */
#include "contact/rigid.h"

#include "tests/check.h"
#include "tests/faults.h"
#include "tests/scene.h"

enum { MOST = 60, STEPS = 400 };

/* A disc with the radius 0.05 m, 0.05 m above a block, which falls at 1 m/s without gravity. */
static void give_disc(struct gr_config *c)
{
    static const double motion[] = {0, 0.2, -1, 0, 0, 0, 0};
    static const struct gr_part part = {
        .kind = GR_PART_CYLINDER, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .size = {0.05, INFINITY, 0}};
    static struct gr_body body;
    body = (struct gr_body){.n_parts = 1,
                            .contact = GR_CONTACT_SEPARATING,
                            .free = 3,
                            .friction = 0.4,
                            .mass = 2,
                            .turns = 1,
                            .inertia = {1, 1, 0.0025},
                            .principal = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                            .bound = 0.05,
                            .extent = {0.05, 0.05, INFINITY},
                            .position = {-0.55, 2.5, 0},
                            .orientation = {1, 0, 0, 0},
                            .n_motion = 1,
                            .motion = motion};
    c->n_bodies = c->n_parts = 1, c->bodies = &body, c->parts = &part;
}

static int touch(struct gr_engine *e)
{
    static const struct gr_obstacle block = {.lower = {-GR_FAR, -GR_FAR, -GR_FAR},
                                             .upper = {GR_FAR, 2.4, GR_FAR},
                                             .friction = GR_FAR,
                                             .opens_at = GR_FAR,
                                             .axis = -1};
    static const double ball[] = {0, 0, 0, 0.05}, restitution[] = {0.5};
    static const int64_t first[] = {0, 1};
    return gr_rigid_new(e, &(struct gr_rigid_config){1, &block, ball, restitution, first});
}

static int build(struct scene *s)
{
    scene_seed(83);
    scene_default(s, 2, GR_LINEAR, GR_AFFINE_NONE, 0);
    give_disc(&s->config);
    return scene_build(s, 100, 0.1, 0.3);
}

/* With e = 0.5 and mu = 0.4 the plastic impact leaves the disc rolling or slips: the impulse along the floor that stops the
 * sliding, m_t 0.2 with m_t = 1/(1/m + r^2/I), is 0.133, less than mu J_n = 0.8. Both are multiplied by 1.5. */
TEST(a_disc_rebounds)
{
    struct scene s;
    const struct gr_kernels *kernels = gr_kernels_select("baseline");
    CHECK(build(&s) == GR_OK && touch(s.engine) == GR_OK);
    CHECK(gr_advance(s.engine, kernels, 100000, 0.07, 1) == GR_OK);
    const struct gr_body_state *now = s.engine->bodies.now;
    const double mobility = 1 / 2.0 + 0.05 * 0.05 / 0.0025, along = 1.5 * 0.2 / mobility;
    CHECK_NEAR(now->v[1], 0.5, 1e-12);
    CHECK_NEAR(now->v[0], 0.2 - along / 2, 1e-12);
    CHECK_NEAR(now->omega[2], -along * 0.05 / 0.0025, 1e-12);
    scene_free(&s);
}

TEST(new_fails)
{
    long n = 0;
    int error;
    struct scene s;
    CHECK(build(&s) == GR_OK);
    do {
        faults_at(++n);
        error = touch(s.engine);
        const int hit = faults_end();
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK) && !s.engine->bodies.rigid == !!error);
    } while (error && n < MOST);
    CHECK(n > 5 && n < MOST);
    scene_free(&s);
}

/* Advance with a fault, then again: the disc is where it is without a fault. */
TEST(advance_fails)
{
    long n = 0;
    int error;
    struct scene good;
    const struct gr_kernels *kernels = gr_kernels_select("baseline");
    CHECK(build(&good) == GR_OK && touch(good.engine) == GR_OK);
    CHECK(gr_advance(good.engine, kernels, STEPS, INFINITY, 1) == GR_OK);
    do {
        struct scene s;
        CHECK(build(&s) == GR_OK && touch(s.engine) == GR_OK);
        faults_at(++n);
        error = gr_advance(s.engine, kernels, STEPS, INFINITY, 1);
        const int hit = faults_end();
        CHECK(error == (hit ? GR_ERR_MEMORY : GR_OK));
        CHECK(gr_advance(s.engine, kernels, STEPS - s.engine->clock.step, INFINITY, 1) == GR_OK);
        CHECK(!memcmp(s.engine->bodies.now, good.engine->bodies.now, sizeof *good.engine->bodies.now));
        CHECK(!scene_differs(&good, &s));
        scene_free(&s);
    } while (error && n < MOST);
    CHECK(n > 2 && n < MOST);
    scene_free(&good);
}
