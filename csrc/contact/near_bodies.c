/* The cells near bodies (near_bodies.h). They are looked for in the table of the active cells, block by block: of cells that
 * are far off neither the distance is worked out, nor is anything read that may be in the memory of a device. */
#include "contact/near_bodies.h"

#include "core/memory.h"
#include "mpm/pose.h"
#include "mpm/sleep.h"
#include "mpm/thin_bodies.h"

/* Bodies may move so far, in cells, before the cells near them are listed again. */
#define FOLLOW 0.5

/* Interpolated distances may be too large by less than this, in cells. */
#define INTERPOLATED 1.0

static int reserve_list(struct gr_engine *e)
{
    struct gr_near_bodies *near = &e->bodies.near;
    if (e->mesh.n_cells <= near->capacity) return GR_OK;
    near->capacity = 0;
    GR_RESIZE(near->cell, e->mesh.cell_capacity);
    GR_RESIZE(near->bodies, e->mesh.cell_capacity);
    GR_RESIZE(near->clearance, e->mesh.cell_capacity);
    GR_RESIZE(e->bodies.contacts->begin, e->mesh.cell_capacity);
    near->capacity = e->mesh.cell_capacity;
    return GR_OK;
}

/* Reserve memory for the nodes of so many contact points at most. Other ranks may name any of the mesh. */
static int reserve_nodes(struct gr_engine *e, int64_t most)
{
    struct gr_contact_points *contacts = e->bodies.contacts;
    const int64_t all = e->mesh.n_nodes, n = e->ranks || most > all / e->K ? all : most * e->K;
    if (n > contacts->node_capacity) {
        contacts->node_capacity = 0;
        GR_RESIZE(contacts->node, n + n / 2);
        GR_RESIZE(contacts->origin, n + n / 2);
        contacts->node_capacity = n + n / 2;
    }
    if (all <= contacts->number_capacity) return GR_OK;
    contacts->number_capacity = 0;
    GR_RESIZE(contacts->number, e->mesh.node_capacity);
    memset(contacts->number, 0, sizeof *contacts->number * (size_t)e->mesh.node_capacity);
    contacts->number_capacity = e->mesh.node_capacity;
    return GR_OK;
}

/* Reserve memory for as many contact points as the listed cells may have, and for their nodes. */
static int reserve_contacts(struct gr_engine *e)
{
    struct gr_contact_points *contacts = e->bodies.contacts;
    const struct gr_near_bodies *near = &e->bodies.near;
    int64_t most = 0;
    for (int64_t k = 0; k < near->n; k++) {
        contacts->begin[k] = most;
        most += (int64_t)e->mesh.cell[near->cell[k]].capacity * __builtin_popcountll(near->bodies[k]);
    }
    if (most > contacts->capacity) {
        contacts->capacity = 0;
        GR_RESIZE(contacts->contact, most + most / 2);
        contacts->capacity = most + most / 2;
    }
    return reserve_nodes(e, most);
}

/* Cells nearer to bodies than this are listed, m. */
static double reach_of_list(const struct gr_engine *e)
{
    return (GR_CONTACT_REACH + FOLLOW + 0.5 * sqrt(e->config.dim)) * e->config.dx;
}

/* List a cell of the mesh if it is near a body. */
static void list_cell(struct gr_engine *e, const struct gr_pose *pose, int64_t c, const int32_t at[3])
{
    struct gr_near_bodies *near = &e->bodies.near;
    const double reach = reach_of_list(e);
    uint64_t bodies = 0;
    double x[3], arm[3], normal[3], least = INFINITY;
    gr_cell_position(e, at, x);
    for (int b = 0; b < e->config.n_bodies; b++) {
        const double phi = gr_pose_distance(e, &pose[b], x, arm, normal);
        if (phi < reach) bodies |= (uint64_t)1 << b;
        least = fmin(least, phi);
    }
    if (!bodies) return;
    near->cell[near->n] = c;
    near->clearance[near->n] = least;
    near->bodies[near->n++] = bodies;
}

/* True if all points of a box, given by its middle and half its edges, are nearest to the same image of a body. */
static int has_one_image(const struct gr_pose *pose, const double x[3], const double half[3])
{
    for (int d = 0; d < 3; d++)
        if (pose->period[d] > 0 && fabs(gr_pose_arm(pose, x[d], d)) + half[d] > 0.499 * pose->period[d]) return 0;
    return 1;
}

/* True if no cell of the grid from number `first` on to number `last` is near a body. */
static int are_far(const struct gr_engine *e, const struct gr_pose *pose, int64_t first, int64_t last)
{
    int32_t low[3], high[3];
    double x[3] = {0}, half[3] = {0}, square = 0, arm[3], normal[3];
    int whole = 0; /* whether rows along the axis are, as they go on in the next one */
    gr_indices_of_cell(e, first, low);
    gr_indices_of_cell(e, last, high);
    for (int d = e->config.dim - 1; d >= 0; d--) {
        const struct gr_axis *axis = &e->axis[d];
        const double begin = axis->cell[whole ? 0 : low[d]].begin, end = axis->cell[whole ? axis->n_cells - 1 : high[d]].end;
        whole |= low[d] != high[d];
        x[d] = 0.5 * (begin + end);
        half[d] = 0.5 * (end - begin);
        square += half[d] * half[d];
    }
    const double reach = reach_of_list(e) + sqrt(square) + INTERPOLATED * e->config.dx;
    for (int b = 0; b < e->config.n_bodies; b++)
        if (!has_one_image(&pose[b], x, half) || gr_pose_distance(e, &pose[b], x, arm, normal) < reach) return 0;
    return 1;
}

/* List the near cells among those of the grid from number `first` on, up to `last`: of those in front of thin bodies, or
 * behind them. */
static void list_block(struct gr_engine *e, const struct gr_pose *pose, int64_t first, int64_t last, int behind)
{
    for (int64_t id = first; id <= last; id++) {
        int32_t at[3];
        int64_t c = (int64_t)gr_table_get(&e->mesh.cell_of, id) - 1;
        if (behind && c >= 0 && c < e->mesh.n_front) c = e->mesh.other[c];
        if (c < 0 || (c >= e->mesh.n_front) != behind) continue;
        gr_indices_of_cell(e, id, at);
        list_cell(e, pose, c, at);
    }
}

int gr_list_near_bodies(struct gr_engine *e)
{
    struct gr_contact_points *contacts = e->bodies.contacts;
    const struct gr_table *cells = &e->mesh.cell_of;
    struct gr_pose pose[GR_MAX_BODIES];
    int moved = !contacts->listed;
    for (int b = 0; b < e->config.n_bodies && !moved; b++)
        moved = gr_body_moved(e, b, &contacts->pose[b]) > FOLLOW * e->config.dx;
    if (!moved) return e->migration.tiles_grown ? reserve_contacts(e) : GR_OK; /* whose cells may have more points now */
    if (reserve_list(e)) return GR_ERR_MEMORY;
    for (int b = 0; b < e->config.n_bodies; b++) {
        memcpy(contacts->pose[b].x, e->bodies.now[b].x, sizeof contacts->pose[b].x);
        memcpy(contacts->pose[b].orientation, e->bodies.now[b].orientation, sizeof contacts->pose[b].orientation);
        gr_pose_at(e, b, e->bodies.now[b].x, e->bodies.now[b].orientation, &pose[b]);
    }
    e->bodies.near.n = 0;
    for (int behind = 0; behind <= (e->bodies.n_thin > 0); behind++)
        for (int64_t block = 1; block < cells->n_blocks; block++) {
            const int64_t first = cells->used[block] * GR_BLOCK,
                          end = first + GR_BLOCK < cells->n ? first + GR_BLOCK : cells->n;
            if (!are_far(e, pose, first, end - 1)) list_block(e, pose, first, end - 1, behind);
        }
    contacts->listed = 1;
    if (e->sleep) e->sleep->changed = 1;
    return reserve_contacts(e);
}
