/* Points in records: packed out of their slots, with their new cells, and put into others. A record has all components of a
 * point, x first. */
#pragma once

#include "mpm/numbers.h"

/* Where a point goes that no active cell takes. */
enum gr_destination { GR_TO_NO_CELL = -1, GR_TO_OUTSIDE = -2, GR_TO_NOWHERE = -3 };

enum { GR_NOT_PUT = -1 }; /* the slot of a packed point whose new cell is full */

/* Empty a list. */
static inline void gr_clear_migrants(struct gr_migrants *list)
{
    list->count = list->invalid = list->outside = list->homeless = 0;
    list->lowest = INT64_MAX;
    list->highest = INT64_MIN;
}

/* Copy a point to a record, and a record to a slot. */
void gr_pack(const struct gr_engine *e, int64_t slot, double *record);
void gr_unpack(struct gr_engine *e, int64_t slot, const double *record, int64_t id);

/* Fill the gap of a removed point with the last point of its cell. */
void gr_close_hole(struct gr_engine *e, struct gr_cell *cell, int64_t slot);

/* Find the cell of a packed point along each axis; from these indices, its number or enum gr_destination; and both. */
void gr_locate_packed(const struct gr_engine *e, const double *record, int64_t at[3]);
int64_t gr_cell_of_packed(const struct gr_engine *e, const int64_t at[3], const double *record);
int64_t gr_find_cell(const struct gr_engine *e, const double *record);

/* Code of the error of a packed point at the indices `at`, GR_OK if it is finite and in a neighbour of its old cell,
 * `from`. */
int gr_check_packed(const struct gr_engine *e, const struct gr_cell *from, const double *record, const int64_t at[3]);

/* Check point k of a list, find its new cell, and count it. */
void gr_address(const struct gr_engine *e, struct gr_migrants *out, int64_t k);

/* Pack the listed points from number `first` on: copy them out of their cells, close the gaps that they leave, and find
 * their new cells. */
void gr_pack_migrants(struct gr_engine *e, struct gr_migrants *out, int64_t first);

/* Put a packed point into a cell, which wakes.
 * Returned: 0 if the cell is full. */
int gr_put_point(struct gr_engine *e, struct gr_cell *cell, double *record, int64_t id);
