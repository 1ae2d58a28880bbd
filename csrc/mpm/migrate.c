#include "mpm/migrate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Whether all nodes of the face that the domain ends with at cell `from` are walls along axis d. */
static int face_is_closed(const struct gr_engine *e, const int32_t from[3], int d, int high)
{
    const int dim = e->config.dim, k = gr_basis_nodes_1d(e->config.basis);
    const double end = high ? e->axis[d].length / e->config.dx : 0;
    int64_t stride[3] = {1, e->axis[0].n_nodes, (int64_t)e->axis[0].n_nodes * e->axis[1].n_nodes};
    for (int n = 0; n < (dim == 2 ? k * k : k * k * k); n++) {
        const int local[3] = {n % k, n / k % k, n / (k * k)};
        int64_t id = 0;
        int on_face = 0;
        for (int j = 0; j < dim; j++) {
            const int32_t node = e->axis[j].cell[from[j]].node[local[j]];
            id += stride[j] * node;
            if (j == d) on_face = fabs(e->axis[j].node_position[node] - end) < 1e-9;
        }
        if (on_face && !(gr_wall_now(e, e->config.node_codes[id])->fixed >> d & 1)) return 0;
    }
    return 1;
}

int gr_confine(struct gr_engine *e, double x[3], int64_t at[3], const int32_t from[3])
{
    for (int d = 0; d < e->config.dim; d++) {
        const struct gr_axis *axis = &e->axis[d];
        const int32_t last = axis->n_cells - 1;
        const int high = at[d] > last;
        const double begin = axis->cell[0].begin, end = axis->cell[last].end;
        if (at[d] >= 0 && !high) continue;
        if (axis->periodic) {
            x[d] += high ? -axis->length : axis->length;
            x[d] = fmax(begin, fmin(x[d], nextafter(end, begin))); /* rounding of the sum */
            at[d] = gr_locate(axis, e->inv_dx, x[d]);
            continue;
        }
        if ((high ? e->config.open_high : e->config.open_low)[d] && !face_is_closed(e, from, d, high)) return 0;
        x[d] = high ? nextafter(end, begin) : begin; /* the nearest number inside */
        at[d] = high ? last : 0;
        e->clamped++;
    }
    return 1;
}

static int fail(struct gr_engine *e, int code, int64_t slot)
{
    e->error = code;
    e->error_id = e->id[slot];
    e->error_step = e->step;
    for (int d = 0; d < e->config.dim; d++) e->error_x[d] = e->field[GR_FIELD_x][d * e->capacity + slot];
    return code;
}

static void mark_dirty(struct gr_engine *e, int64_t index, int already)
{
    if (already || !e->mesh.cell[index].dirty) e->dirty[e->n_dirty++] = index;
    e->mesh.cell[index].dirty = 1;
}

/* Copy a point out of its place: all components, x first. */
static void lift(const struct gr_engine *e, int64_t slot, double *record)
{
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        for (int c = 0; e->field[f] && c < gr_field_components(f, e->config.dim); c++)
            *record++ = e->field[f][c * e->capacity + slot];
}

static void lower(struct gr_engine *e, int64_t slot, const double *record, int64_t id)
{
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        for (int c = 0; e->field[f] && c < gr_field_components(f, e->config.dim); c++)
            e->field[f][c * e->capacity + slot] = *record++;
    e->id[slot] = id;
}

int gr_reserve_pending(struct gr_engine *e, int64_t n)
{
    if (n <= e->pending_room) return GR_OK;
    const int64_t room = n + n / 2 + 64;
    double *pending = realloc(e->pending, sizeof(double) * (size_t)(room * e->n_components));
    if (!pending) return GR_ERR_MEMORY;
    e->pending = pending;
    int64_t *ids = realloc(e->pending_id, sizeof(int64_t) * (size_t)room);
    if (!ids) return GR_ERR_MEMORY;
    e->pending_id = ids;
    e->pending_room = room;
    return GR_OK;
}

/* Fill the hole of a removed point with the last point of its cell. */
static void close_hole(struct gr_engine *e, struct gr_cell *cell, int64_t slot, double *record)
{
    const int64_t last = cell->offset + --cell->count;
    if (slot != last) {
        lift(e, last, record);
        lower(e, slot, record, e->id[last]);
    }
    gr_clear_place(e, cell, last);
}

/* Lift one leaver into the pending list, or drop it. Only checks and copies: its place is closed later. */
static int lift_leaver(struct gr_engine *e, const struct gr_leaver *leaver)
{
    const int dim = e->config.dim;
    const struct gr_cell *cell = &e->mesh.cell[leaver->cell];
    double *record = e->pending + e->n_pending * e->n_components, x[3];
    int64_t at[3];
    lift(e, leaver->slot, record);
    for (int c = 0; c < e->n_components; c++)
        if (!isfinite(record[c])) return fail(e, GR_ERR_NOT_FINITE, leaver->slot);
    for (int d = 0; d < dim; d++) {
        x[d] = record[d];
        at[d] = gr_locate(&e->axis[d], e->inv_dx, x[d]);
        if (at[d] > cell->at[d] + 1 || at[d] < cell->at[d] - 1) return fail(e, GR_ERR_RUNAWAY, leaver->slot);
    }
    if (gr_confine(e, x, at, cell->at)) {
        memcpy(record, x, sizeof(double) * (size_t)dim);
        e->pending_id[e->n_pending++] = e->id[leaver->slot];
    } else {
        e->dropped++;
        e->dropped_mass += e->field[GR_FIELD_mass][leaver->slot];
        e->n_points--;
    }
    return GR_OK;
}

int gr_migrate(struct gr_engine *e, const struct gr_leaver *const list[], const int64_t count[], int lists)
{
    const int dim = e->config.dim;
    int64_t total = 0, waiting = 0;
    e->n_dirty = 0;
    for (int t = 0; t < lists; t++) total += count[t];
    const int64_t n_points = e->n_points, dropped = e->dropped, n_pending = e->n_pending;
    const double dropped_mass = e->dropped_mass;
    int error = gr_reserve_pending(e, n_pending + total + 1); /* one more: scratch of close_hole */
    for (int t = 0; t < lists; t++)
        for (int64_t k = 0; !error && k < count[t]; k++) error = lift_leaver(e, &list[t][k]);
    if (error) { /* nobody has moved yet: as if nobody had been looked at */
        e->n_points = n_points, e->dropped = dropped, e->n_pending = n_pending, e->dropped_mass = dropped_mass;
        return error;
    }
    for (int t = lists - 1; t >= 0; t--)
        for (int64_t k = count[t] - 1; k >= 0; k--)
            close_hole(e, &e->mesh.cell[list[t][k].cell], list[t][k].slot, e->pending + e->n_pending * e->n_components);
    for (int t = 0; t < lists; t++)
        for (int64_t k = 0; k < count[t]; k++)
            if (!k || list[t][k].cell != list[t][k - 1].cell) mark_dirty(e, list[t][k].cell, 1);
    for (int64_t k = 0; k < e->n_pending; k++) {
        double *record = e->pending + k * e->n_components;
        int32_t at[3];
        for (int d = 0; d < dim; d++) at[d] = (int32_t)gr_locate(&e->axis[d], e->inv_dx, record[d]);
        const int64_t index = (int64_t)e->mesh.cell_of[gr_cell_id(e, at)] - 1;
        struct gr_cell *cell = index >= 0 ? &e->mesh.cell[index] : 0;
        if (cell && cell->count < cell->capacity) {
            lower(e, cell->offset + cell->count++, record, e->pending_id[k]);
            mark_dirty(e, index, 0);
        } else { /* no place: it waits for the next regrouping, in order */
            memmove(e->pending + waiting * e->n_components, record, sizeof(double) * (size_t)e->n_components);
            e->pending_id[waiting++] = e->pending_id[k];
        }
    }
    e->n_pending = waiting;
    return GR_OK;
}
