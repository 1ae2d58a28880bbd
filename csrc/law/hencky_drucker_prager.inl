/* Hencky elasticity (hencky.h) with rate-independent friction, tau <= mu p. */
#ifdef GR_LIST_LAWS
GR_LAW(hencky_drucker_prager)
#else
#include "law/hencky_blocks.h"

static inline void law_hencky_drucker_prager(const int dim, const struct gr_law_call *call)
{
    struct gr_hencky_numbers n = gr_hencky_sizeless(call, call->parameter[2], 2 * call->parameter[2], 1);
    gr_hencky_blocks(dim, GR_HENCKY_drucker_prager, &n, call);
}

GR_DESCRIBE_LAW(hencky_drucker_prager,
                .doc = "Hencky's elasticity, rate-independent friction, stress-free when disconnected",
                .parameter = {GR_ELASTIC_PARAMETERS, {"mu", "1", "friction coefficient"}})
#endif
