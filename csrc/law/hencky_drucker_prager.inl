/* Hencky elasticity (hencky.h) with rate-independent friction, tau <= mu p. */
#ifdef GR_LIST_LAWS
GR_LAW(hencky_drucker_prager)
#else
#include "law/hencky_blocks.h"

GR_INLINE void law_hencky_drucker_prager(const int dim, const struct gr_law_call *call)
{
    struct gr_hencky_numbers n = gr_hencky_elasticity_of(call->parameter[0], call->parameter[1], call->dt);
    n.mu_s = v_set(call->parameter[2]);
    gr_hencky_blocks(dim, GR_HENCKY_drucker_prager, &n, call);
}

GR_DESCRIBE_LAW(hencky_drucker_prager,
                .doc = "Hencky's elasticity, rate-independent friction, stress-free when disconnected",
                .parameter = {GR_ELASTIC_PARAMETERS, {"mu", "1", "friction coefficient"}})
#endif
