#include "law/law.h"

#define GR_LOCAL_PARAMETERS                                                                                      \
    {                                                                                                            \
        {"K", "Pa", "bulk modulus"}, {"G", "Pa", "shear modulus"}, {"mu_s", "1", "static friction coefficient"}, \
            {"mu_2", "1", "limiting friction coefficient"},                                                      \
        {                                                                                                        \
            "xi", "sqrt(m/kg)", "rate constant I0/(d sqrt(rho_s))"                                               \
        }                                                                                                        \
    }
#define GR_X(name, unit, doc) {#name, unit, doc},
#define GR_HENCKY_NGF_PARAMETERS                                     \
    {                                                                \
        {"A", "1", "nonlocal amplitude"}, GR_HENCKY_PARAMETERS(GR_X) \
    }

const struct gr_law_info gr_law_table[GR_LAW_COUNT] = {
    [GR_LAW_elastic] = {"elastic",
                        "linear hypoelasticity with the Jaumann rate",
                        0,
                        2,
                        {{"K", "Pa", "bulk modulus"}, {"G", "Pa", "shear modulus"}}},
    [GR_LAW_drucker_prager] = {"drucker_prager",
                               "rate-independent friction, stress-free when disconnected",
                               0,
                               3,
                               {{"K", "Pa", "bulk modulus"},
                                {"G", "Pa", "shear modulus"},
                                {"mu", "1", "friction coefficient"}}},
    [GR_LAW_mu_I] = {"mu_I",
                     "mu(I) rheology, stress-free when disconnected (Dunatunga & Kamrin 2015, eq. 2.13-2.15)",
                     0,
                     5,
                     {{"K", "Pa", "bulk modulus"},
                      {"G", "Pa", "shear modulus"},
                      {"mu_s", "1", "static friction coefficient"},
                      {"mu_2", "1", "limiting friction coefficient"},
                      {"xi", "sqrt(m/kg)", "rate constant I0/(d sqrt(rho_s))"}}},
    [GR_LAW_ngf] = {"ngf",
                    "nonlocal granular fluidity, stress-free when disconnected (Dunatunga & Kamrin, Modelling silo "
                    "clogging with nonlocal granular rheology, eq. 2.1, 2.2)",
                    1,
                    GR_NGF_POINT + GR_FLUIDITY_PARAMETER_COUNT,
                    {{"K", "Pa", "bulk modulus"}, {"A", "1", "nonlocal amplitude"}, GR_FLUIDITY_PARAMETERS(GR_X)}},
    [GR_LAW_hencky_elastic] =
        {"hencky_elastic", "Hencky's elasticity", 0, 2, {{"K", "Pa", "bulk modulus"}, {"G", "Pa", "shear modulus"}}},
    [GR_LAW_hencky_drucker_prager] = {"hencky_drucker_prager",
                                      "Hencky's elasticity, rate-independent friction, stress-free when disconnected",
                                      0,
                                      3,
                                      {{"K", "Pa", "bulk modulus"},
                                       {"G", "Pa", "shear modulus"},
                                       {"mu", "1", "friction coefficient"}}},
    [GR_LAW_hencky_hardening_drucker_prager] =
        {"hencky_hardening_drucker_prager",
         "Hencky's elasticity, friction that grows with the plastic strain (Klar et al. 2016)",
         0,
         6,
         {{"K", "Pa", "bulk modulus"},
          {"G", "Pa", "shear modulus"},
          {"h0_deg", "deg", "friction angle after a long way"},
          {"h1_deg", "deg", "what it gains per plastic strain at first"},
          {"h2", "1", "rate at which that and h3 decay with the plastic strain"},
          {"h3_deg", "deg", "by how much less it is at the start"}}},
    [GR_LAW_hencky_mu_I] = {"hencky_mu_I", "Hencky's elasticity, mu(I) rheology, stress-free when disconnected", 0, 5,
                            GR_LOCAL_PARAMETERS},
    [GR_LAW_hencky_linear_mu_I] = {"hencky_linear_mu_I",
                                   "Hencky's elasticity, mu = mu_s + (mu_2 - mu_s) I/I0, stress-free when disconnected", 0,
                                   5, GR_LOCAL_PARAMETERS},
    [GR_LAW_hencky_ngf] = {"hencky_ngf", "Hencky's elasticity, nonlocal granular fluidity that saturates (hencky.h)", 1,
                           GR_HENCKY_NGF_POINT + GR_HENCKY_PARAMETER_COUNT, GR_HENCKY_NGF_PARAMETERS},
    [GR_LAW_hencky_linear_ngf] = {"hencky_linear_ngf",
                                  "Hencky's elasticity, nonlocal granular fluidity, linear (Haeri & Skonieczny 2021)", 1,
                                  GR_HENCKY_NGF_POINT + GR_HENCKY_PARAMETER_COUNT, GR_HENCKY_NGF_PARAMETERS},
};
#undef GR_X

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
