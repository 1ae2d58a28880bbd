/* Sums of nodes: over the runs of cells about them (struct gr_addend). */
#include "mpm/cell_sums.h"
#include "mpm/grid.h"

/* The numbers of an addend, of one sum after another. */
struct numbers {
    const gr_real *lanes, *first, *second, *before;
    int64_t lanes_apart, first_apart, second_apart, before_apart;
};

GR_INLINE struct numbers numbers_of(const struct gr_engine *e, const struct gr_sums_of_row *of,
                                    const struct gr_addend *addend)
{
    const gr_real *const sums = gr_sums(e), *const end = sums + addend->end;
    return (struct numbers){.lanes = sums + addend->lanes + of->begin[addend->kind_of_lanes],
                            .first = end + of->begin[addend->first],
                            .second = (addend->second ? end : sums) + of->begin[addend->second],
                            .before = sums + addend->before + of->begin[addend->kind_before],
                            .lanes_apart = of->apart[addend->kind_of_lanes],
                            .first_apart = of->apart[addend->first],
                            .second_apart = of->apart[addend->second],
                            .before_apart = of->apart[addend->kind_before]};
}

GR_INLINE void next_sum(struct numbers *at)
{
    at->lanes += at->lanes_apart;
    at->first += at->first_apart;
    at->second += at->second_apart;
    at->before += at->before_apart;
}

#if GR_W == 1
/* What an addend has for its node number `lane`. */
GR_INLINE gr_real number_of(const struct numbers *at, const struct gr_addend *addend, int64_t lane)
{
    if (addend->apart) return (at->lanes[lane] + at->first[lane]) + at->before[lane];
    if (!lane) return (at->lanes[0] + *at->first) + *at->before;
    return lane == 1 ? at->lanes[1] + *at->second : at->lanes[lane];
}

/* Add n sums of an addend to its nodes, in rows of `out`; as far as they are among the nodes [first, last), the first of
 * which `out` begins with. */
GR_INLINE void add_addend(struct numbers at, const struct gr_addend *addend, int n, int64_t first, int64_t last, double *out)
{
    const int64_t begin = first > addend->node ? first - addend->node : 0, left = last - addend->node,
                  end = left < addend->n ? left : addend->n;
    out += addend->node - first;
    for (int q = 0; q < n; q++, out += GR_SUM_ROW, next_sum(&at))
        for (int64_t lane = begin; lane < end; lane++) out[lane] = (gr_real)out[lane] + number_of(&at, addend, lane);
}
#else
/* The same with whole vectors, also of nodes next to these. */
GR_INLINE void add_addend(struct numbers at, const struct gr_addend *addend, int n, int64_t first, int64_t last, double *out)
{
    const int nodes = addend->n;
    (void)last;
    out += addend->node - first;
    if (!addend->apart && nodes <= 2) {
        for (int q = 0; q < n; q++, out += GR_SUM_ROW, next_sum(&at)) {
            out[0] = (gr_real)out[0] + ((at.lanes[0] + *at.first) + *at.before);
            if (nodes == 2) out[1] = (gr_real)out[1] + (at.lanes[1] + *at.second);
        }
        return;
    }
    for (int q = 0; q < n; q++, out += GR_SUM_ROW, next_sum(&at))
        for (int lane = 0; lane < nodes; lane += GR_W) {
            vd v = v_load(at.lanes + lane);
            if (addend->apart)
                v = (v + v_load(at.first + lane)) + v_load(at.before + lane);
            else if (lane < 2)
                v = (v + (vd){*at.first, *at.second}) + (vd){*at.before, 0};
            if (nodes < lane + GR_W) v = v_keep(m_of_bits((1u << (nodes - lane)) - 1), v);
            v_store(out + lane, v_load(out + lane) + v);
        }
}
#endif

enum { AHEAD = 2 }; /* addends that are fetched before they are needed; more was not tried */

/* Fetch n sums of an addend into the caches, before they are needed. */
GR_INLINE void fetch_addend(const struct gr_engine *e, const struct gr_sums_of_row *of, const struct gr_addend *addend,
                            int n)
{
    const struct numbers at = numbers_of(e, of, addend);
    for (int q = 0; q < n; q++) __builtin_prefetch(at.lanes + q * at.lanes_apart);
    for (int q = 0; q < n; q += 2) __builtin_prefetch(at.first + q * at.first_apart);
}

/* Number of the first of the addends [low, high) that may reach node n. */
static int64_t first_reaching(const struct gr_engine *e, int64_t low, int64_t high, int64_t n)
{
    while (low < high) {
        const int64_t middle = (low + high) / 2;
        if (e->mesh.addend[middle].node + GR_LANES <= n)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* n sums of a group, from `begin` on, for the nodes [first, last), at most GR_SUM_BLOCK; rows of `out` are GR_SUM_ROW apart,
 * and have space for GR_SUM_PAD numbers on either side of these nodes. Lower rows of cells come first. */
GR_INLINE void sum_block(const int k, const int n, const struct gr_engine *e, enum gr_group_of_sums group, int begin,
                         int64_t first, int64_t last, double *out)
{
    const int64_t *const list = e->mesh.row_addends;
    for (int q = 0; q < n; q++)
        memset(out + q * GR_SUM_ROW - GR_SUM_PAD, 0, sizeof *out * (size_t)(last - first + 2 * GR_SUM_PAD));
    for (int row = e->n_rows; row-- > 0;) {
        const struct gr_sums_of_row of = gr_sums_of_row(k, e, group, row, begin);
        for (int64_t i = first_reaching(e, list[row], list[row + 1], first); i < list[row + 1]; i++) {
            const struct gr_addend *addend = &e->mesh.addend[i];
            if (addend->node >= last) break;
            if (e->out_of_cache && i + AHEAD < list[row + 1]) fetch_addend(e, &of, addend + AHEAD, n);
            add_addend(numbers_of(e, &of, addend), addend, n, first, last, out);
        }
    }
}
