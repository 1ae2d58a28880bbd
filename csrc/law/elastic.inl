/* Linear hypoelasticity with the Jaumann rate (Dunatunga & Kamrin 2015, eq. 2.9 with D^p = 0). */
#ifdef GR_LIST_LAWS
GR_LAW(elastic)
#else
#include "law/trial.h"

GR_INLINE void law_elastic(const int dim, const struct gr_law_call *call)
{
    const vd K = v_set(call->parameter[0]), G = v_set(call->parameter[1]);
    for (int64_t k = 0; k < call->n_blocks; k++) {
        const int64_t at = call->slot[k];
        const struct gr_stress t = gr_trial(dim, call, k, K, G);
        for (int c = 0; c < GR_STRESSES(dim); c++) v_store(call->stress[c] + at, t.s[c]);
        if (call->shear_rate) v_store(call->shear_rate + at, v_zero());
    }
}

GR_DESCRIBE_LAW(elastic, .doc = "linear hypoelasticity with the Jaumann rate", .parameter = {GR_ELASTIC_PARAMETERS})
#endif
