/* Thin bodies: bodies thinner than the grid resolves, and the separation of the material on their two sides.
 *
 * Material in front of a blade and material behind it would share nodes, and through these one would drag and carry the
 * other. A box with an edge below 3 dx, or 2 dx with linear shape functions, is a thin part. Cells near a thin part
 * exist twice, once for the points on its front and once for those on its back, and so do their nodes. For the points
 * of one side all nodes behind the face of this side lie in the body, and contact acts on them as on the nodes within a
 * thick body. A node that does not face the thin part, beyond its edges, moves as one with its duplicate, by the sums
 * of both. (The idea of sides: Hu et al. 2018, ACM Trans. Graph. 37, CPIC. There points and nodes have sides, and a
 * contribution that does not reach a node becomes an impulse on the body at once.)
 *
 * A point keeps its side while it faces the thin part, even if a step has carried it inside; elsewhere its position decides.
 * Which cells are double is decided at the poses `split`. They follow the bodies when these have moved by a cell, so that
 * the result depends neither on the times of regroupings nor on a restart. */
#pragma once

#include <stdint.h>

struct gr_engine;
struct gr_config;

struct gr_thin_part {
    int body, part; /* indices in the config */
    int axis;       /* of the part, across its thickness */
    double front;   /* 1 or -1: side of the front along this axis, away from the centre of the parts of the body */
};

struct gr_split_pose {
    double x[3], orientation[4];
};

/* Position of a point relative to the nearest thin part. */
struct gr_facing {
    int body, part;       /* indices in the config */
    int facing;           /* 1 if the point projects onto the thin part along its normal */
    double distance, mid; /* from the mid-surface of the thin part; from its mid-plane, positive towards the front; m */
    double half;          /* half thickness, m */
    double inset;         /* distance inside its edges, negative beyond them, m */
    double next;          /* distance from the second nearest thin part, m */
    double normal[3];     /* of the front, in axes of the scene */
};

/* List the thin parts of a config in `thin`, unless it is NULL; none if the scheme does not separate their sides.
 * Returned: their number. */
int gr_list_thin(const struct gr_config *config, struct gr_thin_part *thin);

/* Find the thin part nearest to x, at the present poses (`now`) or at the poses of the split. */
void gr_nearest_thin(const struct gr_engine *e, const double x[3], int now, struct gr_facing *side);

/* Find whether a cell is double, and the side of its centre.
 * Returned: of a double cell the side on which its centre is. */
enum gr_side_of_cell gr_cell_side(const struct gr_engine *e, const int32_t at[3]);

/* True if all points of a cell face the thin part nearest to its centre: then none changes sides there. */
int gr_cell_faces_thin(const struct gr_engine *e, const int32_t at[3]);

/* Side, 1 or -1, of a point of a double cell whose side was `current`, 0 if it had none. */
int gr_point_side(const struct gr_engine *e, const double x[3], int current);

/* Decide which duplicates among the nodes [first, last) are separated from their partners now. */
void gr_split_nodes(struct gr_engine *e, int64_t first, int64_t last);

/* Bound of the distance by which the surface of a body has moved from a pose, within the domain, m: the arm of an unbounded
 * body is at most the diagonal of the domain; a body that is round about the axis of its rotation has not moved by that. */
double gr_body_moved(const struct gr_engine *e, int b, const struct gr_split_pose *pose);

/* Let the pose `split` of a body follow if the body has moved farther.
 * Returned: 1 if it did. */
int gr_follow_body(struct gr_engine *e, int b, double far);

/* Let the poses `split` of thin bodies follow.
 * Returned: 1 if they did; the points must then be regrouped. */
int gr_follow_bodies(struct gr_engine *e);
