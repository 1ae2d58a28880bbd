/* The time step. A call makes many steps, by a team of threads. */
#pragma once

#include "mpm/engine.h"

/* Make at most max_steps steps, up to the time `until`. Returned: 0 or the error, which is in e->failure, too. */
int gr_advance(struct gr_engine *e, const struct gr_kernels *kernels, int64_t max_steps, double until, int threads);

/* The stages one by one, in one thread: the same as a step of gr_advance, to the last bit. */
int gr_p2g(struct gr_engine *e, const struct gr_kernels *kernels);
int gr_grid(struct gr_engine *e, const struct gr_kernels *kernels);
int gr_g2p(struct gr_engine *e, const struct gr_kernels *kernels);
