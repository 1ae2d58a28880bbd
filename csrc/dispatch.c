/* Selection of the kernels that this machine can run. */
#include <string.h>

#include "kernels.h"

extern const struct gr_kernels gr_kernels_baseline;
#ifndef GR_WITHOUT_ONE_LANE
extern const struct gr_kernels gr_kernels_one_lane;
#endif
#ifdef GR_X86
extern const struct gr_kernels gr_kernels_avx2;
#endif
#if defined(GR_X86) && !defined(GR_WITHOUT_AVX512)
#define HAS_AVX512
extern const struct gr_kernels gr_kernels_avx512;
#endif

/* Whether the processor has a fused multiply-add; compilers use a function where one does not. */
static inline int fuses(void)
{
#ifdef GR_X86
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
    return 1;
#endif
}

const struct gr_kernels *gr_kernels_select(const char *name)
{
    const struct gr_kernels *usable[4] = {0};
    int n = 0;
#ifdef GR_X86
    __builtin_cpu_init();
#ifdef HAS_AVX512
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")) usable[n++] = &gr_kernels_avx512;
#endif
    if (fuses()) usable[n++] = &gr_kernels_avx2;
#endif
    usable[n++] = &gr_kernels_baseline;
#ifndef GR_WITHOUT_ONE_LANE
    if (fuses()) usable[n++] = &gr_kernels_one_lane;
#endif
    if (!name || !*name) return usable[0];
    for (int k = 0; k < n; k++)
        if (!strcmp(usable[k]->isa, name)) return usable[k];
    return 0;
}

int gr_single_has_law(int k)
{
    int n = 0;
    while (gr_kernels_baseline.single->laws[n]) n++;
    return k < n;
}

const struct gr_law *gr_law_at(int k) { return gr_kernels_baseline.laws[k]; }

int gr_law_index(const char *name)
{
    for (int k = 0; gr_law_at(k); k++)
        if (!strcmp(gr_law_at(k)->name, name)) return k;
    return -1;
}
