/* Weights of the isotropic stencil.
 *
 * In the bulk a cell exchanges with all that touch it, across faces, edges and corners, with the weights
 *     plane: 4, 1 of 6;   space: 14, 3, 1 of 30,
 * whose Laplacian errs at fourth order by a multiple of lap lap g, alike in all directions. They are those of
 *     1/(6 dx^2) {centre -20, face 4, corner 1},   1/(30 dx^2) {centre -128, face 14, edge 3, corner 1}.
 *
 * Dropping the links to cells that are not there, as the stencil of faces does, would take from the exchange along a
 * surface what goes by way of the cells behind it: 1/6 of that of the outermost cells, an error of first order. What is
 * not there is therefore the mirror image of what is: of a cell at an offset o that cannot be reached, the axes along which
 * even the cell beside is not are left away, o -> m, and g_(i+m) stands for it, times -1 for each such axis whose face is
 * rough. If the cell at m does not see the like, at a corner of the surface, the link is dropped: L stays symmetric, no link has
 * a negative weight, and no wave is stiffer than those of the bulk.
 *
 * Stability: with W the sum of w (1 - cos k.o) over the links of the whole lattice, linear in each cos k_a, its maximum lies
 * where all are 1 or -1: 16/3 in the plane and 92/15 in space, so dt A^2 d^2/(t0 dx^2) < 3/8 and 15/46 = .326. L is a sum of
 * squares over links, and less of them is less; a mirror repeats a part of the lattice, whose waves those of the part are. */
#include "fluidity/fluidity.h"

enum kind { OPEN, EVEN, ODD };

/* The place that a cell exchanges with at a link and side, where bodies let it: one of the copies there, or -1. And what
 * they make of the face. */
static int64_t partner(const struct gr_fluidity *f, int64_t i, int k, int *cut)
{
    int32_t j = f->beside[2 * f->n_links * i + k];
    *cut = GR_SIDE_LINKED;
    for (int copy = 0; j >= 0 && copy < 2; copy++, j = f->other[j]) {
        *cut = gr_cut_of(f->inside[i], f->inside[j]);
        if (*cut != GR_SIDE_CLOSED) return *cut == GR_SIDE_LINKED ? j : -1;
    }
    return -1;
}

/* What stands at the face of a cell along an axis. */
static enum kind kind_of(const struct gr_fluidity *f, int64_t i, int axis, int high)
{
    const int k = 2 * axis + high;
    int cut;
    const int64_t j = partner(f, i, k, &cut), page = f->page[i / GR_PAGE];
    if (cut != GR_SIDE_LINKED) return cut == GR_SIDE_ROUGH ? ODD : EVEN;
    if (j >= 0 && f->dense[j]) return OPEN;
    const int64_t cell = page % f->box_pages * GR_PAGE + i % GR_PAGE;
    return gr_fluidity_side(f, cell, k) == GR_SIDE_ROUGH ? ODD : EVEN;
}

/* Link and side of an offset. */
static int number_of(const struct gr_fluidity *f, const int o[3])
{
    for (int k = 0;; k++) {
        const int8_t *p = f->offset[k / 2];
        const int sign = k % 2 ? 1 : -1;
        if (sign * p[0] == o[0] && sign * p[1] == o[1] && sign * p[2] == o[2]) return k;
    }
}

/* Place of the cell at an offset if it is dense and nothing is in the way, else -1. */
static int64_t neighbour(const struct gr_fluidity *f, int64_t i, const int o[3])
{
    int cut;
    const int64_t j = partner(f, i, number_of(f, o), &cut);
    return j >= 0 && f->dense[j] ? j : -1;
}

/* Whether the cell at the offset m sees the offset o mirrored to i as i sees it mirrored to that cell. */
static int agrees(const struct gr_fluidity *f, int64_t i, const int o[3], const int m[3])
{
    const int64_t there = neighbour(f, i, m);
    int back[3];
    if (there < 0) return 0;
    for (int a = 0; a < 3; a++) {
        back[a] = m[a] ? -m[a] : o[a];
        if (m[a] && kind_of(f, there, a, m[a] < 0) != OPEN) return 0;
        if (!m[a] && o[a] && kind_of(f, there, a, o[a] > 0) != kind_of(f, i, a, o[a] > 0)) return 0;
    }
    return neighbour(f, there, back) < 0;
}

/* The weights of one cell, and what it loses to rough faces. */
static double weigh_cell(const struct gr_fluidity *f, int64_t i, double *weight)
{
    static const double share[2][4] = {{0, 4.0 / 6.0, 1.0 / 6.0, 0}, {0, 14.0 / 30.0, 3.0 / 30.0, 1.0 / 30.0}};
    double rough = 0;
    for (int k = 0; k < 2 * f->n_links; k++) weight[k] = 0;
    for (int k = 0; k < 2 * f->n_links; k++) {
        const int8_t *p = f->offset[k / 2];
        const int side = k % 2 ? 1 : -1, o[3] = {side * p[0], side * p[1], side * p[2]};
        const double w = share[f->dim - 2][!!o[0] + !!o[1] + !!o[2]];
        if (neighbour(f, i, o) >= 0) {
            weight[k] += w;
            continue;
        }
        int m[3] = {0}, steps = 0, mirrors = 0;
        double sign = 1;
        for (int a = 0; a < f->dim; a++) {
            if (!o[a]) continue;
            const enum kind kind = kind_of(f, i, a, o[a] > 0);
            if (kind == OPEN) m[a] = o[a], steps++;
            if (kind != OPEN) mirrors++;
            if (kind == ODD) sign = -sign;
        }
        if (steps && (!mirrors || !agrees(f, i, o, m))) continue;
        if (sign < 0) rough += 2 * w;
        if (steps) weight[number_of(f, m)] += sign * w;
    }
    return rough;
}

void gr_fluidity_weigh(struct gr_fluidity *f, int64_t chunk)
{
    const int sides = 2 * f->n_links;
    struct gr_wrap *wrap = f->wrap + f->wrap_first[chunk], *const end = f->wrap + f->wrap_first[chunk + 1];
    for (int64_t i = f->chunk_first[chunk] * GR_PAGE; i < f->chunk_first[chunk + 1] * GR_PAGE; i++) {
        double weight[2 * GR_MOST_LINKS] = {0};
        const int32_t *near = f->near + i / GR_PAGE * sides;
        const int lane = (int)(i % GR_PAGE);
        int cut;
        f->rough[i] = f->dense[i] ? weigh_cell(f, i, weight) : 0;
        for (int k = 0; k < sides; k++)
            f->weight[k][i] = f->dense[i] && partner(f, i, k, &cut) == near[k] + lane ? weight[k] : 0;
        for (; wrap < end && wrap->to == i; wrap++)
            wrap->weight = partner(f, i, wrap->link, &cut) == wrap->from ? weight[wrap->link] : 0;
    }
}
