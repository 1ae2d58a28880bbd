/* The cell-averaged density, for linear shape functions: the points of a cell share one density.
 *
 * Points that sample a flow unevenly get uneven changes of volume and make uneven forces. Here the points of a cell
 * have one density and one velocity gradient, and act on the nodes by their mean stress:
 *
 *   c = sum m c_p/M,   sigma = sum m sigma_p/M,   M = sum m   (over the points of the cell),
 *   phi = sum m_i/(rho_c sum V_i),   L = sum v_i (x) B_i   (over its nodes),
 *
 * with B_i the gradient of S_i at one quadrature point and V_i the volume of a node. The filling fraction phi ties c to
 * the volume that the points really have. It also tells whether the cell is inside the material or at a surface. A cell
 * inside represents its whole volume, and its quadrature point is its centre. A cell at a surface represents the volume
 * of its points at rho_c, and its quadrature point is their centre of mass: a node that they hardly reach then feels
 * hardly any force. */
#include "mpm/contribution.h"
#include "mpm/density_correction.h"

#define EMPTY -INFINITY /* log-density of a cell without points: below any separation strain */

/* A full cell below an empty row has phi = 3/4, and 0.9 when that row is filled by a third. */
#define SURFACE_BELOW 0.8
#define INSIDE_FROM 0.9

GR_INLINE struct gr_cell_average *cell_average_of(const int dim, const struct gr_engine *e, int64_t index)
{
    return (struct gr_cell_average *)(void *)(e->sums + index * e->sum_stride + GR_SUM_DAMPED(dim) * (1 << dim));
}

/* B_i dx along axis d for the quadrature point xi, in local coordinates. */
GR_INLINE double slope_at(const int dim, const double xi[3], int i, int d)
{
    double slope = i >> d & 1 ? 1.0 : -1.0;
    for (int j = 0; j < dim; j++)
        if (j != d) slope *= i >> j & 1 ? xi[j] : 1 - xi[j];
    return slope;
}

/* P2G of one cell: m and p of its nodes, and its own sums, sum m c and sum m sigma. */
GR_INLINE void p2g_averaged_cell(const int dim, const int affine, struct gr_engine *e, int64_t index)
{
    enum { MOST = 4 * 8 + 7 + GR_SUMS };
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int K = 1 << dim, rows = 1 + dim, stresses = dim == 2 ? 3 : 6, n_sums = K * rows + 1 + stresses;
    const int blocks = GR_BLOCKS(cell->count);
    const struct gr_frame frame = gr_frame_of(dim, e, cell);
    double sum[MOST] = {0}, *out = e->sums + index * e->sum_stride;
    struct contribution contribution[CHUNK];
    vd acc[MOST];
    for (int done = 0; done < blocks; done += CHUNK) {
        const int n = blocks - done < CHUNK ? blocks - done : CHUNK;
        vd *const own = acc + K * rows;
        for (int q = 0; q <= stresses; q++) own[q] = v_zero();
        for (int i = 0; i < n; i++) {
            const int64_t at = cell->offset + (done + i) * GR_W;
            prepare_momentum(dim, GR_LINEAR, affine, e, &frame, at, &contribution[i]);
            own[0] = v_fma(contribution[i].m, component(e, GR_FIELD_log_density, 0, at), own[0]);
            for (int q = 0; q < stresses; q++) {
                const int c = dim == 2 && q == 2 ? 3 : q; /* zz makes no force in 2D */
                own[1 + q] = v_fma(contribution[i].m, component(e, GR_FIELD_stress, c, at), own[1 + q]);
            }
        }
        add_rows(dim, GR_LINEAR, affine, 0, MOMENTUM, contribution, n, rows, 0, acc);
        store_sums(sum, acc, n_sums, done);
    }
    for (int i = 0; i < K; i++)
        for (int q = 0; q < rows; q++) out[i * GR_SUM_DAMPED(dim) + q] = sum[i * rows + q];
    struct gr_cell_average *own = cell_average_of(dim, e, index);
    own->mc = sum[K * rows];
    for (int q = 0; q < stresses; q++) own->stress[q] = sum[K * rows + 1 + q];
}

/* State of a cell before its forces, from its sums and the masses of its nodes: w (`inside`), ln phi (as 2 (phi -
 * 1)/(phi + 1)), c, its quadrature point, and the over-compression sum max(0, m_i/rho_c - V_i) B_i dx.
 * Returned: M. */
GR_INLINE double cell_state(const int dim, const struct gr_engine *e, int64_t index, struct gr_cell_average *own)
{
    const int K = 1 << dim, rows = GR_SUM_DAMPED(dim);
    const double *sum = e->sums + index * e->sum_stride, per_cell = e->mass_scale;
    double M = 0, mass = 0, volume = 0, high[3] = {0}, excess[8];
    for (int i = 0; i < K; i++) {
        const int64_t node = e->mesh.cell_node[index * K + i];
        const double m = e->node_mass[node] * per_cell, V = e->mesh.node_volume[node];
        M += sum[i * rows];
        mass += m;
        volume += V;
        excess[i] = m > V ? m - V : 0;
        for (int d = 0; d < dim; d++) high[d] += i >> d & 1 ? sum[i * rows] : 0;
    }
    const double w = (mass / volume - SURFACE_BELOW) * (1 / (INSIDE_FROM - SURFACE_BELOW)), inverse = 1 / M;
    own->inside = w < 0 ? 0 : w > 1 ? 1 : w;
    own->log_phi = 2 * (mass - volume) / (mass + volume) - e->servo_strain;
    own->c = own->mc * inverse;
    for (int d = 0; d < dim; d++) own->at[d] = own->inside * 0.5 + (1 - own->inside) * high[d] * inverse;
    for (int d = 0; d < dim; d++) {
        own->over_compression[d] = 0;
        for (int i = 0; i < K; i++) own->over_compression[d] += excess[i] * slope_at(dim, own->at, i, d);
    }
    return M;
}

/* Forces of a cell on its nodes; they conserve momentum and angular momentum:
 *
 *   f_i = -A sigma B_i,   A = dx^dim (w + (1 - w) min(1, M/(rho_c dx^dim))). */
GR_INLINE void apply_cell_forces(const int dim, struct gr_engine *e, int64_t index)
{
    static const int place[2][3][3] = {{{0, 2, 5}, {2, 1, 4}, {5, 4, 3}}, {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}}};
    const int K = 1 << dim, rows = GR_SUM_DAMPED(dim);
    struct gr_cell_average *own = cell_average_of(dim, e, index);
    double *sum = e->sums + index * e->sum_stride;
    if (!e->mesh.cell[index].count) { /* without points: all sums are zero */
        own->c = EMPTY;
        for (int i = 0; i < K * rows; i++) sum[i] = 0;
        return;
    }
    const double M = cell_state(dim, e, index, own), filled = M * e->mass_scale, w = own->inside;
    /* A/(dx M), by mass_scale = 1/(rho_c dx^dim) and force_scale = -1/(rho_c dx) */
    const double area = (w + (1 - w) * (filled < 1 ? filled : 1)) * e->force_scale / filled;
    for (int i = 0; i < K; i++)
        for (int d = 0; d < dim; d++) {
            double force = 0;
            for (int j = 0; j < dim; j++) force += own->stress[place[dim - 2][d][j]] * slope_at(dim, own->at, i, j);
            sum[i * rows + GR_SUM_FORCE(dim) + d] = area * force;
        }
}

/* Log-density of the neighbour of a cell along axis d, high or low; EMPTY beyond a wall or an end. `id` is the index of
 * the cell in the whole grid, and `stride` the difference of the indices of neighbours along d. */
GR_INLINE double density_beside(const int dim, const struct gr_engine *e, const struct gr_cell *cell, int64_t id,
                                int64_t stride, int d, int high)
{
    const struct gr_axis *axis = &e->axis[d];
    if (cell->flags / GR_CELL_WALL >> (2 * d + high) & 1) return EMPTY;
    id += high ? stride : -stride;
    if (cell->at[d] == (high ? axis->n_cells - 1 : 0)) {
        if (!axis->periodic) return EMPTY;
        id += (high ? -stride : stride) * axis->n_cells;
    }
    const int64_t index = (int64_t)gr_table_get(&e->mesh.cell_of, id) - 1;
    return index < 0 ? EMPTY : cell_average_of(dim, e, index)->c;
}

/* Second difference of the density, (c- - 2 c + c+)/4, as a mean over the axes. It vanishes for a linear field. Added
 * to an alternating one (checkerboard), whose forces on the nodes cancel, it removes it. Disconnected cells take no
 * part. */
GR_INLINE double second_difference(const int dim, const struct gr_engine *e, int64_t index)
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const double c = cell_average_of(dim, e, index)->c, reach = -e->config.density.separation_strain;
    const int64_t id = gr_cell_id(e, cell->at);
    int64_t stride = 1;
    double sum = 0;
    for (int d = 0; c >= reach && d < dim; stride *= e->axis[d++].n_cells) {
        const double low = density_beside(dim, e, cell, id, stride, d, 0);
        const double high = density_beside(dim, e, cell, id, stride, d, 1);
        if (low >= reach && high >= reach) sum += low - 2 * c + high;
    }
    return sum / (4 * dim);
}

/* Update of a cell in a step, the same for all its points: L dt, the log-density after the step, and the shift, m.
 *
 *   c <- c - dt tr L + eta (second difference of c),   eta: averaged_share;
 *   c += relaxation to ln phi, see relax_to_nodal_density. If it lowers c, only the share w of it, and nothing if the
 *        cell is disconnected already;
 *   delta = -beta gdot dt dx over_compression,   |delta| <= min(limit dx, gdot dt dx/2). */
GR_INLINE vd flow_of_cell(const int dim, const struct gr_engine *e, int64_t index, vd *L, vd shift[3])
{
    const struct gr_density_numbers *q = &e->config.density;
    const struct gr_cell_average *own = cell_average_of(dim, e, index);
    const double dx = e->config.dx;
    double G[9] = {0}, trace = 0, length = 0;
    for (int i = 0; i < 1 << dim; i++) {
        const double *v = e->node_data + (int64_t)e->mesh.cell_node[(index << dim) + i] * e->node_stride;
        for (int j = 0; j < dim; j++) {
            const double slope = slope_at(dim, own->at, i, j);
            for (int d = 0; d < dim; d++) G[d * dim + j] += v[d] * slope;
        }
    }
    for (int k = 0; k < dim * dim; k++) L[k] = v_set(e->dt * e->inv_dx * G[k]);
    for (int d = 0; d < dim; d++) trace += L[d * dim + d][0], length += own->over_compression[d] * own->over_compression[d];
    const double rate = kinematic_rate(dim, L)[0];
    const double eta = averaged_share(e, e->dt, v_set(rate), v_set(own->c))[0];
    double c = own->c - trace + eta * second_difference(dim, e, index);
    if (own->c >= -q->separation_strain) c += e->servo_shift;
    const double gap = own->log_phi - c, relaxed = relax_to_nodal_density(q, e->dt, v_set(rate), v_set(gap))[0];
    if (gap > 0 || c >= 0) c += gap < 0 ? own->inside * relaxed : relaxed;
    const double most = e->mesh.cell[index].flags & GR_CELL_NO_SHIFTING ? 0 : fmin(q->shifting_limit, 0.5 * rate);
    double scale = q->shifting * rate;
    if (scale * scale * length > most * most) scale = most / sqrt(length);
    for (int d = 0; d < dim; d++) shift[d] = v_set(-scale * dx * own->over_compression[d]);
    return v_set(c);
}
