/* Numbers of the tally of a run (tally.h). */
#pragma once

#include <stdint.h>

#include "core/exact.h"

/* X(name, description); energies in J, in 2D per metre of depth */
#define GR_TALLY(X)                                                                       \
    X(time, "time of the last tally, s; -1 if there is none")                             \
    X(first_energy, "kinetic and elastic energy at the first tally")                      \
    X(energy, "the same at the last one")                                                 \
    X(gravity_work, "work of gravity between them")                                       \
    X(plastic_work, "plastic power, integrated over the time between them")               \
    X(outflow, "kinetic and elastic energy of the points that have left")                 \
    X(power, "plastic power at the last tally, W")                                        \
    X(moment_x, "sum of m x at the last tally, less what came and went since then, kg m") \
    X(moment_y, "the same along y")                                                       \
    X(moment_z, "the same along z")                                                       \
    X(densest, "largest log-density that a point had in a tally; at least 0")             \
    X(loosest, "least log-density that a point under stress had; at most 0")              \
    X(fastest, "largest speed, m/s")                                                      \
    X(strain_step, "largest strain and rotation in a step: the norm of the velocity gradient times dt")

struct gr_tally_of_cell;

struct gr_tally {
#define GR_X(name, doc) double name;
    GR_TALLY(GR_X)
#undef GR_X
    struct gr_tally_of_cell *cell; /* work space */
    int64_t capacity;
};

/* Sums of the points of a tally: their energy, their plastic power, their moments; or of those that leave in a step: their
 * energy, their mass, and the moments of all that come and go. */
enum gr_tally_sum { GR_TALLY_ENERGY, GR_TALLY_OTHER, GR_TALLY_MOMENT, GR_TALLY_SUMS = GR_TALLY_MOMENT + 3 };

/* What points that come and go in a step change, until its end. */
struct gr_passage {
    int any;
    struct gr_exact sum[GR_TALLY_SUMS];
};
