/* Sums over the cells of GR_LANES nodes at once. Nodes of a row of the grid follow each other, and so do the cells in which
 * they are the same local node, except where a tile ends (struct gr_node_run). */
#include "mpm/engine.h"

/* The positions of the sums over one cell of GR_W nodes, from node `lane` of a group on. */
struct places {
    const gr_real *piece[GR_RUN_PIECES];
    vm from[GR_RUN_PIECES];    /* lanes of this piece, and of those after it */
    const gr_real *each[GR_W]; /* of nodes whose sums are in more pieces */
};

GR_INLINE struct places places_of(const int K, const int pieces, const struct gr_engine *e, int64_t group, int i, int lane)
{
    const struct gr_node_run *run = &e->mesh.node_run[group * K + i];
    struct places places;
    double number[GR_W];
    for (int l = 0; l < GR_W; l++) number[l] = lane + l;
    GR_UNROLLED
    for (int k = 0; k < pieces; k++) {
        places.piece[k] = gr_sums(e) + run->at[k] + lane;
        places.from[k] = v_ge(v_load(number), v_set(run->begin[k]));
    }
    for (int l = 0; pieces == GR_RUN_BROKEN && l < GR_W; l++) {
        const int64_t n = group * GR_LANES + lane + l;
        places.each[l] = gr_sums(e) + e->mesh.node_source[(n < e->mesh.n_nodes ? n : e->mesh.n_nodes - 1) * K + i];
    }
    return places;
}

GR_INLINE vd sum_at(const int pieces, const struct places *places, int64_t at)
{
    if (pieces == GR_RUN_BROKEN) {
        gr_real each[GR_W];
        for (int l = 0; l < GR_W; l++) each[l] = places->each[l][at];
        return v_load(each);
    }
    vd sum = v_load(places->piece[0] + at);
    GR_UNROLLED
    for (int k = 1; k < pieces; k++) sum = v_select(places->from[k], v_load(places->piece[k] + at), sum);
    return sum;
}

/* Add the sums over the cells in which the nodes are local node K - 1 - i. */
GR_INLINE void add_cells(const int dim, const int K, const int damps, const int averages, const int pieces,
                         const struct gr_engine *e, int64_t group, int i, int lane, vd *sum)
{
    const int rows = GR_SUM_DAMPED(dim), of_density = GR_DENSITY_SUMS(dim), before = rows + damps;
    const struct places places = places_of(K, pieces, e, group, i, lane);
    const vd m = sum_at(pieces, &places, 0);
    sum[0] = sum[0] + m;
    GR_UNROLLED
    for (int q = 1; q < rows; q++) sum[q] = sum[q] + sum_at(pieces, &places, q * GR_LANES);
    if (damps) sum[rows] = sum[rows] + v_mul(sum_at(pieces, &places, (i + 1) * rows * GR_LANES), m);
    const int64_t density = e->sums.of_density + (K - 1 - i) * (of_density - rows) * GR_LANES;
    GR_UNROLLED
    for (int q = 0; q < averages * of_density; q++)
        sum[before + q] = sum[before + q] + sum_at(pieces, &places, density + q * GR_LANES);
}

/* call(pieces) with the number of pieces of a run as a literal. */
#define GR_BY_PIECES(run, call) \
    switch ((run).pieces) {     \
    case 1:                     \
        call(1);                \
        break;                  \
    case 2:                     \
        call(2);                \
        break;                  \
    case 3:                     \
        call(3);                \
        break;                  \
    case GR_RUN_PIECES:         \
        call(GR_RUN_PIECES);    \
        break;                  \
    default:                    \
        call(GR_RUN_BROKEN);    \
    }

/* Sums of the nodes of a group, in rows of GR_LANES: of each step, the damping if the density is smoothed, and of an
 * averaging. */
GR_INLINE void sum_group(const int dim, const int K, const int damps, const int averages, const struct gr_engine *e,
                         int64_t group, double *out)
{
    const int n = GR_SUM_DAMPED(dim) + damps + averages * GR_DENSITY_SUMS(dim);
    for (int lane = 0; lane < GR_LANES; lane += GR_W) {
        vd sum[GR_NODE_SUMS(3)];
        GR_UNROLLED
        for (int q = 0; q < n; q++) sum[q] = v_zero();
        GR_ROLLED
        for (int i = 0; i < K; i++) {
#define GR_ADD(pieces) add_cells(dim, K, damps, averages, pieces, e, group, i, lane, sum)
            GR_BY_PIECES(e->mesh.node_run[group * K + i], GR_ADD)
#undef GR_ADD
        }
        GR_UNROLLED
        for (int q = 0; q < n; q++) v_store(out + q * GR_LANES + lane, sum[q]);
    }
}

/* The same for the additional sums of an averaging with several materials. */
GR_INLINE void add_volumes(const int K, const int pieces, const struct gr_engine *e, int64_t group, int i, int lane, vd *sum)
{
    const int rows = GR_SUM_DAMPED(K == 9 ? 2 : 3);
    const struct places places = places_of(K, pieces, e, group, i, lane);
    const int64_t first = e->sums.of_volume + (K - 1 - i) * (GR_VOLUME_SUMS - rows) * GR_LANES;
    for (int q = 0; q < GR_VOLUME_SUMS; q++) sum[q] = sum[q] + sum_at(pieces, &places, first + q * GR_LANES);
}

GR_INLINE void sum_volumes_of_group(const int K, const struct gr_engine *e, int64_t group, double *out)
{
    for (int lane = 0; lane < GR_LANES; lane += GR_W) {
        vd sum[GR_VOLUME_SUMS] = {v_zero(), v_zero()};
        GR_ROLLED
        for (int i = 0; i < K; i++) {
#define GR_ADD(pieces) add_volumes(K, pieces, e, group, i, lane, sum)
            GR_BY_PIECES(e->mesh.node_run[group * K + i], GR_ADD)
#undef GR_ADD
        }
        for (int q = 0; q < GR_VOLUME_SUMS; q++) v_store(out + q * GR_LANES + lane, sum[q]);
    }
}
