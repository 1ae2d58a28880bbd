/* The solid below heights on a grid of posts: distance from its surface, two triangles between four posts. */
#pragma once

#include <stdint.h>

/* Cells between posts, along each axis, of a tile: the smallest part with a stored range of heights. */
enum { GR_TILE = 8 };

/* Tables are borrowed. The third axis is up. In 2D the map has two equal rows of posts, `stride` 0. */
struct gr_height_map {
    int64_t n[2];         /* posts along x and y, >= 2 */
    int64_t stride;       /* posts from a row to the next */
    double low[2];        /* m: first post */
    double spacing[2];    /* m */
    const double *height; /* m; NULL if they are floats */
    const float *height_float;
    const double *range; /* lowest and highest height of tiles, x fastest, then of two by two of these, to a single one, m */
};

/* Number of ranges of a map of n posts. */
int64_t gr_height_map_ranges(const int64_t n[2]);

/* Distance from the surface, negative below it, and the unit normal there. Beyond its edges the map goes on as it is at
 * its edge. */
double gr_height_map_distance(const struct gr_height_map *map, const double x[3], double normal[3]);

/* Edges nearer to x than `near`, by the bend along either axis: 1 for convex, 2 for concave ones. */
int gr_height_map_edges(const struct gr_height_map *map, const double x[3], double near);
