"""Forces of three-dimensional resistive force theory on plates in slow motion.

The fit of Agarwal, Goldman & Kamrin (2023, PNAS 120, e2214017120, doi:10.1073/pnas.2214017120,
supplement S3): the stress on a surface is its depth times xi_n, which is of the material, times a
response that is not. It was fitted to some 3000 runs of MPM with a law of constant friction whose
volume does not change in flow. Numbers as in four public implementations that agree, but for one
coefficient (0.18519 or 0.18589) on which the forces here depend by less than a thousandth.

That of Li, Zhang & Goldman (2013, Science 339, 1408) is measured: the stress on a plate per depth
in poppy seeds, loose and close.
"""

from __future__ import annotations

import math

import numpy as np

RESPONSE = np.array(
    [
        (0.00212, -0.06796, -0.02634),
        (-0.02320, -0.10941, -0.03436),
        (-0.20890, 0.04725, 0.45256),
        (-0.43083, -0.06914, 0.00835),
        (-0.00259, -0.05835, 0.02553),
        (0.48872, -0.65880, -1.31290),
        (-0.00415, -0.11985, -0.05532),
        (0.07204, -0.25739, 0.06790),
        (-0.02750, -0.26834, -0.16404),
        (-0.08772, 0.02692, 0.02287),
        (0.01992, -0.00736, 0.02927),
        (-0.45961, 0.63758, 0.95406),
        (0.40799, 0.08997, -0.00131),
        (-0.10107, 0.21069, -0.11028),
        (-0.06576, 0.04748, 0.01487),
        (0.05664, 0.20406, -0.02730),
        (-0.09269, 0.18519, 0.10911),
        (0.01892, 0.04934, -0.04097),
        (0.01033, 0.13527, 0.07881),
        (0.15120, -0.33207, -0.27519),
    ]
)
"""Coefficients of the terms of f1, f2 and f3, see `response`."""

MEASURED = {"down": (0.254, 0.464), "along": (0.083, 0.125)}
"""Stress on a plate per depth in loose and in close poppy seeds [N/cm3]: a level one that is pushed
down, and an upright one that moves along the ground (Li, Zhang & Goldman 2013)."""


def scale(mu: float) -> float:
    """Stress over depth xi_n of a material with the friction coefficient mu, over rho g."""
    return 894 * mu**3 - 386 * mu**2 + 89 * mu


def response(tilt_deg: float, attack_deg: float, friction: float) -> tuple[float, float]:
    """Stress on a plate, ahead and upwards, over depth and xi_n.

    The leading face of the plate has the normal (sin(tilt), -cos(tilt)), ahead and upwards, and the
    plate moves along (cos(attack), -sin(attack)). Its friction bounds the shear stress on it.
    """
    beta, gamma = math.radians(tilt_deg), math.radians(attack_deg)
    x, y = math.sin(gamma), math.cos(beta)
    z = math.cos(gamma) * math.sin(beta) + math.sin(gamma) * math.cos(beta)
    terms = (
        1, x, y, z, x * x, y * y, z * z, x * y, y * z, z * x,
        x**3, y**3, z**3, x * y**2, y * x**2, y * z**2, z * y**2, z * x**2, x * z**2, x * y * z,
    )  # fmt: skip
    f1, f2, f3 = np.array(terms) @ RESPONSE
    normal = np.array((math.sin(beta), -math.cos(beta)))
    stress = f1 * normal + f2 * np.array((math.cos(gamma), -math.sin(gamma))) - (0.0, f3)
    pressure = stress @ normal * normal
    shear = stress - pressure
    size = float(np.hypot(*shear))
    largest = friction * float(np.hypot(*pressure))
    ahead, up = pressure + shear * (min(1.0, largest / size) if size > 0 else 0.0)
    return float(ahead), float(up)
