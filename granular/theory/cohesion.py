"""Strength of cohesive laws that do not dilate: of Mohr and Coulomb, and of a vertical cliff.

The laws bound the shear stress by ``tau <= c + mu p`` with tau = sqrt(s:s/2), and their plastic
flow preserves the volume. In plane strain Mohr's circle then has the centre p and the radius c + mu
p (`granular.theory.earth_pressure`). Where stress and strain rate are coaxial, that is the law of
Mohr and Coulomb with

    sin(phi) = mu,  cohesion c/cos(phi);

on a shear band that does not widen it is one with

    tan(phi) = mu,  cohesion c.

The unconfined strength, the major stress of a free-standing sample at yield, is

    f = 2 c_0 tan(45 deg + phi/2)

with the cohesion c_0 of Mohr and Coulomb. A vertical cliff of the height H slides on a plane from
its toe if H >= 2 f/(rho g) (Drucker & Prager 1952, Q. Appl. Math. 10, 157-165). This is an
upper bound by one mechanism; a curved surface lowers the factor from 4 to 3.83. A stress field in
equilibrium proves that a cliff of half the height is stable, and that is the height of a cliff
whose material bears no tension. The theorems are for flow that dilates by the friction angle. Flow
without dilation has no more strength than that with phi on the circle, and in bands that with the
lower angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular.model.gravity import EARTH
from granular.tools.checks import in_range, non_negative, positive


@dataclass(frozen=True, kw_only=True)
class UnconfinedStrength:
    """Major stress at which a sample yields whose sides are free, in plane strain.

    Attributes
    ----------
    coaxial, band : float
        Strength of uniform coaxial plane strain, and on a shear band [Pa].
    """

    coaxial: float
    band: float


def unconfined_strength(cohesion: float, mu: float) -> UnconfinedStrength:
    """Unconfined yield strength of a cohesive law in plane strain, 2 c_0 tan(45 deg + phi/2).

    Parameters
    ----------
    cohesion : float
        Shear stress at yield without pressure [Pa], >= 0: `cohesion` of a material.
    mu : float
        Friction coefficient of the law, such as `mu_s`, 0 to 1 (1 not included).
    {raises}.
    """
    cohesion, mu = non_negative("cohesion", cohesion), in_range("mu", mu, 0.0, 1.0, open_high=True)
    coaxial, band = (
        2.0 * c * math.tan(math.pi / 4 + phi / 2)
        for c, phi in (
            (cohesion / math.sqrt(1.0 - mu**2), math.asin(mu)),
            (cohesion, math.atan(mu)),
        )
    )
    return UnconfinedStrength(coaxial=coaxial, band=band)


@dataclass(frozen=True, kw_only=True)
class CliffHeight:
    """Heights of a vertical cliff by limit analysis.

    Attributes
    ----------
    coaxial_cohesion, band_cohesion : float
        Cohesion of Mohr and Coulomb of uniform coaxial plane strain, and on a shear band [Pa].
    coaxial, band : float
        Height at which a cliff slides on a plane from its toe [m], with the cohesion and the
        friction angle of either.
    """

    coaxial_cohesion: float
    band_cohesion: float
    coaxial: float
    band: float


def cliff_height(
    *, cohesion: float, mu: float, density: float, gravity: float = EARTH
) -> CliffHeight:
    """Height at which a vertical cliff of cohesive material slides, by limit analysis.

    Parameters
    ----------
    cohesion : float
        Shear stress at yield without pressure [Pa], >= 0: `cohesion` of a material.
    mu : float
        Friction coefficient of the law, such as `mu_s`, 0 to 1 (1 not included).
    density : float
        Density of the material [kg/m3], > 0.

    Raises
    ------
    TypeError, ValueError
        If an argument is not a number in its range.
    """
    strength = unconfined_strength(cohesion, mu)
    weight = positive("density", density) * positive("gravity", gravity)
    return CliffHeight(
        coaxial_cohesion=cohesion / math.sqrt(1.0 - mu**2),
        band_cohesion=float(cohesion),
        coaxial=2.0 * strength.coaxial / weight,
        band=2.0 * strength.band / weight,
    )
