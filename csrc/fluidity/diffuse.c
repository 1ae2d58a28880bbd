/* Time steps of the diffusion of the fluidity: explicit, backward Euler (implicit) or RKL2.
 *
 * With k = dt A^2 d^2/(t0 dx^2) and the net outflow of a cell (fluidity.h), (L g)_i = sum over links (g_i - g_j) + 2
 * (rough faces) g_i = -dx^2 lap g:
 *
 *   explicit   g' = g - k L g
 *   implicit   (1 + k L) g' = g. The matrix is symmetric, its eigenvalues are at least 1, and it is an M-matrix: no new
 *              value is negative. Conjugate gradients start from g and stop when |residual| <= tolerance |k L g|, the
 *              residual of g itself, or at round-off. As no eigenvalue is below 1, the error of g' - g in the 2-norm
 *              is at most that bound: a share of the change, however short the step.
 *   rkl2       Runge-Kutta-Legendre of second order (Meyer, Balsara & Aslam 2012, MNRAS 422; 2014, J. Comput. Phys. 257).
 *
 * Rounding, a coarse tolerance, or a long explicit or rkl2 step can make values negative. These are set to zero and
 * counted. A step consists of passes over all cells (passes.inl), by a team of threads or by a device. Each chunk has a part of
 * every sum, and the parts are added up exactly, so that ranks can have chunks of their own. Before each product with L they
 * exchange the values of the cells next to those of others. */
#include "fluidity/pass.h"

struct steps {
    struct gr_diffusion_work w;
    struct gr_team *team;
    gr_chunk_work *const *work; /* of the passes */
    const struct gr_diffusion_device *device;
    int64_t iterations, guess; /* a device is asked after so many iterations of a step whether the search has ended */
};

static int is_foreign(const struct gr_fluidity *f, int64_t chunk) { return f->ranks && f->ranks->foreign[chunk]; }

/* The sum of the parts of all chunks, on all ranks; NaN if one does not answer. */
static double total(const struct gr_fluidity *f, const double *partial)
{
    struct gr_exact sum = {.nan = 0};
    for (int64_t c = 0; c < f->pages.n_chunks; c++)
        if (!is_foreign(f, c)) gr_exact_add(&sum, partial[c]);
    if (f->ranks && f->ranks->sum(f->ranks->context, &sum)) return NAN;
    return gr_exact_value(&sum);
}

/* Receive values of cells of other ranks. Returned: 0, or GR_ERR_DIVERGED if one does not answer. */
static int receive(const struct gr_fluidity *f, double *values, uint8_t *dense)
{
    return f->ranks && f->ranks->exchange(f->ranks->context, values, dense) ? GR_ERR_DIVERGED : GR_OK;
}

static void run_pass(struct steps *s, enum gr_diffusion_pass pass)
{
    struct gr_fluidity *f = s->w.f;
    double sum[2];
    s->w.which = pass;
    if (s->device) {
        s->device->pass(s->device->context, &s->w);
        return;
    }
    gr_team_run(s->team, s->work[pass], &s->w, f->pages.n_chunks);
    for (int k = 0; k < gr_sums_of_pass(pass); k++) sum[k] = total(f, f->space.partial[k]);
    gr_end_pass(f, pass, sum);
}

static void swap(double **a, double **b)
{
    double *const c = *a;
    *a = *b, *b = c;
}

static int explicit_step(struct steps *s)
{
    if (receive(s->w.f, s->w.g, NULL)) return GR_ERR_DIVERGED;
    s->w.out = s->w.work[0];
    run_pass(s, GR_PASS_explicit);
    swap(&s->w.g, &s->w.work[0]);
    return GR_OK;
}

/* Whether the search has ended. A device goes on until it is asked, as an answer takes as long as some passes. */
static int has_ended(struct steps *s, int64_t made)
{
    enum { SHARE = 4 }; /* an estimate: it is asked again after another part in this number */
    if (!s->device) return s->w.f->descent.ended;
    if (made < s->guess) return 0;
    s->guess = made + made / SHARE + 1;
    return s->device->wait(s->device->context) || s->w.f->descent.ended;
}

static int implicit_step(struct steps *s)
{
    struct gr_fluidity *f = s->w.f;
    if (receive(f, s->w.g, NULL)) return GR_ERR_DIVERGED;
    run_pass(s, GR_PASS_first_residual);
    for (int64_t made = 0; !has_ended(s, made); made++) {
        if (receive(f, s->w.work[1], NULL)) return GR_ERR_DIVERGED;
        run_pass(s, GR_PASS_multiply);
        run_pass(s, GR_PASS_descend);
        if (s->device || !f->descent.ended) run_pass(s, GR_PASS_turn);
    }
    if (f->descent.failed) return GR_ERR_DIVERGED;
    s->iterations += f->descent.made;
    s->guess = f->descent.made;
    s->w.out = s->w.g;
    run_pass(s, GR_PASS_clamp);
    return GR_OK;
}

/* The coefficients b_j of RKL2: b_j = (j^2 + j - 2)/(2 j (j + 1)), and 1/3 for j < 2. */
static double legendre(int j) { return j < 2 ? 1.0 / 3.0 : (j * j + j - 2.0) / (2.0 * j * (j + 1.0)); }

/* Coefficients of stage j of as many. */
static struct gr_stage stage_of(int j, int stages, double k)
{
    const double scale = 4.0 / ((double)stages * stages + stages - 2.0);
    if (j == 1) return (struct gr_stage){.step = legendre(1) * scale * k};
    const double mu = (2.0 * j - 1) / j * legendre(j) / legendre(j - 1);
    const double nu = -(j - 1.0) / j * legendre(j) / legendre(j - 2), step = mu * scale * k;
    return (struct gr_stage){.mu = mu, .nu = nu, .step = step, .back = (1 - legendre(j - 1)) * step};
}

static int rkl2_step(struct steps *s, double dt)
{
    struct gr_diffusion_work *w = &s->w;
    const int stages = gr_fluidity_stages(w->f, dt);
    w->in = w->work[0], w->out = w->work[1];
    for (int j = 1; j <= stages; j++) {
        if (receive(w->f, j == 1 ? w->g : w->in, NULL)) return GR_ERR_DIVERGED;
        w->stage = stage_of(j, stages, w->k);
        run_pass(s, j == 1 ? GR_PASS_first_stage : GR_PASS_later_stage);
        if (j > 1) swap(&w->in, &w->out);
    }
    w->work[0] = w->g, w->work[1] = w->out, w->g = w->out = w->in;
    run_pass(s, GR_PASS_clamp);
    s->iterations += stages;
    return GR_OK;
}

static void extrapolate(void *context, int64_t chunk, int t)
{
    const struct gr_diffusion_work *w = context;
    (void)t;
    gr_fluidity_extrapolate(w->f, chunk, w->g);
}

/* Give the arrays back, and count the cells that were clamped. */
static void end(struct steps *s)
{
    struct gr_fluidity *f = s->w.f;
    f->iterations = s->iterations;
    for (int64_t c = 0; !s->device && c < f->pages.n_chunks; c++)
        if (!is_foreign(f, c)) f->clamped += f->space.partial_clamped[c];
    f->g = s->w.g;
    for (int k = 0; k < 3; k++) f->space.vector[k] = s->w.work[k];
}

/* For a grid of few chunks waiting for other threads does not pay: one thread does all the work. */
int gr_fluidity_diffuse(struct gr_fluidity *f, const struct gr_passes *passes, const struct gr_diffusion_call *call,
                        struct gr_team *team, const struct gr_diffusion_device *device)
{
    enum { CHUNKS_WORTH_SHARING = 8 };
    struct steps s = {.w = {.f = f,
                            .k = call->dt * f->diffusivity / (f->dx * f->dx),
                            .g = f->g,
                            .work = {f->space.vector[0], f->space.vector[1], f->space.vector[2]}},
                      .team = f->pages.n_chunks < CHUNKS_WORTH_SHARING ? NULL : team,
                      .work = passes->of[f->n_links == 2   ? 0
                                         : f->n_links == 3 ? 1
                                         : f->n_links == 4 ? 2
                                                           : 3],
                      .device = device,
                      .guess = f->descent.made};
    f->clamped = 0; /* a device adds to it */
    f->error = receive(f, f->g, f->dense);
    run_pass(&s, GR_PASS_connect);
    for (int64_t n = 0; n < call->steps && !f->error; n++)
        f->error = call->method == GR_DIFFUSION_explicit   ? explicit_step(&s)
                   : call->method == GR_DIFFUSION_implicit ? implicit_step(&s)
                                                           : rkl2_step(&s, call->dt);
    if (device && device->wait(device->context)) f->error = GR_ERR_DIVERGED;
    if (f->rough_bodies) gr_team_run(s.team, extrapolate, &s.w, f->pages.n_chunks);
    end(&s);
    return f->error;
}
