/* Hencky elasticity without flow, also in tension (hencky.h). */
#ifdef GR_LIST_LAWS
GR_LAW(hencky_elastic)
#else
#include "law/hencky_blocks.h"

GR_INLINE void law_hencky_elastic(const int dim, const struct gr_law_call *call)
{
    gr_hencky_local_blocks(dim, GR_HENCKY_elastic, call, 1, 2, 1, 0);
}

GR_DESCRIBE_LAW(hencky_elastic, .doc = "Hencky's elasticity", .parameter = {GR_ELASTIC_PARAMETERS})
#endif
