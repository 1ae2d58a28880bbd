/* The finite-strain laws: Hencky elasticity (hencky.h) with each of its flow rules. */
#ifdef GR_LIST_LAWS
GR_LAW(hencky_elastic)
GR_LAW(hencky_drucker_prager)
GR_LAW(hencky_hardening_drucker_prager)
GR_LAW(hencky_mu_I)
GR_LAW(hencky_linear_mu_I)
GR_LAW(hencky_ngf)
GR_LAW(hencky_linear_ngf)
#else
#include "law/hencky_blocks.h"

/* No flow, also in tension. */
static inline void law_hencky_elastic(const int dim, const struct gr_law_call *call)
{
    gr_hencky_local_blocks(dim, GR_HENCKY_elastic, call, 1, 2, 1, 0);
}

GR_DESCRIBE_LAW(hencky_elastic, .doc = "Hencky's elasticity", .parameter = {GR_ELASTIC_PARAMETERS})

static inline void law_hencky_drucker_prager(const int dim, const struct gr_law_call *call)
{
    gr_hencky_local_blocks(dim, GR_HENCKY_drucker_prager, call, call->parameter[2], 2 * call->parameter[2], 1, 0);
}

GR_DESCRIBE_LAW(hencky_drucker_prager,
                .doc = "Hencky's elasticity, rate-independent friction, stress-free when disconnected",
                .parameter = {GR_ELASTIC_PARAMETERS, {"mu", "1", "friction coefficient"}})

static inline void law_hencky_hardening_drucker_prager(const int dim, const struct gr_law_call *call)
{
    gr_hencky_local_blocks(dim, GR_HENCKY_drucker_prager, call, 1, 2, 1, call->parameter + 2);
}

GR_DESCRIBE_LAW(hencky_hardening_drucker_prager,
                .doc = "Hencky's elasticity, friction that grows with the plastic strain (Klar et al. 2016)", .hardens = 1,
                .parameter = {GR_ELASTIC_PARAMETERS,
                              {"h0_deg", "deg", "friction angle at large plastic strain"},
                              {"h1_deg", "deg", "initial increase of the angle per plastic strain"},
                              {"h2", "1", "rate at which h1 and h3 decay with the plastic strain"},
                              {"h3_deg", "deg", "initial deficit of the angle"}})

static inline void law_hencky_mu_I(const int dim, const struct gr_law_call *call)
{
    gr_hencky_local_blocks(dim, GR_HENCKY_mu_I, call, call->parameter[2], call->parameter[3], call->parameter[4], 0);
}

GR_DESCRIBE_LAW(hencky_mu_I, .doc = "Hencky's elasticity, mu(I) rheology, stress-free when disconnected",
                .parameter = {GR_MU_I_PARAMETERS})

static inline void law_hencky_linear_mu_I(const int dim, const struct gr_law_call *call)
{
    gr_hencky_local_blocks(dim, GR_HENCKY_linear_mu_I, call, call->parameter[2], call->parameter[3], call->parameter[4], 0);
}

GR_DESCRIBE_LAW(hencky_linear_mu_I,
                .doc = "Hencky's elasticity, mu = mu_s + (mu_2 - mu_s) I/I0, stress-free when disconnected",
                .parameter = {GR_MU_I_PARAMETERS})

static inline void law_hencky_ngf(const int dim, const struct gr_law_call *call)
{
    gr_hencky_nonlocal_blocks(dim, GR_HENCKY_ngf, GR_HENCKY_mu_I, call);
}

GR_DESCRIBE_LAW(hencky_ngf, .doc = "Hencky's elasticity, nonlocal granular fluidity that saturates (hencky.h)",
                .reaction = GR_NGF, .fluidity = GR_HENCKY_NGF_FLUIDITY,
                .parameter = {{"A", "1", "nonlocal amplitude"}, GR_HENCKY_PARAMETERS(GR_INFO)})

static inline void law_hencky_linear_ngf(const int dim, const struct gr_law_call *call)
{
    gr_hencky_nonlocal_blocks(dim, GR_HENCKY_linear_ngf, GR_HENCKY_linear_mu_I, call);
}

GR_DESCRIBE_LAW(hencky_linear_ngf,
                .doc = "Hencky's elasticity, nonlocal granular fluidity, linear (Haeri & Skonieczny 2021)",
                .reaction = GR_LINEAR_NGF, .fluidity = GR_HENCKY_NGF_FLUIDITY,
                .parameter = {{"A", "1", "nonlocal amplitude"}, GR_HENCKY_PARAMETERS(GR_INFO)})
#endif
