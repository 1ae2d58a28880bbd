/* The struct of a contact point, and the list of all contact points of a step (contact_points.h). */
#pragma once

#include "mpm/engine.h"

/* A contact point. Nodes are numbered in gr_contact_points; the shape functions of those with mass are normalised to the
 * sum 1. */
struct gr_contact_point {
    int body, n_nodes, at_edge;       /* at_edge: the stress of the point bounds its impulse */
    int64_t slot, lane;               /* of the point in its arrays; of its cell */
    double arm[3], normal[3];         /* from the position of the body, m; out of the body. The arm of a body that turns
                                         freely is the arm of sum N_i x_i, so that it gains the angular momentum that the
                                         nodes lose */
    double normal_mobility, mobility; /* of the material and of the body along the normal, and at most; 1/kg */
    double bound;                     /* of the velocity along the normal, m/s: <= 0 */
    double most;                      /* impulse, N s */
    double impulse[3], pressing;      /* on the material, N s; its part along the normal */
    double speed;                     /* of the point where its impulse may pull, m/s */
    int n_barred;
    double barred[2][3]; /* directions along the surface, normal to each other, in which other contact points of the point
                            act */
    int32_t node[GR_MAX_NODES];
    double weight[GR_MAX_NODES];
};

/* A node that contact points act on: velocity and inverse mass, 0 where a wall holds the component, also if the node leaves
 * it in this step. Only what the sweeps read. */
struct gr_contact_node {
    double v[4], mobility[4];
};

/* The same node: velocity before contact, inverse mass, 1/kg, also of held components, and its index in the mesh. Its
 * wall takes the velocity `taken` from its points, m/s, the impulse `pressed` of the contact points in components that it
 * holds, N s, and the velocity `friction` along itself, if it has some. Of the contact points that may pull: their mean
 * impulse there, and the sum of their shape functions. */
struct gr_contact_origin {
    double before[3], inverse_mass, taken[3], pressed[3], friction[3], mean[3], weight;
    int64_t n;
    int held, rubs; /* bit d: a wall holds component d; whether it has friction */
    uint8_t code;   /* of its wall, see gr_wall_now */
};

struct gr_contact_points {
    struct gr_contact_point *contact;
    int64_t n, capacity;
    struct gr_contact_node *node;
    struct gr_contact_origin *origin; /* of the nodes */
    int64_t n_nodes, node_capacity;
    int32_t *number; /* per node of the mesh: its number + 1 in the nodes of the contact points, 0 for none */
    int64_t number_capacity;
    int64_t *begin;                  /* per cell near bodies: where its contact points begin in the search */
    int64_t of_chunk[GR_MAX_CHUNKS]; /* number of contact points from each chunk of the search */
    struct gr_split_pose *pose;      /* of the bodies, when these cells were listed */
    int listed;
};

/* Take away the part of a vector along a unit vector. */
static inline void gr_take_away(double vector[3], const double unit[3])
{
    const double part = vector[0] * unit[0] + vector[1] * unit[1] + vector[2] * unit[2];
    for (int d = 0; d < 3; d++) vector[d] -= part * unit[d];
}
