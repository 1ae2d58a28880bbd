/* Migration of points between cells, through periodic ends, and out of the domain (migrate.h). */
#include "mpm/migrate.h"

#include <math.h>

#include "core/memory.h"
#include "mpm/walls.h"

/* True if all nodes are walls along axis d on the face with which the domain ends at cell `from`. */
static int is_closed(const struct gr_engine *e, const int32_t from[3], int d, int high)
{
    const int dim = e->config.dim, k = gr_basis_nodes_1d(e->config.basis);
    const double end = high ? e->axis[d].length / e->config.dx : 0;
    for (int n = 0; n < e->K; n++) {
        const int local[3] = {n % k, n / k % k, n / (k * k)};
        int32_t node[3] = {0};
        for (int j = 0; j < dim; j++) node[j] = e->axis[j].cell[from[j]].node[local[j]];
        const int on_face = fabs(e->axis[d].node_position[node[d]] - end) < 1e-9;
        if (on_face && !(gr_wall_now(e, gr_map_get(&e->config.node_codes, node))->fixed >> d & 1)) return 0;
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
            x[d] = fmax(begin, fmin(x[d], nextafter(end, begin))); /* against rounding of the sum */
            at[d] = gr_locate(axis, e->inv_dx, x[d]);
            continue;
        }
        if ((high ? e->config.open_high : e->config.open_low)[d] && !is_closed(e, from, d, high)) return 0;
        x[d] = high ? nextafter(end, begin) : begin; /* the nearest number inside */
        at[d] = high ? last : 0;
        e->clamped++;
    }
    return 1;
}

static int fail(struct gr_engine *e, int code, const double *record, int64_t id)
{
    e->error = code;
    e->error_id = id;
    e->error_step = e->step;
    for (int d = 0; d < e->config.dim; d++) e->error_x[d] = record[d];
    return code;
}

/* Pack a point: copy all its components from its place to a record, x first. */
static void pack(const struct gr_engine *e, int64_t slot, double *record)
{
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        for (int c = 0; e->field[f] && c < gr_field_components(f, e->config.dim); c++)
            *record++ = e->field[f][c * e->capacity + slot];
}

/* Unpack a record: copy a point to its new place. */
static void unpack(struct gr_engine *e, int64_t slot, const double *record, int64_t id)
{
    for (int f = 0; f < GR_FIELD_COUNT; f++)
        for (int c = 0; e->field[f] && c < gr_field_components(f, e->config.dim); c++)
            e->field[f][c * e->capacity + slot] = *record++;
    e->id[slot] = id;
}

int gr_reserve_pending(struct gr_engine *e, int64_t n)
{
    if (n <= e->pending_capacity) return GR_OK;
    const int64_t capacity = n + n / 2 + 64;
    GR_RESIZE(e->pending, capacity * e->n_components);
    GR_RESIZE(e->pending_id, capacity);
    GR_RESIZE(e->migrant, capacity);
    e->pending_capacity = capacity;
    return GR_OK;
}

/* Fill the gap of a removed point with the last point of its cell. */
static void close_hole(struct gr_engine *e, struct gr_cell *cell, int64_t slot, double *record)
{
    const int64_t last = cell->offset + --cell->count;
    if (slot != last) {
        pack(e, last, record);
        unpack(e, slot, record, e->id[last]);
    }
    gr_clear_place(e, cell, last);
}

void gr_pack_migrants(struct gr_engine *e, struct gr_migrants *out, int64_t first)
{
    double *scratch = out->record + out->count * e->n_components;
    for (int64_t k = first; k < out->count; k++) {
        pack(e, out->from[k].slot, out->record + k * e->n_components);
        out->id[k] = e->id[out->from[k].slot];
    }
    for (int64_t k = out->count - 1; k >= first; k--)
        close_hole(e, &e->mesh.cell[out->from[k].cell], out->from[k].slot, scratch);
}

int gr_component_of(const struct gr_engine *e, int field)
{
    int component = 0;
    for (int f = 0; f < field; f++) component += e->field[f] ? gr_field_components(f, e->config.dim) : 0;
    return component;
}

/* Check a point that left its cell: it must be finite, and in a neighbour of the cell. */
static int check_migrant(struct gr_engine *e, const struct gr_cell *cell, const double *record, int64_t id)
{
    for (int c = 0; c < e->n_components; c++)
        if (!isfinite(record[c])) return fail(e, GR_ERR_NOT_FINITE, record, id);
    for (int d = 0; d < e->config.dim; d++) {
        const int64_t at = gr_locate(&e->axis[d], e->inv_dx, record[d]);
        if (at > cell->at[d] + 1 || at < cell->at[d] - 1) return fail(e, GR_ERR_RUNAWAY, record, id);
    }
    return GR_OK;
}

/* Put all migrants back into their old cells, which still have the places for them. */
static void put_back(struct gr_engine *e, const struct gr_migrants *list, int lists)
{
    for (int t = 0; t < lists; t++)
        for (int64_t k = 0; k < list[t].count; k++) {
            struct gr_cell *cell = &e->mesh.cell[list[t].from[k].cell];
            unpack(e, cell->offset + cell->count++, list[t].record + k * e->n_components, list[t].id[k]);
        }
}

/* Insert a point into a cell; into the pending points if the cell is full or index is -1, for a cell that is not
 * active. */
static void insert(struct gr_engine *e, int64_t index, double *record, int64_t id)
{
    struct gr_cell *cell = index >= 0 ? &e->mesh.cell[index] : 0;
    if (cell && cell->count < cell->capacity) {
        unpack(e, cell->offset + cell->count++, record, id);
        if (!cell->dirty) e->dirty[e->n_dirty++] = index;
        cell->dirty = 1;
    } else { /* pending records never pass the one read now: nothing is overwritten */
        memmove(e->pending + e->n_pending * e->n_components, record, sizeof(double) * (size_t)e->n_components);
        e->pending_id[e->n_pending++] = id;
    }
}

/* Set the side of a point that enters a cell, in its record.
 * Returned: 1 for the back of a double cell, else 0. */
static int find_side(const struct gr_engine *e, const struct gr_cell *cell, double *record)
{
    double *side = record + gr_component_of(e, GR_FIELD_side), x[3] = {0};
    for (int d = 0; d < e->config.dim; d++) x[d] = record[d];
    *side = cell->side == 1 ? gr_point_side(e, x, (int)*side) : 0;
    return *side < 0;
}

/* Insert a migrant into its new cell. It is dropped if it has left the domain, and becomes pending without a free
 * place. */
static void insert_migrant(struct gr_engine *e, const struct gr_cell *from, double *record, int64_t id)
{
    const int dim = e->config.dim;
    int64_t at[3];
    int32_t to[3];
    for (int d = 0; d < dim; d++) at[d] = gr_locate(&e->axis[d], e->inv_dx, record[d]);
    if (!gr_confine(e, record, at, from->at)) {
        e->dropped++;
        e->dropped_mass += record[gr_component_of(e, GR_FIELD_mass)];
        e->n_points--;
        return;
    }
    for (int d = 0; d < dim; d++) to[d] = (int32_t)at[d];
    int64_t index = (int64_t)gr_table_get(&e->mesh.cell_of, gr_cell_id(e, to)) - 1;
    if (e->n_thin && index >= 0) index += find_side(e, &e->mesh.cell[index], record);
    insert(e, index, record, id);
}

int gr_migrate(struct gr_engine *e, struct gr_migrants *list, int lists)
{
    int error = GR_OK;
    e->n_dirty = 0;
    for (int t = 0; t < lists; t++)
        for (int64_t k = 0; !error && k < list[t].count; k++)
            error =
                check_migrant(e, &e->mesh.cell[list[t].from[k].cell], list[t].record + k * e->n_components, list[t].id[k]);
    if (error) { /* restore the state before migration */
        put_back(e, list, lists);
        return error;
    }
    for (int t = 0; t < lists; t++)
        for (int64_t k = 0; k < list[t].count; k++)
            insert_migrant(e, &e->mesh.cell[list[t].from[k].cell], list[t].record + k * e->n_components, list[t].id[k]);
    return GR_OK;
}

void gr_change_sides(struct gr_engine *e)
{
    for (int64_t k = 0; k < 2 * e->mesh.n_paired; k++) {
        const int64_t index = e->mesh.paired[k / 2] + k % 2;
        struct gr_cell *cell = &e->mesh.cell[index];
        if (!cell->count || gr_cell_faces_thin(e, cell->at)) continue;
        for (int64_t slot = cell->offset; slot < cell->offset + cell->count; slot++) {
            double *record = e->pending + e->n_pending * e->n_components, x[3] = {0};
            for (int d = 0; d < e->config.dim; d++) x[d] = e->field[GR_FIELD_x][d * e->capacity + slot];
            if (gr_point_side(e, x, cell->side) == cell->side) continue;
            const int64_t id = e->id[slot];
            pack(e, slot, record);
            close_hole(e, cell, slot--, record + e->n_components);
            if (!cell->dirty) e->dirty[e->n_dirty++] = index;
            cell->dirty = 1;
            record[gr_component_of(e, GR_FIELD_side)] = -cell->side;
            insert(e, index + cell->side, record, id);
        }
    }
}

int gr_replace_point(struct gr_engine *e, int64_t index, int64_t slot, const double x[3])
{
    struct gr_cell *cell = &e->mesh.cell[index];
    double *record = e->pending + e->n_pending * e->n_components;
    const int64_t id = e->id[slot];
    int same = 1;
    if (!cell->dirty) e->dirty[e->n_dirty++] = index;
    cell->dirty = 1;
    for (int d = 0; d < e->config.dim; d++) {
        e->field[GR_FIELD_x][d * e->capacity + slot] = x[d];
        same &= gr_locate(&e->axis[d], e->inv_dx, x[d]) == cell->at[d];
    }
    if (same) return 0;
    pack(e, slot, record);
    close_hole(e, cell, slot, record + e->n_components);
    insert_migrant(e, cell, record, id);
    return 1;
}
