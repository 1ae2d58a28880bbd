/* Passes of the diffusion over all cells (diffuse.c): of a chunk, by a team of threads; or of a cell, as a thread of a device
 * does it. A pass has up to four parts, each for what the one before has made:
 *
 *   1. begin_cells, cell by cell, with the links to cells at the usual distance,
 *   2. the links of f->pages.wrap, chunk by chunk,
 *   3. end_cells, cell by cell,
 *   4. products of cells, whose sums are those of the pass; of `multiply` before 2, which has its own products.
 *
 * A sum over a chunk has a part for each place in a page, so that it does not depend on the length of a vector. */
#include <math.h>

#include "core/simd.h"
#include "fluidity/pass.h"

#define GR_EACH_BLOCK(f, c, i)                                                                                              \
    for (int64_t i = (f)->pages.chunk_first[c] * GR_PAGE, end_##i = (f)->pages.chunk_first[(c) + 1] * GR_PAGE; i < end_##i; \
         i += GR_W)

/* ---- Which cells exchange ---- */

/* Remove the links of a cell to others that a body separates from it, and those to border cells, whose g is zero at the
 * surface. */
GR_INLINE void cut_links(const int links, struct gr_fluidity *f, int64_t i)
{
    const uint8_t *inside = f->inside;
    for (int k = 0; k < 2 * links; k++) {
        const int64_t j = f->pages.near[2 * links * (i / GR_PAGE) + k] + i % GR_PAGE;
        const int cut = f->pages.link[k][i] ? gr_cut_of(inside[i], inside[j]) : GR_SIDE_LINKED;
        if (cut != GR_SIDE_LINKED) f->space.weight[k][i] = 0;
    }
}

/* gr_fluidity_ring of the cell at a place, for link and side k. */
GR_INLINE double ring_of(const struct gr_fluidity *f, int64_t i, int k)
{
    if (!f->axisymmetric) return 1;
    return gr_fluidity_ring(f, gr_fluidity_cell(f, i), (k % 2 ? 1 : -1) * f->offset[k / 2][0]);
}

/* Coefficient of g itself of a cell, from links to border cells; a border cell keeps its g. */
GR_INLINE void drop_at_borders(const int links, struct gr_fluidity *f, int64_t i)
{
    if (f->inside[i] & GR_BORDER) f->space.rough[i] = 0;
    if (!(f->inside[i] & GR_LINKED_TO_BORDER)) return;
    for (int k = 0; k < 2 * links; k++) f->space.rough[i] += f->drop[k][i] * ring_of(f, i, k);
}

/* Weights of a link of the lanes [first, last) of a page: 1 where both cells exist and are dense. */
GR_INLINE void exchange(const uint8_t *restrict link, const uint8_t *here, const uint8_t *there, int first, int last,
                        double *restrict weight)
{
    for (int lane = first; lane < last; lane++) weight[lane] = (double)(link[lane] & here[lane] & there[lane]);
}

/* Find with which cells the lanes [first, last) of page q exchange, from the set of dense cells; g of all others becomes
 * zero. */
GR_INLINE void link_cells(const int links, struct gr_fluidity *f, int64_t q, const int first, const int last)
{
    const uint8_t *dense = f->dense;
    const int64_t page = q * GR_PAGE, begin = page + first, end = page + last;
    for (int64_t i = begin; i < end; i++) f->g[i] = dense[i] ? f->g[i] : 0;
    if (f->stencil == GR_STENCIL_isotropic) {
        for (int64_t i = begin; i < end; i++) gr_fluidity_weigh(f, i);
        return;
    }
    for (int k = 0; k < 2 * links; k++)
        exchange(f->pages.link[k] + page, dense + page, dense + f->pages.near[2 * links * q + k], first, last,
                 f->space.weight[k] + page);
    for (int64_t i = begin; i < end; i++) f->space.rough[i] = f->pages.rough_walls[i];
    for (int64_t i = begin; f->axisymmetric && i < end; i++)
        for (int k = 0; k < 2 * links; k++) f->space.weight[k][i] *= ring_of(f, i, k);
    for (int64_t i = begin; f->has_inside && i < end; i++) cut_links(links, f, i);
    for (int64_t i = begin; f->rough_bodies && i < end; i++) drop_at_borders(links, f, i);
}

/* Weights of the links of f->pages.wrap that belong to a chunk. */
GR_INLINE void link_wraps(struct gr_fluidity *f, int64_t chunk)
{
    if (f->stencil == GR_STENCIL_isotropic) {
        gr_fluidity_weigh_wraps(f, chunk);
        return;
    }
    for (int64_t k = f->pages.wrap_first[chunk]; k < f->pages.wrap_first[chunk + 1]; k++) {
        struct gr_wrap *wrap = &f->pages.wrap[k];
        wrap->weight = (double)(f->dense[wrap->to] & f->dense[wrap->from]);
        if (f->axisymmetric) wrap->weight *= ring_of(f, wrap->to, wrap->link);
        const int cut = f->has_inside ? gr_cut_of(f->inside[wrap->to], f->inside[wrap->from]) : GR_SIDE_LINKED;
        if (cut != GR_SIDE_LINKED) wrap->weight = 0;
    }
}

/* ---- The parts of the other passes ---- */

/* L g of a block of cells, without the links of f->pages.wrap. Differences are formed before products, so that a uniform
 * field stays unchanged to the last bit and a cell gains exactly what another loses. */
GR_INLINE vd outflow(const int links, const struct gr_fluidity *f, int64_t i, const double *g)
{
    const vd here = v_load(g + i);
    const int32_t *near = f->pages.near + i / GR_PAGE * (2 * links);
    const double *lane = g + i % GR_PAGE;
    vd sum = v_load(f->space.rough + i) * here;
    for (int k = 0; k < 2 * links; k++) sum = v_fma(v_load(f->space.weight[k] + i), here - v_load(lane + near[k]), sum);
    return sum;
}

/* Y_j of a block over Y_j-2, from Y_j-1 in `in`. L Y_0 is in work[2]. */
GR_INLINE void stage_of_cells(const int links, const struct gr_diffusion_work *w, int64_t i)
{
    const struct gr_stage *stage = &w->stage;
    vd sum = v_fma(v_set(1 - stage->mu - stage->nu), v_load(w->g + i), v_set(stage->nu) * v_load(w->out + i));
    sum = v_fma(v_set(stage->mu), v_load(w->in + i), sum);
    sum = v_fnma(v_set(stage->step), outflow(links, w->f, i, w->in), sum);
    v_store(w->out + i, v_fma(v_set(stage->back), v_load(w->work[2] + i), sum));
}

/* Replace g by max(g, 0) in a block. NaN remains.
 * Returned: the number of changes. */
GR_INLINE int clamp(double *g, int64_t i)
{
    const vd value = v_load(g + i);
    v_store(g + i, v_max(v_zero(), value));
    return __builtin_popcount(m_bits(v_gt(v_zero(), value)));
}

/* The first part of a pass for a block of cells: explicit: out = g - k L g. first_residual: r = -k L g, the residual of g
 * itself. multiply: q = (1 + k L) p. descend: g += alpha p, r -= alpha q. turn: p = r + beta p. first_stage: L Y_0. */
GR_INLINE void begin_cells(const int pass, const int links, const struct gr_diffusion_work *w, int64_t i)
{
    const struct gr_fluidity *f = w->f;
    double *r = w->work[0], *p = w->work[1], *q = w->work[2];
    const vd k = v_set(w->k), scale = v_set(f->descent.scale);
    if (pass == GR_PASS_explicit) v_store(w->out + i, v_fnma(k, outflow(links, f, i, w->g), v_load(w->g + i)));
    if (pass == GR_PASS_first_residual) v_store(r + i, v_set(-w->k) * outflow(links, f, i, w->g));
    if (pass == GR_PASS_multiply) v_store(q + i, v_fma(k, outflow(links, f, i, p), v_load(p + i)));
    if (pass == GR_PASS_descend) {
        const vd rest = v_fnma(scale, v_load(q + i), v_load(r + i));
        v_store(w->g + i, v_fma(scale, v_load(p + i), v_load(w->g + i)));
        v_store(r + i, rest);
    }
    if (pass == GR_PASS_turn) v_store(p + i, v_fma(scale, v_load(p + i), v_load(r + i)));
    if (pass == GR_PASS_first_stage) v_store(q + i, outflow(links, f, i, w->g));
    if (pass == GR_PASS_later_stage) stage_of_cells(links, w, i);
}

/* Add the links of f->pages.wrap that belong to a chunk: out[i] += scale (L g)_i. Returned: the sum of g_i times the terms
 * added. */
GR_INLINE double add_links(const struct gr_fluidity *f, int64_t chunk, double scale, const double *g, double *out)
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

/* The same for a pass: the second part. */
GR_INLINE double add_wraps(const int pass, const struct gr_diffusion_work *w, int64_t chunk)
{
    const struct gr_fluidity *f = w->f;
    if (pass == GR_PASS_explicit) return add_links(f, chunk, -w->k, w->g, w->out);
    if (pass == GR_PASS_first_residual) return add_links(f, chunk, -w->k, w->g, w->work[0]);
    if (pass == GR_PASS_multiply) return add_links(f, chunk, w->k, w->work[1], w->work[2]);
    if (pass == GR_PASS_first_stage) return add_links(f, chunk, 1, w->g, w->work[2]);
    return add_links(f, chunk, -w->stage.step, w->in, w->out);
}

/* The third part of a pass: negative values become zero; p = r; Y_1 to `in`, and Y_0 takes the place of Y_j-2 for j = 2.
 * Returned: the number of values that were negative. */
GR_INLINE int end_cells(const int pass, const struct gr_diffusion_work *w, int64_t i)
{
    if (pass == GR_PASS_explicit || pass == GR_PASS_clamp) return clamp(w->out, i);
    if (pass == GR_PASS_first_residual) v_store(w->work[1] + i, v_load(w->work[0] + i));
    if (pass == GR_PASS_first_stage) {
        v_store(w->work[0] + i, v_fnma(v_set(w->stage.step), v_load(w->work[2] + i), v_load(w->g + i)));
        v_store(w->out + i, v_load(w->g + i));
    }
    return 0;
}

/* Add the products of a block of cells to the sums of a pass: r.r, and g.g at first; p.q. They are weighted by the radii of
 * cells in an axisymmetric plane, where the matrix is symmetric in such products. */
GR_INLINE void add_products(const int pass, const struct gr_diffusion_work *w, int64_t i, vd sum[2])
{
    const struct gr_fluidity *f = w->f;
    const vd weight = f->axisymmetric ? v_load(f->space.radius + i) : v_set(1.0), r = v_load(w->work[0] + i);
    if (pass == GR_PASS_multiply) {
        sum[0] = v_fma(weight * v_load(w->work[1] + i), v_load(w->work[2] + i), sum[0]);
        return;
    }
    sum[0] = v_fma(weight * r, r, sum[0]);
    if (pass == GR_PASS_first_residual) {
        const vd g = v_load(w->g + i);
        sum[1] = v_fma(weight * g, g, sum[1]);
    }
}

/* ---- Chunks, for a team ---- */

/* Sums over the cells of a chunk, one for each place in a page. */
struct sums_of_chunk {
    vd of[GR_VECTORS][2];
};

/* Store the sums of a chunk, with what links of f->pages.wrap have added. */
GR_INLINE void store_sums(const int pass, const struct gr_fluidity *f, int64_t c, const struct sums_of_chunk *sums,
                          double more)
{
    for (int s = 0; s < gr_sums_of_pass(pass); s++) {
        double total = 0;
        for (int k = 0; k < GR_PAGE; k++) total += sums->of[k / GR_W][s][k % GR_W];
        f->space.partial[s][c] = total + more;
    }
}

/* A pass over the cells of a chunk. */
GR_INLINE void pass_chunk(const int pass, const int links, const struct gr_diffusion_work *given, int64_t c)
{
    const struct gr_diffusion_work copy = *given, *const w = &copy; /* which no store to a cell can change */
    const struct gr_fluidity *f = w->f;
    const int multiplies = pass == GR_PASS_multiply, together = !gr_pass_has_wraps(pass) || multiplies;
    struct sums_of_chunk sums;
    double more = 0;
    int64_t clamped = 0;
    for (int k = 0; k < GR_VECTORS; k++) sums.of[k][0] = sums.of[k][1] = v_zero();
#define GR_SUMS(i) sums.of[(i) % GR_PAGE / GR_W]
    GR_EACH_BLOCK(f, c, i)
    {
        begin_cells(pass, links, w, i);
        if (together && gr_sums_of_pass(pass)) add_products(pass, w, i, GR_SUMS(i));
        if (together && gr_pass_has_end(pass)) clamped += end_cells(pass, w, i);
    }
    if (gr_pass_has_wraps(pass)) more = add_wraps(pass, w, c);
    if (!together && gr_pass_has_end(pass)) GR_EACH_BLOCK(f, c, i)
        {
            clamped += end_cells(pass, w, i);
            if (gr_sums_of_pass(pass)) add_products(pass, w, i, GR_SUMS(i));
        }
#undef GR_SUMS
    store_sums(pass, f, c, &sums, multiplies ? more : 0);
    f->space.partial_clamped[c] += clamped;
}

GR_INLINE void connect_chunk(const int links, const struct gr_diffusion_work *w, int64_t c)
{
    for (int64_t q = w->f->pages.chunk_first[c]; q < w->f->pages.chunk_first[c + 1]; q++)
        link_cells(links, w->f, q, 0, GR_PAGE);
    link_wraps(w->f, c);
    w->f->space.partial_clamped[c] = 0;
}

#ifndef GR_ON_DEVICE
#define GR_CHUNK(pass, links)                                   \
    static void pass##_##links(void *context, int64_t c, int t) \
    {                                                           \
        (void)t;                                                \
        if (GR_PASS_##pass == GR_PASS_connect)                  \
            connect_chunk(links, context, c);                   \
        else                                                    \
            pass_chunk(GR_PASS_##pass, links, context, c);      \
    }
#define GR_X(pass) GR_CHUNK(pass, 2) GR_CHUNK(pass, 3) GR_CHUNK(pass, 4) GR_CHUNK(pass, 13)
GR_DIFFUSION_PASSES(GR_X)
#undef GR_X

static const struct gr_passes passes_of_diffusion = {{
#define GR_X(pass) pass##_2,
    {GR_DIFFUSION_PASSES(GR_X)},
#undef GR_X
#define GR_X(pass) pass##_3,
    {GR_DIFFUSION_PASSES(GR_X)},
#undef GR_X
#define GR_X(pass) pass##_4,
    {GR_DIFFUSION_PASSES(GR_X)},
#undef GR_X
#define GR_X(pass) pass##_13,
    {GR_DIFFUSION_PASSES(GR_X)},
#undef GR_X
}};
#endif
