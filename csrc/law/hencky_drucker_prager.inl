/* Hencky elasticity (hencky.h) with rate-independent friction, tau <= mu p. */
#ifdef GR_LIST_LAWS
GR_LAW(hencky_drucker_prager)
#else
#include "law/hencky_blocks.h"

GR_INLINE void law_hencky_drucker_prager(const int dim, const struct gr_law_call *call)
{
    gr_hencky_local_blocks(dim, GR_HENCKY_drucker_prager, call, call->parameter[2], 2 * call->parameter[2], 1, 0);
}

GR_DESCRIBE_LAW(hencky_drucker_prager,
                .doc = "Hencky's elasticity, rate-independent friction, stress-free when disconnected",
                .parameter = {GR_ELASTIC_PARAMETERS, {"mu", "1", "friction coefficient"}})
#endif
