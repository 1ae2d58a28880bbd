/* Hypoelasticity with rate-independent friction, tau <= c + mu p; stress-free when disconnected. */
#ifdef GR_LIST_LAWS
GR_LAW(drucker_prager)
#else
#include "law/frictional.h"

GR_INLINE void law_drucker_prager(const int dim, const struct gr_law_call *call)
{
    gr_frictional(dim, GR_RATE_INDEPENDENT, call, call->parameter[P_AFTER_DRUCKER_PRAGER]);
}

GR_DESCRIBE_LAW(drucker_prager, .doc = "rate-independent friction and cohesion, stress-free when disconnected",
                .parameter = {GR_ELASTIC_PARAMETERS, {"mu", "1", "friction coefficient"}, GR_COHESION_PARAMETERS})
#endif
