/* Sums over the cells of GR_LANES nodes at once. Nodes of a row of the grid follow each other, and so do the cells in which
 * they are the same local node, except where a tile ends (struct gr_node_run). */
#include "mpm/engine.h"

/* The places of the sums over one cell of GR_W nodes, from node `lane` of a group on. */
struct places {
    const double *first, *second; /* the latter of lanes from `split` on */
    vm in_first;
    int pieces; /* 1 or 2; more: all apart, in `each` */
    const double *each[GR_W];
};

GR_INLINE struct places places_of(const int K, const struct gr_engine *e, int64_t group, int i, int lane)
{
    const struct gr_node_run *run = &e->mesh.node_run[group * K + i];
    struct places places = {.first = e->sums + run->first + lane, .second = e->sums + run->second + lane, .pieces = 1};
    if (run->split == GR_RUN_BROKEN) {
        for (int l = 0; l < GR_W; l++) {
            const int64_t n = group * GR_LANES + lane + l;
            places.each[l] = e->sums + e->mesh.node_source[(n < e->mesh.n_nodes ? n : e->mesh.n_nodes - 1) * K + i];
        }
        places.pieces = GR_W + 1;
    } else if (run->split <= lane) {
        places.first = places.second;
    } else if (run->split < lane + GR_W) {
        double number[GR_W];
        for (int l = 0; l < GR_W; l++) number[l] = lane + l;
        places.in_first = v_gt(v_set(run->split), v_load(number));
        places.pieces = 2;
    }
    return places;
}

GR_INLINE vd sum_at(const struct places *places, int64_t at)
{
    if (places->pieces == 1) return v_load(places->first + at);
    if (places->pieces == 2) return v_select(places->in_first, v_load(places->first + at), v_load(places->second + at));
    double each[GR_W];
    for (int l = 0; l < GR_W; l++) each[l] = places->each[l][at];
    return v_load(each);
}

/* Sums of the nodes of a group, in rows of GR_LANES: those of each step, the damping if the density is smoothed, and those
 * of an averaging. */
GR_INLINE void sum_group(const int dim, const int K, const int damps, const int averages, const struct gr_engine *e,
                         int64_t group, double *out)
{
    const int rows = GR_SUM_DAMPED(dim), of_density = GR_DENSITY_SUMS(dim), before = rows + damps;
    for (int lane = 0; lane < GR_LANES; lane += GR_W) {
        vd sum[GR_NODE_SUMS(3)];
        for (int q = 0; q < before + averages * of_density; q++) sum[q] = v_zero();
        for (int i = 0; i < K; i++) { /* local node K - 1 - i */
            const struct places places = places_of(K, e, group, i, lane);
            const vd m = sum_at(&places, 0);
            sum[0] = sum[0] + m;
            for (int q = 1; q < rows; q++) sum[q] = sum[q] + sum_at(&places, q * GR_LANES);
            if (damps) sum[rows] = sum[rows] + v_mul(sum_at(&places, (i + 1) * rows * GR_LANES), m);
            const int64_t density = e->density_sums + (K - 1 - i) * (of_density - rows) * GR_LANES;
            for (int q = 0; averages && q < of_density; q++)
                sum[before + q] = sum[before + q] + sum_at(&places, density + q * GR_LANES);
        }
        for (int q = 0; q < before + averages * of_density; q++) v_store(out + q * GR_LANES + lane, sum[q]);
    }
}

/* Sums of the nodes of a group that several materials add to those of an averaging. */
GR_INLINE void sum_volumes_of_group(const int K, const struct gr_engine *e, int64_t group, double *out)
{
    const int rows = GR_SUM_DAMPED(K == 9 ? 2 : 3);
    for (int lane = 0; lane < GR_LANES; lane += GR_W) {
        vd sum[GR_VOLUME_SUMS] = {v_zero(), v_zero()};
        for (int i = 0; i < K; i++) { /* local node K - 1 - i, as in sum_group */
            const struct places places = places_of(K, e, group, i, lane);
            const int64_t own = e->volume_sums + (K - 1 - i) * (GR_VOLUME_SUMS - rows) * GR_LANES;
            for (int q = 0; q < GR_VOLUME_SUMS; q++) sum[q] = sum[q] + sum_at(&places, own + q * GR_LANES);
        }
        for (int q = 0; q < GR_VOLUME_SUMS; q++) v_store(out + q * GR_LANES + lane, sum[q]);
    }
}
