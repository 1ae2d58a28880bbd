/* Cells of the fluidity grid at bodies (fluidity_bodies.h). */
#include "mpm/fluidity_bodies.h"

#include "mpm/migrate.h"
#include "mpm/pose.h"
#include "mpm/thin_bodies.h"

/* The rough bodies at their present poses. */
struct rough_bodies {
    const struct gr_engine *e;
    int n;
    struct gr_pose pose[GR_MAX_BODIES];
};

static void list_rough(const struct gr_engine *e, struct rough_bodies *rough)
{
    rough->e = e;
    rough->n = 0;
    for (int b = 0; b < e->config.n_bodies; b++)
        if (e->config.bodies[b].rough)
            gr_pose_at(e, b, e->bodies.now[b].x, e->bodies.now[b].orientation, &rough->pose[rough->n++]);
}

/* Distance of x from the surface of a body without the part `skipped`; a bound of it where the body is far. */
static double distance_from(const struct gr_engine *e, const struct gr_pose *pose, const double x[3], int skipped)
{
    const struct gr_body *body = pose->body;
    double r[3] = {0}, at[3], normal[3], nearest = INFINITY, square = 0;
    for (int d = 0; d < e->config.dim; d++) r[d] = gr_pose_arm(pose, x[d], d), square += r[d] * r[d];
    const double away = sqrt(square) - body->bound;
    if (away > e->config.dx) return away;
    gr_pose_in_body(pose, r, at);
    for (int k = 0; k < body->n_parts; k++)
        if (body->first_part + k != skipped) nearest = fmin(nearest, gr_part_distance(&pose->parts[k], at, normal));
    return nearest;
}

/* Distance of x from the surfaces of all rough bodies, for a copy of a cell; `side` is its side of thin bodies, 1 or -1,
 * or 0 for a cell without copies. */
static double distance(const struct rough_bodies *rough, const double x[3], int side)
{
    const struct gr_engine *e = rough->e;
    struct gr_facing thin;
    double nearest = INFINITY;
    int skipped = -1;
    if (side) {
        gr_nearest_thin(e, x, 1, &thin);
        if (thin.facing) skipped = thin.part;
        if (thin.facing && e->config.bodies[thin.body].rough) nearest = side * thin.mid - thin.half;
    }
    for (int k = 0; k < rough->n; k++) nearest = fmin(nearest, distance_from(e, &rough->pose[k], x, skipped));
    return nearest;
}

/* The middle of the points that share the fluidity of a cell, by mass; its centre without points. */
static void middle_of_points(const struct gr_engine *e, const struct gr_cell *cell, double x[3])
{
    double mass = 0, moment[3] = {0};
    GR_EACH_OF_FLUIDITY(e, cell, side)
    for (int32_t k = 0; k < side->count; k++) {
        const int64_t s = gr_slot(side, k);
        const double m = gr_number(e, GR_FIELD_mass, 0, s);
        mass += m;
        for (int d = 0; d < e->config.dim; d++) moment[d] += m * gr_x(e, d)[s];
    }
    for (int d = 0; d < e->config.dim && mass > 0; d++) x[d] = moment[d] / mass;
}

/* Set the distances of the copy of a cell in a slot, and of its neighbours that may be border cells. */
static void set_distances(const struct rough_bodies *rough, const struct gr_cell *cell, int64_t i, int side)
{
    const struct gr_engine *e = rough->e;
    struct gr_fluidity *f = e->nonlocal.fluidity;
    const double dx = e->config.dx, reach = sqrt(e->config.dim) * dx; /* of a link at most */
    const int64_t id = gr_cell_id(e, cell->at);
    double x[3], middle[3];
    gr_cell_position(e, cell->at, x);
    const double here = distance(rough, x, side);
    memcpy(middle, x, sizeof x);
    if (here < 0.5 * dx) middle_of_points(e, cell, middle);
    gr_fluidity_set_distance(f, i, here, here < 0.5 * dx ? distance(rough, middle, side) : here);
    for (int k = 0; k < 2 * f->n_links && here < 0.5 * dx + reach; k++) {
        const int8_t *link = f->offset[k / 2];
        const int sign = k % 2 ? 1 : -1, offset[3] = {sign * link[0], sign * link[1], sign * link[2]};
        const int64_t to = gr_fluidity_reach(f, id, offset);
        double there[3];
        for (int d = 0; d < 3; d++) there[d] = x[d] + offset[d] * dx;
        if (to >= 0 && to != id) gr_fluidity_set_link(f, i, k, distance(rough, there, side));
    }
}

/* Set the gr_inside bits of the two copies of a double cell. They are separated if its centre faces the thin part. */
static void mark_copies(const struct gr_facing *side, uint8_t *front, uint8_t *back)
{
    if (side->facing) {
        *front = GR_SEPARATED;
        *back = GR_SEPARATED | GR_BEHIND;
    } else {
        *front = side->mid < 0 ? GR_BEHIND : 0;
        *back = GR_HIDDEN;
    }
}

void gr_bodies_mark(struct gr_engine *e, int64_t first, int64_t last)
{
    struct gr_fluidity *f = e->nonlocal.fluidity;
    struct rough_bodies rough;
    list_rough(e, &rough);
    for (int64_t c = first; c < last && c < e->mesh.n_cells; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        struct gr_facing side = {0};
        double x[3];
        if (cell->side == GR_BACK) continue; /* set with its front */
        const int is_double = cell->side == GR_FRONT;
        const int64_t front = e->mesh.place[c], back = is_double ? e->mesh.place[e->mesh.other[c]] : -1;
        f->inside[front] = cell->side < 0 ? GR_BEHIND : 0;
        if (is_double) {
            gr_cell_position(e, cell->at, x);
            gr_nearest_thin(e, x, 1, &side);
            mark_copies(&side, &f->inside[front], &f->inside[back]);
        }
        if (!rough.n) continue;
        set_distances(&rough, cell, front, !is_double ? 0 : side.facing || side.mid >= 0 ? 1 : -1);
        if (side.facing) set_distances(&rough, gr_other_side(e, cell), back, -1);
    }
}
