/* The kernels of one instruction set: a table of functions that kernels.c fills once for each set. dispatch.c selects
 * one. */
#pragma once

#include "fluidity/fluidity.h"
#include "mpm/device.h"
#include "law/law.h"
#include "sph/sph.h"

struct gr_engine;
struct gr_migrants;
struct gr_node_motion;

struct gr_kernels {
    const char *isa;
    int lanes;
    /* of the tiles [first, last) */
    void (*p2g)(struct gr_engine *, int64_t first, int64_t last);
    void (*sweep)(struct gr_engine *, int64_t first, int64_t last, struct gr_migrants *out, int fused);
    /* `n` sums of a group (enum gr_group_of_sums) from number `begin` on, of nodes [first, last), at most GR_SUM_BLOCK; to rows
     * of GR_SUM_ROW, with space for GR_SUM_PAD numbers before and behind */
    void (*sum_nodes)(const struct gr_engine *, int group, int begin, int n, int64_t first, int64_t last, double *sums);
    /* from these sums, in double precision in any case: the motion of so many nodes before walls; damped: the damping, too */
    void (*move_nodes)(const struct gr_engine *, int damped, const double g[3], const double *sums, int lanes,
                       struct gr_node_motion *);
    /* store the motion of the nodes from `first` on; and the fields of an averaging, with the volume of their points */
    void (*store_nodes)(struct gr_engine *, int damped, int64_t first, int lanes, const struct gr_node_motion *);
    void (*describe_nodes)(struct gr_engine *, int64_t first, int lanes, const double *sums, const double *filled);
    unsigned (*mean_gaps)(struct gr_engine *, int64_t first, int lanes); /* about them; a bit for each inside the material */
    void (*fill_cells)(struct gr_engine *, int64_t first, int64_t last); /* tiles, for an averaging of a smoothed density */
    /* of the double cells: the fluidity before the first substep, and after one */
    void (*mean_pairs)(struct gr_engine *, int64_t first, int64_t last);
    void (*store_pairs)(struct gr_engine *, int64_t first, int64_t last);
    void (*begin_substeps)(struct gr_engine *, int64_t first, int64_t last);
    void (*substep)(struct gr_engine *, int64_t first, int64_t last);
    gr_thread *const *threads;        /* of one lane alone, else NULL: the stages of a device (mpm/device.h) */
    const struct gr_law *const *laws; /* the laws of law/registry.inl, then NULL */
    /* in single precision only, else NULL: copy the fields of nodes as floats */
    void (*narrow_nodes)(struct gr_engine *, int64_t first, int64_t last);
    /* in double precision only, else NULL */
    const struct gr_kernels *single; /* the kernels of the same instruction set in single precision */
    void (*apply_cell_forces)(struct gr_engine *, int64_t first, int64_t last);
    void (*smooth)(struct gr_engine *, int64_t first, int64_t last);
    void (*update_fluidity)(const struct gr_fluidity_call *call);
    void (*update_hencky)(int flow, int dim, const struct gr_hencky_call *call);
    const struct gr_passes *passes; /* of the diffusion of the fluidity */
    gr_sph_kernel *sph;
};

const struct gr_kernels *gr_kernels_select(const char *name); /* NULL or "": the widest that this machine supports */

/* The kernels of a scheme in single or double precision, from those in double precision. */
static inline const struct gr_kernels *gr_in_precision(const struct gr_kernels *kernels, int single)
{
    return single ? kernels->single : kernels;
}

/* True if the kernels in single precision have law k. */
int gr_single_has_law(int k);
