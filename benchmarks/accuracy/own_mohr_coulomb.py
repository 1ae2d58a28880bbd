"""Mohr-Coulomb, and dilation that ends at a critical density, as user-defined laws in C."""

from __future__ import annotations

import math

import granular as gr

SOURCE = """
/* Friction tau/p: of a cone, or of the Mohr-Coulomb surface in the direction of the deviator, where
   sigma_1 - sigma_3 = (sigma_1 + sigma_3) sin(phi) in compression. The angle alpha is 0 in triaxial
   compression and pi/6 in coaxial plane strain without dilation. */
static double friction(double mu, double sin_phi, double tau, double J3)
{
    if (!(sin_phi > 0) || !(tau > 0)) return mu;
    double cosine = 1.5 * sqrt(3.0) * J3 / (tau * tau * tau);
    if (cosine > 1) cosine = 1;
    if (cosine < -1) cosine = -1;
    const double third = 2.0 * acos(-1.0) / 3.0, alpha = acos(cosine) / 3.0;
    const double c1 = cos(alpha), c2 = cos(alpha - third), c3 = cos(alpha + third);
    return sqrt(3.0) * sin_phi / (c1 - c3 + c2 * sin_phi);
}

void update(int64_t n, int64_t dim, double dt, const double *parameters, const double *gradient,
            const double *log_density, double *s, double *shear_rate, double *history)
{
    const double K = parameters[0], G = parameters[1], mu = parameters[2], sin_phi = parameters[3];
    const double dilatancy = parameters[4], most = parameters[5];
    for (int64_t k = 0; k < n; k++) {
        const double grown = history[k]; /* plastic dilation so far */
        double p = K * (log_density[k] - most + grown);
        if (!(p > 0)) {
            for (int i = 0; i < 2 * dim; i++) s[i * n + k] = 0;
            continue;
        }
        const double mean = (s[k] + s[n + k] + s[2 * n + k]) / 3;
        const double x = s[k] - mean, y = s[n + k] - mean, z = s[2 * n + k] - mean;
        const double xy = s[3 * n + k];
        const double yz = dim == 3 ? s[4 * n + k] : 0, xz = dim == 3 ? s[5 * n + k] : 0;
        const double tau = sqrt(0.5 * (x * x + y * y + z * z) + xy * xy + yz * yz + xz * xz);
        /* of the deviator that is positive in compression */
        const double J3 = -(x * (y * z - yz * yz) - xy * (xy * z - yz * xz)
                            + xz * (xy * yz - y * xz));
        const double d = most > 0 ? dilatancy * (1 - grown / most) : 0;
        const double M = friction(mu, sin_phi, tau, J3) + d;
        double share = 1;
        if (tau > M * p) {
            double rate = (tau - M * p) / (G + M * K * d);
            if (rate * d > most - grown) rate = (tau - M * (p + K * (most - grown))) / G;
            if (rate < 0) rate = 0;
            const double more = rate * d > most - grown ? most - grown : rate * d;
            history[k] = grown + more;
            p += K * more;
            shear_rate[k] = rate / dt;
            share = M * p < tau ? M * p / tau : 1;
        }
        s[k] = share * x - p, s[n + k] = share * y - p, s[2 * n + k] = share * z - p;
        for (int i = 3; i < 2 * dim; i++) s[i * n + k] *= share;
    }
}
"""


def material(
    *,
    mu: float = 0.0,
    phi_deg: float = 0.0,
    dilatancy: float = 0.0,
    dilation: float = 0.0,
    **numbers: float,
) -> gr.materials.OwnLaw:
    """Material with a cone of coefficient `mu`, or with a Mohr-Coulomb surface of `phi_deg`.

    The flow is radial in the deviator. With `dilatancy`, the plastic volumetric over the shear
    strain at first, it dilates: the rate falls linearly to zero as the volume grows by `dilation`,
    and the friction is the critical friction plus the rate (Taylor 1948). A point then begins
    with the logarithm `dilation` of its density over rho_c, which is the critical density.
    """
    return gr.materials.from_function(
        SOURCE,
        name="mohr_coulomb",
        parameters={
            "mu": mu, "sin_phi": math.sin(math.radians(phi_deg)), "dilatancy": dilatancy,
            "dilation": dilation,
        },
        history={"dilation": 0.0},
        **numbers,
    )  # fmt: skip
