/* Points in records (packing.h). */
#include "mpm/packing.h"

#include <math.h>

#include "core/index.h"
#include "mpm/sleep.h"
#include "mpm/slots.h"
#include "mpm/thin_bodies.h"

void gr_pack(const struct gr_engine *e, int64_t slot, double *record)
{
    for (int k = 0; k < e->points.n_components; k++) record[k] = gr_component(e, k, slot);
}

void gr_unpack(struct gr_engine *e, int64_t slot, const double *record, int64_t id)
{
    for (int k = 0; k < e->points.n_components; k++) gr_set_component(e, k, slot, record[k]);
    e->points.id[slot] = id;
}

void gr_close_hole(struct gr_engine *e, struct gr_cell *cell, int64_t slot)
{
    const int64_t last = gr_slot(cell, --cell->count);
    if (slot != last) {
        for (int k = 0; k < e->points.n_components; k++) gr_set_component(e, k, slot, gr_component(e, k, last));
        e->points.id[slot] = e->points.id[last];
    }
    gr_clear_slot(e, cell, last);
}

void gr_locate_packed(const struct gr_engine *e, const double *record, int64_t at[3])
{
    for (int d = 0; d < e->config.dim; d++) at[d] = gr_locate(&e->axis[d], e->inv_dx, record[d]);
}

int gr_check_packed(const struct gr_engine *e, const struct gr_cell *from, const double *record, const int64_t at[3])
{
    int finite = 1;
    for (int k = 0; k < e->points.n_components; k++) finite &= isfinite(record[k]) != 0;
    if (!finite) return GR_ERR_NOT_FINITE;
    for (int d = 0; d < e->config.dim; d++)
        if (at[d] > from->at[d] + 1 || at[d] < from->at[d] - 1) return GR_ERR_RUNAWAY;
    return GR_OK;
}

int64_t gr_cell_of_packed(const struct gr_engine *e, const int64_t at[3], const double *record)
{
    int32_t to[3];
    double x[3] = {0};
    for (int d = 0; d < e->config.dim; d++) {
        if (at[d] < 0 || at[d] >= e->axis[d].n_cells) return GR_TO_OUTSIDE;
        to[d] = (int32_t)at[d];
        x[d] = record[d];
    }
    const int64_t index = (int64_t)gr_table_get(&e->mesh.cell_of, gr_cell_id(e, to)) - 1;
    if (index < 0) return GR_TO_NO_CELL;
    if (!e->bodies.n_thin || e->mesh.cell[index].side != GR_FRONT) return index;
    return gr_point_side(e, x, gr_sign(record[gr_component_of(e, GR_FIELD_side)])) < 0 ? e->mesh.other[index] : index;
}

int64_t gr_find_cell(const struct gr_engine *e, const double *record)
{
    int64_t at[3];
    gr_locate_packed(e, record, at);
    return gr_cell_of_packed(e, at, record);
}

void gr_address(const struct gr_engine *e, struct gr_migrants *out, int64_t k)
{
    struct gr_migrant *migrant = &out->from[k];
    const double *record = out->record + k * e->points.n_components;
    int64_t at[3];
    gr_locate_packed(e, record, at);
    migrant->to = gr_cell_of_packed(e, at, record);
    out->invalid += gr_check_packed(e, &e->mesh.cell[migrant->cell], record, at) != GR_OK;
    out->outside += migrant->to == GR_TO_OUTSIDE;
    out->homeless += migrant->to == GR_TO_NO_CELL;
    if (migrant->to < 0) return;
    if (migrant->to < out->lowest) out->lowest = migrant->to;
    if (migrant->to > out->highest) out->highest = migrant->to;
}

void gr_pack_migrants(struct gr_engine *e, struct gr_migrants *out, int64_t first)
{
    for (int64_t k = first; k < out->count; k++) {
        gr_pack(e, out->from[k].slot, out->record + k * e->points.n_components);
        out->id[k] = e->points.id[out->from[k].slot];
        gr_address(e, out, k);
    }
    for (int64_t k = out->count - 1; k >= first; k--) gr_close_hole(e, &e->mesh.cell[out->from[k].cell], out->from[k].slot);
}

int gr_put_point(struct gr_engine *e, struct gr_cell *cell, double *record, int64_t id)
{
    if (e->bodies.n_thin) record[gr_component_of(e, GR_FIELD_side)] = GR_IS_DOUBLE(cell) ? cell->side : 0;
    if (cell->count == cell->capacity) return 0;
    gr_wake_for_arrival(e, cell);
    gr_unpack(e, gr_slot(cell, cell->count++), record, id);
    return 1;
}
