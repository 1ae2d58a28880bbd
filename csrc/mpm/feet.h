/* Contact points of the material with the surfaces of bodies.
 *
 * A material point near a body touches it at its foot, the nearest point x_s = x - phi n of the surface, with phi the
 * signed distance and n the outward normal. There the velocity of the material is interpolated from the nodes. A point
 * takes part if its distance is below r, half the spacing of points,
 *
 *   r = (m/rho_c)^(1/dim)/2,
 *
 * or can fall below it within the next two steps; of sticky and bilateral surfaces, if it is below 1.5 r. The impulses at all feet are found together (contact.c).
 *
 * An impulse is at most m c_w, with the speed c_w of compression waves: a traction of about rho c_w^2. Where material is
 * pinched between surfaces that approach each other no impulse fulfils all conditions, and this alone bounds it.
 *
 * Where the nodes about a foot have hardly any mass, a point acts at its own place instead: there is its own mass at
 * least. At convex edges the impulse is bounded by the stress of the point (edges.h).
 *
 * In a corner, where a point has feet on several surfaces, a foot has no friction in the directions that another surface
 * bars: there only what presses on that surface acts. */
#pragma once

#include "core/team.h"
#include "mpm/engine.h"

/* A foot. Nodes are numbered in gr_feet; the shape functions of those with mass are normalised to the sum 1. */
struct gr_foot {
    int body, n_nodes, at_edge; /* at_edge: the stress of the point bounds its impulse */
    int64_t place;              /* of the point in its arrays */
    int32_t node[GR_MAX_NODES];
    double weight[GR_MAX_NODES];
    double arm[3], normal[3];         /* from the position of the body, m; out of the body. The arm of a body that turns
                                         freely is that of sum N_i x_i, so that it gains the angular momentum that the
                                         nodes lose */
    double normal_mobility, mobility; /* of the material and of the body along the normal, and at most; 1/kg */
    double bound;                     /* of the velocity along the normal, m/s: <= 0 */
    double most;                      /* impulse, N s */
    double impulse[3], pressing;      /* on the material, N s; its part along the normal */
    int n_barred;
    double barred[2][3]; /* directions along the surface, normal to each other, in which other feet of the point act */
};

/* A node that feet act on: velocity and inverse mass, 0 where a wall holds the component, also if the node leaves it in this
 * step; what the sweeps read, and nothing else. */
struct gr_foot_node {
    double v[4], mobility[4];
};

/* The same node: velocity before contact, inverse mass, 1/kg, also of held components, and its place in the mesh. Its wall
 * takes the velocity `taken` from its points, m/s, the impulse `pressed` of the feet in components that it holds, N s, and the
 * velocity `friction` along itself, if it has some. Of the feet that may pull: their mean impulse there, and the sum of their
 * shape functions. */
struct gr_foot_origin {
    double before[3], inverse_mass, taken[3], pressed[3], friction[3], mean[3], weight;
    int64_t n;
    int held, rubs; /* bit d: a wall holds component d; whether it has friction */
};

struct gr_feet {
    struct gr_foot *foot;
    int64_t n, capacity;
    struct gr_foot_node *node;
    struct gr_foot_origin *origin; /* of the nodes */
    int64_t n_nodes, node_capacity;
    int32_t *number; /* per node of the mesh: its number + 1 among those of the feet, 0 for none */
    int64_t number_capacity;
    int64_t *near;     /* cells near a body, ascending */
    uint64_t *bodies;  /* of these: bit b: body b */
    double *clearance; /* distance of their centres from the nearest of these, m */
    int64_t *begin;    /* place of their first foot in the search */
    int64_t n_near, near_capacity;
    int64_t found[GR_MAX_CHUNKS]; /* feet that each chunk of the search has found */
    struct gr_split_pose *pose;   /* of the bodies, when these cells were listed */
    int listed;
};

/* Take away the part of a vector along a unit vector. */
static inline void gr_take_away(double vector[3], const double unit[3])
{
    const double part = vector[0] * unit[0] + vector[1] * unit[1] + vector[2] * unit[2];
    for (int d = 0; d < 3; d++) vector[d] -= part * unit[d];
}

int gr_feet_new(struct gr_engine *e);
void gr_feet_free(struct gr_feet *feet);

/* List the cells near bodies, unless the list still holds: the mesh is the same and no body has moved far. It does not
 * bear on the results.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_feet_list(struct gr_engine *e);

/* Find the feet of this step, by all threads of a team. Call it after the grid stage. The impulses start from those of the
 * last step, which the points have kept as forces: of a point with several feet, each has the part of the force along its
 * normal. */
void gr_feet_find(struct gr_engine *e, const double g[3], struct gr_team *team);

/* Keep the impulses of the feet as forces on their points. */
void gr_feet_keep(struct gr_engine *e);

/* Move points that have slipped into a body at one of its edges towards its surface. Call it when the points are in their
 * cells, and before the sums of the cells that lost or gained points are made anew. */
void gr_feet_move_out(struct gr_engine *e);
