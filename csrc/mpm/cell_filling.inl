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

/* Differences of the excess of the cells from `first` on to their neighbours, for each face the low side less the high
 * side. Cells hold whole points: differences up to so many `points` are left. */
GR_INLINE void face_drops(const int dim, const struct gr_engine *e, int64_t first, double points, vd drop[3][2])
{
    const double *const excess = average_of(e, GR_AVERAGE_EXCESS, 0);
    double count[GR_W], rise[GR_W];
    for (int l = 0; l < GR_W; l++) count[l] = e->mesh.cell[first + l].count;
    const vd point = v_load(average_of(e, GR_AVERAGE_FILLED, first)) / v_max(v_load(count), v_set(1.0));
    for (int d = 0; d < dim; d++)
        for (int high = 0; high < 2; high++) {
            for (int l = 0; l < GR_W; l++) {
                const int64_t neighbour = e->mesh.neighbour[(first + l) * 2 * dim + 2 * d + high];
                const double here = excess[first + l], other = neighbour < 0 ? 0 : excess[neighbour];
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
