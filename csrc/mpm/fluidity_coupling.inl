/* Coupling of the fluidity of the cells with the points: means over the points of a cell before the diffusion, and what
 * points start from after it. */
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
        e->nonlocal.fluidity->gain[place] = gain;
        g += gain;
    }
    e->nonlocal.fluidity->g[place] = g;
}

/* Points of the material that has a fluidity, in the slots from `at` on. For the fluidity others are like empty cells: no
 * fluidity diffuses into them, as with the law itself for A = 0. */
GR_INLINE vm is_nonlocal(const struct gr_engine *e, int64_t at)
{
    double is_one[GR_W];
    for (int l = 0; l < GR_W; l++) is_one[l] = gr_material_at(e, at + l) == e->nonlocal.material;
    return v_gt(v_load(is_one), v_zero());
}

/* Points with pressure in the slots from `at` on. */
GR_INLINE vm has_pressure(const struct gr_engine *e, int64_t at)
{
    vd tension = component(e, GR_FIELD_stress, 0, at);
    for (int c = 1; c < 3; c++) tension = tension + component(e, GR_FIELD_stress, c, at);
    return v_gt(v_zero(), tension);
}

/* Sums over the points with pressure of GR_W cells, a lane each: of m, m g and m times the gain. */
GR_INLINE void sum_fluidity(const struct gr_engine *e, int64_t first, double sum[3][GR_W])
{
    vd acc[3] = {v_zero(), v_zero(), v_zero()};
    int points = 0;
    for (int l = 0; l < GR_W; l++) points = points > e->mesh.cell[first + l].count ? points : e->mesh.cell[first + l].count;
    for (int n = 0; n < points; n++) { /* spare slots have no mass */
        const int64_t at = gr_slot(&e->mesh.cell[first], n);
        vd m = v_keep(has_pressure(e, at), component(e, GR_FIELD_mass, 0, at));
        if (__builtin_expect(e->config.n_materials > 1, 0)) m = v_keep(is_nonlocal(e, at), m);
        acc[0] = acc[0] + m;
        acc[1] = v_fma(m, component(e, GR_FIELD_g, 0, at), acc[1]);
        if (gr_is_balanced(e)) acc[2] = v_fma(m, component(e, GR_FIELD_g_gain, 0, at), acc[2]);
    }
    for (int q = 0; q < 3; q++) v_store(sum[q], acc[q]);
}

GR_INLINE void store_mean(struct gr_engine *e, int64_t place, double m, double g, double gain)
{
    const double inverse = m > 0 ? 1 / m : 0;
    e->nonlocal.fluidity->dense[place] = m > 0;
    e->nonlocal.fluidity->mean[place] = inverse * g;
    store_gain(e, place, inverse * g, inverse * gain);
}

/* Mean fluidity of the cells from `first` on that are not double. */
GR_INLINE void means_of_cells(struct gr_engine *e, int64_t first)
{
    double sum[3][GR_W];
    sum_fluidity(e, first, sum);
    for (int l = 0; l < GR_W && first + l < e->mesh.n_cells; l++) {
        const struct gr_cell *cell = &e->mesh.cell[first + l];
        if (!GR_IS_DOUBLE(cell)) store_mean(e, gr_place_of_cell(e, cell), sum[0][l], sum[1][l], sum[2][l]);
    }
}

/* Mean fluidity of a side of a double cell, or of both sides if they are not separated. */
GR_INLINE void mean_of_double_cell(struct gr_engine *e, const struct gr_cell *cell)
{
    double all[3] = {0}, sum[3][GR_W];
    GR_EACH_OF_FLUIDITY(e, cell, side)
    {
        const int64_t index = side - e->mesh.cell, first = index / GR_W * GR_W;
        sum_fluidity(e, first, sum);
        for (int q = 0; q < 3; q++) all[q] += sum[q][index - first];
    }
    store_mean(e, gr_place_of_cell(e, cell), all[0], all[1], all[2]);
}

/* The fluidity of a cell after the diffusion, from which the law starts (store_gain). */
GR_INLINE double fluidity_of_cell(const struct gr_engine *e, int64_t place)
{
    double g = e->nonlocal.fluidity->g[place];
    if (gr_is_balanced(e)) g -= e->nonlocal.fluidity->gain[place];
    return g < e->config.nonlocal.floor ? e->config.nonlocal.floor : g; /* NaN remains */
}

/* Fluidities from which the law starts in GR_W cells: the fluidity of the cells after the diffusion; its change, so that a
 * point with pressure starts from deviation * g + change, with its fluidity g. */
struct fluidity_start {
    vd of_cell, change, deviation;
};

GR_INLINE void fluidity_starts(const struct gr_engine *e, int64_t first, struct fluidity_start *start)
{
    double of_cell[GR_W], mean[GR_W];
    for (int l = 0; l < GR_W; l++) {
        const int is_cell = first + l < e->mesh.n_cells;
        const int64_t place = is_cell ? gr_place_of_cell(e, &e->mesh.cell[first + l]) : 0;
        of_cell[l] = is_cell ? fluidity_of_cell(e, place) : 0;
        mean[l] = is_cell ? e->nonlocal.fluidity->mean[place] : 0;
    }
    start->of_cell = v_load(of_cell);
    start->deviation = v_set(e->nonlocal.deviation_left);
    start->change = start->of_cell - start->deviation * v_load(mean);
}

/* Fluidities from which the law starts at the points in the slots from `at` on. Points without pressure have none: if they
 * reconnect, they start from the fluidity of their cell. */
GR_INLINE vd start_of_points(const struct gr_engine *e, const struct fluidity_start *start, vm with_pressure, int64_t at)
{
    const vd g = v_fma(start->deviation, component(e, GR_FIELD_g, 0, at), start->change);
    return v_select(with_pressure, v_max(v_set(e->config.nonlocal.floor), g), start->of_cell); /* NaN remains */
}

/* True if a cell represents a fluidity, as any cell but the back of a double one without its own, and it has points. */
static inline int represents_fluidity(const struct gr_engine *e, const struct gr_cell *cell)
{
    int64_t points = 0;
    GR_EACH_OF_FLUIDITY(e, cell, side) points += side->count;
    return points > 0;
}
