/* The cell-averaged density, for linear shape functions: the points of a cell share one density.
 *
 * Points that sample a flow unevenly get uneven changes of volume and make uneven forces. Here the points of a cell
 * have one density and one velocity gradient, and act on the nodes by their mean stress:
 *
 *   c = sum m c_p/M,   sigma = sum m sigma_p/M,   M = sum m   (over the points of the cell),
 *   phi = sum m_i/(rho_c sum V_i),   L = sum v_i (x) B_i   (over its nodes),
 *
 * with B_i the gradient of S_i at one quadrature point and V_i the volume of a node. Of material that dilates m_i and the
 * content of a cell are volumes of the points when free of stress, as a mass at rho_c; the means are by mass. The filling fraction phi ties c to
 * the volume that the points really have. It also tells whether the cell is inside the material or at a surface. A cell
 * inside represents its whole volume outside of bodies, and its quadrature point is the centre of that. A cell at a
 * surface represents the volume of its points at rho_c, and its quadrature point is their centre of mass: a node that
 * they hardly reach then feels hardly any force. So does a cell with a light node, for example a corner that its few
 * points are far from.
 *
 * In an axisymmetric plane the cell is a ring, with the volume and the centroid of one, and B_i has the component H_i of
 * hoops (hoop_at) in L_tt = sum H_i v_ir and in the force along r. */
#include "mpm/solid_cells.h"
#include "mpm/contribution.h"
#include "mpm/density_correction.h"
#include "mpm/open_volume.h"

#define ONE_POINT 1.0   /* differences between cells up to this are left */
#define EMPTY -INFINITY /* log-density of a cell without points: below any separation strain */

/* A full cell below an empty row has phi = 3/4, and 0.9 when that row is filled by a third. */
#define SURFACE_BELOW 0.8
#define INSIDE_FROM 0.9

/* A node of the filling fraction phi among full cells has the frequency c_w/dx sqrt(2/phi) in 2D, which the largest
 * step of linear shape functions, 0.75 dx/c_w, bears from phi = 0.28 on; sqrt(1.5/phi) in 3D. The nodes of the surface
 * of a full cell have phi = 1/2. */
#define LIGHT_BELOW 0.25
#define LIGHT_UNTIL 0.5

/* Largest square of the frequency that a cell may give its nodes, over (c_w/dx)^2; a full cell alone has 8 in 2D and 12 in
 * 3D. Steps of dx/(2 c_w) bear 16 where nothing moves. The light points at the surface of a disc that flies through the
 * cells change it from step to step: with 16 the disc gains energy in 6 of 16 seedings of 16 points per cell, with 14 in 2,
 * with 12 in none (measured). */
#define STIFFEST 12.0

/* Number i of an array with an entry per node, at local node i of the cells from `first` on. */
GR_INLINE vd at_nodes(const struct gr_engine *e, const double *array, int64_t first, int i)
{
    const int64_t tile = first / GR_LANES, row = (tile * e->n_rows + i / 2) * GR_LANES;
    double value[GR_W];
    if (e->mesh.tile_in_order[tile] == GR_IN_ROW) return v_load(array + e->mesh.row_node[row] + first % GR_LANES + i % 2);
    for (int l = 0; l < GR_W; l++) value[l] = array[gr_lane_nodes(e, tile, i)[first % GR_LANES + l]];
    return v_load(value);
}

/* Cells that have points. */
GR_INLINE vm occupied(const struct gr_engine *e, int64_t first)
{
    double count[GR_W];
    for (int l = 0; l < GR_W; l++) count[l] = e->mesh.cell[first + l].count;
    return v_gt(v_load(count), v_zero());
}

/* Volumes of local node i of the cells from `first` on, without what bodies take of them. */
GR_INLINE vd free_volumes(const struct gr_engine *e, int64_t first, int i)
{
    double volume[GR_W];
    if (!e->bodies.open) return at_nodes(e, e->mesh.node_volume, first, i);
    for (int l = 0; l < GR_W; l++)
        volume[l] = gr_node_volume(e, e->mesh.node_id[gr_node_in_row(e, first + l, i / 2, i % 2)]);
    return v_load(volume);
}

/* Index of the sum of the volumes of the points of a cell, as a mass, behind the masses of its nodes. */
GR_INLINE int own_volume_of_cell(const int dim) { return GR_CELL_AVERAGED_SUMS(dim) + (1 << dim); }

/* B_i dx along axis d for the quadrature point xi, in local coordinates. */
GR_INLINE vd slope_at(const int dim, const vd xi[3], int i, int d)
{
    vd slope = v_set(i >> d & 1 ? 1.0 : -1.0);
    for (int j = 0; j < dim; j++)
        if (j != d) slope = i >> j & 1 ? v_mul(slope, xi[j]) : v_mul(slope, v_set(1.0) - xi[j]);
    return slope;
}

/* H_i dx = S_i/r over dx at the point at which S_i r is linear in a full cell, its middle, where B_i has the centroid of the
 * ring: a uniform pressure then makes no force between full cells. Not inline, so that planes do not pay for it. */
static __attribute__((noinline)) vd hoop_at(const struct gr_engine *e, int64_t first, const vd xi[3], int i)
{
    const vd one = v_set(1.0), radius = GR_OF_CELLS(e, first, 0, radius);
    const vd along = v_fnma(v_load(average_of(e, GR_AVERAGE_INSIDE, first)), ring_shift(e, first), xi[0]);
    const vd across = i >> 1 & 1 ? xi[1] : v_sub(one, xi[1]);
    return (i & 1 ? along : v_sub(one, along)) * across / (radius - v_set(0.5) + along);
}

/* The volume of the points in the slots from `at` on, as a mass, for their nodes. Returned: the same. */
GR_INLINE vd prepare_own_volume(const int dim, const struct gr_engine *e, int64_t at, struct contribution *contribution)
{
    contribution->filled = contribution->m * gr_of_material(e, GR_MATERIAL_FILLING, at);
    if (e->dilates) contribution->filled = contribution->filled * component(e, GR_FIELD_bulking, 0, at);
    contribution->joined = contribution->weight = contribution->pressed = v_zero(); /* no pressure is averaged */
    for (int d = 0; d < dim; d++) contribution->pressure_slope[d] = v_zero();
    return contribution->filled;
}

/* P2G of GR_W cells of a tile: m and p of their nodes, and their own sums, sum m c and sum m sigma, and the masses that they
 * bring to each of their nodes; where volume is not mass, volumes of nodes and cells, too. */
GR_INLINE void p2g_averaged_cells(const int dim, const int affine, struct gr_engine *e, int64_t tile, int part,
                                  struct pass *pass, struct pass *volume)
{
    const int stresses = dim == 2 ? 3 : 6;
    const int64_t first = tile * GR_LANES + part * GR_W;
    const int most = most_points(e, first, GR_W);
    struct gr_frame frame;
    struct contribution contribution[MOST_PREPARED];
    struct stretch stretch = {0};
    const int rings = dim == 2 && e->config.axisymmetric;
    vd of_cell[GR_CELL_STRESS + 6], stress[6], of_rings = v_zero(), filled = v_zero();
    gr_frame_of(dim, GR_LINEAR, 0, e, first, &frame);
    for (int q = 0; q < GR_CELL_STRESS + stresses; q++) of_cell[q] = v_zero();
    for (int done = 0; !stretch.ends; done += stretch.n) {
        stretch = next_stretch(part, done, most);
        for (int i = 0; i < stretch.n; i++) {
            const int64_t at = gr_slot(&e->mesh.cell[first], done + i);
            prepare_momentum(dim, GR_LINEAR, affine, e, &frame, at, &contribution[i]);
            const vd m = contribution[i].m;
            of_cell[GR_CELL_MC] = v_fma(m, component(e, GR_FIELD_log_density, 0, at), of_cell[GR_CELL_MC]);
            acting_stress(dim, e, at, stress);
            for (int q = 0; q < stresses; q++) {
                const int c = dim == 2 && q == 2 ? 3 : q; /* zz makes no force but in rings */
                of_cell[GR_CELL_STRESS + q] = v_fma(m, stress[c], of_cell[GR_CELL_STRESS + q]);
            }
            if (rings) of_rings = v_fma(m, stress[2], of_rings);
            if (e->config.largest.damping_rate > 0)
                of_cell[GR_CELL_M_RATE] = v_fma(m, component(e, GR_FIELD_shear_rate, 0, at), of_cell[GR_CELL_M_RATE]);
            if (__builtin_expect(e->own_volumes, 0)) filled = filled + prepare_own_volume(dim, e, at, &contribution[i]);
        }
        add_rows(dim, GR_LINEAR, affine, MOMENTUM | MASSES, &frame, contribution, stretch, 0, pass);
        if (__builtin_expect(e->own_volumes, 0))
            add_rows(dim, GR_LINEAR, 0, VOLUME, &frame, contribution, stretch, 0, volume);
    }
    if (__builtin_expect(e->own_volumes, 0)) v_store(gr_cell_sums(e, first, own_volume_of_cell(dim)), filled);
    for (int q = 0; q < GR_CELL_STRESS + stresses; q++) v_store(gr_cell_sums(e, first, q), of_cell[q]);
    if (rings) v_store(gr_cell_sums(e, first, GR_CELL_STRESS + stresses), of_rings);
}

/* P2G of the points of a tile, or of parts of it. The forces follow. */
GR_INLINE void p2g_averaged(const int dim, const int affine, struct gr_engine *e, int64_t tile, const struct gr_parts parts)
{
    struct pass pass, volume;
    if (is_empty_tile(e, tile, parts)) {
        clear_sums(e, tile);
        return;
    }
    begin_pass(e, GR_SUMS_OF_MOTION, tile, 0, &pass);
    begin_pass(e, GR_SUMS_OF_VOLUME, tile, 0, &volume); /* always, or compilers warn of what is not set */
    pass.masses = gr_cell_sums(e, tile * GR_LANES, GR_CELL_AVERAGED_SUMS(dim));
    GR_EACH_PART (part, parts) p2g_averaged_cells(dim, affine, e, tile, part, &pass, &volume);
    store_ends(2, 1 << (dim - 1), &pass, 0, GR_SUM_FORCE(dim));
    if (e->own_volumes) store_ends(2, 1 << (dim - 1), &volume, 0, GR_VOLUME_SUMS);
}

/* The masses that the cells from `first` on bring to their node i. */
GR_INLINE vd own_mass(const int dim, const struct gr_engine *e, int64_t first, int i)
{
    return v_load(gr_cell_sums(e, first, GR_CELL_AVERAGED_SUMS(dim) + i));
}

/* State of the cells from `first` on before their forces, from their sums and the masses of their nodes: w (`inside`), ln
 * phi (as 2 (phi - 1)/(phi + 1)), c, the quadrature point, the over-compression sum max(0, m_i/rho_c - V_i) B_i dx, and
 * the excess of mass. Only cells with points have a state; for their neighbours the others count as disconnected.
 * Returned: the damping of their points, from the mean of the plastic shear rate. */
GR_INLINE vd store_state(const int dim, struct gr_engine *e, int64_t first, vm has)
{
    const int K = 1 << dim;
    const vd per_cell = v_set(e->mass_scale), one = v_set(1.0);
    vd M = v_zero(), mass = v_zero(), volume = v_zero(), high[3] = {v_zero(), v_zero(), v_zero()}, over[8], at[3];
    vd lightest = one, centre[3];
    const vd open = open_parts(dim, e, first, centre);
    const double *const content = e->own_volumes ? e->nodes.filled : e->nodes.mass;
    for (int i = 0; i < K; i++) {
        const vd m = at_nodes(e, content, first, i) * per_cell, V = at_nodes(e, e->mesh.node_volume, first, i);
        const vd part = own_mass(dim, e, first, i);
        M = M + part;
        mass = mass + m;
        volume = volume + V;
        lightest = v_min(m / V, lightest); /* the latter if V = 0 */
        over[i] = v_max(m - V, v_zero());
        for (int d = 0; d < dim; d++)
            if (i >> d & 1) high[d] = high[d] + part;
    }
    const vd inverse = one / v_select(has, M, one);
    vd filled = (e->own_volumes ? v_load(gr_cell_sums(e, first, own_volume_of_cell(dim))) : M) * per_cell;
    if (dim == 2 && e->config.axisymmetric) {
        const vd ring = one / GR_OF_CELLS(e, first, 0, radius);
        filled = filled * ring;
        for (int i = 0; i < K; i++) over[i] = over[i] * ring;
    }
    const vd inside = v_min(between(LIGHT_BELOW, LIGHT_UNTIL, lightest), between(SURFACE_BELOW, INSIDE_FROM, mass / volume));
    const vd c = v_load(gr_cell_sums(e, first, GR_CELL_MC)) * inverse;
    v_store(average_of(e, GR_AVERAGE_INSIDE, first), v_keep(has, inside)); /* a node on an axis may have no volume */
    v_store(average_of(e, GR_AVERAGE_LOG_PHI, first),
            v_set(2.0) * (mass - volume) / (mass + volume) - v_set(e->servo_strain));
    v_store(average_of(e, GR_AVERAGE_C, first), v_select(has, c, v_set(EMPTY)));
    store_filling(e, first, filled, v_keep(has, excess_of(filled, open, inside)));
    v_store(average_of(e, GR_AVERAGE_OPEN, first), open);
    for (int d = 0; d < dim; d++) {
        at[d] = v_select(has, v_fma(one - inside, high[d] * inverse, inside * centre[d]), centre[d]);
        v_store(average_of(e, GR_AVERAGE_AT + d, first), at[d]);
    }
    for (int d = 0; d < dim; d++) {
        vd gradient = v_zero();
        for (int i = 0; i < K; i++) gradient = v_fma(over[i], slope_at(dim, at, i, d), gradient);
        v_store(average_of(e, GR_AVERAGE_OVER_COMPRESSION(dim) + d, first), gradient);
    }
    if (!(e->config.largest.damping_rate > 0)) return v_zero();
    return v_keep(has, damped_share(e, v_load(gr_cell_sums(e, first, GR_CELL_M_RATE)) * inverse, c, first));
}

/* Volume that a cell represents, over dx^dim, if the node masses bear it, else as much as they bear:
 *
 *   A = w V + (1 - w) min(V, M/(rho_c dx^dim)),   A sum |B_i dx|^2/m_i <= STIFFEST,
 *
 * with V the volume of the cell outside of bodies, over dx^dim, and m_i the part of the mass of node i that the cell brings,
 * or its share of the volume inside the material, over rho_c dx^dim; in rings V and A are over the volume of a whole ring. The
 * square of the frequency of all cells together is not above the largest of the cells one by one (Irons & Treharne 1971).
 * Inside the material all nodes are heavy enough, except in cells that the surface of a body cuts: a node within it may be
 * full and yet have next to no mass. */
GR_INLINE vd represented_volume(const int dim, const struct gr_engine *e, int64_t first, const vd at[3])
{
    const int K = 1 << dim;
    const vd one = v_set(1.0), w = v_load(average_of(e, GR_AVERAGE_INSIDE, first));
    const vd open = v_load(average_of(e, GR_AVERAGE_OPEN, first));
    const vd volume = v_fma(one - w, v_min(open, v_load(average_of(e, GR_AVERAGE_FILLED, first))), w * open);
    const vm at_surface = v_gt(one, v_min(w, open));
    const int rings = dim == 2 && e->config.axisymmetric;
    const vd radius = rings ? GR_OF_CELLS(e, first, 0, radius) : one;
    vd stiffness = v_zero();
    if (!m_bits(at_surface)) return volume;
    for (int i = 0; i < K; i++) {
        vd shared = w * at_nodes(e, e->nodes.mass, first, i) / (v_set(K) * free_volumes(e, first, i));
        vd square = v_zero();
        for (int d = 0; d < dim; d++) {
            vd slope = slope_at(dim, at, i, d);
            if (rings && d == 0) slope = slope + hoop_at(e, first, at, i);
            square = v_fma(slope, slope, square);
        }
        if (rings) shared = shared * radius, square = square * radius;
        stiffness =
            stiffness + square / v_fma(v_set(e->mass_scale), v_max(shared, own_mass(dim, e, first, i)), v_set(GR_NOTHING));
    }
    const vm too_stiff = m_and(at_surface, v_gt(volume * stiffness, v_set(STIFFEST)));
    return v_select(too_stiff, v_set(STIFFEST) / stiffness, volume);
}

/* State of GR_W cells of a tile, and their forces on their nodes, which conserve momentum and angular momentum:
 *
 *   f_i = -A sigma B_i,   A: represented_volume. */
GR_INLINE void forces_of_cells(const int dim, struct gr_engine *e, int64_t tile, int part, struct pass *pass)
{
    static const int place[2][3][3] = {{{0, 2, 5}, {2, 1, 4}, {5, 4, 3}}, {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}}};
    const int stresses = dim == 2 ? 3 : 6, width = pass->rows->width;
    const int64_t first = tile * GR_LANES + part * GR_W;
    const vm has = occupied(e, first);
    vd at[3], stress[6];
    const vd damped = store_state(dim, e, first, has);
    for (int d = 0; d < dim; d++) at[d] = v_load(average_of(e, GR_AVERAGE_AT + d, first));
    const int rings = dim == 2 && e->config.axisymmetric;
    /* A/(dx M), by mass_scale = 1/(rho_c dx^dim) and -1/(rho_c dx) */
    vd mass = v_load(average_of(e, GR_AVERAGE_FILLED, first));
    if (__builtin_expect(e->own_volumes, 0)) { /* that is not the content, in which a whole ring counts as one cell */
        mass = v_zero();
        for (int i = 0; i < 1 << dim; i++) mass = v_fma(v_set(e->mass_scale), own_mass(dim, e, first, i), mass);
        if (rings) mass = mass / GR_OF_CELLS(e, first, 0, radius);
    }
    const vd area = v_keep(has, represented_volume(dim, e, first, at) *
                                    v_set(e->material_number[GR_MATERIAL_FORCE_SCALE][0]) / v_select(has, mass, v_set(1.0)));
    for (int q = 0; q < stresses; q++) stress[q] = v_keep(has, v_load(gr_cell_sums(e, first, GR_CELL_STRESS + q)));
    const vd of_rings = rings ? v_keep(has, v_load(gr_cell_sums(e, first, GR_CELL_STRESS + stresses))) : v_zero();
    for (int row = 0; row < 1 << (dim - 1); row++) {
        for (int d = 0; d < dim; d++) {
            vd force[2];
            for (int a = 0; a < 2; a++) {
                vd sum = v_zero();
                for (int j = 0; j < dim; j++)
                    sum = v_fma(stress[place[dim - 2][d][j]], slope_at(dim, at, 2 * row + a, j), sum);
                if (rings && d == 0) sum = v_fma(of_rings, hoop_at(e, first, at, 2 * row + a), sum);
                force[a] = v_keep(has, area * sum);
            }
            store_lanes(2, pass, part, row * width + GR_SUM_FORCE(dim) + d, force[0], force[1], force[1]);
        }
        const vd left = damped * own_mass(dim, e, first, 2 * row), right = damped * own_mass(dim, e, first, 2 * row + 1);
        store_lanes(2, pass, part, row * width + GR_SUM_DAMPED(dim), left, right, right);
    }
}

/* The same for a tile, or for parts of it; without points all sums are zero. */
GR_INLINE void apply_forces_of_tile(const int dim, struct gr_engine *e, int64_t tile, const struct gr_parts parts)
{
    struct pass pass;
    begin_pass(e, GR_SUMS_OF_MOTION, tile, 0, &pass);
    if (is_empty_tile(e, tile, parts)) {
        for (int64_t first = tile * GR_LANES; first < (tile + 1) * GR_LANES; first += GR_W) {
            v_store(average_of(e, GR_AVERAGE_C, first), v_set(EMPTY));
            v_store(average_of(e, GR_AVERAGE_EXCESS, first), v_zero());
        }
        return;
    }
    GR_EACH_PART (part, parts) forces_of_cells(dim, e, tile, part, &pass);
    store_ends(2, 1 << (dim - 1), &pass, GR_SUM_FORCE(dim), GR_SUM_DAMPED(dim) + 1);
}

/* The second difference of the density of the cells from `first` on, (c- - 2 c + c+)/4, as a mean over the axes. It sees
 * what alternates from cell to cell (checkerboard), as the nodes do not, and vanishes for a linear field; disconnected
 * cells take no part in it. */
GR_INLINE vd second_difference(const int dim, const struct gr_engine *e, int64_t first)
{
    const double *const c_of = average_of(e, GR_AVERAGE_C, 0);
    const vd reach = v_set(e->material_number[GR_MATERIAL_SEPARATION][0]), own_c = v_load(c_of + first);
    vd sum = v_zero();
    for (int d = 0; d < dim; d++) {
        vd c[2];
        for (int high = 0; high < 2; high++) {
            double near_c[GR_W];
            for (int l = 0; l < GR_W; l++) {
                const int64_t neighbour = e->mesh.neighbour[(first + l) * 2 * dim + 2 * d + high];
                near_c[l] = neighbour < 0 ? EMPTY : c_of[neighbour];
            }
            c[high] = v_load(near_c);
        }
        const vm all = m_and(v_ge(own_c, reach), m_and(v_ge(c[0], reach), v_ge(c[1], reach)));
        sum = sum + v_keep(all, c[0] - v_set(2.0) * own_c + c[1]);
    }
    return sum * v_set(1.0 / (4 * dim));
}

/* Shift of the points of cells along each axis at their low and high faces, m; linear between them.
 *
 *   delta = -beta gdot dt dx over_compression,             |delta| <= min(limit dx, gdot dt dx/2),
 *         + shift_at_face for the strain r dt,             r = 2 |L_dd|; |delta| <= min(limit dx, r dt dx).
 *
 * The first is seen by the nodes, without the noise of single cells; the second carries points out of cells that have
 * too many into neighbours that have too few. It is stretching along an axis that makes cells uneven along it, r = gdot
 * in a plane flow; layers in simple shear are left alone. Nothing goes through a wall. */
GR_INLINE void shift_of_cells(const int dim, const struct gr_engine *e, int64_t first, const struct gr_wall_cells *walls,
                              const vd *L, vd rate, vd shift[3][2])
{
    const struct gr_density_numbers *q = &e->config.density;
    const vd dx = v_set(e->config.dx), limit = v_keep(walls->shifts, v_set(q->shifting_limit)), zero = v_zero();
    const vd most = v_min(limit, v_set(0.5) * rate);
    vd over[3], drop[3][2], length = zero, scale = v_set(q->shifting) * rate;
    for (int d = 0; d < dim; d++) {
        over[d] = v_load(average_of(e, GR_AVERAGE_OVER_COMPRESSION(dim) + d, first));
        length = v_fma(over[d], over[d], length);
    }
    face_drops(dim, 0, e, first, ONE_POINT, drop);
    const vm far = v_gt(scale * scale * length, most * most);
    if (m_bits(far)) scale = v_select(far, most / v_sqrt(v_max(length, v_set(GR_NOTHING))), scale);
    for (int d = 0; d < dim; d++) {
        const vd along = v_set(2.0) * v_abs(L[d * dim + d]), most_of_face = v_min(limit, along);
        for (int high = 0; high < 2; high++) {
            vd all = -scale * over[d];
            if (walls->any) {
                const vm wall = walls->wall[d][high];
                all = high ? v_select(wall, v_min(all, zero), all) : v_select(wall, v_max(all, zero), all);
            }
            shift[d][high] = dx * (all + shift_at_face(q, along, drop[d][high], most_of_face));
        }
    }
}

/* Update of the cells from `first` on in a step, the same for all points of a cell: L dt, the log-density after the step,
 * the shift, m.
 *
 *   c <- c - dt tr L + eta (second difference of c),   eta: averaged_share;
 *   c += relaxation to ln phi, see relax_to_nodal_density. If it lowers c, only the share w of it, and nothing if the
 *        cell is disconnected already.
 * Given: dt v/dx at the nodes, component by component. */
GR_INLINE vd flow_of_cells(const int dim, const struct gr_engine *e, int64_t first, const struct gr_wall_cells *walls,
                           const vd *v, vd *L, vd shift[3][2])
{
    const struct gr_density_numbers *q = &e->config.density;
    const int K = 1 << dim;
    const vd mean = v_load(average_of(e, GR_AVERAGE_C, first)), zero = v_zero();
    vd at[3], trace = zero;
    for (int d = 0; d < dim; d++) at[d] = v_load(average_of(e, GR_AVERAGE_AT + d, first));
    for (int k = 0; k < (dim == 2 ? 5 : 9); k++) L[k] = zero; /* in 2D the last is the one out of the plane */
    for (int i = 0; i < K; i++)
        for (int j = 0; j < dim; j++) {
            const vd slope = slope_at(dim, at, i, j);
            for (int d = 0; d < dim; d++) L[d * dim + j] = v_fma(v[d * K + i], slope, L[d * dim + j]);
        }
    for (int d = 0; d < dim; d++) trace = trace + L[d * dim + d];
    if (dim == 2 && e->config.axisymmetric) {
        for (int i = 0; i < K; i++) L[4] = v_fma(v[i], hoop_at(e, first, at, i), L[4]);
        trace = trace + L[4];
    }
    const vd rate = kinematic_rate(dim, L), origin = v_set(e->material_number[GR_MATERIAL_ORIGIN][0]),
             eta = averaged_share(e, e->clock.dt, rate, mean - origin);
    vd c = v_fma(eta, second_difference(dim, e, first), mean - trace);
    c = c + v_keep(v_ge(mean, v_set(e->material_number[GR_MATERIAL_SEPARATION][0])), v_set(e->servo_shift));
    const vd gap = v_load(average_of(e, GR_AVERAGE_LOG_PHI, first)) - c;
    const vd relaxed = relax_to_nodal_density(q, e->clock.dt, rate, gap);
    const vd raised = c + relaxed, lowered = v_fma(v_load(average_of(e, GR_AVERAGE_INSIDE, first)), relaxed, c);
    c = v_select(v_gt(zero, gap), v_select(v_ge(c, origin), lowered, c), v_select(v_gt(gap, zero), raised, c));
    shift_of_cells(dim, e, first, walls, L, rate, shift);
    return v_keep(occupied(e, first), c); /* spare slots have finite numbers */
}
