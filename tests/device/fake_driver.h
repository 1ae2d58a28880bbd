/* What csrc/gpu_kernels.c needs to run on a processor, for fake_driver.c. */
#pragma once

#include <stdint.h>

#define GR_ENTRY __attribute__((visibility("default")))
#define GR_THREAD_NUMBER fake_thread

extern _Thread_local int64_t fake_thread; /* the number of the thread that runs */
