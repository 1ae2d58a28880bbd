/* Weights of the isotropic stencil of the Laplacian.
 *
 * In the bulk a cell exchanges with all cells that touch it, across faces, edges and corners, with the weights
 *
 *     2D: 4/6, 1/6;   3D: 14/30, 3/30, 1/30.
 *
 * The leading error of this Laplacian is a multiple of dx^2 lap lap g and thus the same in all directions. The stencils
 * are
 *
 *     1/(6 dx^2) {centre -20, face 4, corner 1},   1/(30 dx^2) {centre -128, face 14, edge 3, corner 1}.
 *
 * At a surface it would be wrong to drop the links to missing cells, as the stencil of faces does: the exchange along
 * the surface would lose the part that goes through the cells behind it, 1/6 for the outermost cells, an error of first
 * order. Missing cells are therefore mirror images. Let the cell at an offset o be unreachable. The components of o
 * along which even the face neighbour is missing are set to zero, o -> m, and g_(i+m) is used in its place, with a
 * factor -1 for each such axis whose face is rough. If the cell at m does not see the mirrored situation, as at a
 * corner of the surface, the link is dropped. L thus stays symmetric, no link has a negative weight, and no wave is
 * stiffer than in the bulk.
 *
 * Stability: let W be the sum of w (1 - cos k.o) over the links of an unbounded grid. It is linear in each cos k_a, so
 * that its maximum lies where all of them are 1 or -1: 16/3 in 2D and 92/15 in 3D. Hence dt A^2 d^2/(t0 dx^2) < 3/8 in
 * 2D and 15/46 = 0.326 in 3D. L is a sum of squares over links, and fewer links make it smaller. A mirror repeats a
 * part of the grid, and the waves of the part are among those of the whole.
 *
 * Border cells at rough bodies (border.c) are no mirror images: the line through the surface goes on behind it. Their
 * factors, up to 2 |o|, may make waves stiffer. By Gershgorin half the largest eigenvalue is at most the sum of w |o|, here
 * 3.61 in 2D and 4.96 in 3D. */
#include <math.h>
#include <string.h>

#include "fluidity/fluidity.h"

static const double share[2][4] = {{0, 4.0 / 6.0, 1.0 / 6.0, 0}, {0, 14.0 / 30.0, 3.0 / 30.0, 1.0 / 30.0}};

double gr_fluidity_stiffest(const struct gr_fluidity *f)
{
    const double *w = share[f->dim - 2];
    if (!f->rough_bodies) return f->dim == 2 ? 8.0 / 3.0 : 46.0 / 15.0;
    return f->dim == 2 ? 4 * w[1] + 4 * sqrt(2) * w[2] : 6 * w[1] + 12 * sqrt(2) * w[2] + 8 * sqrt(3) * w[3];
}

enum kind { OPEN, EVEN, ODD };

/* The place with which a cell exchanges at a link and side, as far as bodies allow: one of the two copies there, or -1.
 * `cut` receives the kind of the face (enum gr_side). */
static int64_t partner(const struct gr_fluidity *f, int64_t i, int k, int *cut)
{
    int32_t j = f->pages.neighbour[2 * f->n_links * i + k];
    *cut = GR_SIDE_LINKED;
    for (int copy = 0; j >= 0 && copy < 2; copy++, j = f->pages.other[j]) {
        *cut = gr_cut_of(f->inside[i], f->inside[j]);
        if (*cut != GR_SIDE_CLOSED) return *cut == GR_SIDE_LINKED ? j : -1;
    }
    return -1;
}

/* Parity of g at the face of a cell along an axis: OPEN if the next cell is linked and dense, or a border cell; else g is
 * continued as an EVEN function, or as an ODD one at a rough face. */
static enum kind kind_of(const struct gr_fluidity *f, int64_t i, int axis, int high)
{
    const int k = 2 * axis + high;
    int cut;
    if (gr_fluidity_drop(f, i, k) > 0) return OPEN;
    const int64_t j = partner(f, i, k, &cut);
    if (cut != GR_SIDE_LINKED) return EVEN;
    if (j >= 0 && f->dense[j]) return OPEN;
    return gr_fluidity_side(f, gr_fluidity_cell(f, i), k) == GR_SIDE_ROUGH ? ODD : EVEN;
}

/* Number 2 link + side of an offset. */
static int number_of_offset(const struct gr_fluidity *f, const int o[3])
{
    for (int k = 0;; k++) {
        const int8_t *p = f->offset[k / 2];
        const int sign = k % 2 ? 1 : -1;
        if (sign * p[0] == o[0] && sign * p[1] == o[1] && sign * p[2] == o[2]) return k;
    }
}

/* Place of the cell at an offset if it is dense and reachable, else -1. */
static int64_t neighbour(const struct gr_fluidity *f, int64_t i, const int o[3])
{
    int cut;
    const int64_t j = partner(f, i, number_of_offset(f, o), &cut);
    return j >= 0 && f->dense[j] ? j : -1;
}

/* True if the cell at the offset m sees the offset o mirrored to i, just as i sees o mirrored to the cell at m. */
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

/* gr_fluidity_ring of the cell at a place. */
static double ring_at(const struct gr_fluidity *f, int64_t i, int o)
{
    return f->axisymmetric ? gr_fluidity_ring(f, gr_fluidity_cell(f, i), o) : 1;
}

/* Set the weights of the links of one cell.
 * Returned: the coefficient of g itself, from rough faces. */
static double weigh_cell(const struct gr_fluidity *f, int64_t i, double *weight)
{
    double rough = 0;
    for (int k = 0; k < 2 * f->n_links; k++) weight[k] = 0;
    if (f->inside[i] & GR_BORDER) return 0;
    for (int k = 0; k < 2 * f->n_links; k++) {
        const int8_t *p = f->offset[k / 2];
        const int side = k % 2 ? 1 : -1, o[3] = {side * p[0], side * p[1], side * p[2]};
        const double w = share[f->dim - 2][!!o[0] + !!o[1] + !!o[2]] * ring_at(f, i, o[0]);
        if (gr_fluidity_drop(f, i, k) > 0) {
            rough += w * gr_fluidity_drop(f, i, k);
            continue;
        }
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
        const double drop = steps && mirrors ? gr_fluidity_drop(f, i, number_of_offset(f, m)) : 0;
        if (drop > 0) {
            rough += w * (sign > 0 ? drop : fmax(2 - drop, 0));
            continue;
        }
        if (steps && (!mirrors || !agrees(f, i, o, m))) continue;
        if (sign < 0) rough += 2 * w;
        if (steps) weight[number_of_offset(f, m)] += sign * w;
    }
    return rough;
}

void gr_fluidity_weigh(struct gr_fluidity *f, int64_t i)
{
    const int sides = 2 * f->n_links, lane = (int)(i % GR_PAGE);
    const int32_t *near = f->pages.near + i / GR_PAGE * sides;
    double weight[2 * GR_MOST_LINKS] = {0};
    int cut;
    f->space.rough[i] = f->dense[i] ? weigh_cell(f, i, weight) : 0;
    for (int k = 0; k < sides; k++)
        f->space.weight[k][i] = f->dense[i] && partner(f, i, k, &cut) == near[k] + lane ? weight[k] : 0;
}

void gr_fluidity_weigh_wraps(struct gr_fluidity *f, int64_t chunk)
{
    double weight[2 * GR_MOST_LINKS];
    int64_t i = -1;
    int cut;
    for (int64_t k = f->pages.wrap_first[chunk]; k < f->pages.wrap_first[chunk + 1]; k++) {
        struct gr_wrap *wrap = &f->pages.wrap[k];
        if (wrap->to != i) {
            i = wrap->to;
            memset(weight, 0, sizeof weight);
            if (f->dense[i]) (void)weigh_cell(f, i, weight);
        }
        wrap->weight = partner(f, i, wrap->link, &cut) == wrap->from ? weight[wrap->link] : 0;
    }
}
