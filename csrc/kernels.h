/* The kernels of one instruction set: a table of functions that kernels.c fills once for each set. dispatch.c selects
 * one. */
#pragma once

#include "fluidity/fluidity.h"
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
    void (*p2g_arrivals)(struct gr_engine *, int64_t tile); /* of a tile that has gained points */
    void (*sweep)(struct gr_engine *, int64_t first, int64_t last, struct gr_migrants *out, int fused);
    /* sums of the nodes of a group of GR_LANES; see enum gr_node_sum. damped: with the sum of the damping */
    void (*sum_nodes)(const struct gr_engine *, int64_t group, int damped, int averages, double *sums);
    /* from these sums, in double precision in any case: the motion before walls; damped: the damping, too */
    void (*move_nodes)(const struct gr_engine *, int damped, const double g[3], const double *sums, struct gr_node_motion *);
    /* store the motion of the nodes from `first` on; and the fields of an averaging, with the volume of their points */
    void (*store_nodes)(struct gr_engine *, int damped, int64_t first, const struct gr_node_motion *);
    void (*describe_nodes)(struct gr_engine *, int64_t first, const double *sums, const double *filled);
    unsigned (*mean_gaps)(struct gr_engine *, int64_t first); /* about them; a bit for each that is inside the material */
    void (*sum_volumes)(const struct gr_engine *, int64_t group, double *sums); /* of a smoothed density */
    void (*fill_cells)(struct gr_engine *, int64_t first, int64_t last); /* tiles, for an averaging of a smoothed density */
    void (*mean_pairs)(struct gr_engine *, int64_t first, int64_t last);
    void (*begin_substeps)(struct gr_engine *, int64_t first, int64_t last);
    void (*substep)(struct gr_engine *, int64_t first, int64_t last);
    const struct gr_law *const *laws; /* the laws of law/registry.inl, then NULL */
    /* in single precision only, else NULL: copy the fields of groups of nodes as floats */
    void (*narrow_nodes)(struct gr_engine *, int64_t first, int64_t last);
    /* in double precision only, else NULL */
    const struct gr_kernels *single; /* the kernels of the same instruction set in single precision */
    void (*apply_cell_forces)(struct gr_engine *, int64_t first, int64_t last);
    void (*smooth)(struct gr_engine *, int64_t first, int64_t last);
    void (*update_fluidity)(const struct gr_fluidity_call *call);
    void (*update_hencky)(int flow, int dim, const struct gr_hencky_call *call);
    gr_diffuse *diffuse;
    gr_sph_kernel *sph;
};

const struct gr_kernels *gr_kernels_select(const char *name); /* NULL or "": the widest that this machine supports */

/* True if the kernels in single precision have law k. */
int gr_single_has_law(int k);
