/* Signed distance of a surface from samples (samples.h). */
#include "body/samples.h"

#include <math.h>

#include "body/vector.h"
#include "core/index.h"

/* Spacings within which all samples are fine, and by which coarse ones, interpolated, are too large at most. Along a
 * straight line a distance rho has the second derivative 1/rho at most, in two directions; coarse cells are GR_CUBE
 * spacings wide, and rho is no less than the band in cells without a block: 2 GR_CUBE^2/(8 BAND). */
#define BAND 6.0
#define COARSE_ERROR (GR_CUBE * GR_CUBE / (4 * BAND))

/* Linear interpolation in the cube of samples at `first`, and its slope per spacing. */
static double interpolate(const float *first, const int64_t step[3], const double share[3], double slope[3])
{
    double value = 0;
    slope[0] = slope[1] = slope[2] = 0;
    for (int corner = 0; corner < 8; corner++) {
        double weight[3];
        int64_t at = 0;
        for (int d = 0; d < 3; d++) {
            weight[d] = corner >> d & 1 ? share[d] : 1 - share[d];
            at += (corner >> d & 1) * step[d];
        }
        const double sample = (double)first[at];
        value += weight[0] * weight[1] * weight[2] * sample;
        for (int d = 0; d < 3; d++)
            slope[d] += (corner >> d & 1 ? sample : -sample) * weight[(d + 1) % 3] * weight[(d + 2) % 3];
    }
    return value;
}

/* Block of the coarse cell `at`; NULL if it has none. The caller may write to the table: a wrong number is none. */
static const float *block_at(const struct gr_samples *s, const int32_t at[3], int64_t *number)
{
    *number = s->block[((int64_t)at[2] * s->n[1] + at[1]) * s->n[0] + at[0]];
    return *number >= 0 && *number < s->n_blocks ? s->fine + *number * GR_CUBE_SIZE : 0;
}

/* Place in fine spacings of the nearest point of the grid, and its coarse cell. Returned: squared distance from the grid. */
static double locate(const struct gr_samples *s, const double x[3], double place[3], int32_t cell[3], double out[3])
{
    double square = 0;
    for (int d = 0; d < 3; d++) {
        const double all = (x[d] - s->low[d]) / s->spacing;
        place[d] = fmax(0, fmin(all, (double)GR_CUBE * s->n[d]));
        cell[d] = (int32_t)gr_index(place[d] / GR_CUBE, 0, s->n[d] - 1);
        out[d] = (all - place[d]) * s->spacing;
        square += out[d] * out[d];
    }
    return square;
}

static double within(const struct gr_samples *s, const double place[3], const int32_t cell[3], double slope[3])
{
    double share[3];
    int64_t number, first = 0;
    const float *fine = block_at(s, cell, &number);
    if (fine) {
        const int64_t step[3] = {1, GR_CUBE_SIDE, GR_CUBE_SIDE * GR_CUBE_SIDE};
        for (int d = 0; d < 3; d++) {
            const double at = place[d] - (double)GR_CUBE * cell[d];
            const int k = (int)gr_index(at, 0, GR_CUBE - 1);
            share[d] = at - k;
            first += k * step[d];
        }
        return interpolate(fine + first, step, share, slope);
    }
    const int64_t step[3] = {1, s->n[0] + 1, (int64_t)(s->n[0] + 1) * (s->n[1] + 1)};
    for (int d = 0; d < 3; d++) {
        share[d] = place[d] / GR_CUBE - cell[d];
        first += cell[d] * step[d];
    }
    const double value = interpolate(s->coarse + first, step, share, slope), margin = COARSE_ERROR * s->spacing;
    return value < 0 ? fmin(value + margin, -BAND * s->spacing) : fmax(value - margin, BAND * s->spacing);
}

double gr_samples_distance(const struct gr_samples *s, const double x[3], double normal[3])
{
    double place[3], slope[3], out[3];
    int32_t cell[3];
    const double square = locate(s, x, place, cell, out);
    double value = within(s, place, cell, slope), length = sqrt(gr_dot(slope, slope));
    for (int d = 0; d < 3; d++) normal[d] = length > 0 ? slope[d] / length : d == 2;
    if (!(square > 0)) return value;
    /* A surface point p and the nearest point q of the grid to x: |x - p|^2 >= |x - q|^2 + |q - p|^2. */
    value = fabs(value);
    const double all = sqrt(square + value * value);
    for (int d = 0; d < 3; d++) normal[d] = (value * normal[d] + out[d]) / all;
    length = sqrt(gr_dot(normal, normal));
    for (int d = 0; d < 3; d++) normal[d] = length > 0 ? normal[d] / length : d == 2;
    return all;
}

int gr_samples_edges(const struct gr_samples *s, const double x[3], double near)
{
    double place[3], out[3];
    int32_t cell[3], low[3], high[3];
    int edges = 0;
    const double reach = near / s->spacing + 1;
    locate(s, x, place, cell, out);
    for (int d = 0; d < 3; d++) {
        const int64_t last = (int64_t)GR_CUBE * s->n[d] - 1;
        low[d] = (int32_t)gr_index(ceil(place[d] - reach), 0, last);
        high[d] = (int32_t)gr_index(place[d] + reach, 0, last);
    }
    for (int32_t k = low[2]; k <= high[2]; k++)
        for (int32_t j = low[1]; j <= high[1]; j++)
            for (int32_t i = low[0]; i <= high[0]; i++) {
                const int32_t at[3] = {i / GR_CUBE, j / GR_CUBE, k / GR_CUBE};
                const double off[3] = {i - place[0], j - place[1], k - place[2]};
                int64_t number;
                if (gr_dot(off, off) > reach * reach || !block_at(s, at, &number)) continue;
                const int64_t in = ((k % GR_CUBE) * GR_CUBE_SIDE + j % GR_CUBE) * GR_CUBE_SIDE + i % GR_CUBE;
                edges |= s->sharp[number * GR_CUBE_SIZE + in] & 3;
            }
    return edges;
}
