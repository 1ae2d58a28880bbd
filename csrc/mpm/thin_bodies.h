/* The two sides of bodies that are thinner than the grid resolves.
 *
 * Material on one side of a blade and material on the other have nodes in common: through them one would drag and bear the
 * other. Cells about a thin, a box with an edge below 3 dx (2 dx with hats), therefore exist twice, for the points on its front and for
 * those on its back, and so do their nodes. To the points of one side all nodes beyond the middle of the thin lie in the
 * body, and contact rules them as it does the nodes within a thick body. Where a node does not face the thin, beyond its
 * edges, its two copies move as one, by the sums of both. (The idea of sides: Hu et al. 2018, ACM Trans. Graph. 37, CPIC;
 * there points and nodes have them, and what does not reach a node is an impulse on the body at once.)
 *
 * A point keeps its side while it faces the thin, even if it has entered it by a step; elsewhere it is that of its place.
 * Which cells are double is decided at the poses `split`, which follow those of the bodies when these have moved by a
 * cell: it does not depend on when points were regrouped, nor on a restart. */
#ifndef GR_MPM_THIN_BODIES_H
#define GR_MPM_THIN_BODIES_H

#include <stdint.h>

struct gr_engine;
struct gr_config;

struct gr_thin_part {
    int body, part; /* of the config */
    int axis;       /* of the part, across the thin */
    double front;   /* 1 or -1: to which side along it the front is, away from the middle of the parts of the body */
};

struct gr_split_pose {
    double x[3], orientation[4];
};

/* A place as seen from the nearest thin. */
struct gr_facing {
    int body, facing;     /* whether the normal of the thin through the place meets it */
    double distance, mid; /* from the middle of the thin; from its plane, towards the front; m */
    double half;          /* half thickness, m */
    double inset;         /* from the edges of the thin, negative beyond them, m */
    double next;          /* distance from the next thin, m */
    double normal[3];     /* of the front, in axes of space */
};

/* Whether the scheme keeps the sides of thin bodies apart, and a body is thin. */
int gr_has_thin(const struct gr_config *config);

/* The thin parts of a config, to `thin` if that is not NULL. Returned: their number. */
int gr_list_thin(const struct gr_config *config, struct gr_thin_part *thin);

/* The nearest thin to a place, at the present poses or at those of the split. */
void gr_nearest_thin(const struct gr_engine *e, const double x[3], int now, struct gr_facing *side);

/* Whether a cell is double, and on which side its middle is: 1, -1 double; 2, -2 simple. */
int gr_cell_side(const struct gr_engine *e, const int32_t at[3], int *is_double);

/* Whether all places of a cell face the thin that is nearest to its middle: no point changes its side there. */
int gr_cell_faces_thin(const struct gr_engine *e, const int32_t at[3]);

/* Side, 1 or -1, of a point of a double cell that has had the side `current`, 0 for none. */
int gr_point_side(const struct gr_engine *e, const double x[3], int current);

/* Which of the copies among the nodes [first, last) are apart now. */
void gr_split_nodes(struct gr_engine *e, int64_t first, int64_t last);

/* Let the split follow bodies that have moved. Returned: whether it has: the points are to be grouped anew. */
int gr_follow_bodies(struct gr_engine *e);

#endif
