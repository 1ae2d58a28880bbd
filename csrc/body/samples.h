/* Signed distance of a surface from samples: fine ones in blocks about it, coarse ones elsewhere. */
#pragma once

#include <stdint.h>

/* Fine samples of a block are on a cube of GR_CUBE spacings, both ends included. */
enum { GR_CUBE = 8, GR_CUBE_SIDE = GR_CUBE + 1, GR_CUBE_SIZE = GR_CUBE_SIDE * GR_CUBE_SIDE * GR_CUBE_SIDE };

/* Tables are borrowed; x is the fastest index of all. */
struct gr_samples {
    double low[3], spacing; /* m: lowest sample, in coordinates of the part; distance of fine samples */
    int32_t n[3];           /* cells of the coarse grid, GR_CUBE spacings wide */
    const float *coarse;    /* (n[2] + 1)(n[1] + 1)(n[0] + 1) signed distances at its nodes, m */
    const int32_t *block;   /* n[2] n[1] n[0]: the block of a cell, or -1 */
    int32_t n_blocks;
    const float *fine;    /* n_blocks x GR_CUBE_SIZE signed distances, m */
    const uint8_t *sharp; /* n_blocks x GR_CUBE_SIZE: 1 at samples next to a convex edge, 2 a concave one */
};

/* Signed distance and its gradient, a unit vector: linear between the samples. In cells without a block, and outside of
 * the grid, it is a lower bound of the distance; of the right sign. */
double gr_samples_distance(const struct gr_samples *s, const double x[3], double normal[3]);

/* Edges next to samples nearer than `near` and a spacing: 1 for convex, 2 for concave ones. */
int gr_samples_edges(const struct gr_samples *s, const double x[3], double near);
