/* The threads of the stages of a step, compiled for a GPU: an entry point for each stage and precision (device.h). */
#include "kernels.c"
#include "mpm/grid.c"
#include "mpm/packing.c"
#include "mpm/smoothed_density.c"

/* What devices are refused for (gr_device_lacks), so that no thread comes here. */
int gr_point_side(const struct gr_engine *e, const double x[3], int current)
{
    (void)e, (void)x, (void)current;
    __builtin_trap();
}

#define GR_X(stage, unit)                                                                                           \
    __attribute__((nvptx_kernel)) void GR_PASTE(GR_PASTE(GR_ISA, _), stage)(struct gr_launch launch, int64_t n)     \
    {                                                                                                               \
        const int64_t i =                                                                                           \
            (int64_t)__nvvm_read_ptx_sreg_ctaid_x() * __nvvm_read_ptx_sreg_ntid_x() + __nvvm_read_ptx_sreg_tid_x(); \
        gr_thread *const thread = thread_##stage;                                                                   \
        if (i < n && thread) thread(&launch, i);                                                                    \
    }
GR_DEVICE_STAGES(GR_X)
#undef GR_X
