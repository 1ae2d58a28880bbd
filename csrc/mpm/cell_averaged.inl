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
 * inside represents its whole volume outside of bodies, and its quadrature point is the centre of that. A cell at a surface represents the volume
 * of its points at rho_c, and its quadrature point is their centre of mass: a node that they hardly reach then feels
 * hardly any force. So does a cell with a light node, for example a corner that its few points are far from. */
#include "mpm/contribution.h"
#include "mpm/density_correction.h"
#include "mpm/open_volume.h"

#define EMPTY -INFINITY /* log-density of a cell without points: below any separation strain */

/* A full cell below an empty row has phi = 3/4, and 0.9 when that row is filled by a third. */
#define SURFACE_BELOW 0.8
#define INSIDE_FROM 0.9

/* A node of the filling fraction phi among full cells has the frequency c_w/dx sqrt(2/phi) in 2D, which the largest
 * step of linear shape functions, 0.75 dx/c_w, bears from phi = 0.28 on; sqrt(1.5/phi) in 3D. The nodes of the surface
 * of a full cell have phi = 1/2. */
#define LIGHT_BELOW 0.25
#define LIGHT_UNTIL 0.5

/* Largest square of the frequency that a cell may give its nodes, over (c_w/dx)^2: stable up to steps of dx/(2 c_w). A
 * full cell alone has 8 in 2D and 12 in 3D. */
#define STIFFEST 16.0

/* The lesser and the greater of two numbers, b if a is a NaN; fmin and fmax of the library are calls. */
GR_INLINE double lesser(double a, double b) { return a < b ? a : b; }
GR_INLINE double greater(double a, double b) { return a > b ? a : b; }

/* Rise from 0 at `low` to 1 at `high`. */
GR_INLINE double between(double low, double high, double x)
{
    const double share = (x - low) * (1 / (high - low));
    return share > 0 ? (share < 1 ? share : 1) : 0;
}

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
    enum { MOST = 4 * 8 + 8 + GR_SUMS };
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int K = 1 << dim, rows = 1 + dim, stresses = dim == 2 ? 3 : 6, n_sums = K * rows + 2 + stresses;
    const int blocks = GR_BLOCKS(cell->count);
    struct gr_frame frame;
    gr_frame_of(dim, e, cell, &frame);
    double sum[MOST] = {0}, *out = e->sums + index * e->sum_stride;
    struct contribution contribution[CHUNK];
    vd acc[MOST];
    for (int done = 0; done < blocks; done += CHUNK) {
        const int n = blocks - done < CHUNK ? blocks - done : CHUNK;
        vd *const own = acc + K * rows;
        for (int q = 0; q <= stresses + 1; q++) own[q] = v_zero();
        for (int i = 0; i < n; i++) {
            const int64_t at = cell->offset + (done + i) * GR_W;
            prepare_momentum(dim, GR_LINEAR, affine, e, &frame, at, &contribution[i]);
            own[0] = v_fma(contribution[i].m, component(e, GR_FIELD_log_density, 0, at), own[0]);
            for (int q = 0; q < stresses; q++) {
                const int c = dim == 2 && q == 2 ? 3 : q; /* zz makes no force in 2D */
                own[1 + q] = v_fma(contribution[i].m, component(e, GR_FIELD_stress, c, at), own[1 + q]);
            }
            if (e->config.damping_rate > 0)
                own[1 + stresses] = v_fma(contribution[i].m, component(e, GR_FIELD_shear_rate, 0, at), own[1 + stresses]);
        }
        add_rows(dim, GR_LINEAR, affine, 0, MOMENTUM, contribution, n, rows, 0, acc);
        store_sums(sum, acc, n_sums, done);
    }
    for (int i = 0; i < K; i++)
        for (int q = 0; q < rows; q++) out[i * GR_SUM_DAMPED(dim) + q] = sum[i * rows + q];
    struct gr_cell_average *own = cell_average_of(dim, e, index);
    own->mc = sum[K * rows];
    for (int q = 0; q < stresses; q++) own->stress[q] = sum[K * rows + 1 + q];
    own->m_rate = sum[K * rows + 1 + stresses];
}

/* State of a cell before its forces, from its sums and the masses of its nodes: w (`inside`), ln phi (as 2 (phi -
 * 1)/(phi + 1)), c, its quadrature point, the over-compression sum max(0, m_i/rho_c - V_i) B_i dx, and the excess of
 * its mass; and its damping, from the mean of the plastic shear rate. */
GR_INLINE void cell_state(const int dim, const struct gr_engine *e, int64_t index, struct gr_cell_average *own)
{
    const int K = 1 << dim, rows = GR_SUM_DAMPED(dim);
    const double *sum = e->sums + index * e->sum_stride, per_cell = e->mass_scale;
    const struct gr_open_part *part = gr_open_part(e->open, e->open ? gr_cell_id(e, e->mesh.cell[index].at) : 0);
    double M = 0, mass = 0, volume = 0, high[3] = {0}, over[8];
    int light = 0;
    for (int i = 0; i < K; i++) {
        const int64_t node = e->mesh.cell_node[index * K + i];
        const double m = e->node_mass[node] * per_cell, V = e->mesh.node_volume[node];
        M += sum[i * rows];
        mass += m;
        volume += V;
        light |= m < LIGHT_UNTIL * V;
        over[i] = greater(m - V, 0);
        for (int d = 0; d < dim; d++) high[d] += i >> d & 1 ? sum[i * rows] : 0;
    }
    const double inverse = 1 / M;
    own->inside = between(SURFACE_BELOW, INSIDE_FROM, mass / volume);
    for (int i = 0; __builtin_expect(light, 0) && i < K; i++) {
        const int64_t node = e->mesh.cell_node[index * K + i];
        const double phi = e->node_mass[node] * per_cell / e->mesh.node_volume[node];
        own->inside = lesser(between(LIGHT_BELOW, LIGHT_UNTIL, phi), own->inside);
    }
    own->log_phi = 2 * (mass - volume) / (mass + volume) - e->servo_strain;
    own->c = own->mc * inverse;
    for (int d = 0; d < dim; d++) {
        const double centre = part ? part->centre[d] : 0.5;
        own->at[d] = own->inside * centre + (1 - own->inside) * high[d] * inverse;
    }
    for (int d = 0; d < dim; d++) {
        own->over_compression[d] = 0;
        for (int i = 0; i < K; i++) own->over_compression[d] += over[i] * slope_at(dim, own->at, i, d);
    }
    own->damped = e->config.damping_rate > 0 ? damped_share(e, v_set(own->m_rate * inverse), v_set(own->c))[0] : 0;
    own->filled = M * per_cell;
    own->open = part ? part->volume : 1;
    own->excess = (own->filled - own->open) * (own->filled < own->open ? own->inside : 1);
}

/* Volume that a cell represents, over dx^dim, if the node masses bear it, else as much as they bear:
 *
 *   A = w V + (1 - w) min(V, M/(rho_c dx^dim)),   A sum |B_i dx|^2/m_i <= STIFFEST,
 *
 * with V the volume of the cell outside of bodies, over dx^dim, and m_i the part of the mass of node i that the cell
 * brings, or its share of the volume inside the material, over rho_c dx^dim. The square of the frequency of all cells
 * together is not above the largest of the cells one by one (Irons & Treharne 1971). Inside the material all nodes are
 * heavy enough, but for those of cells that the surface of a body cuts: a node within it may be full and yet have next
 * to no mass. */
GR_INLINE double represented_volume(const int dim, const struct gr_engine *e, int64_t index,
                                    const struct gr_cell_average *own)
{
    const int K = 1 << dim, rows = GR_SUM_DAMPED(dim);
    const double *sum = e->sums + index * e->sum_stride, per_cell = e->mass_scale, w = own->inside;
    const double volume = w * own->open + (1 - w) * lesser(own->open, own->filled);
    double stiffness = 0;
    if (!(w < 1) && !(own->open < 1)) return volume;
    for (int i = 0; i < K; i++) {
        const int64_t node = e->mesh.cell_node[index * K + i];
        const double free_volume = e->open ? gr_node_volume(e, e->mesh.node_id[node]) : e->mesh.node_volume[node];
        const double shared = w * e->node_mass[node] / (K * free_volume);
        double square = 0;
        for (int d = 0; d < dim; d++) square += slope_at(dim, own->at, i, d) * slope_at(dim, own->at, i, d);
        stiffness += square / (per_cell * greater(shared, sum[i * rows]) + 1e-300);
    }
    return volume * stiffness > STIFFEST ? STIFFEST / stiffness : volume;
}

/* Forces of a cell on its nodes; they conserve momentum and angular momentum:
 *
 *   f_i = -A sigma B_i,   A: represented_volume. */
GR_INLINE void apply_cell_forces(const int dim, struct gr_engine *e, int64_t index)
{
    static const int place[2][3][3] = {{{0, 2, 5}, {2, 1, 4}, {5, 4, 3}}, {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}}};
    const int K = 1 << dim, rows = GR_SUM_DAMPED(dim);
    struct gr_cell_average *own = cell_average_of(dim, e, index);
    double *sum = e->sums + index * e->sum_stride;
    if (!e->mesh.cell[index].count) {                  /* without points: all sums are zero */
        own->c = EMPTY, own->excess = own->damped = 0; /* for neighbours; counts change during a sweep */
        for (int i = 0; i < K * rows; i++) sum[i] = 0;
        return;
    }
    cell_state(dim, e, index, own);
    /* A/(dx M), by mass_scale = 1/(rho_c dx^dim) and force_scale = -1/(rho_c dx) */
    const double area = represented_volume(dim, e, index, own) * e->force_scale / own->filled;
    for (int i = 0; i < K; i++)
        for (int d = 0; d < dim; d++) {
            double force = 0;
            for (int j = 0; j < dim; j++) force += own->stress[place[dim - 2][d][j]] * slope_at(dim, own->at, i, j);
            sum[i * rows + GR_SUM_FORCE(dim) + d] = area * force;
        }
}

enum {
    NO_POINTS = -1,
    CLOSED = -2
}; /* neighbours that are not there: a cell outside the active part; beyond a wall or an end */

/* Index of the neighbour of a cell along axis d, low or high. `id` is the index of the cell in the whole grid, and
 * `stride` the difference of the indices of neighbours along d. */
GR_INLINE int64_t cell_beside(const struct gr_engine *e, const struct gr_cell *cell, int64_t id, int64_t stride, int d,
                              int high)
{
    const struct gr_axis *axis = &e->axis[d];
    if (cell->flags / GR_CELL_WALL >> (2 * d + high) & 1) return CLOSED;
    id += high ? stride : -stride;
    if (cell->at[d] == (high ? axis->n_cells - 1 : 0)) {
        if (!axis->periodic) return CLOSED;
        id += (high ? -stride : stride) * axis->n_cells;
    }
    const int64_t index = (int64_t)gr_table_get(&e->mesh.cell_of, id) - 1;
    return index < 0 ? NO_POINTS : index;
}

/* Differences of a cell to its neighbours across its faces.
 *
 * Returned: the second difference of the density, (c- - 2 c + c+)/4, as a mean over the axes, and for each face the
 * difference of the excess, of its low side less its high side.
 *
 * Both see what alternates from cell to cell (checkerboard). The nodes do not: their sums are over the cells around
 * them, so that neither their masses nor the forces on them change with it. The second difference vanishes for a linear
 * field; disconnected cells take no part in it. Cells hold whole points: differences of the excess up to one point are
 * left. */
GR_INLINE double across_faces(const int dim, const struct gr_engine *e, int64_t index, double drop[3][2])
{
    const struct gr_cell *cell = &e->mesh.cell[index];
    const struct gr_cell_average *own = cell_average_of(dim, e, index);
    const double reach = -e->config.density.separation_strain, point = own->filled / cell->count;
    const int64_t id = gr_cell_id(e, cell->at);
    int64_t stride = 1;
    double sum = 0;
    for (int d = 0; d < dim; stride *= e->axis[d++].n_cells) {
        double c[2];
        for (int high = 0; high < 2; high++) {
            const int64_t beside = cell_beside(e, cell, id, stride, d, high);
            const struct gr_cell_average *other = beside < 0 ? 0 : cell_average_of(dim, e, beside);
            c[high] = other ? other->c : EMPTY;
            const double rise = beside == CLOSED ? 0 : (other ? other->excess : 0) - own->excess;
            const double much = greater(fabs(rise) - point, 0);
            drop[d][high] = (rise > 0) == high ? -much : much;
        }
        if (own->c >= reach && c[0] >= reach && c[1] >= reach) sum += c[0] - 2 * own->c + c[1];
    }
    return sum / (4 * dim);
}

/* Shift of the points of a cell along each axis at its low and high face, m; linear between them.
 *
 *   delta = -beta gdot dt dx over_compression,             |delta| <= min(limit dx, gdot dt dx/2),
 *         + beta r dt dx (excess_low - excess_high),       r = 2 |L_dd|; of a face; |delta| <= min(limit dx, r dt dx).
 *
 * The first is seen by the nodes, without the noise of single cells; the second carries points out of cells that have
 * too many into neighbours that have too few. It is stretching along an axis that makes cells uneven along it, r = gdot
 * in a plane flow; layers in simple shear are left alone. Nothing goes through a wall. */
GR_INLINE void shift_of_cell(const int dim, const struct gr_engine *e, int64_t index, const vd *L, double rate,
                             double drop[3][2], vd shift[3][2])
{
    const struct gr_density_numbers *q = &e->config.density;
    const struct gr_cell_average *own = cell_average_of(dim, e, index);
    const int flags = e->mesh.cell[index].flags;
    const double dx = e->config.dx, limit = flags & GR_CELL_NO_SHIFTING ? 0 : q->shifting_limit;
    const double most = lesser(limit, 0.5 * rate);
    double length = 0, scale = q->shifting * rate;
    for (int d = 0; d < dim; d++) length += own->over_compression[d] * own->over_compression[d];
    if (scale * scale * length > most * most) scale = most / sqrt(length);
    for (int d = 0; d < dim; d++) {
        const double along = 2 * fabs(L[d * dim + d][0]), most_of_face = lesser(limit, along);
        for (int high = 0; high < 2; high++) {
            const double all = -scale * own->over_compression[d], flux = q->shifting * along * drop[d][high];
            const int into_wall = flags / GR_CELL_WALL >> (2 * d + high) & 1 && (all > 0) == high;
            shift[d][high] = v_set(dx * ((into_wall ? 0 : all) + lesser(greater(flux, -most_of_face), most_of_face)));
        }
    }
}

/* Update of a cell in a step, the same for all its points: L dt, the log-density after the step, the shift, m.
 *
 *   c <- c - dt tr L + eta (second difference of c),   eta: averaged_share;
 *   c += relaxation to ln phi, see relax_to_nodal_density. If it lowers c, only the share w of it, and nothing if the
 *        cell is disconnected already. */
GR_INLINE vd flow_of_cell(const int dim, const struct gr_engine *e, int64_t index, vd *L, vd shift[3][2])
{
    const struct gr_density_numbers *q = &e->config.density;
    const struct gr_cell_average *own = cell_average_of(dim, e, index);
    double G[9] = {0}, drop[3][2], trace = 0;
    for (int i = 0; i < 1 << dim; i++) {
        const double *v = e->node_data + (int64_t)e->mesh.cell_node[(index << dim) + i] * e->node_stride;
        for (int j = 0; j < dim; j++) {
            const double slope = slope_at(dim, own->at, i, j);
            for (int d = 0; d < dim; d++) G[d * dim + j] += v[d] * slope;
        }
    }
    for (int k = 0; k < dim * dim; k++) L[k] = v_set(e->dt * e->inv_dx * G[k]);
    for (int d = 0; d < dim; d++) trace += L[d * dim + d][0];
    const double rate = kinematic_rate(dim, L)[0];
    const double eta = averaged_share(e, e->dt, v_set(rate), v_set(own->c))[0];
    double c = own->c - trace + eta * across_faces(dim, e, index, drop);
    if (own->c >= -q->separation_strain) c += e->servo_shift;
    const double gap = own->log_phi - c, relaxed = relax_to_nodal_density(q, e->dt, v_set(rate), v_set(gap))[0];
    if (gap > 0 || c >= 0) c += gap < 0 ? own->inside * relaxed : relaxed;
    shift_of_cell(dim, e, index, L, rate, drop, shift);
    return v_set(c);
}
