/* What a pass of the diffusion consists of (passes.inl), and its end: what its sums tell the passes that follow. */
#pragma once

#include <math.h>

#include "fluidity/fluidity.h"

/* Number of the sums of a pass, whose parts are in f->space.partial. */
static inline int gr_sums_of_pass(enum gr_diffusion_pass pass)
{
    return pass == GR_PASS_first_residual ? 2 : pass == GR_PASS_multiply || pass == GR_PASS_descend ? 1 : 0;
}

/* True if a pass has links of f->pages.wrap. */
static inline int gr_pass_has_wraps(enum gr_diffusion_pass pass)
{
    return pass != GR_PASS_descend && pass != GR_PASS_turn && pass != GR_PASS_clamp;
}

/* True if a pass goes over the cells once more after the links of f->pages.wrap. */
static inline int gr_pass_has_end(enum gr_diffusion_pass pass)
{
    return pass == GR_PASS_explicit || pass == GR_PASS_first_residual || pass == GR_PASS_first_stage ||
           pass == GR_PASS_clamp;
}

/* Begin the search with the squared norms of the residual and of g. */
static inline void gr_begin_descent(struct gr_fluidity *f, double rr, double gg)
{
    static const double ROUND_OFF = 2e-16, NOTHING = 1e-150; /* 1/s; its square is still a normal number */
    struct gr_descent *d = &f->descent;
    const double relative = fmax(f->tolerance * f->tolerance * rr, ROUND_OFF * ROUND_OFF * gg);
    *d = (struct gr_descent){.rr = rr, .enough = fmax(relative, NOTHING * NOTHING)};
    d->failed = !isfinite(rr);
    d->ended = d->failed || rr <= d->enough;
}

/* After an iteration. */
static inline void gr_continue_descent(struct gr_fluidity *f, double rr)
{
    struct gr_descent *d = &f->descent;
    d->scale = rr / d->rr;
    d->rr = rr;
    d->made++;
    d->failed = !(rr <= d->enough) && (!isfinite(rr) || d->made == f->max_iterations);
    d->ended = d->failed || rr <= d->enough;
}

/* End a pass that has these sums. */
static inline void gr_end_pass(struct gr_fluidity *f, enum gr_diffusion_pass pass, const double sum[2])
{
    if (pass == GR_PASS_first_residual)
        gr_begin_descent(f, sum[0], sum[1]);
    else if (pass == GR_PASS_multiply)
        f->descent.scale = f->descent.rr / sum[0];
    else if (pass == GR_PASS_descend)
        gr_continue_descent(f, sum[0]);
}
