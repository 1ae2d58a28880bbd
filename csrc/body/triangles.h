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

/* A surface; its tables are borrowed, the rest is its own. */
struct gr_triangles {
    int64_t n_vertices, n_faces;
    const double *vertex;        /* n_vertices x 3, m */
    const int32_t *face;         /* n_faces x 3 */
    const int32_t *neighbour;    /* n_faces x 3: the triangle beyond the edge from vertex k to the next; NULL: not closed */
    double *normal;              /* n_vertices x 3: angle-weighted normals of a closed surface */
    int32_t *order;              /* triangles leaf by leaf */
    double *corner;              /* n_faces x 3 x 3: their vertices, m, in this order: what is near lies together */
    int64_t n_leaves;            /* a power of two */
    struct gr_triangle_box *box; /* a complete binary tree, node 1 the root */
};

/* Build the tree and the normals. Returned: 0 or GR_ERR_MEMORY. */
int gr_triangles_new(struct gr_triangles **out, const struct gr_triangles *tables);
void gr_triangles_free(struct gr_triangles *t);

/* Distance of x; negative within a closed surface (the sign of Baerentzen & Aanaes 2005, IEEE Trans. Vis. Comput. Graph. 11,
 * 243: by the angle-weighted normal of the nearest feature). `guess` is the place in this order of a triangle that is near, of the nearest afterwards. */
double gr_triangles_distance(const struct gr_triangles *t, const double x[3], int64_t *guess);
