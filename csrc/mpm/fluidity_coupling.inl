/* Coupling of the fluidity of the cells with the points: means over the points of a cell before the diffusion, and the
 * substeps of the nonlocal law between one diffusion and the next. */
#include "law/substep.h"
#include "mpm/contribution.h"
#include "mpm/migrate.h"

/* Store the fluidity of a cell from which the diffusion starts: the mean over its points with pressure, weighted by
 * mass.
 *
 * If a step of diffusion is simply followed by a step of the law, the steady state of the two together is wrong.
 * Backward Euler adds g - k L g' with g' = g/(1 + k L), which is too little diffusion
 * (docs/explanation/fluidity.md). The implicit
 * step is therefore balanced (Speth, Green, MacNamara & Strang 2013, SIAM J. Numer. Anal. 51). With r, the increment by
 * the law in the substep before, it solves (1 + k L) g' = g + r, and the law starts from g' - r. In a steady state this
 * is g - k L g, without error. r is limited to [-g, g/2], so that no g' is negative and a growing mode of the law does
 * not overshoot. */
GR_INLINE void store_gain(struct gr_engine *e, int64_t place, double g, double gain)
{
    if (gr_is_balanced(e)) {
        const double more = gain < -g ? -g : gain, most = 0.5 * g;
        gain = more > most ? most : more;
        e->fluidity->gain[place] = gain;
        g += gain;
    }
    e->fluidity->g[place] = g;
}

/* The same after a substep that began from g_star. */
GR_INLINE void store_fluidity(struct gr_engine *e, int64_t place, double g, double g_star)
{
    store_gain(e, place, g, e->fluidity->dense[place] ? g - g_star : 0);
}

/* Mean fluidity of a cell, or of both sides of a double cell that are not separated. */
GR_INLINE void mean_of_cell(struct gr_engine *e, const struct gr_cell *cell)
{
    enum { SUMS = GR_SUMS > 3 ? GR_SUMS : 4 };
    const int64_t place = gr_place_of_cell(e, cell);
    const int balanced = gr_is_balanced(e);
    double sum[SUMS];
    vd acc[SUMS];
    for (int i = 0; i < SUMS; i++) acc[i] = v_zero();
    GR_EACH_OF_FLUIDITY(e, cell, side)
    for (int n = 0; n < GR_BLOCKS(side->count); n++) {
        const int64_t at = side->offset + n * GR_W;
        vd tension = component(e, GR_FIELD_stress, 0, at);
        for (int c = 1; c < 3; c++) tension = tension + component(e, GR_FIELD_stress, c, at);
        const vd m = v_keep(v_gt(v_zero(), tension), component(e, GR_FIELD_mass, 0, at));
        acc[0] = acc[0] + m;
        acc[1] = v_fma(m, component(e, GR_FIELD_g, 0, at), acc[1]);
        if (balanced) acc[2] = v_fma(m, component(e, GR_FIELD_g_gain, 0, at), acc[2]);
    }
    for (int i = 0; i < 3; i += GR_SUMS) v_sums(sum + i, acc + i);
    const double inverse = sum[0] > 0 ? 1 / sum[0] : 0;
    e->fluidity->dense[place] = sum[0] > 0;
    store_gain(e, place, inverse * sum[1], inverse * sum[2]);
}

/* The fluidity of a cell after the diffusion, from which the law starts (store_gain). */
GR_INLINE double fluidity_of_cell(const struct gr_engine *e, int64_t place)
{
    double g = e->fluidity->g[place];
    if (gr_is_balanced(e)) g -= e->fluidity->gain[place];
    return g < e->config.nonlocal.floor ? e->config.nonlocal.floor : g; /* NaN is kept */
}

/* L dt of the points of a cell at their present positions. Whenever the batch is full, the first substep of its points
 * is made. */
GR_INLINE void strain_cell(const int dim, const int basis, const int cell_averaged, const struct gr_engine *e, int64_t index,
                           struct batch *batch, gr_law_update *law)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int stride = MODE_STRIDE(GR_NODE_FIELDS(dim, 0)), blocks = GR_BLOCKS(cell->count);
    const double g_star = fluidity_of_cell(e, gr_place_of_cell(e, cell));
    struct view view;
    look_at_cell(dim, basis, GR_AFFINE_NONE, 0, cell_averaged, 0, e, index, batch->scale, &view);
    for (int n = 0; n < blocks; n++) {
        struct gr_shape s;
        const int64_t at = cell->offset + n * GR_W;
        vd L[9];
        if (batch->n == BATCH) run_law(e, law, batch, 1);
        double *gradient = batch->gradient + batch->n * dim * dim * GR_W;
        gr_shapes(dim, basis, e, &view.frame, at, 0, &s);
        for (int d = 0; d < dim; d++)
            (void)gr_interpolate(dim, basis, 0, view.mode + d, stride, &s, (const vd(*)[3])s.g, L + d * dim);
        for (int c = 0; c < dim * dim; c++) v_store(gradient + c * GR_W, cell_averaged ? view.L[c] : L[c]);
        batch->g_star[batch->n] = g_star;
        batch->slot[batch->n++] = at;
    }
}

/* True if a cell represents a fluidity, as any cell but the back of a double one without its own, and it has points. */
static inline int represents_fluidity(const struct gr_engine *e, const struct gr_cell *cell)
{
    int64_t points = 0;
    GR_EACH_OF_FLUIDITY(e, cell, side) points += side->count;
    return points > 0;
}

/* Weights of the points in the fluidity of their cell, by mass, for those with pressure; and the fluidity of the cell
 * after the first substep. */
GR_INLINE void weigh_substeps(struct gr_engine *e, const struct gr_cell *cell)
{
    const int64_t place = gr_place_of_cell(e, cell);
    vd mass = v_zero(), flow = mass;
    for (int pass = 0; pass < 2; pass++) {
        const double sum = v_sum(mass);
        const vd inverse = v_set(sum > 0 ? 1 / sum : 0);
        GR_EACH_OF_FLUIDITY(e, cell, side)
        for (int n = 0; n < GR_BLOCKS(side->count); n++) {
            const int64_t at = side->offset + n * GR_W;
            const vm dense = v_gt(v_load(gr_substep_at(e->substeps, at, GR_SUBSTEP_p)), v_zero());
            const vd m = v_keep(dense, component(e, GR_FIELD_mass, 0, at));
            if (!pass) {
                mass = mass + m;
                flow = v_fma(m, v_keep(dense, component(e, GR_FIELD_g, 0, at)), flow);
            } else {
                v_store(gr_substep_at(e->substeps, at, GR_SUBSTEP_weight), inverse * m);
            }
        }
        e->fluidity->dense[place] = sum > 0;
        if (pass) store_fluidity(e, place, v_sum(inverse * flow), fluidity_of_cell(e, place));
    }
}

/* The first of many substeps, before the points move: for cells [first, last), the state of their points and the
 * fluidity. */
GR_INLINE void begin_substeps_of_cells(const int dim, const int basis, const int cell_averaged, struct gr_engine *e,
                                       int64_t first, int64_t last, gr_law_update *law)
{
    struct batch batch;
    batch.n = 0;
    for (int q = 0; q < MODE_STRIDE(GR_NODE_FIELDS(3, 1)); q++) batch.scale[q] = q < dim ? e->dt * e->inv_dx : 1.0;
    for (int64_t index = first; index < last; index++) {
        if (e->mesh.cell[index].count) strain_cell(dim, basis, cell_averaged, e, index, &batch, law);
        if (index + 1 < last && batch.n + GR_BLOCKS(e->mesh.cell[index + 1].count) <= BATCH) continue;
        if (batch.n) run_law(e, law, &batch, 1);
    }
    for (int64_t index = first; index < last; index++)
        if (represents_fluidity(e, &e->mesh.cell[index])) weigh_substeps(e, &e->mesh.cell[index]);
}

/* One substep of the points, and the new fluidity of the cells [first, last). */
GR_INLINE void substep_cells(const int linear, struct gr_engine *e, int64_t first, int64_t last, const double *fluidity)
{
    enum { TOGETHER = GR_SUMS > 4 ? GR_SUMS : 4 };
    const vd fraction = v_set(1.0 / e->config.nonlocal.substeps);
    const struct gr_fluidity_numbers numbers = gr_fluidity_numbers_of(fluidity, e->dt / e->config.nonlocal.substeps);
    double *const rate = e->field[GR_FIELD_shear_rate], sum[TOGETHER], g_star[TOGETHER];
    int64_t place[TOGETHER];
    vd acc[TOGETHER];
    int found = 0;
    for (int k = 0; k < TOGETHER; k++) acc[k] = v_zero();
    for (int64_t index = first; index < last; index++) {
        const struct gr_cell *cell = &e->mesh.cell[index];
        if (represents_fluidity(e, cell)) {
            place[found] = gr_place_of_cell(e, cell);
            g_star[found] = fluidity_of_cell(e, place[found]);
            const vd start = gr_fluidity_start(&numbers, v_set(g_star[found]));
            vd flow = v_zero();
            GR_EACH_OF_FLUIDITY(e, cell, side)
            for (int n = 0; n < GR_BLOCKS(side->count); n++) {
                const int64_t at = side->offset + n * GR_W;
                const vd g = gr_substep(linear, 0, &numbers, fraction, e->substeps, at, start, v_zero(), rate + at);
                flow = v_fma(v_load(gr_substep_at(e->substeps, at, GR_SUBSTEP_weight)), g, flow);
            }
            acc[found++] = flow;
        }
        if (found < TOGETHER && index + 1 < last) continue;
        for (int k = 0; k < TOGETHER; k += GR_SUMS) v_sums(sum + k, acc + k);
        for (int k = 0; k < found; k++) store_fluidity(e, place[k], sum[k], g_star[k]);
        found = 0;
    }
}
