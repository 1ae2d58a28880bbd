/* Tables of the parameters and flow rules that laws share. */
#include "law/law.h"

const struct gr_parameter_info gr_fluidity_parameter_table[] = {GR_FLUIDITY_PARAMETERS(GR_INFO)};
const struct gr_parameter_info gr_hencky_parameter_table[] = {GR_HENCKY_PARAMETERS(GR_INFO)};

#define GR_X(name, doc) #name,
const char *const gr_hencky_flow_names[GR_HENCKY_FLOW_COUNT] = {GR_HENCKY_FLOWS(GR_X)};
#undef GR_X
