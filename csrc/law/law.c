#include "law/law.h"

const struct gr_law_info gr_law_table[GR_LAW_COUNT] = {
    [GR_LAW_elastic] = {"elastic",
                        "linear hypoelasticity with the Jaumann rate",
                        2,
                        {{"K", "Pa", "bulk modulus"}, {"G", "Pa", "shear modulus"}}},
    [GR_LAW_drucker_prager] = {"drucker_prager",
                               "rate-independent friction, stress-free when disconnected",
                               3,
                               {{"K", "Pa", "bulk modulus"},
                                {"G", "Pa", "shear modulus"},
                                {"mu", "1", "friction coefficient"}}},
    [GR_LAW_mu_i] = {"mu_i",
                     "mu(I) rheology, stress-free when disconnected (Dunatunga & Kamrin 2015, eq. 2.13-2.15)",
                     5,
                     {{"K", "Pa", "bulk modulus"},
                      {"G", "Pa", "shear modulus"},
                      {"mu_s", "1", "static friction coefficient"},
                      {"mu_2", "1", "limiting friction coefficient"},
                      {"xi", "sqrt(m/kg)", "rate constant I0/(d sqrt(rho_s))"}}},
    [GR_LAW_ngf] = {"ngf",
                    "nonlocal granular fluidity, stress-free when disconnected (Dunatunga & Kamrin, Modelling silo "
                    "clogging with nonlocal granular rheology, eq. 2.1, 2.2)",
                    GR_NGF_POINT + GR_FLUIDITY_PARAMETER_COUNT,
                    {{"K", "Pa", "bulk modulus"},
                     {"A", "1", "nonlocal amplitude"},
#define GR_X(name, unit, doc) {#name, unit, doc},
                     GR_FLUIDITY_PARAMETERS(GR_X)
#undef GR_X
                    }},
};

const struct gr_parameter_info gr_fluidity_parameter_table[GR_FLUIDITY_PARAMETER_COUNT] = {
#define GR_X(name, unit, doc) {#name, unit, doc},
    GR_FLUIDITY_PARAMETERS(GR_X)
#undef GR_X
};

const struct gr_parameter_info gr_hencky_parameter_table[GR_HENCKY_PARAMETER_COUNT] = {
#define GR_X(name, unit, doc) {#name, unit, doc},
    GR_HENCKY_PARAMETERS(GR_X)
#undef GR_X
};

const char *const gr_hencky_flow_names[GR_HENCKY_FLOW_COUNT] = {
#define GR_X(name, doc) #name,
    GR_HENCKY_FLOWS(GR_X)
#undef GR_X
};
