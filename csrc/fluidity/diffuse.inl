/* Time steps of the diffusion of the fluidity, by a team of threads: explicit, backward Euler (implicit) or RKL2.
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
 * counted. Each chunk has a part of every sum, and the parts are added up exactly, so that ranks can have chunks of their own.
 * Before each product with L they exchange the values of the cells next to those of others. */
#include <math.h>

#include "core/simd.h"
#include "fluidity/fluidity.h"

struct diffusion {
    struct gr_fluidity *f;
    struct gr_team *team;
    const struct passes *passes;
    double k, dt;
    double *g, *work[3]; /* the arrays of f, swapped */
    int64_t iterations;
    /* arguments of a pass */
    double *in, *out, *other, scale;
    int stage;
};

/* Passes over the chunks that depend on the number of links of a cell. */
struct passes {
    gr_chunk_work *connect, *explicit_step, *first_residual, *multiply, *first_stage, *later_stage;
};

#define GR_EACH_BLOCK(f, c, i)                                                                                              \
    for (int64_t i = (f)->pages.chunk_first[c] * GR_PAGE, end_##i = (f)->pages.chunk_first[(c) + 1] * GR_PAGE; i < end_##i; \
         i += GR_W)

/* Sums over the cells of a chunk, one for each place in a page, so that they do not depend on the length of a vector. */
struct page_sum {
    vd of[GR_VECTORS];
};

#define GR_PART(i) ((i) % GR_PAGE / GR_W) /* which of the vectors of a page begins at place i */

static inline struct page_sum no_sum(void)
{
    struct page_sum sum;
    for (int k = 0; k < GR_VECTORS; k++) sum.of[k] = v_zero();
    return sum;
}

/* Weights of a block of cells in inner products: their radii in an axisymmetric plane, where the matrix is symmetric in
 * such products; else 1. */
static inline vd weights_of(const struct gr_fluidity *f, int64_t i)
{
    return f->axisymmetric ? v_load(f->space.radius + i) : v_set(1.0);
}

static inline double total_of_page(const struct page_sum *sum)
{
    double total = 0;
    for (int k = 0; k < GR_PAGE; k++) total += sum->of[k / GR_W][k % GR_W];
    return total;
}

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

/* Remove the links between cells that a body separates, and those to border cells, whose g is zero at the surface. */
static void cut_links(const int links, struct gr_fluidity *f, int64_t chunk)
{
    const uint8_t *inside = f->inside;
    for (int64_t i = f->pages.chunk_first[chunk] * GR_PAGE; i < f->pages.chunk_first[chunk + 1] * GR_PAGE; i++)
        for (int k = 0; k < 2 * links; k++) {
            const int64_t j = f->pages.near[2 * links * (i / GR_PAGE) + k] + i % GR_PAGE;
            const int cut = f->pages.link[k][i] ? gr_cut_of(inside[i], inside[j]) : GR_SIDE_LINKED;
            if (cut != GR_SIDE_LINKED) f->space.weight[k][i] = 0;
        }
    for (int64_t k = f->pages.wrap_first[chunk]; k < f->pages.wrap_first[chunk + 1]; k++) {
        struct gr_wrap *wrap = &f->pages.wrap[k];
        const int cut = gr_cut_of(inside[wrap->to], inside[wrap->from]);
        if (cut != GR_SIDE_LINKED) wrap->weight = 0;
    }
}

/* gr_fluidity_ring of the cell at a place, for link and side k. */
static inline double ring_of(const struct gr_fluidity *f, int64_t i, int k)
{
    if (!f->axisymmetric) return 1;
    return gr_fluidity_ring(f, gr_fluidity_cell(f, i), (k % 2 ? 1 : -1) * f->offset[k / 2][0]);
}

/* Coefficients of g itself of a chunk, from links to border cells; a border cell keeps its g. */
static void drop_at_borders(const int links, struct gr_fluidity *f, int64_t chunk)
{
    for (int64_t i = f->pages.chunk_first[chunk] * GR_PAGE; i < f->pages.chunk_first[chunk + 1] * GR_PAGE; i++) {
        if (f->inside[i] & GR_BORDER) f->space.rough[i] = 0;
        if (!(f->inside[i] & GR_LINKED_TO_BORDER)) continue;
        for (int k = 0; k < 2 * links; k++) f->space.rough[i] += f->drop[k][i] * ring_of(f, i, k);
    }
}

/* Weights of the links of a page: 1 where both cells of a link exist and are dense. */
static inline void exchange(const uint8_t *restrict link, const uint8_t *here, const uint8_t *there, double *restrict weight)
{
    for (int lane = 0; lane < GR_PAGE; lane++) weight[lane] = (double)(link[lane] & here[lane] & there[lane]);
}

/* Multiply the weights of links along the radius by the areas of their faces. */
static void weigh_rings(const int links, struct gr_fluidity *f, int64_t chunk)
{
    for (int64_t i = f->pages.chunk_first[chunk] * GR_PAGE; i < f->pages.chunk_first[chunk + 1] * GR_PAGE; i++)
        for (int k = 0; k < 2 * links; k++) f->space.weight[k][i] *= ring_of(f, i, k);
    for (int64_t k = f->pages.wrap_first[chunk]; k < f->pages.wrap_first[chunk + 1]; k++)
        f->pages.wrap[k].weight *= ring_of(f, f->pages.wrap[k].to, f->pages.wrap[k].link);
}

/* Find which cells exchange, from the set of dense cells; g of all others becomes zero. */
static void connect(const int links, struct gr_fluidity *f, int64_t chunk)
{
    const uint8_t *dense = f->dense;
    const int64_t first = f->pages.chunk_first[chunk], last = f->pages.chunk_first[chunk + 1];
    for (int64_t i = first * GR_PAGE; i < last * GR_PAGE; i++) f->g[i] = dense[i] ? f->g[i] : 0;
    if (f->stencil == GR_STENCIL_isotropic) {
        gr_fluidity_weigh(f, chunk);
        return;
    }
    for (int64_t q = first; q < last; q++)
        for (int k = 0; k < 2 * links; k++)
            exchange(f->pages.link[k] + q * GR_PAGE, dense + q * GR_PAGE, dense + f->pages.near[2 * links * q + k],
                     f->space.weight[k] + q * GR_PAGE);
    for (int64_t i = first * GR_PAGE; i < last * GR_PAGE; i++) f->space.rough[i] = f->pages.rough_walls[i];
    for (int64_t k = f->pages.wrap_first[chunk]; k < f->pages.wrap_first[chunk + 1]; k++)
        f->pages.wrap[k].weight = (double)(dense[f->pages.wrap[k].to] & dense[f->pages.wrap[k].from]);
    if (f->axisymmetric) weigh_rings(links, f, chunk);
    if (f->has_inside) cut_links(links, f, chunk);
    if (f->rough_bodies) drop_at_borders(links, f, chunk);
}

/* L g of a block of cells, without the links of f->pages.wrap. Differences are formed before products, so that a uniform
 * field stays unchanged to the last bit and a cell gains exactly what another loses. */
static inline vd outflow(const int links, const struct gr_fluidity *f, int64_t i, const double *g)
{
    const vd here = v_load(g + i);
    const int32_t *near = f->pages.near + i / GR_PAGE * (2 * links);
    const double *lane = g + i % GR_PAGE;
    vd sum = v_load(f->space.rough + i) * here;
    for (int k = 0; k < 2 * links; k++) sum = v_fma(v_load(f->space.weight[k] + i), here - v_load(lane + near[k]), sum);
    return sum;
}

/* Add the links of f->pages.wrap that belong to a chunk: out[i] += scale (L g)_i. Returned: the sum of g_i times the terms
 * added. */
static double add_wraps(const struct gr_fluidity *f, int64_t chunk, double scale, const double *g, double *out)
{
    double product = 0;
    for (int64_t k = f->pages.wrap_first[chunk]; k < f->pages.wrap_first[chunk + 1]; k++) {
        const struct gr_wrap *wrap = &f->pages.wrap[k];
        const double lost = scale * wrap->weight * (g[wrap->to] - g[wrap->from]);
        out[wrap->to] += lost;
        product += g[wrap->to] * lost * (f->axisymmetric ? f->space.radius[wrap->to] : 1);
    }
    return product;
}

/* Replace g by max(g, 0) in a chunk and count the changes. NaN remains. */
static void clamp(const struct gr_fluidity *f, int64_t chunk, double *g)
{
    int64_t n = 0;
    GR_EACH_BLOCK(f, chunk, i)
    {
        const vd value = v_load(g + i);
        n += __builtin_popcount(m_bits(v_gt(v_zero(), value)));
        v_store(g + i, v_max(v_zero(), value));
    }
    f->space.partial_clamped[chunk] += n;
}

static void swap(double **a, double **b)
{
    double *const c = *a;
    *a = *b, *b = c;
}

static void over_chunks(struct diffusion *w, gr_chunk_work *pass) { gr_team_run(w->team, pass, w, w->f->pages.n_chunks); }

static inline void connect_chunk(const int links, const struct diffusion *w, int64_t c)
{
    connect(links, w->f, c);
    w->f->space.partial_clamped[c] = 0;
}

/* out = g - k L g */
static inline void explicit_chunk(const int links, const struct diffusion *w, int64_t c)
{
    const vd k = v_set(w->k);
    GR_EACH_BLOCK(w->f, c, i) v_store(w->out + i, v_fnma(k, outflow(links, w->f, i, w->g), v_load(w->g + i)));
    add_wraps(w->f, c, -w->k, w->g, w->out);
    clamp(w->f, c, w->out);
}

/* r = p = -k L g, the residual of g itself. Its squared norm goes to partial[1], and the squared norm of g to
 * partial[2]. */
static inline void first_residual_chunk(const int links, const struct diffusion *w, int64_t c)
{
    const struct gr_fluidity *f = w->f;
    const vd k = v_set(-w->k);
    double *r = w->work[0], *p = w->work[1];
    struct page_sum rr = no_sum(), gg = no_sum();
    GR_EACH_BLOCK(f, c, i) v_store(r + i, k * outflow(links, f, i, w->g));
    add_wraps(f, c, -w->k, w->g, r);
    GR_EACH_BLOCK(f, c, i)
    {
        const vd rest = v_load(r + i), g = v_load(w->g + i);
        v_store(p + i, rest);
        rr.of[GR_PART(i)] = v_fma(weights_of(f, i) * rest, rest, rr.of[GR_PART(i)]);
        gg.of[GR_PART(i)] = v_fma(weights_of(f, i) * g, g, gg.of[GR_PART(i)]);
    }
    f->space.partial[1][c] = total_of_page(&rr), f->space.partial[2][c] = total_of_page(&gg);
}

/* q = (1 + k L) p; p.q goes to partial[0]. */
static inline void multiply_chunk(const int links, const struct diffusion *w, int64_t c)
{
    const vd k = v_set(w->k);
    const double *p = w->work[1];
    double *q = w->work[2];
    struct page_sum sum = no_sum();
    GR_EACH_BLOCK(w->f, c, i)
    {
        const vd here = v_load(p + i), value = v_fma(k, outflow(links, w->f, i, p), here);
        v_store(q + i, value);
        sum.of[GR_PART(i)] = v_fma(weights_of(w->f, i) * here, value, sum.of[GR_PART(i)]);
    }
    w->f->space.partial[0][c] = total_of_page(&sum) + add_wraps(w->f, c, w->k, p, q);
}

/* g += alpha p, r -= alpha q with alpha = scale; r.r goes to partial[1]. */
static void descend(void *context, int64_t c, int t)
{
    const struct diffusion *w = context;
    const vd alpha = v_set(w->scale);
    double *r = w->work[0], *p = w->work[1], *q = w->work[2];
    struct page_sum sum = no_sum();
    (void)t;
    GR_EACH_BLOCK(w->f, c, i)
    {
        const vd rest = v_fnma(alpha, v_load(q + i), v_load(r + i));
        v_store(w->g + i, v_fma(alpha, v_load(p + i), v_load(w->g + i)));
        v_store(r + i, rest);
        sum.of[GR_PART(i)] = v_fma(weights_of(w->f, i) * rest, rest, sum.of[GR_PART(i)]);
    }
    w->f->space.partial[1][c] = total_of_page(&sum);
}

/* p = r + beta p with beta = scale */
static void turn(void *context, int64_t c, int t)
{
    const struct diffusion *w = context;
    const vd beta = v_set(w->scale);
    double *r = w->work[0], *p = w->work[1];
    (void)t;
    GR_EACH_BLOCK(w->f, c, i) v_store(p + i, v_fma(beta, v_load(p + i), v_load(r + i)));
}

static void clamp_out(void *context, int64_t c, int t)
{
    const struct diffusion *w = context;
    (void)t;
    clamp(w->f, c, w->out);
}

/* The coefficients b_j of RKL2: b_j = (j^2 + j - 2)/(2 j (j + 1)), and 1/3 for j < 2. */
static double legendre(int j) { return j < 2 ? 1.0 / 3.0 : (j * j + j - 2.0) / (2.0 * j * (j + 1.0)); }

/* First stage, Y_1 = Y_0 + mu~_1 dt M Y_0 with dt M = -k L and mu~_1 = legendre(1) scale, to `in`. L Y_0 is stored in
 * work[2], and Y_0 takes the place of Y_j-2 for j = 2. */
static inline void first_stage_chunk(const int links, const struct diffusion *w, int64_t c)
{
    const vd step = v_set(legendre(1) * w->scale * w->k);
    double *lost_0 = w->work[2];
    GR_EACH_BLOCK(w->f, c, i) v_store(lost_0 + i, outflow(links, w->f, i, w->g));
    add_wraps(w->f, c, 1, w->g, lost_0);
    GR_EACH_BLOCK(w->f, c, i)
    {
        v_store(w->in + i, v_fnma(step, v_load(lost_0 + i), v_load(w->g + i)));
        v_store(w->out + i, v_load(w->g + i));
    }
}

/* Stage j, from `in` = Y_j-1, written over `out` = Y_j-2:
 *
 *   Y_j = mu_j Y_j-1 + nu_j Y_j-2 + (1 - mu_j - nu_j) Y_0 + mu~_j dt M Y_j-1 + gamma~_j dt M Y_0. */
static inline void later_stage_chunk(const int links, const struct diffusion *w, int64_t c)
{
    const int j = w->stage;
    const double mu = (2.0 * j - 1) / j * legendre(j) / legendre(j - 1);
    const double nu = -(j - 1.0) / j * legendre(j) / legendre(j - 2);
    const double step = mu * w->scale * w->k, back = (1 - legendre(j - 1)) * step;
    const double *last = w->in, *lost_0 = w->work[2];
    GR_EACH_BLOCK(w->f, c, i)
    {
        vd sum = v_fma(v_set(1 - mu - nu), v_load(w->g + i), v_set(nu) * v_load(w->out + i));
        sum = v_fma(v_set(mu), v_load(last + i), sum);
        sum = v_fnma(v_set(step), outflow(links, w->f, i, last), sum);
        v_store(w->out + i, v_fma(v_set(back), v_load(lost_0 + i), sum));
    }
    add_wraps(w->f, c, -step, last, w->out);
}

#define GR_PASS(pass, n) \
    static void pass##_##n(void *context, int64_t c, int t) { (void)t, pass##_chunk(n, context, c); }
#define GR_PASSES(n)           \
    GR_PASS(connect, n)        \
    GR_PASS(explicit, n)       \
    GR_PASS(first_residual, n) \
    GR_PASS(multiply, n)       \
    GR_PASS(first_stage, n)    \
    GR_PASS(later_stage, n)
GR_PASSES(2)
GR_PASSES(3)
GR_PASSES(4)
GR_PASSES(13)

#define GR_TABLE(n)                                                                                   \
    {                                                                                                 \
        connect_##n, explicit_##n, first_residual_##n, multiply_##n, first_stage_##n, later_stage_##n \
    }
static const struct passes passes_2 = GR_TABLE(2), passes_3 = GR_TABLE(3), passes_4 = GR_TABLE(4), passes_13 = GR_TABLE(13);

static void extrapolate(void *context, int64_t c, int t)
{
    const struct diffusion *w = context;
    (void)t;
    gr_fluidity_extrapolate(w->f, c, w->g);
}

static int explicit_step(struct diffusion *w)
{
    if (receive(w->f, w->g, NULL)) return GR_ERR_DIVERGED;
    w->out = w->work[0];
    over_chunks(w, w->passes->explicit_step);
    swap(&w->g, &w->work[0]);
    return GR_OK;
}

static int implicit_step(struct diffusion *w)
{
    static const double ROUND_OFF = 2e-16, NOTHING = 1e-150; /* 1/s; its square is still a normal number */
    const struct gr_fluidity *f = w->f;
    if (receive(f, w->g, NULL)) return GR_ERR_DIVERGED;
    over_chunks(w, w->passes->first_residual);
    double rr = total(f, f->space.partial[1]);
    const double relative = fmax(f->tolerance * f->tolerance * rr, ROUND_OFF * ROUND_OFF * total(f, f->space.partial[2]));
    const double enough = fmax(relative, NOTHING * NOTHING);
    for (int64_t n = 0; !(rr <= enough); n++) {
        if (n == f->max_iterations || !isfinite(rr) || receive(f, w->work[1], NULL)) return GR_ERR_DIVERGED;
        over_chunks(w, w->passes->multiply);
        w->scale = rr / total(f, f->space.partial[0]);
        over_chunks(w, descend);
        const double before = rr;
        rr = total(f, f->space.partial[1]);
        w->iterations++;
        if (rr <= enough) break;
        w->scale = rr / before;
        over_chunks(w, turn);
    }
    w->out = w->g;
    over_chunks(w, clamp_out);
    return GR_OK;
}

static int rkl2_step(struct diffusion *w)
{
    const int stages = gr_fluidity_stages(w->f, w->dt);
    w->scale = 4.0 / ((double)stages * stages + stages - 2.0);
    w->in = w->work[0], w->out = w->work[1];
    if (receive(w->f, w->g, NULL)) return GR_ERR_DIVERGED;
    over_chunks(w, w->passes->first_stage);
    for (w->stage = 2; w->stage <= stages; w->stage++) {
        if (receive(w->f, w->in, NULL)) return GR_ERR_DIVERGED;
        over_chunks(w, w->passes->later_stage);
        swap(&w->in, &w->out);
    }
    w->work[0] = w->g, w->work[1] = w->out, w->g = w->out = w->in;
    over_chunks(w, clamp_out);
    w->iterations += stages;
    return GR_OK;
}

/* The kernel (gr_diffuse). For a grid of few chunks waiting for other threads does not pay: one thread does all the
 * work. */
static int diffuse(struct gr_fluidity *f, const struct gr_diffusion_call *call, struct gr_team *team)
{
    enum { CHUNKS_WORTH_SHARING = 8 };
    struct diffusion w = {.f = f,
                          .team = f->pages.n_chunks < CHUNKS_WORTH_SHARING ? NULL : team,
                          .passes = f->n_links == 2   ? &passes_2
                                    : f->n_links == 3 ? &passes_3
                                    : f->n_links == 4 ? &passes_4
                                                      : &passes_13,
                          .k = call->dt * f->diffusivity / (f->dx * f->dx),
                          .dt = call->dt,
                          .g = f->g,
                          .work = {f->space.vector[0], f->space.vector[1], f->space.vector[2]}};
    f->error = receive(f, f->g, f->dense);
    over_chunks(&w, w.passes->connect);
    for (int64_t n = 0; n < call->steps && !f->error; n++)
        f->error = call->method == GR_DIFFUSION_explicit   ? explicit_step(&w)
                   : call->method == GR_DIFFUSION_implicit ? implicit_step(&w)
                                                           : rkl2_step(&w);
    if (f->rough_bodies) over_chunks(&w, extrapolate);
    f->iterations = w.iterations;
    f->clamped = 0;
    for (int64_t c = 0; c < f->pages.n_chunks; c++)
        if (!is_foreign(f, c)) f->clamped += f->space.partial_clamped[c];
    f->g = w.g;
    for (int k = 0; k < 3; k++) f->space.vector[k] = w.work[k];
    return f->error;
}
