"""Depth of the crater of a ball that falls on a bed at low speed.

An empirical law: J. S. Uehara, M. A. Ambroso, R. P. Ojha & D. J. Durian, Phys. Rev. Lett. 90,
194301 (2003).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from granular.tools.arrays import Array
from granular.tools.checks import positive


def crater_depth(drop: ArrayLike, D: float, mu: float, density_ratio: float) -> Array:
    """Depth that a ball reaches when it falls on a bed of dry grains (Uehara et al. 2003).

    ``d = 0.14/mu sqrt(rho_b/rho_g) D^(2/3) H^(1/3)`` with the total distance H of the fall from the
    release to rest. As H = drop + d, the depth is the positive root of a cubic equation. The law
    is a fit to measurements.

    Parameters
    ----------
    drop : array_like
        Height of the lowest point of the ball above the bed when it is released [m], >= 0.
    D : float
        Diameter of the ball [m].
    mu : float
        Tangent of the angle of repose of the grains, > 0.
    density_ratio : float
        Density of the ball over that of the bed, rho_b/rho_g, > 0.

    Returns
    -------
    ndarray
        Depth d of the lowest point of the ball below the initial surface [m], of the shape of
        `drop`.
    {raises}.
    """
    drop = np.asarray(drop, dtype=float)
    if not np.all(np.isfinite(drop) & (drop >= 0)):
        raise ValueError(f"drop = {drop} must be >= 0 and finite")
    D = positive("D", D)
    k = 0.14 / positive("mu", mu) * np.sqrt(positive("density_ratio", density_ratio)) * D ** (2 / 3)
    # The root of d^3 = k^3 (drop + d) that is >= 0, by Newton's method from above: the cubic is
    # convex there, and positive at the start.
    depth = k**1.5 + k * np.cbrt(drop)
    for _ in range(60):
        depth = (2 * depth**3 + k**3 * drop) / (3 * depth**2 - k**3)
    return np.asarray(depth)
