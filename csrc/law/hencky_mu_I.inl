/* Hencky elasticity (hencky.h) with mu(I) flow (flow_rules.h). */
#ifdef GR_LIST_LAWS
GR_LAW(hencky_mu_I)
#else
#include "law/hencky_blocks.h"

GR_INLINE void law_hencky_mu_I(const int dim, const struct gr_law_call *call)
{
    gr_hencky_mu_I_blocks(dim, GR_HENCKY_mu_I, call);
}

GR_DESCRIBE_LAW(hencky_mu_I, .doc = "Hencky's elasticity, mu(I) rheology, stress-free when disconnected",
                .parameter = {GR_MU_I_PARAMETERS})
#endif
