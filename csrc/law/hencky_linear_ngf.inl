/* Hencky elasticity (hencky.h) with nonlocal granular fluidity and unbounded friction (Haeri & Skonieczny 2021). */
#ifdef GR_LIST_LAWS
GR_LAW(hencky_linear_ngf)
#else
#include "law/hencky_blocks.h"

GR_INLINE void law_hencky_linear_ngf(const int dim, const struct gr_law_call *call)
{
    gr_hencky_nonlocal_blocks(dim, GR_HENCKY_linear_ngf, GR_HENCKY_linear_mu_I, call);
}

GR_DESCRIBE_LAW(hencky_linear_ngf,
                .doc = "Hencky's elasticity, nonlocal granular fluidity, linear (Haeri & Skonieczny 2021)",
                .reaction = GR_LINEAR_NGF, .fluidity = GR_HENCKY_NGF_FLUIDITY,
                .parameter = {{"A", "1", "nonlocal amplitude"}, GR_HENCKY_PARAMETERS(GR_INFO)})
#endif
