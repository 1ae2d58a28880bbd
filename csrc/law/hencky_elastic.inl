/* Hencky elasticity without flow, also in tension (hencky.h). */
#ifdef GR_LIST_LAWS
GR_LAW(hencky_elastic)
#else
#include "law/hencky_blocks.h"

GR_INLINE void law_hencky_elastic(const int dim, const struct gr_law_call *call)
{
    struct gr_hencky_numbers n = gr_hencky_elasticity_of(call->parameter[0], call->parameter[1], call->dt);
    gr_hencky_blocks(dim, GR_HENCKY_elastic, &n, call);
}

GR_DESCRIBE_LAW(hencky_elastic, .doc = "Hencky's elasticity", .parameter = {GR_ELASTIC_PARAMETERS})
#endif
