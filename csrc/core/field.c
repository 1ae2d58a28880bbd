/* Table of the fields of a material point. */
#include "core/field.h"

#define GR_X(name, kind, need, unit, doc) {#name, unit, doc, kind, need},
const struct gr_field_info gr_field_table[GR_FIELD_COUNT] = {GR_FIELDS(GR_X)};
#undef GR_X
