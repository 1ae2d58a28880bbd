/* Values given at some times: gravity, and the motion of bodies. */
#pragma once

/* The values at time t: linear between the given times, constant before the first and after the last.
 * Given: n times in ascending order, each `time_stride` numbers after the last, and the `components` values of each, which
 * begin `stride` numbers after the last. */
static inline void gr_piecewise(int components, int n, const double *times, int time_stride, const double *values,
                                int stride, double t, double *out)
{
    int k = 0;
    while (k < n && times[k * time_stride] <= t) k++;
    for (int c = 0; c < components; c++) {
        if (k == 0 || k == n) {
            out[c] = values[(k ? n - 1 : 0) * stride + c];
        } else {
            const double begin = times[(k - 1) * time_stride], s = (t - begin) / (times[k * time_stride] - begin);
            out[c] = values[(k - 1) * stride + c] * (1 - s) + values[k * stride + c] * s;
        }
    }
}
