/* Contact points of the material with the surfaces of bodies (contact_points.h). */
#include "contact/contact_points.h"

#include <stdlib.h>

#include "contact/edges.h"
#include "contact/moment_arm.h"
#include "contact/moving.h"
#include "contact/near_bodies.h"
#include "contact/node_weights.h"
#include "core/memory.h"
#include "mpm/migrate.h"
#include "mpm/of_material.h"
#include "mpm/pose.h"
#include "mpm/sleep.h"
#include "mpm/thin_bodies.h"
#include "mpm/walls.h"

/* Distances between samples are linear, so that they may change by a little more than the position does: by less than
 * this, in cells, in half of a cell. */
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

/* A contact point acts if the mean mass of the nodes about it, over the mass of a full cell, is more than this. */
#define LEAST_FILLING 0.1

/* The surface of another contact point of a point bars a direction along the surface of a contact point if its normal is
 * nearer to this direction than to the normal of the contact point: the sine of the angle between the normals is more
 * than this. */
#define BARRED 0.7071

/* At a convex edge a contact point gives at most this many times the normal stress of its point times the area of a point
 * on the surface. This bears what presses on the edge. The weight of the material that falls past it, which the shape
 * functions reach, needs more. In a fluid points get 0.1 cells deep into the edges of a box with 1, and not at all with
 * 2, but a hopper of 30 degrees 8 cells wide discharges 1 % less with 1 and 6 % less with 2. A slot in a flat floor
 * discharges alike with either, 2 % less with 4, and 28 % less without a bound. */
#define EDGE_STRESS 1.0

int gr_contact_points_new(struct gr_engine *e)
{
    e->bodies.contacts = gr_calloc(1, sizeof *e->bodies.contacts);
    if (!e->bodies.contacts) return GR_ERR_MEMORY;
    e->bodies.contacts->pose = gr_calloc((size_t)e->config.n_bodies, sizeof *e->bodies.contacts->pose);
    return e->bodies.contacts->pose ? GR_OK : GR_ERR_MEMORY;
}

void gr_contact_points_free(struct gr_contact_points *contacts)
{
    if (!contacts) return;
    gr_free(contacts->contact);
    gr_free(contacts->node);
    gr_free(contacts->origin);
    gr_free(contacts->number);
    gr_free(contacts->begin);
    gr_free(contacts->pose);
    gr_free(contacts);
}

/* Signed distance of a point of a cell from a body, and the normal in axes of the scene. Points of double cells stay on
 * their side of a thin body, however deep they are. */
static double distance_on_side(const struct gr_engine *e, const struct gr_cell *cell, int b, const struct gr_pose *pose,
                               const double x[3], double arm[3], double normal[3])
{
    struct gr_facing side;
    const double phi = gr_pose_distance(e, pose, x, arm, normal);
    if (!e->bodies.n_thin || !GR_IS_DOUBLE(cell)) return phi;
    gr_nearest_thin(e, x, 1, &side);
    if (side.body != b || !side.facing) return phi;
    for (int d = 0; d < 3; d++) normal[d] = cell->side * side.normal[d];
    return cell->side * side.mid - side.half;
}

/* Distance by which the surface of a body has moved at most since the cells were listed. */
static double moved_since(const struct gr_engine *e)
{
    double moved = 0;
    for (int b = 0; b < e->config.n_bodies; b++) moved = fmax(moved, gr_body_moved(e, b, &e->bodies.contacts->pose[b]));
    return moved;
}

/* Bounds for the distance of the points of a cell from the bodies, from its centre. */
struct about {
    double centre[3], distance;
};

/* Look about the cell number k of the list, when the bodies have moved. */
static struct about look_about(const struct gr_engine *e, int64_t k, double moved)
{
    const struct gr_cell *cell = &e->mesh.cell[e->bodies.near.cell[k]];
    struct about about = {.distance = e->bodies.near.clearance[k] - moved - ROUNDED * e->config.dx};
    if (e->bodies.n_thin && GR_IS_DOUBLE(cell)) about.distance = -INFINITY; /* distances are those from the faces of sides */
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

/* Volume of the point at a slot as the mass of as much of the first material, of a ring over its radius in cells. */
static double volume_of(const struct gr_engine *e, int64_t slot)
{
    const double volume = gr_volume_as_mass(e, slot);
    return e->config.axisymmetric ? volume * e->config.dx / gr_x(e, 0)[slot] : volume;
}

/* Half the spacing of the points of such a volume, m. */
static double half_spacing(const struct gr_engine *e, double filled)
{
    const double filling = filled * e->mass_scale;
    return 0.5 * e->config.dx * (e->config.dim == 2 ? sqrt(filling) : cbrt(filling));
}

/* Distance within which bodies may act on the point at `slot` with half the spacing r, if they are not faster than `speed`
 * and gravity gives no more than `fall`, m/s, in two steps. */
static double reach_of(const struct gr_engine *e, int64_t slot, double r, double speed, double fall)
{
    return HOLD * r + 2 * e->clock.dt * (sqrt(gr_speed_squared(e, slot)) + speed + fall);
}

/* Largest impulse of a contact point of the point at `slot` with half the spacing r, where the normal of the surface is n.
 * The viscous stress of damping is left out: it is small compared with the uncertainty of EDGE_STRESS. */
static double most_at_edge(const struct gr_engine *e, int64_t slot, double r, const double n[3])
{
    const double rings = e->config.axisymmetric ? 2 * M_PI * gr_x(e, 0)[slot] : 1;
    const double area = e->config.dim == 2 ? 2 * r * rings : 4 * r * r;
    double stress[6] = {0}, tension = 0;
    for (int c = 0; c < gr_field_components(GR_FIELD_stress, e->config.dim); c++)
        stress[c] = gr_number(e, GR_FIELD_stress, c, slot);
    for (int d = 0; d < e->config.dim; d++) tension += n[d] * n[d] * stress[d];
    tension += 2 * n[0] * n[1] * stress[3];
    if (e->config.dim == 3) tension += 2 * n[2] * (n[1] * stress[4] + n[0] * stress[5]);
    return EDGE_STRESS * fmax(-tension, 0) * area * e->clock.dt;
}

/* Find the contact point of the point at `slot`, with half the spacing r, on a body.
 * All: the poses of the bodies. Returned: whether it has one. */
static int find_contact(const struct gr_engine *e, const struct gr_cell *cell, int64_t slot, int b,
                        const struct gr_pose *all, double r, double fall, struct gr_contact_point *contact)
{
    const struct gr_pose *pose = &all[b];
    const int dim = e->config.dim;
    const int separating = pose->body->contact == GR_CONTACT_SEPARATING;
    double x[3] = {0}, at[3], into = 0;
    for (int d = 0; d < dim; d++) x[d] = gr_x(e, d)[slot];
    const double phi = distance_on_side(e, cell, b, pose, x, contact->arm, contact->normal);
    if (phi > GR_CONTACT_REACH * e->config.dx) return 0;
    if (phi < -DEEP * e->config.dx) return 0;
    if (separating && !(phi < r)) {
        const double *w = e->bodies.now[b].omega, *arm = contact->arm;
        for (int d = 0; d < dim; d++) {
            const double turning = w[(d + 1) % 3] * arm[(d + 2) % 3] - w[(d + 2) % 3] * arm[(d + 1) % 3];
            into += (gr_number(e, GR_FIELD_v, d, slot) - e->bodies.now[b].v[d] - turning) * contact->normal[d];
        }
    }
    if (!(phi < r) && (separating ? !(phi + 2 * e->clock.dt * (into - fall) < r) : !(phi < HOLD * r))) return 0;
    contact->body = b;
    contact->at_edge = 0;
    contact->bound = separating && phi > r ? (r - phi) / e->clock.dt : 0;
    contact->most = gr_number(e, GR_FIELD_mass, 0, slot) * e->config.wave_speed;
    contact->slot = slot;
    contact->lane = cell - e->mesh.cell;
    contact->speed = separating ? 0 : sqrt(gr_speed_squared(e, slot));
    for (int d = 0; d < 3; d++) at[d] = x[d] - phi * contact->normal[d];
    if (gr_is_at_edge(e, pose, at, contact->normal)) {
        if (gr_edge_is_covered(e, all, b, x, at, contact->normal)) return 0;
        contact->most = fmin(contact->most, most_at_edge(e, slot, r, contact->normal));
        if (!(contact->most > 0)) return 0;
        contact->at_edge = 1;
    }
    if (gr_weigh_nodes(e, at, cell->side, LEAST_FILLING, contact)) {
        for (int d = 0; d < 3; d++) contact->arm[d] -= phi * contact->normal[d];
    } else if (!gr_weigh_nodes(e, x, cell->side, 0, contact)) {
        return 0;
    }
    if (pose->body->turns) gr_set_moment_arm(e, pose, contact);
    return 1;
}

/* Let the contact points of a point at edges share the stress that bounds them: bodies may have an edge in common. */
static void share_stress(int n, struct gr_contact_point *contact)
{
    int edges = 0;
    for (int k = 0; k < n; k++) edges += contact[k].at_edge;
    for (int k = 0; k < n; k++)
        if (contact[k].at_edge) contact[k].most /= edges;
}

/* In a corner, where a point has several contact points, find the directions along the surface of each that the others
 * bar. Friction there and what presses on the other surface would hold the same nodes twice, at positions a fraction of a
 * cell apart: they would pull against each other more and more, up to the bound of impulses, and then throw the points of
 * the corner. */
static void find_barred(const struct gr_engine *e, int n, struct gr_contact_point *contact)
{
    for (int k = 0; k < n; k++) {
        struct gr_contact_point *f = &contact[k];
        f->n_barred = 0;
        for (int l = 0; l < n && f->n_barred < e->config.dim - 1; l++) {
            double *a = f->barred[f->n_barred], square = 0;
            memcpy(a, contact[l].normal, sizeof contact[l].normal);
            gr_take_away(a, f->normal);
            for (int m = 0; m < f->n_barred; m++) gr_take_away(a, f->barred[m]);
            for (int d = 0; d < 3; d++) square += a[d] * a[d];
            if (!(square > BARRED * BARRED)) continue;
            for (int d = 0; d < 3; d++) a[d] /= sqrt(square);
            f->n_barred++;
        }
    }
}

/* Start the impulses of the n contact points of a point, which together gave it its force: each in turn takes the component
 * along its normal, and the one with the most friction the rest along its surface. */
static void start_from_force(const struct gr_engine *e, int n, struct gr_contact_point *contact)
{
    double rest[3] = {0}, most = -1;
    int holding = 0;
    for (int d = 0; d < e->config.dim; d++) rest[d] = e->clock.dt * gr_number(e, GR_FIELD_contact_force, d, contact->slot);
    for (int k = 0; k < n; k++) {
        const struct gr_body *body = &e->config.bodies[contact[k].body];
        double pressing = 0;
        for (int d = 0; d < 3; d++) pressing += rest[d] * contact[k].normal[d];
        if (body->contact == GR_CONTACT_SEPARATING) pressing = fmax(pressing, 0);
        pressing = fmin(fmax(pressing, -contact[k].most), contact[k].most);
        for (int d = 0; d < 3; d++) rest[d] -= contact[k].impulse[d] = pressing * contact[k].normal[d];
        contact[k].pressing = pressing;
        const double friction = body->contact == GR_CONTACT_STICKY ? INFINITY : body->friction * fabs(pressing);
        if (friction > most) most = friction, holding = k;
    }
    double out = 0;
    for (int d = 0; d < 3; d++) out += rest[d] * contact[holding].normal[d];
    for (int d = 0; d < 3 && contact[holding].pressing != 0; d++)
        contact[holding].impulse[d] += rest[d] - out * contact[holding].normal[d];
}

void gr_store_contact_forces(struct gr_engine *e)
{
    const struct gr_contact_points *contacts = e->bodies.contacts;
    for (int d = 0; d < e->config.dim; d++) {
        for (int64_t k = 0; k < e->bodies.near.n; k++) {
            const struct gr_cell *cell = &e->mesh.cell[e->bodies.near.cell[k]];
            for (int32_t s = 0; s < cell->count; s++) gr_set_number(e, GR_FIELD_contact_force, d, gr_slot(cell, s), 0);
        }
        for (int64_t k = 0; k < contacts->n; k++) {
            const int64_t slot = contacts->contact[k].slot;
            const double before = gr_number(e, GR_FIELD_contact_force, d, slot);
            gr_set_number(e, GR_FIELD_contact_force, d, slot, before + e->clock.inv_dt * contacts->contact[k].impulse[d]);
        }
    }
}

/* The search of the contact points of a step. */
struct search {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks;
    double moved, speed, fall;
    struct gr_pose pose[GR_MAX_BODIES];
};

/* Find the contact points of the points of the near cells [first, last). They follow each other from the slot of the
 * first cell on. */
GR_SHARED(search, struct search, w->e->bodies.near.n, w)
{
    struct gr_engine *e = w->e;
    struct gr_contact_points *contacts = e->bodies.contacts;
    struct gr_contact_point *contact = contacts->contact + contacts->begin[first];
    double filled = 0, r = 0;
    contacts->of_chunk[chunk] = 0;
    for (int64_t k = first; k < last; k++) {
        const struct gr_cell *cell = &e->mesh.cell[e->bodies.near.cell[k]];
        const struct about about = look_about(e, k, w->moved);
        for (int32_t slot = 0; slot < cell->count; slot++) {
            const int64_t s = gr_slot(cell, slot);
            double x[3] = {0};
            int n = 0;
            for (int d = 0; d < e->config.dim; d++) x[d] = gr_x(e, d)[s];
            const double volume = volume_of(e, s);
            if (volume != filled) filled = volume, r = half_spacing(e, filled);
            if (is_far(&about, x, reach_of(e, s, r, w->speed, w->fall))) continue;
            for (int b = 0; b < e->config.n_bodies; b++)
                if (e->bodies.near.bodies[k] >> b & 1) n += find_contact(e, cell, s, b, w->pose, r, w->fall, &contact[n]);
            share_stress(n, contact);
            find_barred(e, n, contact);
            if (n) start_from_force(e, n, contact);
            contact += n, contacts->of_chunk[chunk] += n;
        }
    }
}

/* The number of a node in the nodes of the contact points. */
static int32_t number_of(struct gr_engine *e, int64_t n)
{
    struct gr_contact_points *contacts = e->bodies.contacts;
    if (contacts->number[n]) return contacts->number[n] - 1;
    const int dim = e->config.dim, fixed = gr_wall_now(e, e->mesh.node_code[n])->fixed;
    const double mobility = 1 / gr_contact_mass(e, n);
    struct gr_contact_node *node = &contacts->node[contacts->n_nodes];
    struct gr_contact_origin *origin = &contacts->origin[contacts->n_nodes];
    *node = (struct gr_contact_node){0};
    *origin = (struct gr_contact_origin){.inverse_mass = mobility, .n = n, .held = fixed, .code = e->mesh.node_code[n]};
    for (int d = 0; d < dim; d++) {
        origin->before[d] = node->v[d] = gr_node_field(e, GR_NODE_VELOCITY + d)[n];
        node->mobility[d] = fixed >> d & 1 ? 0 : mobility;
    }
    return (contacts->number[n] = (int32_t)++contacts->n_nodes) - 1;
}

/* Close the gaps between the contact points of the chunks, and number the nodes of the contact points in their order. */
static void collect(const struct search *w)
{
    struct gr_contact_points *contacts = w->e->bodies.contacts;
    for (int64_t k = 0; k < contacts->n_nodes; k++) contacts->number[contacts->origin[k].n] = 0;
    contacts->n = contacts->n_nodes = 0;
    for (int64_t c = 0; c < w->chunks; c++) {
        int64_t first, last;
        gr_share(w->e->bodies.near.n, c, w->chunks, &first, &last);
        const struct gr_contact_point *first_of_chunk = contacts->contact + contacts->begin[first];
        for (int64_t k = 0; k < contacts->of_chunk[c]; k++) {
            struct gr_contact_point *contact = &contacts->contact[contacts->n++];
            if (contact != &first_of_chunk[k]) *contact = first_of_chunk[k];
            for (int i = 0; i < contact->n_nodes; i++) contact->node[i] = number_of(w->e, contact->node[i]);
        }
    }
}

void gr_find_contact_points(struct gr_engine *e, const double g[3], struct gr_team *team)
{
    struct search w = {.e = e, .team = team, .chunks = gr_chunks(team, e->bodies.near.n)};
    w.moved = moved_since(e);
    w.speed = gr_bodies_speed(e);
    for (int d = 0; d < e->config.dim; d++) w.fall += g[d] * g[d];
    w.fall = 2 * e->clock.dt * sqrt(w.fall);
    for (int b = 0; b < e->config.n_bodies; b++) gr_pose_now(e, b, &w.pose[b]);
    search(&w);
    collect(&w);
}

int gr_move_out_of_bodies(struct gr_engine *e)
{
    const struct gr_near_bodies *near = &e->bodies.near;
    const double dx = e->config.dx;
    struct gr_pose pose[GR_MAX_BODIES];
    if (e->clock.step % OUT_INTERVAL) return GR_OK;
    struct gr_migrants list = gr_begin_replacing(e);
    const double moved = moved_since(e);
    for (int b = 0; b < e->config.n_bodies; b++)
        gr_pose_at(e, b, e->bodies.now[b].x, e->bodies.now[b].orientation, &pose[b]);
    for (int64_t k = 0; k < near->n; k++) {
        const struct gr_cell *cell = &e->mesh.cell[near->cell[k]];
        const struct about about = look_about(e, k, moved);
        for (int32_t slot = 0; slot < cell->count; slot++)
            for (int b = 0; b < e->config.n_bodies; b++) {
                const int64_t s = gr_slot(cell, slot);
                double x[3] = {0}, arm[3], normal[3];
                if (!(near->bodies[k] >> b & 1)) continue;
                for (int d = 0; d < e->config.dim; d++) x[d] = gr_x(e, d)[s];
                if (is_far(&about, x, 0)) break;
                const double deep = -distance_on_side(e, cell, b, &pose[b], x, arm, normal) - DEEPEST * dx;
                if (!(deep > 1e-9 * dx) || deep > (LOST - DEEPEST) * dx) continue;
                for (int d = 0; d < e->config.dim; d++) x[d] += fmin(deep, OUT * dx) * normal[d];
                if (!gr_replace_point(e, &list, near->cell[k], s, x)) continue;
                slot--; /* another point has taken its slot */
                break;
            }
    }
    return gr_end_replacing(e, &list);
}
