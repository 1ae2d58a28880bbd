/* Solid cells (solid_cells.h). */
#include "mpm/solid_cells.h"

void gr_find_solid_cells(struct gr_engine *e)
{
    const struct gr_map *flags = &e->config.cell_flags;
    int any = 0;
    for (int64_t k = 0; flags->value && k < gr_map_size(flags); k++) any |= flags->value[k] & GR_CELL_SOLID;
    e->has_solid = any != 0;
}

double gr_solid_volume(const struct gr_engine *e, const int32_t at[3])
{
    static const struct gr_node_cells flat = {.count = 1, .integral = {1}};
    const struct gr_map *flags = &e->config.cell_flags;
    if (!e->has_solid) return 0;
    const struct gr_node_cells *x = &e->cells_of_node[0][at[0]], *y = &e->cells_of_node[1][at[1]];
    const struct gr_node_cells *z = e->config.dim == 3 ? &e->cells_of_node[2][at[2]] : &flat;
    double volume = 0;
    int64_t column[GR_MAX_NODES_1D];
    for (int a = 0; a < x->count; a++) column[a] = gr_map_class(flags, 0, x->cell[a]);
    for (int c = 0; c < z->count; c++) {
        const int64_t layer = gr_map_class(flags, 2, z->cell[c]) * flags->n_classes[1];
        for (int b = 0; b < y->count; b++) {
            const uint8_t *row = flags->value + (layer + gr_map_class(flags, 1, y->cell[b])) * flags->n_classes[0];
            for (int a = 0; a < x->count; a++)
                if (row[column[a]] & GR_CELL_SOLID) volume += x->integral[a] * y->integral[b] * z->integral[c];
        }
    }
    return volume;
}

double gr_node_volume(const struct gr_engine *e, int64_t id)
{
    int32_t at[3] = {0};
    double volume = 1;
    for (int d = 0; d < e->config.dim; d++) {
        at[d] = (int32_t)(id % e->axis[d].n_nodes);
        volume *= e->axis[d].node_integral[at[d]];
        id /= e->axis[d].n_nodes;
    }
    return volume - gr_solid_volume(e, at);
}
