/* Hencky elasticity (hencky.h) with friction that depends on the plastic strain (hencky_blocks.h). */
#ifdef GR_LIST_LAWS
GR_LAW(hencky_hardening_drucker_prager)
#else
#include "law/hencky_blocks.h"

GR_INLINE void law_hencky_hardening_drucker_prager(const int dim, const struct gr_law_call *call)
{
    struct gr_hencky_numbers n = gr_hencky_elasticity_of(call->parameter[0], call->parameter[1], call->dt);
    n.hardening = call->parameter + 2;
    gr_hencky_blocks(dim, GR_HENCKY_drucker_prager, &n, call);
}

GR_DESCRIBE_LAW(hencky_hardening_drucker_prager,
                .doc = "Hencky's elasticity, friction that grows with the plastic strain (Klar et al. 2016)", .hardens = 1,
                .parameter = {GR_ELASTIC_PARAMETERS,
                              {"h0_deg", "deg", "friction angle at large plastic strain"},
                              {"h1_deg", "deg", "initial increase of the angle per plastic strain"},
                              {"h2", "1", "rate at which h1 and h3 decay with the plastic strain"},
                              {"h3_deg", "deg", "initial deficit of the angle"}})
#endif
