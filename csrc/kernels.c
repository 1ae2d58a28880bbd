/* The kernels of one instruction set. This file is compiled once for each set, with GR_ISA naming it, and once more for
 * single precision, with GR_SINGLE, where the fluidity of cells and SPH are those in double precision.
 *
 * Every combination of dimension, basis, transfer and density is compiled as a function of its own, from one inline
 * function called with literal arguments. The choice among them is made once, when a kernel is called for a run of
 * cells. */
#include "kernels.h"

/* Define the updates of a law in 2D and 3D, and its descriptor. The arguments after the name are members of struct gr_law.
 * A law and the functions it calls are GR_INLINE, but for the long ones of hencky_blocks.h: one body for both dimensions
 * would have its stresses in memory, not in registers. */
#define GR_DESCRIBE_LAW(law, ...)                                                \
    static void law##_2d(const struct gr_law_call *call) { law_##law(2, call); } \
    static void law##_3d(const struct gr_law_call *call) { law_##law(3, call); } \
    static const struct gr_law law##_descriptor = {.name = #law, .update = {law##_2d, law##_3d}, __VA_ARGS__};

#include "law/registry.inl"

static const struct gr_law *const laws[] = {
#define GR_LIST_LAWS
#define GR_LAW(law) &law##_descriptor,
#include "law/registry.inl"
    0};

#ifndef GR_SINGLE
#include "fluidity/passes.inl"
#endif
#if !defined(GR_SINGLE) && !defined(GR_ON_DEVICE)
#include "sph/sums.inl"
#include "sph/stress.inl"
#include "sph/gas_sums.inl"
#endif
#include "mpm/migrate.h"
#include "mpm/sleep.h"
#include "mpm/damping.inl"
#include "mpm/elastic_damping.inl"
#include "mpm/flutter.inl"
#include "mpm/cell_filling.inl"
#include "mpm/smoothed_density.inl"
#include "mpm/p2g.inl"
#include "mpm/xpic.inl"
#include "mpm/cell_averaged.inl"
#include "mpm/fluidity_coupling.inl"
#include "mpm/cell_view.inl"
#include "mpm/substeps.inl"
#include "mpm/g2p.inl"
#include "mpm/sweep.inl"
#include "mpm/node_sums.inl"
#ifndef GR_SINGLE
#include "mpm/node_motion.inl"
#endif

#define GR_PASTE2(a, b) a##b
#define GR_PASTE(a, b) GR_PASTE2(a, b)
#define GR_STRING2(a) #a
#define GR_STRING(a) GR_STRING2(a)

#define GR_2D_AND_3D(X, ...) X(2, __VA_ARGS__) X(3, __VA_ARGS__)

/* The parts of a tile that a call is for: vectors are always all of them, as the compiler is to know. */
#ifdef GR_ONE_LANE
#define GR_PARTS_OF_CALL(parts) (parts)
#else
#define GR_PARTS_OF_CALL(parts) ((void)(parts), GR_ALL_PARTS)
#endif

/* X(dim, basis, affine, smoothed, cell_averaged): the variants of the MPM kernels. The smoothed density requires the
 * quadratic basis, the cell-averaged density the linear basis. */
#define GR_PLAIN_VARIANTS(X, dim, basis) \
    X(dim, basis, GR_AFFINE_NONE, 0, 0) X(dim, basis, GR_AFFINE_GRADIENT, 0, 0) X(dim, basis, GR_AFFINE_MOMENT, 0, 0)
#ifdef GR_SINGLE
#define GR_VARIANTS_OF(X, dim)                   \
    X(dim, GR_QUADRATIC, GR_AFFINE_MOMENT, 0, 0) \
    X(dim, GR_QUADRATIC, GR_AFFINE_GRADIENT, 1, 0)
#else
#define GR_VARIANTS_OF(X, dim)                  \
    X(dim, GR_LINEAR, GR_AFFINE_GRADIENT, 0, 1) \
    GR_PLAIN_VARIANTS(X, dim, GR_LINEAR)        \
    GR_PLAIN_VARIANTS(X, dim, GR_UGIMP)         \
    GR_PLAIN_VARIANTS(X, dim, GR_QUADRATIC)     \
    X(dim, GR_QUADRATIC, GR_AFFINE_GRADIENT, 1, 0)
#endif
#define GR_VARIANTS(X) GR_VARIANTS_OF(X, 2) GR_VARIANTS_OF(X, 3)

#define GR_X(d, b, a, q, u)                                                                                             \
    static __attribute__((noinline)) void p2g_##d##b##a##q##u(struct gr_engine *e, int64_t tile, struct gr_parts parts) \
    {                                                                                                                   \
        p2g_tile(d, b, a > 0, q, u, e, tile, GR_PARTS_OF_CALL(parts));                                                  \
    }                                                                                                                   \
    static __attribute__((noinline)) void sweep_##d##b##a##q##u(struct gr_engine *e, int64_t first, int64_t last,       \
                                                                struct gr_migrants *out, int fused)                     \
    {                                                                                                                   \
        sweep_tiles(d, b, a, q, u, e, first, last, out, fused);                                                         \
    }
GR_VARIANTS(GR_X)
#undef GR_X

#define GR_IS(e, d, b, a, q, u)                                                                                \
    ((e)->config.dim == d && (e)->config.basis == b && (e)->config.affine == a && (e)->config.smoothed == q && \
     (e)->config.cell_averaged == u)

static void p2g_of_tile(struct gr_engine *e, int64_t tile, struct gr_parts parts)
{
#define GR_X(d, b, a, q, u) \
    if (GR_IS(e, d, b, a, q, u)) p2g_##d##b##a##q##u(e, tile, parts);
    GR_VARIANTS(GR_X)
#undef GR_X
}

static void p2g(struct gr_engine *e, int64_t first, int64_t last)
{
    for (int64_t tile = first; tile < last; tile++) p2g_of_tile(e, tile, GR_ALL_PARTS);
    v_streamed();
}

static void sweep(struct gr_engine *e, int64_t first, int64_t last, struct gr_migrants *out, int fused)
{
#define GR_X(d, b, a, q, u) \
    if (GR_IS(e, d, b, a, q, u)) sweep_##d##b##a##q##u(e, first, last, out, fused);
    GR_VARIANTS(GR_X)
#undef GR_X
    v_streamed();
}

#ifndef GR_SINGLE
static void forces_of_tile(struct gr_engine *e, int64_t tile, struct gr_parts parts)
{
    if (e->config.dim == 2)
        apply_forces_of_tile(2, e, tile, GR_PARTS_OF_CALL(parts));
    else
        apply_forces_of_tile(3, e, tile, GR_PARTS_OF_CALL(parts));
}

static void cell_forces(struct gr_engine *e, int64_t first, int64_t last)
{
    for (int64_t tile = first; tile < last; tile++) forces_of_tile(e, tile, GR_ALL_PARTS);
}
#endif

static void fill_cells_from(struct gr_engine *e, int64_t first)
{
    if (e->config.dim == 2)
        fill_cells(2, e, first);
    else
        fill_cells(3, e, first);
}

static void fillings(struct gr_engine *e, int64_t first, int64_t last)
{
    for (int64_t i = first * GR_LANES; i < last * GR_LANES; i += GR_W) fill_cells_from(e, i);
}

/* With the numbers of sums of motion of a step as literals, which most calls ask for. */
static void sum_nodes(const struct gr_engine *e, int group, int begin, int n, int64_t first, int64_t last, double *sums)
{
    if (e->config.basis == GR_LINEAR)
        sum_block(2, n, e, group, begin, first, last, sums);
    else if (n == GR_SUM_DAMPED(2))
        sum_block(3, GR_SUM_DAMPED(2), e, group, begin, first, last, sums);
    else if (n == GR_SUM_DAMPED(3))
        sum_block(3, GR_SUM_DAMPED(3), e, group, begin, first, last, sums);
    else
        sum_block(3, n, e, group, begin, first, last, sums);
}

#ifdef GR_SINGLE
/* Copy the fields of nodes that the points will see, for groups of nodes that do not rest. */
static void narrow_nodes(struct gr_engine *e, int64_t first, int64_t last)
{
    const int fields = GR_NODE_FIELDS(e->config.dim, gr_averages(e, e->clock.step));
    for (int64_t n = first; n < last; n += GR_LANES) {
        if (gr_group_rests(e, n)) continue;
        for (int f = 0; f < fields; f++)
            for (int64_t at = n; at < n + GR_LANES && at < last; at += GR_W)
                v_store(e->nodes.single + f * e->nodes.capacity + at, v_load(gr_node_field(e, f) + at));
    }
}
#endif

/* The kernels in single precision take those in double precision. */
#define GR_MOVE_NODES GR_PASTE(gr_move_nodes_, GR_ISA)
#define GR_STORE_NODES GR_PASTE(gr_store_nodes_, GR_ISA)
#define GR_DESCRIBE_NODES GR_PASTE(gr_describe_nodes_, GR_ISA)
#define GR_MEAN_GAPS GR_PASTE(gr_mean_gaps_, GR_ISA)
void GR_MOVE_NODES(const struct gr_engine *e, int damped, const double g[3], const double *sums, int lanes,
                   struct gr_node_motion *motion);
void GR_STORE_NODES(struct gr_engine *e, int damped, int64_t first, int lanes, const struct gr_node_motion *motion);
void GR_DESCRIBE_NODES(struct gr_engine *e, int64_t first, int lanes, const double *sums, const double *filled);
unsigned GR_MEAN_GAPS(struct gr_engine *e, int64_t first, int lanes);

#ifndef GR_SINGLE
void GR_MOVE_NODES(const struct gr_engine *e, int damped, const double g[3], const double *sums, int lanes,
                   struct gr_node_motion *motion)
{
    if (e->config.dim == 2)
        damped ? move_group(2, 1, e, g, sums, lanes, motion) : move_group(2, 0, e, g, sums, lanes, motion);
    else
        damped ? move_group(3, 1, e, g, sums, lanes, motion) : move_group(3, 0, e, g, sums, lanes, motion);
}

void GR_STORE_NODES(struct gr_engine *e, int damped, int64_t first, int lanes, const struct gr_node_motion *motion)
{
    if (e->config.dim == 2)
        damped ? store_group(2, 1, e, first, lanes, motion) : store_group(2, 0, e, first, lanes, motion);
    else
        damped ? store_group(3, 1, e, first, lanes, motion) : store_group(3, 0, e, first, lanes, motion);
}

void GR_DESCRIBE_NODES(struct gr_engine *e, int64_t first, int lanes, const double *sums, const double *filled)
{
    if (e->config.dim == 2)
        describe_group(2, e, first, lanes, sums, filled);
    else
        describe_group(3, e, first, lanes, sums, filled);
}

unsigned GR_MEAN_GAPS(struct gr_engine *e, int64_t first, int lanes)
{
    return e->config.dim == 2 ? mean_gaps_of_group(2, e, first, lanes) : mean_gaps_of_group(3, e, first, lanes);
}

static void smooth_of_tile(struct gr_engine *e, int64_t tile, struct gr_parts parts)
{
#define GR_SMOOTH(d, b) \
    if (e->config.dim == d && e->config.basis == b) smooth_tile(d, b, e, tile, GR_PARTS_OF_CALL(parts));
    GR_2D_AND_3D(GR_SMOOTH, GR_LINEAR)
    GR_2D_AND_3D(GR_SMOOTH, GR_UGIMP)
    GR_2D_AND_3D(GR_SMOOTH, GR_QUADRATIC)
#undef GR_SMOOTH
}

static void smooth(struct gr_engine *e, int64_t first, int64_t last)
{
    for (int64_t tile = first; tile < last; tile++) smooth_of_tile(e, tile, GR_ALL_PARTS);
}
#endif

/* Mean fluidity of the double cells: of each side where the two are separated, else of both together. */
static void mean_pairs(struct gr_engine *e, int64_t first, int64_t last)
{
    for (int64_t k = first; k < last; k++) {
        const struct gr_cell *front = &e->mesh.cell[e->mesh.paired[k]];
        mean_of_double_cell(e, front);
        if (gr_is_separate(e, front))
            mean_of_double_cell(e, gr_other_side(e, front));
        else
            e->nonlocal.fluidity->dense[gr_fluidity_place(e->nonlocal.fluidity, gr_cell_id(e, front->at), 1)] = 0;
    }
}

/* The fluidity of the double cells after a substep. */
static void store_pairs(struct gr_engine *e, int64_t first, int64_t last)
{
    for (int64_t k = first; k < last; k++) {
        store_substep(e, e->mesh.paired[k]);
        store_substep(e, e->mesh.other[e->mesh.paired[k]]);
    }
}

static void begin_substeps_of(struct gr_engine *e, int64_t first, int64_t last, struct gr_parts parts)
{
#define GR_BEGIN_SUBSTEPS(d, b, u)                                                  \
    if (e->config.dim == d && e->config.basis == b && e->config.cell_averaged == u) \
        begin_substeps_of_tiles(d, b, u, e, first, last, GR_PARTS_OF_CALL(parts));
    GR_2D_AND_3D(GR_BEGIN_SUBSTEPS, GR_LINEAR, 0)
    GR_2D_AND_3D(GR_BEGIN_SUBSTEPS, GR_LINEAR, 1)
    GR_2D_AND_3D(GR_BEGIN_SUBSTEPS, GR_QUADRATIC, 0)
#undef GR_BEGIN_SUBSTEPS
}

static void substep_of(struct gr_engine *e, int64_t first, int64_t last, struct gr_parts parts)
{
    const struct gr_material *material = &e->config.material[0]; /* the only one where there are substeps */
    const struct gr_law *law = laws[material->law];
    if (law->reaction == GR_NGF)
        substep_tiles(0, e, first, last, material->parameter + law->fluidity, GR_PARTS_OF_CALL(parts));
    else if (law->reaction == GR_LINEAR_NGF)
        substep_tiles(1, e, first, last, material->parameter + law->fluidity, GR_PARTS_OF_CALL(parts));
}

static void begin_substeps(struct gr_engine *e, int64_t first, int64_t last)
{
    begin_substeps_of(e, first, last, GR_ALL_PARTS);
}

static void substep(struct gr_engine *e, int64_t first, int64_t last) { substep_of(e, first, last, GR_ALL_PARTS); }

#ifndef GR_SINGLE
static void update_hencky(int flow, int dim, const struct gr_hencky_call *call)
{
    if (dim == 2)
        hencky_points(2, flow, call);
    else
        hencky_points(3, flow, call);
}

#ifndef GR_ON_DEVICE
static void sph(struct gr_sph *s, enum gr_sph_stage stage, int64_t first, int64_t last, struct gr_sph_extremes *extremes)
{
    if (s->config.dim == 2)
        sph_stage(2, s, stage, first, last, extremes);
    else
        sph_stage(3, s, stage, first, last, extremes);
}

#endif

#define GR_NAME GR_PASTE(gr_kernels_, GR_ISA)
#define GR_IN_SINGLE GR_PASTE(gr_single_, GR_ISA)
extern const struct gr_kernels GR_IN_SINGLE;
#else
#define GR_NAME GR_PASTE(gr_single_, GR_ISA)
#endif

extern const struct gr_kernels GR_NAME;
#ifdef GR_ONE_LANE
#include "gpu/stages.inl"
#endif

const struct gr_kernels GR_NAME = {
    .isa = GR_STRING(GR_ISA),
    .lanes = GR_W,
    .sum_nodes = sum_nodes,
    .move_nodes = GR_MOVE_NODES,
    .store_nodes = GR_STORE_NODES,
    .describe_nodes = GR_DESCRIBE_NODES,
    .mean_gaps = GR_MEAN_GAPS,
#ifdef GR_ONE_LANE
    .threads = threads,
#endif
#ifndef GR_ON_DEVICE /* whose threads do the rest */
    .p2g = p2g,
    .fill_cells = fillings,
    .sweep = sweep,
    .mean_pairs = mean_pairs,
    .store_pairs = store_pairs,
    .begin_substeps = begin_substeps,
    .substep = substep,
    .laws = laws,
#ifdef GR_SINGLE
    .narrow_nodes = narrow_nodes,
#else
    .single = &GR_IN_SINGLE,
    .apply_cell_forces = cell_forces,
    .smooth = smooth,
    .update_fluidity = fluidity_points,
    .update_hencky = update_hencky,
    .passes = &passes_of_diffusion,
    .sph = sph,
#endif
#endif
};
