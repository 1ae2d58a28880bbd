/* Places of things that lie one behind the other, from how many there are of each. */
#pragma once

#include "mpm/engine.h"

/* Replace each of n numbers, which passes have made, by *end plus the sum of those before it; *end grows by the sum of all.
 * Returned: 0, GR_ERR_MEMORY or GR_ERR_DEVICE. */
int gr_make_places(struct gr_engine *e, int64_t *number, int64_t n, int64_t *end);
