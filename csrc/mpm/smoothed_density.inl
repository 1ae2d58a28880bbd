/* The smoothed density at the points: their contributions to its averaging (P2G), and the density correction (G2P). */
#include "mpm/contribution.h"
#include "mpm/density_correction.h"

/* Log-density of the points in the slots from `at` on, its gradient, and their volume. With several materials the stored
 * gradient is of the pressure over K of the first. */
GR_INLINE void prepare_density(const int dim, const int basis, const struct gr_engine *e, const struct gr_frame *frame,
                               int64_t at, struct contribution *contribution)
{
    struct gr_shape s;
    gr_shapes(dim, basis, e, frame, at, 0, &s); /* its local coordinates alone are used */
    contribution->c = component(e, GR_FIELD_log_density, 0, at);
    const vd separation = gr_of_material(e, GR_MATERIAL_SEPARATION, at);
    contribution->filled = contribution->m;
    for (int j = 0; j < dim; j++)
        contribution->slope[j] = v_set(e->config.dx) * component(e, GR_FIELD_density_gradient, j, at);
    if (__builtin_expect(e->own_volumes, 0)) {
        const vd softness = gr_of_material(e, GR_MATERIAL_SOFTNESS, at);
        contribution->filled = contribution->m * gr_of_material(e, GR_MATERIAL_FILLING, at);
        if (e->dilates) contribution->filled = contribution->filled * component(e, GR_FIELD_bulking, 0, at);
        contribution->pressed = contribution->c * gr_of_material(e, GR_MATERIAL_STIFFNESS, at);
        for (int j = 0; j < dim; j++) {
            contribution->pressure_slope[j] = contribution->slope[j];
            contribution->slope[j] = contribution->slope[j] * softness;
        }
    }
    contribution->joined = v_keep(v_ge(contribution->c, separation), contribution->filled);
    if (__builtin_expect(e->config.n_materials > 1, 0)) /* an elastic body is no part of the averaging */
        contribution->joined = v_keep(v_gt(separation, v_set(-NO_SEPARATION)), contribution->joined);
    contribution->c = at_edge(dim, &s, contribution->c, contribution->slope);
    if (__builtin_expect(e->own_volumes, 0))
        contribution->pressed = at_edge(dim, &s, contribution->pressed, contribution->pressure_slope);
}

/* For the nodes of a row: mass, mass with quadrature weights, log-density, and residual force,
 *
 *   sum w m,  sum w q m,  sum w q m (c + grad c (x_i - x)),  sum q m grad w,  over the connected points,
 *
 * with `rings` also sum q m w/r along r. */
GR_INLINE void add_density(const int dim, const int basis, const int rings, const struct gr_frame *frame,
                           const struct contribution *p, const struct row row, vd sum[3][MOST_SUMS])
{
    const vd m_yz = p->joined * weight_yz(dim, basis, p, row, 0), c = linear_yz(dim, basis, frame, row, p->c, p->slope);
    vd qm_yz[3];
    qm_yz[0] = m_yz * p->weight;
    for (int d = 1; d < dim; d++) qm_yz[d] = p->joined * p->weight * weight_yz(dim, basis, p, row, d);
    for (int a = 0; a < gr_nodes_1d(basis); a++) {
        sum[a][GR_SUM_CONNECTED] = v_fma(m_yz, p->w[0][a], sum[a][GR_SUM_CONNECTED]);
        const vd wqm = qm_yz[0] * p->w[0][a];
        sum[a][GR_SUM_WEIGHTED] = sum[a][GR_SUM_WEIGHTED] + wqm;
        sum[a][GR_SUM_LOG_DENSITY] = v_fma(wqm, along_axis(basis, frame, 0, a, c, p->slope[0]), sum[a][GR_SUM_LOG_DENSITY]);
        sum[a][GR_SUM_RESIDUAL] = v_fma(qm_yz[0], p->g[0][a], sum[a][GR_SUM_RESIDUAL]);
        if (rings) sum[a][GR_SUM_RESIDUAL] = v_fma(wqm, p->hoop, sum[a][GR_SUM_RESIDUAL]);
        for (int d = 1; d < dim; d++) sum[a][GR_SUM_RESIDUAL + d] = v_fma(qm_yz[d], p->w[0][a], sum[a][GR_SUM_RESIDUAL + d]);
    }
}

/* With several materials, for the nodes of a row: volume of all points, and pressure of those that are averaged,
 *
 *   sum w m,  sum w q m (p + grad p (x_i - x)). */
GR_INLINE void add_volume(const int dim, const int basis, const struct gr_frame *frame, const struct contribution *p,
                          const struct row row, vd sum[3][MOST_SUMS])
{
    const vd w_yz = weight_yz(dim, basis, p, row, 0),
             pressed = linear_yz(dim, basis, frame, row, p->pressed, p->pressure_slope);
    for (int a = 0; a < gr_nodes_1d(basis); a++) {
        const vd w = w_yz * p->w[0][a], wqm = w * p->joined * p->weight;
        sum[a][GR_SUM_VOLUME] = v_fma(w, p->filled, sum[a][GR_SUM_VOLUME]);
        sum[a][GR_SUM_PRESSURE] =
            v_fma(wqm, along_axis(basis, frame, 0, a, pressed, p->pressure_slope[0]), sum[a][GR_SUM_PRESSURE]);
    }
}

/* Correct the quadrature weights q = 1 + u of the points, so that a uniform pressure makes no force inside the
 * material:
 *
 *   u += -weight_correction sum_i grad S_i . E_i - weight_correction_decay u - sum_i S_i x_i,
 *   E_i = sum (1 + u) m/(rho_c dx^dim) grad S_i,
 *
 * with lengths in cells; in an axisymmetric plane div E = grad S . E + S E_r/r, and dx^dim is 2 pi dx^3 times the mean radius
 * of the node in cells. The first term is a descent on the sum of E^2 over the nodes, E being the residual force. The
 * second makes a point forget where it has been. The third removes x_i, the excess of the mean weight at a node over
 * exp(cbar_i)/phi_i. Points that are not connected are in none of these sums, and keep their weights.
 * Given: the modes of x and E. */
GR_INLINE void correct_weights(const int dim, const int basis, struct gr_engine *e, const struct gr_shape *s, const vd *mode,
                               vm connected, int64_t at)
{
    const int K = gr_power(gr_nodes_1d(basis), dim);
    const struct gr_density_numbers *q = &e->config.density;
    gr_real *place = gr_numbers(e, GR_FIELD_weight_correction, 0, at);
    vd u = v_load(place), divergence = v_zero(), slope[3];
    for (int d = 0; d < dim; d++) {
        const vd E = gr_interpolate(dim, basis, 0, mode + (GR_NODE_RESIDUAL + d) * K, s, (const vd(*)[3])s->g, slope);
        divergence = divergence + slope[d];
        if (dim == 2 && d == 0 && __builtin_expect(e->config.axisymmetric, 0))
            divergence = v_fma(E, gr_inverse_radius(e, at), divergence);
    }
    const vd excess = gr_interpolate(dim, basis, 0, mode + GR_NODE_WEIGHT * K, s, (const vd(*)[3])s->g, slope) *
                      v_set(q->weight_correction > 0);
    const vd old = u;
    u = v_fnma(v_set(q->weight_correction), divergence, v_fnma(v_set(q->weight_correction_decay), u, u) - excess);
    u = v_clamp(u, -q->weight_correction_limit, q->weight_correction_limit);
    if (__builtin_expect(e->config.n_materials > 1, 0)) /* an elastic body next to grains keeps its weights */
        u = v_select(v_gt(gr_of_material(e, GR_MATERIAL_SEPARATION, at), v_set(-NO_SEPARATION)), u, old);
    v_store(place, v_select(connected, u, old));
}

/* Differences between cells that are left, in points, and the share of the rest that goes across a face, over the share of
 * the shift of the nodes. By trial in a steady extension: with (1.5, 1), (1, 1) and (1.5, 2) 15, 10 and 9 % of the cells
 * hold more than 1.3 times the right number; (0.5, 1) has 9 %, too, but moves points in slow flow where they need not be,
 * and (1, 2) makes the flow between cylinders worse. */
#define LEFT_POINTS 1.5
#define ACROSS_FACES 2.0

/* 2^64 over the golden ratio: odd, and without a pattern in its bits. */
#define HASH 0x9E3779B97F4A7C15u

/* Content of the cells from `first` on, and whether they are inside, from the node at their middle. Blocks and cells that a
 * body cuts take no part: shifts of points there would change the friction on it, by 1 % of the speed in the flow between
 * cylinders. Call it after the nodes are described. */
GR_INLINE void fill_cells(const int dim, const struct gr_engine *e, int64_t first)
{
    const int K = gr_power(3, dim);
    const double *gap = gr_node_field(e, GR_NODE_DENSITY(dim) + GR_NODE_OWN_GAP(dim));
    double at_middle[GR_W], solid[GR_W];
    vd centre[3];
    for (int l = 0; l < GR_W; l++) {
        at_middle[l] = gap[gr_node_in_row(e, first + l, K / 6, 1)];
        solid[l] = e->mesh.cell[first + l].flags & GR_CELL_SOLID;
    }
    vd filled = v_load(gr_cell_sums(e, first, GR_CELL_FILLED)) * v_set(e->mass_scale);
    if (dim == 2 && e->config.axisymmetric) filled = filled / GR_OF_CELLS(e, first, 0, radius);
    const vd open = open_parts(dim, e, first, centre);
    store_filling(e, first, filled, excess_at(filled, open, v_load(at_middle), v_load(solid)));
}

/* Part of a shift that each of the points in the slots from `at` on takes: from 0 to 2 by a hash of its number, 1 on
 * average. Points of a column of the seeding lattice have one coordinate along an axis. With equal parts the column would
 * go to and fro as a whole, and leave an empty cell behind each time. */
GR_INLINE vd own_parts(const struct gr_engine *e, int64_t at)
{
    double part[GR_W];
    for (int l = 0; l < GR_W; l++) {
        const uint64_t mixed = (uint64_t)e->points.id[at + l] * HASH, other = (mixed ^ mixed >> 32) * HASH;
        part[l] = (double)(other >> 11) * 0x1p-52;
    }
    return v_load(part);
}

/* Density correction of the points in the slots from `at` on: averaging, relaxation to the nodal density, particle shifting.
 *
 *   c += eta (cbar - c) + relaxation(gap),   eta: averaged_share, relaxation: relax_to_nodal_density,
 *   delta = -beta gdot dt dx^2 sum max(0, phi_i - 1) grad S_i,   |delta| <= min(limit dx, gdot dt dx/2),
 *         + the part of each point (own_parts) of the shift of the faces, linear between them (shift_at_face), for the
 *           strain ACROSS_FACES gdot dt min(1, 2 e_d/rate), e_d = min(|L_dd|, lasting_rate), with the rate of L.
 *
 * The last is for material that stretches along an axis for long, which makes cells uneven along it; simple shear is left
 * alone. dt and gdot dt include all the steps that the averaging stands for. gdot is the plastic shear rate of points with
 * stress, and the shear rate of the flow for stress-free points.
 * Given: L dt and dt tr L of this step, the modes of the gap, cbar, max(0, phi - 1), x and E, and face_drops.
 * Returned: the new log-density; delta, m; and L delta, m/s, the change of velocity. */
GR_INLINE vd relax_density(const int dim, const int basis, struct gr_engine *e, const struct gr_wall_cells *walls,
                           const vd drop[3][2], const struct gr_shape *s, const vd *mode, const vd *L, vd trace, int64_t at,
                           vd delta[3], vd shift_velocity[3])
{
    const int K = gr_power(gr_nodes_1d(basis), dim);
    const struct gr_density_numbers *q = &e->config.density;
    const double dx = e->config.dx, inv_dx = e->inv_dx;
    const vd(*g)[3] = (const vd(*)[3])s->g;
    vd slope[3], gradient[3];
    const double interval = e->config.averaging_interval;
    const vd old = component(e, GR_FIELD_log_density, 0, at), flow = component(e, GR_FIELD_shear_rate, 0, at);
    const vd origin = gr_of_material(e, GR_MATERIAL_ORIGIN, at);
    const vm stressed = v_ge(old, gr_of_material(e, GR_MATERIAL_STRESSED, at));
    const vm connected = v_ge(old, gr_of_material(e, GR_MATERIAL_SEPARATION, at));
    const vd rate = kinematic_rate(dim, L);
    const vd strain = v_set(interval) * v_select(stressed, v_set(e->clock.dt) * flow, rate);
    const vd gap = gr_interpolate(dim, basis, 0, mode + GR_NODE_GAP * K, s, g, slope);
    vd near = gr_interpolate(dim, basis, 0, mode + GR_NODE_LOG_DENSITY * K, s, g, gradient);
    if (__builtin_expect(e->config.n_materials > 1, 0)) near = near * gr_of_material(e, GR_MATERIAL_SOFTNESS, at);
    (void)gr_interpolate(dim, basis, 0, mode + GR_NODE_EXCESS * K, s, g, slope);
    vd c =
        v_fma(v_keep(connected, averaged_share(e, interval * e->clock.dt, strain, old - origin)), near - old, old - trace);
    for (int d = 0; d < dim; d++)
        v_store(gr_numbers(e, GR_FIELD_density_gradient, d, at), v_keep(connected, gradient[d] * v_set(inv_dx)));
    c = c + v_keep(connected, v_set(e->servo_shift));
    c = c + v_keep(v_ge(c, origin), relax_to_nodal_density(q, interval * e->clock.dt, strain, gap));
    vd length = v_zero();
    for (int d = 0; d < dim; d++) {
        delta[d] = v_set(-q->shifting * dx) * strain * slope[d];
        length = v_fma(delta[d], delta[d], length);
    }
    const vd most = v_keep(walls->shifts, v_min(v_set(q->shifting_limit * dx), v_set(0.5 * dx) * strain));
    const vm far = v_gt(length, most * most);
    if (m_bits(far)) {
        const vd scale = v_select(far, most / v_sqrt(v_max(length, v_set(GR_NOTHING))), v_set(1.0));
        for (int d = 0; d < dim; d++) delta[d] = delta[d] * scale;
    }
    if (walls->any) hold_at_walls(dim, walls, s->xi, delta);
    const vd reach = v_set(dx) * own_parts(e, at), lasting = lasting_rate(dim, L);
    for (int d = 0; d < dim; d++) {
        const vd part = v_set(2.0) * v_min(lasting, v_abs(L[d * dim + d])) / v_max(rate, v_set(GR_NOTHING));
        const vd along = v_set(ACROSS_FACES) * strain * v_min(part, v_set(1.0)),
                 limit = v_keep(walls->shifts, v_set(q->shifting_limit));
        const vd low = shift_at_face(q, along, drop[d][0], limit), high = shift_at_face(q, along, drop[d][1], limit);
        delta[d] = v_fma(reach, v_fma(s->xi[d], high - low, low), delta[d]);
    }
    correct_weights(dim, basis, e, s, mode, connected, at);
    for (int d = 0; d < dim; d++) {
        shift_velocity[d] = v_zero();
        for (int j = 0; j < dim; j++) shift_velocity[d] = v_fma(L[d * dim + j], delta[j], shift_velocity[d]);
        shift_velocity[d] = shift_velocity[d] * v_set(e->clock.inv_dt);
        v_store(gr_numbers(e, GR_FIELD_shift_velocity, d, at), shift_velocity[d]);
    }
    return c;
}
