/* Contact points of the material with the surfaces of bodies (feet.h). */
#include "mpm/feet.h"

#include <stdlib.h>

#include "core/memory.h"
#include "mpm/edges.h"
#include "mpm/foot_support.h"
#include "mpm/lever.h"
#include "mpm/migrate.h"
#include "mpm/moving.h"
#include "mpm/of_material.h"
#include "mpm/pose.h"
#include "mpm/sleep.h"
#include "mpm/thin_bodies.h"
#include "mpm/walls.h"

/* Distances in cells: a point has its foot nearer than this, at Courant numbers up to 1/2; bodies may move so far before
 * the cells near them are listed again. */
#define REACH 1.5
#define FOLLOW 0.5

/* Distances between samples are linear, so that they may change by a little more than the place does: by less than this, in
 * cells, in half of a cell. */
#define ROUNDED 0.1

/* Points deeper in a body than this, in cells, were there from the beginning: the surface does not act on them. */
#define DEEP 0.5

/* Points that have slipped in at an edge by more than DEEPEST, and less than LOST, are moved out, in cells, by at most OUT
 * in so many steps. */
#define DEEPEST 0.1
#define LOST 1.5
#define OUT 0.1
enum { OUT_INTERVAL = 8 };

/* Surfaces that hold material whatever its velocity do so up to this distance, over r: rows of points lie at r, and noise
 * must not decide. */
#define HOLD 1.5

/* A foot acts if the mean mass of the nodes about it, over that of a full cell, is more than this. */
#define LEAST_FILLING 0.1

/* The surface of another foot of a point bars a direction along the surface of a foot if its normal is nearer to this
 * direction than to the normal of the foot: the sine of the angle between the normals is more than this. */
#define BARRED 0.7071

/* At a convex edge a foot gives at most this many times the normal stress of its point times the area of a point on the
 * surface. This bears what presses on the edge. The weight of the material that falls past it, which the shape functions
 * reach, needs more. In a fluid points get 0.1 cells deep into the edges of a box with 1, and not at all with 2, but a
 * hopper of 30 degrees 8 cells wide discharges 1 % less with 1 and 6 % less with 2. A slot in a flat floor discharges alike
 * with either, 2 % less with 4, and 28 % less without a bound. */
#define EDGE_STRESS 1.0

int gr_feet_new(struct gr_engine *e)
{
    e->feet = calloc(1, sizeof *e->feet);
    if (!e->feet) return GR_ERR_MEMORY;
    e->feet->pose = calloc((size_t)e->config.n_bodies, sizeof *e->feet->pose);
    return e->feet->pose ? GR_OK : GR_ERR_MEMORY;
}

void gr_feet_free(struct gr_feet *feet)
{
    if (!feet) return;
    free(feet->foot);
    free(feet->node);
    free(feet->origin);
    free(feet->number);
    free(feet->near);
    free(feet->bodies);
    free(feet->clearance);
    free(feet->begin);
    free(feet->pose);
    free(feet);
}

/* Signed distance of a point of a cell from a body, and the normal in axes of the scene. Points of double cells stay on
 * their side of a thin body, however deep they are. */
static double distance_on_side(const struct gr_engine *e, const struct gr_cell *cell, int b, const struct gr_pose *pose,
                               const double x[3], double arm[3], double normal[3])
{
    struct gr_facing side;
    const double phi = gr_pose_distance(e, pose, x, arm, normal);
    if (!e->n_thin || !GR_IS_DOUBLE(cell)) return phi;
    gr_nearest_thin(e, x, 1, &side);
    if (side.body != b || !side.facing) return phi;
    for (int d = 0; d < 3; d++) normal[d] = cell->side * side.normal[d];
    return cell->side * side.mid - side.half;
}

static int reserve(struct gr_engine *e)
{
    struct gr_feet *feet = e->feet;
    int64_t most = 0;
    for (int64_t k = 0; k < feet->n_near; k++) {
        feet->begin[k] = most;
        most += (int64_t)e->mesh.cell[feet->near[k]].capacity * __builtin_popcountll(feet->bodies[k]);
    }
    if (most > feet->capacity) {
        feet->capacity = 0;
        GR_RESIZE(feet->foot, most + most / 2);
        feet->capacity = most + most / 2;
    }
    if (e->mesh.n_nodes > feet->node_capacity) {
        const int64_t n = e->mesh.node_capacity;
        feet->node_capacity = 0;
        GR_RESIZE(feet->node, n);
        GR_RESIZE(feet->origin, n);
        GR_RESIZE(feet->number, n);
        memset(feet->number, 0, sizeof *feet->number * (size_t)n);
        feet->node_capacity = n;
    }
    return GR_OK;
}

int gr_feet_list(struct gr_engine *e)
{
    struct gr_feet *feet = e->feet;
    const double dx = e->config.dx, near = (REACH + FOLLOW + 0.5 * sqrt(e->config.dim)) * dx;
    struct gr_pose pose[GR_MAX_BODIES];
    int moved = !feet->listed;
    for (int b = 0; b < e->config.n_bodies && !moved; b++) moved = gr_body_moved(e, b, &feet->pose[b]) > FOLLOW * dx;
    if (!moved) return GR_OK;
    if (e->mesh.n_cells > feet->near_capacity) {
        feet->near_capacity = 0;
        GR_RESIZE(feet->near, e->mesh.cell_capacity);
        GR_RESIZE(feet->bodies, e->mesh.cell_capacity);
        GR_RESIZE(feet->clearance, e->mesh.cell_capacity);
        GR_RESIZE(feet->begin, e->mesh.cell_capacity);
        feet->near_capacity = e->mesh.cell_capacity;
    }
    for (int b = 0; b < e->config.n_bodies; b++) {
        memcpy(feet->pose[b].x, e->body[b].x, sizeof feet->pose[b].x);
        memcpy(feet->pose[b].orientation, e->body[b].orientation, sizeof feet->pose[b].orientation);
        gr_pose_at(e, b, e->body[b].x, e->body[b].orientation, &pose[b]);
    }
    feet->n_near = 0;
    for (int64_t c = 0; c < e->mesh.n_cells; c++) {
        uint64_t bodies = 0;
        double x[3], arm[3], normal[3], least = INFINITY;
        gr_cell_position(e, e->mesh.cell[c].at, x);
        for (int b = 0; b < e->config.n_bodies; b++) {
            const double phi = gr_pose_distance(e, &pose[b], x, arm, normal);
            if (phi < near) bodies |= (uint64_t)1 << b;
            least = fmin(least, phi);
        }
        if (!bodies) continue;
        feet->near[feet->n_near] = c;
        feet->clearance[feet->n_near] = least;
        feet->bodies[feet->n_near++] = bodies;
    }
    feet->listed = 1;
    if (e->sleep) e->sleep->changed = 1;
    return reserve(e);
}

/* Distance by which the surface of a body has moved at most since the cells were listed. */
static double moved_since(const struct gr_engine *e)
{
    double moved = 0;
    for (int b = 0; b < e->config.n_bodies; b++) moved = fmax(moved, gr_body_moved(e, b, &e->feet->pose[b]));
    return moved;
}

/* What the centre of a cell tells of the distance of its points from the bodies. */
struct about {
    double centre[3], distance;
};

/* Look about the cell number k of the list, when the bodies have moved. */
static struct about look_about(const struct gr_engine *e, int64_t k, double moved)
{
    const struct gr_cell *cell = &e->mesh.cell[e->feet->near[k]];
    struct about about = {.distance = e->feet->clearance[k] - moved - ROUNDED * e->config.dx};
    if (e->n_thin && GR_IS_DOUBLE(cell)) about.distance = -INFINITY; /* distances are those from the faces of sides */
    gr_cell_position(e, cell->at, about.centre);
    return about;
}

/* True if x is farther than `reach` from the bodies. As it saves the distance itself where there is no contact, it does not
 * bear on the results. */
static int is_far(const struct about *about, const double x[3], double reach)
{
    double square = 0;
    for (int d = 0; d < 3; d++) square += (x[d] - about->centre[d]) * (x[d] - about->centre[d]);
    return about->distance > reach && square < (about->distance - reach) * (about->distance - reach);
}

/* Half the spacing of points of a volume, given as the mass of as much of the first material, m. */
static double half_spacing(const struct gr_engine *e, double filled)
{
    const double filling = filled * e->mass_scale;
    return 0.5 * e->config.dx * (e->config.dim == 2 ? sqrt(filling) : cbrt(filling));
}

/* Distance within which bodies may act on the point at `place` with half the spacing r, if they are not faster than `speed`
 * and gravity gives no more than `fall`, m/s, in two steps. */
static double reach_of(const struct gr_engine *e, int64_t place, double r, double speed, double fall)
{
    return HOLD * r + 2 * e->dt * (sqrt(gr_speed_squared(e, place)) + speed + fall);
}

/* Largest impulse of a foot of the point at `place` with half the spacing r, where the normal of the surface is n. The viscous
 * stress of damping is left out: it is small beside what EDGE_STRESS is uncertain by. */
static double most_at_edge(const struct gr_engine *e, int64_t place, double r, const double n[3])
{
    const double area = e->config.dim == 2 ? 2 * r : 4 * r * r;
    double stress[6] = {0}, tension = 0;
    for (int c = 0; c < gr_field_components(GR_FIELD_stress, e->config.dim); c++)
        stress[c] = gr_number(e, GR_FIELD_stress, c, place);
    for (int d = 0; d < e->config.dim; d++) tension += n[d] * n[d] * stress[d];
    tension += 2 * n[0] * n[1] * stress[3];
    if (e->config.dim == 3) tension += 2 * n[2] * (n[1] * stress[4] + n[0] * stress[5]);
    return EDGE_STRESS * fmax(-tension, 0) * area * e->dt;
}

/* Find the foot of the point at `place`, with half the spacing r, on a body.
 * All: the poses of the bodies. Returned: whether it has one. */
static int find_foot(const struct gr_engine *e, const struct gr_cell *cell, int64_t place, int b, const struct gr_pose *all,
                     double r, double fall, struct gr_foot *foot)
{
    const struct gr_pose *pose = &all[b];
    const int dim = e->config.dim;
    const int separating = pose->body->contact == GR_CONTACT_SEPARATING;
    double x[3] = {0}, at[3], into = 0;
    for (int d = 0; d < dim; d++) x[d] = gr_x(e, d)[place];
    const double phi = distance_on_side(e, cell, b, pose, x, foot->arm, foot->normal);
    if (phi > REACH * e->config.dx) return 0;
    if (phi < -DEEP * e->config.dx) return 0;
    if (separating && !(phi < r)) {
        const double *w = e->body[b].omega, *arm = foot->arm;
        for (int d = 0; d < dim; d++) {
            const double turning = w[(d + 1) % 3] * arm[(d + 2) % 3] - w[(d + 2) % 3] * arm[(d + 1) % 3];
            into += (gr_number(e, GR_FIELD_v, d, place) - e->body[b].v[d] - turning) * foot->normal[d];
        }
    }
    if (!(phi < r) && (separating ? !(phi + 2 * e->dt * (into - fall) < r) : !(phi < HOLD * r))) return 0;
    foot->body = b;
    foot->at_edge = 0;
    foot->bound = separating && phi > r ? (r - phi) / e->dt : 0;
    foot->most = gr_number(e, GR_FIELD_mass, 0, place) * e->config.wave_speed;
    foot->place = place;
    for (int d = 0; d < 3; d++) at[d] = x[d] - phi * foot->normal[d];
    if (gr_is_at_edge(e, pose, at, foot->normal)) {
        if (gr_edge_is_covered(e, all, b, x, at, foot->normal)) return 0;
        foot->most = fmin(foot->most, most_at_edge(e, place, r, foot->normal));
        if (!(foot->most > 0)) return 0;
        foot->at_edge = 1;
    }
    if (gr_foot_support(e, at, cell->side, LEAST_FILLING, foot)) {
        for (int d = 0; d < 3; d++) foot->arm[d] -= phi * foot->normal[d];
    } else if (!gr_foot_support(e, x, cell->side, 0, foot)) {
        return 0;
    }
    if (pose->body->turns) gr_foot_lever(e, pose, foot);
    return 1;
}

/* Let the feet of a point at edges share the stress that bounds them: bodies may have an edge in common. */
static void share_stress(int n, struct gr_foot *foot)
{
    int edges = 0;
    for (int k = 0; k < n; k++) edges += foot[k].at_edge;
    for (int k = 0; k < n; k++)
        if (foot[k].at_edge) foot[k].most /= edges;
}

/* In a corner, where a point has several feet, find the directions along the surface of each that the others bar. Friction
 * there and what presses on the other surface would hold the same nodes twice, at places a fraction of a cell apart: they
 * would pull against each other more and more, up to the bound of impulses, and then throw the points of the corner. */
static void find_barred(const struct gr_engine *e, int n, struct gr_foot *foot)
{
    for (int k = 0; k < n; k++) {
        struct gr_foot *f = &foot[k];
        f->n_barred = 0;
        for (int l = 0; l < n && f->n_barred < e->config.dim - 1; l++) {
            double *a = f->barred[f->n_barred], square = 0;
            memcpy(a, foot[l].normal, sizeof foot[l].normal);
            gr_take_away(a, f->normal);
            for (int m = 0; m < f->n_barred; m++) gr_take_away(a, f->barred[m]);
            for (int d = 0; d < 3; d++) square += a[d] * a[d];
            if (!(square > BARRED * BARRED)) continue;
            for (int d = 0; d < 3; d++) a[d] /= sqrt(square);
            f->n_barred++;
        }
    }
}

/* Start the impulses of the n feet of a point, which together gave it its force: each in turn takes what lies along its
 * normal, and the one with the most friction what is left along its surface. */
static void start_from_force(const struct gr_engine *e, int n, struct gr_foot *foot)
{
    double rest[3] = {0}, most = -1;
    int holding = 0;
    for (int d = 0; d < e->config.dim; d++) rest[d] = e->dt * gr_number(e, GR_FIELD_contact_force, d, foot->place);
    for (int k = 0; k < n; k++) {
        const struct gr_body *body = &e->config.bodies[foot[k].body];
        double pressing = 0;
        for (int d = 0; d < 3; d++) pressing += rest[d] * foot[k].normal[d];
        if (body->contact == GR_CONTACT_SEPARATING) pressing = fmax(pressing, 0);
        pressing = fmin(fmax(pressing, -foot[k].most), foot[k].most);
        for (int d = 0; d < 3; d++) rest[d] -= foot[k].impulse[d] = pressing * foot[k].normal[d];
        foot[k].pressing = pressing;
        const double friction = body->contact == GR_CONTACT_STICKY ? INFINITY : body->friction * fabs(pressing);
        if (friction > most) most = friction, holding = k;
    }
    double out = 0;
    for (int d = 0; d < 3; d++) out += rest[d] * foot[holding].normal[d];
    for (int d = 0; d < 3 && foot[holding].pressing != 0; d++)
        foot[holding].impulse[d] += rest[d] - out * foot[holding].normal[d];
}

void gr_feet_keep(struct gr_engine *e)
{
    const struct gr_feet *feet = e->feet;
    for (int d = 0; d < e->config.dim; d++) {
        for (int64_t k = 0; k < feet->n_near; k++) {
            const struct gr_cell *cell = &e->mesh.cell[feet->near[k]];
            for (int32_t s = 0; s < cell->count; s++) gr_set_number(e, GR_FIELD_contact_force, d, gr_slot(cell, s), 0);
        }
        for (int64_t k = 0; k < feet->n; k++) {
            const int64_t place = feet->foot[k].place;
            const double before = gr_number(e, GR_FIELD_contact_force, d, place);
            gr_set_number(e, GR_FIELD_contact_force, d, place, before + e->inv_dt * feet->foot[k].impulse[d]);
        }
    }
}

/* The search of the feet of a step. */
struct search {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks;
    double moved, speed, fall;
    struct gr_pose pose[GR_MAX_BODIES];
};

/* Find the feet of the points of the near cells [first, last). They follow each other from the place of the first cell on. */
GR_SHARED(search, struct search, w->e->feet->n_near, w)
{
    struct gr_engine *e = w->e;
    struct gr_feet *feet = e->feet;
    struct gr_foot *foot = feet->foot + feet->begin[first];
    double filled = 0, r = 0;
    feet->found[chunk] = 0;
    for (int64_t k = first; k < last; k++) {
        const struct gr_cell *cell = &e->mesh.cell[feet->near[k]];
        const struct about about = look_about(e, k, w->moved);
        for (int32_t place = 0; place < cell->count; place++) {
            const int64_t s = gr_slot(cell, place);
            double x[3] = {0};
            int n = 0;
            for (int d = 0; d < e->config.dim; d++) x[d] = gr_x(e, d)[s];
            const double volume = gr_volume_as_mass(e, s);
            if (volume != filled) filled = volume, r = half_spacing(e, filled);
            if (is_far(&about, x, reach_of(e, s, r, w->speed, w->fall))) continue;
            for (int b = 0; b < e->config.n_bodies; b++)
                if (feet->bodies[k] >> b & 1) n += find_foot(e, cell, s, b, w->pose, r, w->fall, &foot[n]);
            share_stress(n, foot);
            find_barred(e, n, foot);
            if (n) start_from_force(e, n, foot);
            foot += n, feet->found[chunk] += n;
        }
    }
}

/* The number of a node among those of the feet. */
static int32_t number_of(struct gr_engine *e, int64_t n)
{
    struct gr_feet *feet = e->feet;
    if (feet->number[n]) return feet->number[n] - 1;
    const int dim = e->config.dim, fixed = gr_wall_now(e, e->mesh.node_code[n])->fixed;
    const double mobility = 1 / gr_foot_mass(e, n);
    struct gr_foot_node *node = &feet->node[feet->n_nodes];
    struct gr_foot_origin *origin = &feet->origin[feet->n_nodes];
    *node = (struct gr_foot_node){0};
    *origin = (struct gr_foot_origin){.inverse_mass = mobility, .n = n, .held = fixed};
    for (int d = 0; d < dim; d++) {
        origin->before[d] = node->v[d] = gr_node_field(e, GR_NODE_VELOCITY + d)[n];
        node->mobility[d] = fixed >> d & 1 ? 0 : mobility;
    }
    return (feet->number[n] = (int32_t)++feet->n_nodes) - 1;
}

/* Close the gaps between the feet of the chunks, and number the nodes of the feet in their order. */
static void collect(const struct search *w)
{
    struct gr_feet *feet = w->e->feet;
    for (int64_t k = 0; k < feet->n_nodes; k++) feet->number[feet->origin[k].n] = 0;
    feet->n = feet->n_nodes = 0;
    for (int64_t c = 0; c < w->chunks; c++) {
        int64_t first, last;
        gr_share(feet->n_near, c, w->chunks, &first, &last);
        const struct gr_foot *found = feet->foot + feet->begin[first];
        for (int64_t k = 0; k < feet->found[c]; k++) {
            struct gr_foot *foot = &feet->foot[feet->n++];
            if (foot != &found[k]) *foot = found[k];
            for (int i = 0; i < foot->n_nodes; i++) foot->node[i] = number_of(w->e, foot->node[i]);
        }
    }
}

void gr_feet_find(struct gr_engine *e, const double g[3], struct gr_team *team)
{
    struct search w = {.e = e, .team = team, .chunks = gr_chunks(team, e->feet->n_near)};
    w.moved = moved_since(e);
    w.speed = gr_bodies_speed(e);
    for (int d = 0; d < e->config.dim; d++) w.fall += g[d] * g[d];
    w.fall = 2 * e->dt * sqrt(w.fall);
    for (int b = 0; b < e->config.n_bodies; b++) gr_pose_now(e, b, &w.pose[b]);
    search(&w);
    collect(&w);
}

void gr_feet_move_out(struct gr_engine *e)
{
    const struct gr_feet *feet = e->feet;
    const double dx = e->config.dx;
    struct gr_pose pose[GR_MAX_BODIES];
    if (e->step % OUT_INTERVAL) return;
    const double moved = moved_since(e);
    for (int b = 0; b < e->config.n_bodies; b++) gr_pose_at(e, b, e->body[b].x, e->body[b].orientation, &pose[b]);
    for (int64_t k = 0; k < feet->n_near; k++) {
        const struct gr_cell *cell = &e->mesh.cell[feet->near[k]];
        const struct about about = look_about(e, k, moved);
        for (int32_t place = 0; place < cell->count; place++)
            for (int b = 0; b < e->config.n_bodies; b++) {
                const int64_t s = gr_slot(cell, place);
                double x[3] = {0}, arm[3], normal[3];
                if (!(feet->bodies[k] >> b & 1)) continue;
                for (int d = 0; d < e->config.dim; d++) x[d] = gr_x(e, d)[s];
                if (is_far(&about, x, 0)) break;
                const double deep = -distance_on_side(e, cell, b, &pose[b], x, arm, normal) - DEEPEST * dx;
                if (!(deep > 1e-9 * dx) || deep > (LOST - DEEPEST) * dx) continue;
                for (int d = 0; d < e->config.dim; d++) x[d] += fmin(deep, OUT * dx) * normal[d];
                if (!gr_replace_point(e, feet->near[k], s, x)) continue;
                place--; /* another point has taken its place */
                break;
            }
    }
}
