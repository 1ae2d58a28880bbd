/* Hypoelasticity with mu(I) flow, the trans-phase law of Dunatunga & Kamrin 2015, and cohesion: elastic below yield,
 * stress-free when disconnected. */
#ifdef GR_LIST_LAWS
GR_LAW(mu_I)
#else
#include "law/frictional.h"

GR_INLINE void law_mu_I(const int dim, const struct gr_law_call *call)
{
    gr_frictional(dim, GR_MU_I, call, call->parameter[P_AFTER_MU_I]);
}

GR_DESCRIBE_LAW(mu_I, .doc = "mu(I) rheology, stress-free when disconnected (Dunatunga & Kamrin 2015, eq. 2.13-2.15)",
                .parameter = {GR_MU_I_PARAMETERS, GR_COHESION_PARAMETERS})
#endif
