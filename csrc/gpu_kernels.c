/* The threads of the stages of a step, compiled for a GPU: an entry point for each stage (mpm/device.h).
 *
 * The source is that of a processor: kernels.c with vectors of one lane, and the parts of the stages that are not kernels
 * there. Quotients and roots are rounded correctly, and nothing is fused that is not written so: the bits are the same.
 * GR_ON_DEVICE leaves out what needs a processor. With GR_SINGLE the file is compiled once more; the nodes, which are in
 * double precision in any case, are linked from the other. */
#include "kernels.c"

#ifndef GR_SINGLE
#include "core/exact.c"
#include "core/field.c"
#include "fluidity/links.c"
#include "mpm/addends.c"
#include "mpm/connect.c"
#include "mpm/fill_table.c"
#include "mpm/grid.c"
#include "mpm/moves.c"
#include "mpm/packing.c"
#include "mpm/places.c"
#include "mpm/regroup_passes.c"
#include "mpm/sides.c"
#include "mpm/smoothed_density.c"
#include "mpm/solid_cells.c"
#include "mpm/spread.c"
#include "mpm/tally_cells.c"
#include "mpm/tiles.c"
#endif

#ifdef GR_SINGLE
#define GR_ENTRY_OF(stage) single_##stage
#else
#define GR_ENTRY_OF(stage) double_##stage
#endif

/* What a GPU calls its threads. Tests that run this file on a processor have words of their own. */
#ifdef __NVPTX__
#define GR_ENTRY __attribute__((nvptx_kernel))
#define GR_THREAD_NUMBER                                                                \
    ((int64_t)__nvvm_read_ptx_sreg_ctaid_x() * (int64_t)__nvvm_read_ptx_sreg_ntid_x() + \
     (int64_t)__nvvm_read_ptx_sreg_tid_x())
#endif

#define GR_X(stage, unit)                                                \
    GR_ENTRY void GR_ENTRY_OF(stage)(struct gr_launch launch, int64_t n) \
    {                                                                    \
        gr_thread *const thread = thread_##stage;                        \
        const int64_t i = GR_THREAD_NUMBER;                              \
        if (i < n && thread) thread(&launch, i);                         \
    }
GR_DEVICE_STAGES(GR_X)
#undef GR_X
