/* Motion of rigid bodies, and the contact rule (body.h). */
#include "body/body.h"

#include <math.h>
#include <string.h>

#include "core/piecewise.h"

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

void gr_motion_at(const struct gr_body *body, double t, double out[6])
{
    gr_piecewise(6, body->n_motion, body->motion, 7, body->motion + 1, 7, t, out);
}

void gr_motion_mean(const struct gr_body *body, double begin, double length, double out[6])
{
    const double end = begin + length;
    double from = begin;
    memset(out, 0, 6 * sizeof(double));
    for (int k = 0; k <= body->n_motion && from < end; k++) { /* the interval that ends with row k */
        const double to = k < body->n_motion ? fmin(body->motion[7 * k], end) : end;
        double middle[6];
        if (!(to > from)) continue;
        gr_motion_at(body, from + (to - from) / 2, middle); /* linear in this interval: the mean */
        for (int c = 0; c < 6; c++) out[c] += (to - from) / length * middle[c];
        from = to;
    }
}

void gr_turn(const double o[4], const double omega[3], double dt, double out[4])
{
    const double rate = sqrt(dot(omega, omega)), half = rate * dt / 2;
    const double share = rate > 0 ? sin(half) / rate : 0;
    const double w = cos(half), x = share * omega[0], y = share * omega[1], z = share * omega[2];
    const double turned[4] = {w * o[0] - x * o[1] - y * o[2] - z * o[3], w * o[1] + x * o[0] + y * o[3] - z * o[2],
                              w * o[2] - x * o[3] + y * o[0] + z * o[1], w * o[3] + x * o[2] - y * o[1] + z * o[0]};
    double norm = 0;
    for (int k = 0; k < 4; k++) norm += turned[k] * turned[k];
    for (int k = 0; k < 4; k++) out[k] = turned[k] / sqrt(norm);
}
