/* Filling of cells, and the shift of their points across their faces.
 *
 * The sums of the nodes are over the cells around them. Differences that alternate from cell to cell, or from one pair of
 * cells to the next, change neither their masses nor the forces on them: a seeding lattice that is stretched falls into
 * strings with empty cells between them, while every node has its mass. So cells compare their content with their
 * neighbours. */
#include "mpm/density_correction.h"
#include "mpm/open_volume.h"

/* Number `which` (enum gr_average) of the state of the cells from `first` on. */
GR_INLINE double *average_of(const struct gr_engine *e, int which, int64_t first)
{
    return e->sums.average + which * e->mesh.cell_capacity + first;
}

/* Distance of the centroid of the rings of the cells from `first` on from the middle of the cells, in cells: int xi r/int r
 * - 1/2. */
GR_INLINE vd ring_shift(const struct gr_engine *e, int64_t first)
{
    return v_set(1.0 / 12.0) / GR_OF_CELLS(e, first, 0, radius);
}

/* The parts of the cells from `first` on that are outside of bodies: their volume over the volume of the cell, and the
 * centroid in local coordinates. */
GR_INLINE vd open_parts(const int dim, const struct gr_engine *e, int64_t first, vd centre[3])
{
    double volume[GR_W], at[3][GR_W];
    for (int d = 0; d < dim; d++) centre[d] = v_set(0.5);
    if (dim == 2 && e->config.axisymmetric) centre[0] = centre[0] + ring_shift(e, first);
    if (!e->bodies.open) return v_set(1.0);
    for (int l = 0; l < GR_W; l++) {
        const struct gr_open_part *part = gr_open_part(e->bodies.open, gr_cell_id(e, e->mesh.cell[first + l].at));
        volume[l] = part ? part->volume : 1;
        for (int d = 0; d < dim; d++) at[d][l] = part ? part->centre[d] : centre[d][l];
    }
    for (int d = 0; d < dim; d++) centre[d] = v_load(at[d]);
    return v_load(volume);
}

/* What cells have beyond their open volume; or, if they are `inside` the material, 0 to 1, too little. */
GR_INLINE vd excess_of(vd filled, vd open, vd inside)
{
    return (filled - open) * v_select(v_gt(open, filled), inside, v_set(1.0));
}

GR_INLINE void store_filling(const struct gr_engine *e, int64_t first, vd filled, vd excess)
{
    v_store(average_of(e, GR_AVERAGE_FILLED, first), filled);
    v_store(average_of(e, GR_AVERAGE_EXCESS, first), excess);
}

/* Gaps of a node between which a cell about it is a surface and inside the material: phi = 0.7 and 0.9. A cell that is
 * full to three quarters above a full one and under an empty one has 0.7, a full one under an empty one 5/6. */
#define SURFACE_GAP -0.353
#define INSIDE_GAP -0.105

/* Open part of a cell below which a body cuts it. For a cell which a body only touches it is one but for round-off. */
#define CUT_BELOW 0.99

/* The excess of cells with the smoothed density, from the gap of the node at their middle. Those that a body cuts, or that a
 * block fills, take no part. */
GR_INLINE vd excess_at(vd filled, vd open, vd gap, vd solid)
{
    const vd excess = excess_of(filled, open, between(SURFACE_GAP, INSIDE_GAP, gap));
    const vd space = v_select(v_gt(solid, v_zero()), v_zero(), open);
    return v_select(v_gt(v_set(CUT_BELOW), space), v_set(GR_NO_EXCESS), excess);
}

/* Local index along axis d of the node at the middle of the neighbour `at` among the nodes of a cell; -1 if it is not one. */
static int middle_among(const struct gr_engine *e, const struct gr_cell *cell, int d, int32_t at)
{
    const struct gr_axis_cell *along = e->axis[d].cell;
    int a = 2;
    while (a >= 0 && along[cell->at[d]].node[a] != along[at].node[1]) a--;
    return a;
}

/* Set the excess of the neighbours across a face that have no points and are not active: what they would have if they
 * were. So it does not matter when the points were grouped. */
static __attribute__((noinline)) void excess_of_absent(const struct gr_engine *e, int64_t first, int d, int high,
                                                       double other[GR_W])
{
    const int dim = e->config.dim;
    const double *const gap_of = gr_node_field(e, GR_NODE_DENSITY(dim) + GR_NODE_OWN_GAP(dim));
    double gap[GR_W], open[GR_W], solid[GR_W];
    for (int l = 0; l < GR_W; l++) {
        const struct gr_cell *cell = &e->mesh.cell[first + l];
        gap[l] = -INFINITY, open[l] = 1, solid[l] = 0;
        if (e->mesh.neighbour[(first + l) * 2 * dim + 2 * d + high] != GR_NEIGHBOUR_NO_POINTS) continue;
        int32_t at[3] = {cell->at[0], cell->at[1], cell->at[2]};
        const int32_t n = e->axis[d].n_cells;
        at[d] = (at[d] + (high ? 1 : n - 1)) % n;
        const struct gr_open_part *part = gr_open_part(e->bodies.open, gr_cell_id(e, at));
        const int a = middle_among(e, cell, d, at[d]), y = d == 1 ? a : 1, z = d == 2 ? a : dim == 3;
        if (a >= 0) gap[l] = gap_of[gr_node_in_row(e, first + l, y + 3 * z, d == 0 ? a : 1)];
        if (part) open[l] = part->volume;
        solid[l] = gr_map_get(&e->config.cell_flags, at) & GR_CELL_SOLID;
    }
    v_store(other, excess_at(v_zero(), v_load(open), v_load(gap), v_load(solid)));
}

/* Differences of the excess of the cells from `first` on to their neighbours, for each face the low side less the high
 * side. Cells hold whole points: differences up to so many `points` are left. With `smoothed` empty cells have an excess,
 * too. */
GR_INLINE void face_drops(const int dim, const int smoothed, const struct gr_engine *e, int64_t first, double points,
                          vd drop[3][2])
{
    const double *const excess = average_of(e, GR_AVERAGE_EXCESS, 0);
    double count[GR_W], rise[GR_W], absent[GR_W];
    for (int l = 0; l < GR_W; l++) count[l] = e->mesh.cell[first + l].count;
    const vd point = v_load(average_of(e, GR_AVERAGE_FILLED, first)) / v_max(v_load(count), v_set(1.0));
    for (int d = 0; d < dim; d++)
        for (int high = 0; high < 2; high++) {
            int any = 0;
            for (int l = 0; smoothed && l < GR_W; l++)
                any |= e->mesh.neighbour[(first + l) * 2 * dim + 2 * d + high] == GR_NEIGHBOUR_NO_POINTS;
            if (any) excess_of_absent(e, first, d, high, absent);
            for (int l = 0; l < GR_W; l++) {
                const int64_t neighbour = e->mesh.neighbour[(first + l) * 2 * dim + 2 * d + high];
                const double here = excess[first + l], other = neighbour >= 0 ? excess[neighbour] : any ? absent[l] : 0;
                rise[l] =
                    neighbour == GR_NEIGHBOUR_CLOSED || here == GR_NO_EXCESS || other == GR_NO_EXCESS ? 0 : other - here;
            }
            const vd up = v_load(rise), much = v_max(v_abs(up) - v_set(points) * point, v_zero());
            drop[d][high] = v_select(v_gt(up, v_zero()), much, -much) * v_set(high ? -1.0 : 1.0);
        }
}

/* Shift of the points at a face, in cells, for the strain `along` its normal:
 *
 *   beta along (excess_low - excess_high),   |shift| <= most. */
GR_INLINE vd shift_at_face(const struct gr_density_numbers *q, vd along, vd drop, vd most)
{
    return v_min(v_max(v_set(q->shifting) * along * drop, -most), most);
}
