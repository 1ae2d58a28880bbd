/* Hypoelasticity with the partially regularised mu(I) of Barker & Gray 2017 (regularised_flow.h): no yield stress, but
 * creep at any shear stress; stress-free when disconnected. */
#ifdef GR_LIST_LAWS
GR_LAW(regularised_mu_I)
#else
#include "law/frictional.h"

GR_INLINE void law_regularised_mu_I(const int dim, const struct gr_law_call *call)
{
    frictional_blocks(dim, GR_REGULARISED, 0, call);
}

GR_DESCRIBE_LAW(regularised_mu_I, .doc = "partially regularised mu(I), without a yield stress (Barker & Gray 2017)",
                .parameter = {GR_MU_I_PARAMETERS,
                              {"I0", "1", "reference inertial number"},
                              {"mu_inf", "1", "slope of mu(I) in the limit of fast flow"},
                              {"alpha", "1", "constant of the creep, mu = sqrt(alpha/ln(A/I)) for I <= I1"},
                              {"I1", "1", "inertial number below which the law creeps"}})
#endif
