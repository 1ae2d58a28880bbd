/* Position of the cells of the fluidity grid relative to bodies. */
#pragma once

#include "mpm/engine.h"

/* Set the gr_inside bits of the cells [first, last), and with rough bodies their distances from the surfaces of these
 * (fluidity/border.c). Of a separated copy near a rough thin body, that is the distance from the surface on its own side,
 * negative on the other. */
void gr_bodies_mark(struct gr_engine *e, int64_t first, int64_t last);
