/* Tally of a run: sums and extremes of its points, kept for its verdict (granular/diagnostics.py).
 *
 * One is made every GR_TALLY_INTERVAL steps. Each cell is summed over its points in their order, and the cells in theirs, so
 * that the bits depend neither on the number of threads nor on when the points were grouped. */
#pragma once

#include <stdint.h>

struct gr_team;

/* Steps between two tallies; a point of one takes about as long as in half a step. The plastic power is integrated from one to
 * the next, over impacts of some ten steps: with 64 steps the block that falls on a bed came out with 12 % of the work more
 * than in the sum over all steps, with 17 steps 1 % at most. Not a multiple of the steps between two averagings of the density,
 * which is 4: the power is largest in these, and at every fourth step it comes out 10 % too small in slow flow. */
enum { GR_TALLY_INTERVAL = 17 };

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

struct gr_engine;
struct gr_tally_of_cell;

struct gr_tally {
#define GR_X(name, doc) double name;
    GR_TALLY(GR_X)
#undef GR_X
    struct gr_tally_of_cell *cell; /* work space */
    int64_t capacity;
};

/* True if a tally is to be made of the present state. */
int gr_tally_is_due(const struct gr_engine *e);

/* Make it; the points are grouped. Returned: 0 or GR_ERR_MEMORY. */
int gr_tally_make(struct gr_engine *e, struct gr_team *team);

/* Account for a packed point that appears, or is taken away, at a place: `sign` is 1 or -1. */
void gr_tally_carry(struct gr_engine *e, const double *record, int sign);

/* Account for the energy of a packed point that leaves. */
void gr_tally_outflow(struct gr_engine *e, const double *record);
