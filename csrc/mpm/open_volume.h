/* Volume of bodies at the nodes near their surface.
 *
 * The density correction compares the mass of a node with its volume, and the residual force with zero. Near a body both
 * are of the open part of the support of the node, outside of the bodies:
 *
 *   V_i = V_i0 - s_i,  s_i = int S_i,   E_i -> E_i + G_i,  G_i = int grad S_i,   over the solid, lengths in cells.
 *
 * A uniform pressure then is in balance with its traction on the surface. In an axisymmetric plane the integrals are over
 * rings, int S_i r and int grad S_i r + S_i e_r, and the latter are divided by the mean radius of the node. */
#pragma once

#include "mpm/engine.h"

/* Nodes with less open volume than this, over dx^dim, say nothing about the density. */
#define GR_LEAST_OPEN 0.1

/* The open part of a cell: its volume over the volume of the cell, and its centroid in local coordinates. */
struct gr_open_part {
    double volume, centre[3];
};

/* Integrals over the bodies for the nodes near their surfaces, and for the cells. */
struct gr_open_volume {
    struct gr_table place;    /* of a node of the grid: its index + 1, 0 for none */
    double *solid, *slope;    /* s_i; G_i, dim numbers */
    int64_t *id, n, capacity; /* the nodes */
    struct gr_table part_of;  /* of a cell of the grid: the index of its part + 1, 0 if it is open */
    struct gr_open_part *part;
    int64_t n_parts, part_capacity;
    int known; /* the integrals are for the poses `split` */
};

int gr_open_volume_new(struct gr_engine *e, int64_t n_cells, int64_t n_nodes);
void gr_open_volume_free(struct gr_open_volume *open);

/* Compute the integrals for the poses `split`, unless they are known, and from them the volumes of the nodes near the
 * surfaces; those of a new mesh are without bodies before. If `follow`, the mesh is the same, and the poses first follow bodies
 * whose surfaces have moved, however little: where they lag by a hundredth of a cell, the force on a box
 * that moves through a bed is 2 to 8 % off. A body that is round about the axis of its rotation has not moved by it.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_open_volumes(struct gr_engine *e, int follow);

/* Place of a node of the grid in the tables, -1 if no body is near. */
static inline int64_t gr_open_place(const struct gr_open_volume *open, int64_t id)
{
    return open ? (int64_t)gr_table_get(&open->place, id) - 1 : -1;
}

/* Open part of a cell of the grid, NULL if all of it is. */
static inline const struct gr_open_part *gr_open_part(const struct gr_open_volume *open, int64_t id)
{
    const int64_t place = open ? (int64_t)gr_table_get(&open->part_of, id) - 1 : -1;
    return place < 0 ? 0 : &open->part[place];
}
