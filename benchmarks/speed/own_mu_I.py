"""The mu(I) law as a user would write it, in NumPy, for numba and in C, for tests and timings."""

from __future__ import annotations

import numpy as np


def mu_I(dt, parameters, gradient, log_density, stress, shear_rate, history):
    """mu(I) of Dunatunga & Kamrin 2015, eq. 3.11 to 3.15, for arrays of points."""
    K, G, mu_s, mu_2, xi = parameters[:5]
    normal = stress[:3]
    p = np.where(log_density >= 0, K * log_density, 0.0)
    normal += -normal.sum(axis=0) / 3  # the deviator is left
    tau = np.sqrt(0.5 * (normal**2).sum(axis=0) + (stress[3:] ** 2).sum(axis=0))
    alpha = xi * G * dt * np.sqrt(p)
    B, H = mu_2 * p + tau + alpha, mu_2 * p * tau + mu_s * p * alpha
    flows = tau > mu_s * p
    root = np.sqrt(np.maximum(B**2 - 4 * H, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(flows, 2 * H / ((B + root) * tau), 1.0)
    share = np.where(p > 0, share, 0.0)
    shear_rate[:] = np.where(flows & (p > 0), (tau - share * tau) / (G * dt), 0.0)
    stress *= share
    normal -= p


def mu_I_by_points(dt, parameters, gradient, log_density, stress, shear_rate, history):
    """The same, point by point, as numba has it."""
    K, G, mu_s = parameters[0], parameters[1], parameters[2]
    mu_2, xi = parameters[3], parameters[4]
    for k in range(len(log_density)):
        p = K * log_density[k]
        if not p > 0:
            stress[:, k] = 0.0
            continue
        mean = (stress[0, k] + stress[1, k] + stress[2, k]) / 3
        square = 0.0
        for c in range(len(stress)):
            if c < 3:
                stress[c, k] -= mean
            square += stress[c, k] ** 2 * (0.5 if c < 3 else 1.0)
        tau, share = np.sqrt(square), 1.0
        if tau > mu_s * p:
            alpha = xi * G * dt * np.sqrt(p)
            B, H = mu_2 * p + tau + alpha, mu_2 * p * tau + mu_s * p * alpha
            share = 2 * H / ((B + np.sqrt(max(B * B - 4 * H, 0.0))) * tau)
            shear_rate[k] = (tau - share * tau) / (G * dt)
        for c in range(len(stress)):
            stress[c, k] *= share
            if c < 3:
                stress[c, k] -= p


MU_I_IN_C = """
#define MOST(a, b) ((a) > (b) ? (a) : (b)) /* fmax would keep the loop from becoming vectors */

static inline void flow(const int m, int64_t n, double dt, const double *q,
                        const double *restrict c, double *restrict s, double *restrict rate)
{
    const double K = q[0], G = q[1], mu_s = q[2], mu_2 = q[3], xi = q[4];
    #pragma omp simd
    for (int64_t k = 0; k < n; k++) {
        const double mean = (s[k] + s[n + k] + s[2 * n + k]) / 3, p = MOST(K * c[k], 0);
        double square = 0;
        #pragma GCC unroll 6
        for (int i = 0; i < m; i++) {
            const double d = s[i * n + k] - (i < 3 ? mean : 0);
            s[i * n + k] = d, square += (i < 3 ? 0.5 : 1) * d * d;
        }
        const double tau = sqrt(square), S0 = mu_s * p, S2 = mu_2 * p;
        const double alpha = xi * G * dt * sqrt(p), B = S2 + tau + alpha, H = S2 * tau + S0 * alpha;
        const double root = sqrt(MOST(B * B - 4 * H, 0)),
                     flows = 2 * H / ((B + root) * MOST(tau, 1e-300));
        const double share = p > 0 ? (tau > S0 ? flows : 1) : 0;
        rate[k] = p > 0 ? (tau - share * tau) / (G * dt) : 0;
        #pragma GCC unroll 6
        for (int i = 0; i < m; i++) s[i * n + k] = share * s[i * n + k] - (i < 3 ? p : 0);
    }
}

void update(int64_t n, int64_t dim, double dt, const double *parameters, const double *gradient,
            const double *log_density, double *stress, double *shear_rate, double *history)
{
    if (dim == 2)
        flow(4, n, dt, parameters, log_density, stress, shear_rate);
    else
        flow(6, n, dt, parameters, log_density, stress, shear_rate);
}
"""
