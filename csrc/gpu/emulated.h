/* The emulated device: threads of the processor, and memory of its own, so that all but the machine itself can be tested
 * without a device. */
#pragma once

#include "core/memory.h"

extern const struct gr_source gr_emulated_memory;

struct gr_engine;

/* The name of an array of an engine that the threads of a device read or write, and that is not of this memory; NULL if all
 * are. */
const char *gr_foreign_array(const struct gr_engine *e);
