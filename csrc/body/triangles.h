/* Exact distances from the triangles of a surface, by a tree of boxes. */
#pragma once

#include <stdint.h>

/* Part of a triangle that is nearest to a point: its inside, the vertex k, or the edge from vertex k to the next. */
enum { GR_ON_FACE, GR_ON_VERTEX, GR_ON_EDGE = GR_ON_VERTEX + 3 };

/* The point of the triangle v[0], v[1], v[2] nearest to x (Ericson 2005, Real-Time Collision Detection, section 5.1.5: by
 * the Voronoi regions of its features). Returned: on which part it lies. */
int gr_nearest_on_triangle(const double v[3][3], const double x[3], double nearest[3]);

/* A box about triangles, with axes of its own: a box along x, y and z about a sloped part is thick, and near a fine surface
 * hundreds of them would be no farther than the nearest triangle. */
struct gr_triangle_box {
    double axis[3][3], low[3], high[3]; /* m, along the axes; low > high where it is empty */
};

/* Triangles seen from far off: a dipole. */
struct gr_dipole {
    double at[3], area[3]; /* m: mean position by area; m2: sum of areas times unit normals */
    double radius;         /* m: no corner is farther from `at` */
};

/* A surface; its tables are borrowed, the rest is its own. */
struct gr_triangles {
    int64_t n_vertices, n_faces;
    const double *vertex; /* n_vertices x 3, m */
    const int32_t *face;  /* n_faces x 3 */
    double *corner;       /* n_faces x 3 x 3: vertices of the triangles, m, leaf by leaf, so that near ones are adjacent */
    int64_t n_leaves;     /* a power of two */
    struct gr_triangle_box *box; /* a complete binary tree, node 1 the root */
    struct gr_dipole *dipole;    /* of the same nodes */
};

/* Build the tree. Returned: 0 or GR_ERR_MEMORY. */
int gr_triangles_new(struct gr_triangles **out, const struct gr_triangles *tables);
void gr_triangles_free(struct gr_triangles *t);

/* Distance of x. `guess` is the index in this order of a triangle nearby, afterwards of the nearest. */
double gr_triangles_distance(const struct gr_triangles *t, const double x[3], int64_t *guess);

/* 1 if no triangle is nearer to x than a radius; cheaper than the distance. */
int gr_triangles_clear(const struct gr_triangles *t, const double x[3], double radius);

/* Winding number of a closed surface about x: the sum of the solid angles of its triangles over 4 pi, by the number of
 * times that the surface goes around x, anticlockwise as seen from outside (Jacobson, Kavan & Sorkine-Hornung 2013, ACM
 * Trans. Graph. 32, 33). Nodes of the tree that are far off count as dipoles (Barill et al. 2018, ACM Trans. Graph. 37,
 * 43). */
double gr_triangles_winding(const struct gr_triangles *t, const double x[3]);

/* Distances of n points x; if `closed`, negative where the winding number exceeds a half. */
void gr_triangles_distances(const struct gr_triangles *t, int64_t n, const double *x, int closed, double *distance);
