/* Hencky elasticity (hencky.h) with nonlocal granular fluidity, which gives mu(I) where the fluidity is uniform. */
#ifdef GR_LIST_LAWS
GR_LAW(hencky_ngf)
#else
#include "law/hencky_blocks.h"

GR_INLINE void law_hencky_ngf(const int dim, const struct gr_law_call *call)
{
    gr_hencky_nonlocal_blocks(dim, GR_HENCKY_ngf, GR_HENCKY_mu_I, call);
}

GR_DESCRIBE_LAW(hencky_ngf, .doc = "Hencky's elasticity, nonlocal granular fluidity that saturates (hencky.h)",
                .reaction = GR_NGF, .fluidity = GR_HENCKY_NGF_FLUIDITY,
                .parameter = {{"A", "1", "nonlocal amplitude"}, GR_HENCKY_PARAMETERS(GR_INFO)})
#endif
