/* Gravity that changes with time. */
#pragma once

/* Gravity at time t: piecewise linear between the given times, constant before the first and after the last.
 * Given: times[n], s, and vectors[n x dim], m/s^2.
 * Returned: g[dim], m/s^2. */
static inline void gr_gravity(int dim, int n, const double *times, const double *vectors, double t, double *g)
{
    int k = 0;
    while (k < n && times[k] <= t) k++;
    for (int d = 0; d < dim; d++) {
        if (k == 0 || k == n) {
            g[d] = vectors[(k ? n - 1 : 0) * dim + d];
        } else {
            const double s = (t - times[k - 1]) / (times[k] - times[k - 1]);
            g[d] = vectors[(k - 1) * dim + d] * (1 - s) + vectors[k * dim + d] * s;
        }
    }
}
