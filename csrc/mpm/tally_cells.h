/* Sums of a tally over the points of cells (tally.h), on a processor or on a device. */
#pragma once

#include "mpm/engine.h"

/* Sums over the points of a cell, and the largest of each number. */
struct gr_tally_of_cell {
    double energy, power, moment[3], densest, loosest, square, gradient;
};

/* Make the sums of the cells of a tile, from `first` on; on a device of this cell alone. */
void gr_tally_cells(struct gr_engine *e, int64_t first);

/* Kinetic and elastic energy of a packed point, J. */
double gr_tally_packed(const struct gr_engine *e, const double *record);
