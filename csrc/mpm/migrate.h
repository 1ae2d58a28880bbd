/* Migration of points between cells, and the slots of cells. */
#pragma once

#include "core/team.h"
#include "mpm/packing.h"

/* The other side of a double cell. */
static inline const struct gr_cell *gr_other_side(const struct gr_engine *e, const struct gr_cell *cell)
{
    return &e->mesh.cell[e->mesh.other[cell - e->mesh.cell]];
}

/* True if a cell has a fluidity of its own: it is not double, or its sides are separated. */
static inline int gr_is_separate(const struct gr_engine *e, const struct gr_cell *cell)
{
    const int32_t place = e->mesh.place[cell - e->mesh.cell];
    return !GR_IS_DOUBLE(cell) || (place >= 0 && e->nonlocal.fluidity->inside[place] & GR_SEPARATED);
}

/* Place of a cell on the fluidity grid. The two sides of a double cell use the place of the front alone if the centre of the
 * cell does not face the thin body. */
static inline int64_t gr_place_of_cell(const struct gr_engine *e, const struct gr_cell *cell)
{
    if (cell->side == GR_BACK && !gr_is_separate(e, cell)) cell = gr_other_side(e, cell);
    return e->mesh.place[cell - e->mesh.cell];
}

/* The cells that share the fluidity of a cell which represents it: both sides of a double cell from its front on, or the cell
 * alone. The back of a double cell that is not separated represents none. */
static inline const struct gr_cell *gr_next_of_fluidity(const struct gr_engine *e, const struct gr_cell *cell,
                                                        const struct gr_cell *last)
{
    if (gr_is_separate(e, cell)) return last ? NULL : cell;
    if (cell->side == GR_BACK) return NULL;
    return !last ? cell : last == cell ? gr_other_side(e, cell) : NULL;
}

#define GR_EACH_OF_FLUIDITY(e, cell, name)                                              \
    for (const struct gr_cell *name = gr_next_of_fluidity(e, cell, NULL); name != NULL; \
         name = gr_next_of_fluidity(e, cell, name))

/* Insert the packed points into their new cells, in the order of the lists, by cells and slots. Points that leave through
 * an open side are dropped; points without a free slot become pending. Cells that gain points are listed in `dirty`. */
int gr_migrate(struct gr_engine *e, struct gr_migrants *list, int lists, struct gr_team *team);

/* Move points of double cells to the other side if they have crossed over where they do not face the thin body. */
void gr_change_sides(struct gr_engine *e);

/* Put a new point, packed at the next slot of `pending`, into its cell; it waits there if it has none or the cell is
 * full. One outside of the domain is brought back, or dropped. */
void gr_insert_new(struct gr_engine *e, double *record, int64_t id);

/* Where gr_insert_new would put a point. Set: its position, and its cell or, if it would be dropped, the one that is nearest.
 * Returned: whether it would be inside. */
int gr_place_new(struct gr_engine *e, const double *record, double x[3], int32_t cell[3]);

/* Reserve memory for n packed points. share_out does it before the steps, so that none of them allocates. */
int gr_reserve_pending(struct gr_engine *e, int64_t n);

/* Bring a point that is outside the domain back: across a periodic end, or to a closed side.
 * Given: x, and the cell `at` found for it; `from`, its old cell.
 * Returned: 1 if the point is inside now, 0 if it has left. */
int gr_confine(struct gr_engine *e, double x[3], int64_t at[3], const int32_t from[3]);

/* Points that are moved out of their cells after the migration of a step: an empty list, behind the points that wait. */
struct gr_migrants gr_begin_replacing(struct gr_engine *e);

/* Move the point in a slot of a cell to x; if that lies in another cell, add it to the list.
 * Returned: whether it has left its cell; another point may be at its slot then. */
int gr_replace_point(struct gr_engine *e, struct gr_migrants *list, int64_t index, int64_t slot, const double x[3]);

/* Insert the points of the list, which are in the order of their cells, into their new cells. Returned: 0 or an error. */
int gr_end_replacing(struct gr_engine *e, struct gr_migrants *list);
