/* Rate-independent friction of half the coefficient: tau <= mu p/2, stress-free when disconnected. */
#ifdef GR_LIST_LAWS
GR_LAW(half_friction)
#else
#include "law/frictional.h"

static inline void law_half_friction(const int dim, const struct gr_law_call *call)
{
    const double halved[] = {call->parameter[0], call->parameter[1], 0.5 * call->parameter[2]};
    struct gr_law_call half = *call;
    half.parameter = halved;
    gr_frictional(dim, 0, &half);
}

GR_DESCRIBE_LAW(half_friction, .doc = "half the friction, stress-free when disconnected",
                .parameter = {GR_ELASTIC_PARAMETERS, {"mu", "1", "twice the friction coefficient"}})
#endif
