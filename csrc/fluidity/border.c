/* g = 0 at the surface of rough bodies, which may lie anywhere between the centres of cells.
 *
 * Near the surface g is nearly linear in the distance phi from it. A cell whose centre has phi < dx/2, or is in the body, is
 * a border cell. It takes no part in the diffusion. Another cell i exchanges with a border cell j as if the g of j were that
 * of the line through 0 at the surface and g_i at the centre of i, g_i phi_j/phi_i:
 *
 *     g_i - g_j -> g_i (phi_i - phi_j)/phi_i.
 *
 * This is g_i/theta, with theta the distance of the surface along the link (Gibou et al. 2002, J. Comput. Phys. 176),
 * here also beyond theta = 1. L stays symmetric and an M-matrix. The error of g is of second order in dx. As a distance
 * changes by no more than the way, the factor is at most 2 |o|, with o the offset of j in cells: in the stencil of faces
 * no more than at a rough face. This is why cells with phi < dx/2 are left out. With a surface on faces of cells it is 2
 * as well.
 *
 * Then border cells get values for their points, from the slopes in the cells around them:
 *
 *     g_j = phi_m sum g_i/sum phi_i,
 *
 * over dense cells i that touch j and are no border cells, with phi_m >= 0 the distance of the middle of the points. If
 * there are none, as in a gap of less than a cell, g_j = 0. */
#include <math.h>

#include "fluidity/fluidity.h"

/* Distances within this part of a cell count as equal, so that round-off does not decide on a surface that lies on faces. */
static const double ROUND_OFF = 1e-6;

static double length_of(const int8_t o[3]) { return sqrt((double)(o[0] * o[0] + o[1] * o[1] + o[2] * o[2])); }

void gr_fluidity_set_distance(struct gr_fluidity *f, int64_t i, double phi, double of_points)
{
    const int border = phi < (0.5 - ROUND_OFF) * f->dx;
    f->inside[i] = (uint8_t)((f->inside[i] & ~(GR_BORDER | GR_LINKED_TO_BORDER)) | (border ? GR_BORDER : 0));
    f->distance[i] = fmax(border ? of_points : phi, 0) / f->dx;
    for (int k = 0; k < 2 * f->n_links; k++) f->drop[k][i] = 0;
}

void gr_fluidity_set_link(struct gr_fluidity *f, int64_t i, int k, double phi)
{
    const double here = f->distance[i] * f->dx;
    if ((f->inside[i] & GR_BORDER) || !(phi < (0.5 - ROUND_OFF) * f->dx)) return;
    f->drop[k][i] = fmin((here - phi) / here, 2 * length_of(f->offset[k / 2]));
    f->inside[i] |= GR_LINKED_TO_BORDER;
}

/* The place of the dense cell at an offset from the one at place i, if it has a value of its own, on the same side of a thin
 * body; else -1. */
static int64_t partner(const struct gr_fluidity *f, int64_t i, const int offset[3])
{
    const int back = f->pages.number[i / GR_PAGE] >= f->box_pages;
    const int64_t cell = f->pages.number[i / GR_PAGE] % f->box_pages * GR_PAGE + i % GR_PAGE;
    const int64_t to = gr_fluidity_reach(f, cell, offset);
    for (int copy = 0; copy < 2; copy++) {
        const int64_t j = gr_fluidity_find(f, to, copy ? !back : back);
        if (j < 0 || j == i || !f->dense[j] || (f->inside[j] & GR_BORDER)) continue;
        if (gr_cut_of(f->inside[i], f->inside[j]) != GR_SIDE_CLOSED) return j;
    }
    return -1;
}

static double extrapolated(const struct gr_fluidity *f, int64_t i, const double *g)
{
    double sum = 0, distances = 0;
    for (int n = 0; n < (f->dim == 3 ? 27 : 9); n++) {
        const int offset[3] = {n % 3 - 1, n / 3 % 3 - 1, f->dim == 3 ? n / 9 - 1 : 0};
        const int64_t j = offset[0] || offset[1] || offset[2] ? partner(f, i, offset) : -1;
        if (j < 0) continue;
        sum += g[j], distances += f->distance[j];
    }
    return distances > 0 ? f->distance[i] * (sum / distances) : 0;
}

void gr_fluidity_extrapolate(const struct gr_fluidity *f, int64_t chunk, double *g)
{
    for (int64_t i = f->pages.chunk_first[chunk] * GR_PAGE; i < f->pages.chunk_first[chunk + 1] * GR_PAGE; i++)
        if (f->dense[i] && (f->inside[i] & GR_BORDER)) g[i] = extrapolated(f, i, g);
}
