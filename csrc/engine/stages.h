/* The stages of a time step, each divided into chunks of cells or nodes. Each result is written by one chunk, and every
 * sum has a fixed order, so that the bits do not depend on the number of threads. */
#pragma once

#include "engine/run.h"

/* Make the sums of all tiles; of those alone whose sums lack something. */
void gr_stage_p2g(struct gr_run *run);
void gr_stage_p2g_again(struct gr_run *run);

/* From the sums to the velocities of the nodes after the step, with walls and bodies, and the averaging of the density.
 * After an error, which is in the engine, the sums are not valid. */
void gr_stage_grid(struct gr_run *run);

/* Diffuse the fluidity, and make all substeps of the nonlocal law but the last, which is part of G2P.
 * Returned: 0, or the error of the step. */
int gr_stage_fluidity(struct gr_run *run);

/* Move the points, update their stresses, and list those that leave their cells. After an error of a device, which is in the
 * engine as after those of the other stages, the points are lost. */
void gr_stage_g2p(struct gr_run *run);
