"""Bearing capacity of a strip footing, by limit analysis in plane strain.

The mean pressure at collapse is ``c N_c + N_q q + N_gamma rho g B/2``, with the cohesion c, the
surcharge q next to the footing and its width B; each coefficient is computed without the others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from granular.model.gravity import EARTH
from granular.tools.arrays import Array
from granular.tools.checks import in_range, non_negative, positive, truth

_NEAR = 1e-5
"""Distance from the passive wedge at which the fan ends: there the equations are singular."""
LEAST = math.radians(3.0)
"""Least angle for which N_gamma of a smooth footing is computed; it is 0.041 there, and taken in
proportion to the angle below."""


@dataclass(frozen=True, kw_only=True)
class BearingCapacity:
    """Coefficients of a strip footing.

    Attributes
    ----------
    surcharge : float
        N_q, for a surcharge on weightless ground, of a rough or smooth footing.
    cohesion : float
        N_c, for the cohesion of weightless ground: 2 + pi without friction.
    smooth_self_weight : float
        N_gamma of a smooth footing, for the weight of the ground alone.
    rough_self_weight : float
        N_gamma of a rough footing, about twice as large, within 1 % (from 20 to 45 degrees; 8
        % too large at 5 degrees).
    """

    surcharge: float
    cohesion: float
    smooth_self_weight: float
    rough_self_weight: float

    def pressure(
        self,
        width: float,
        *,
        rho: float = 0.0,
        cohesion: float = 0.0,
        surcharge: float = 0.0,
        rough: bool = True,
        gravity: float = EARTH,
    ) -> float:
        """Mean pressure on a footing at collapse [Pa]: the sum of the three parts.

        The sum is less than the exact pressure of all loads together, by up to a fifth.

        Parameters
        ----------
        width : float
            Width B of the footing [m], > 0.
        rho : float
            Density of the ground [kg/m3], >= 0.
        cohesion : float
            Cohesion c of Mohr and Coulomb [Pa], >= 0.
        surcharge : float
            Pressure q on the ground next to the footing [Pa], >= 0.
        rough : bool
            Whether the footing is rough.
        gravity : float
            [m/s2], > 0.
        {raises}.
        """
        weight = non_negative("rho", rho) * positive("gravity", gravity) * positive("width", width)
        N_gamma = self.rough_self_weight if truth("rough", rough) else self.smooth_self_weight
        parts = (
            self.cohesion * non_negative("cohesion", cohesion),
            self.surcharge * non_negative("surcharge", surcharge),
            N_gamma * weight / 2,
        )
        return sum(parts)


def bearing_capacity(phi_deg: float) -> BearingCapacity:
    """Bearing capacity of a strip footing for a friction angle.

    ``N_q = exp(pi tan(phi)) tan(45 deg + phi/2)^2`` (Prandtl 1921, Reissner 1924). Under a smooth
    footing without a surcharge the stress is self-similar around the edge, as Hill's mechanism has
    two independent halves: the mean stress is ``rho g r S(t)``, and equilibrium at yield is an
    ordinary differential equation for S and for the direction of the principal stress over the
    angle t (Sokolovskii 1965, Statics of Granular Media). It is integrated from the footing to the
    passive wedge next to it, where the pressure is obtained.

    ``N_c = (N_q - 1)/tan(phi)`` (Prandtl 1920). N_gamma of a rough footing is the fit
    ``exp((pi + 3 pi^2 tan(phi))/6) tan(phi)^(2 pi/5)`` of Hjiaj, Lyamin & Sloan (2005, Int. J.
    Solids Struct. 42, 1681) to lower and upper bounds.

    Parameters
    ----------
    phi_deg : float
        Friction angle [deg], 0 to 45; 0 is clay that is not drained. A law without dilation has
        two, see `earth_pressure`.
    {raises}.
    """
    phi = math.radians(in_range("phi_deg", phi_deg, 0.0, 45.0))
    tangent = math.tan(phi)
    N_q = math.exp(math.pi * tangent) * math.tan(0.25 * math.pi + 0.5 * phi) ** 2
    return BearingCapacity(
        surcharge=N_q,
        cohesion=(N_q - 1.0) / tangent if tangent else 2.0 + math.pi,
        smooth_self_weight=_smooth(max(phi, LEAST)) * min(phi / LEAST, 1.0),
        rough_self_weight=math.exp((math.pi + 3 * math.pi**2 * tangent) / 6)
        * tangent ** (0.4 * math.pi),
    )


def _smooth(phi: float) -> float:
    """N_gamma of a smooth footing, for a friction angle [rad]."""

    def beyond(N: float) -> float:
        return _end_of_fan(phi, N) - (0.25 * math.pi - 0.5 * phi)

    # From 0.76 of (N_q - 1) tan(phi) at 45 deg to 2.5 times at 3 deg; far above the fan never ends.
    passive = math.tan(0.25 * math.pi + 0.5 * phi) ** 2
    high = 0.5 * (math.exp(math.pi * math.tan(phi)) * passive - 1.0) * math.tan(phi)
    while beyond(high) > 0.0:
        high *= 1.1
    return scipy.optimize.brentq(beyond, high / 1.1, high, rtol=1e-7)


def _end_of_fan(phi: float, N_gamma: float) -> float:
    """Angle from the level surface [rad] at which the fan of a given pressure ends.

    There the radial direction is a characteristic, and the passive wedge begins. With the angle psi
    of the principal stress against the radius, k = sin(phi), and compression positive, the stresses
    are S (1 + k cos 2 psi) along the radius, S (1 - k cos 2 psi) across it, and S k sin 2 psi.
    """
    k = math.sin(phi)

    def rate(t: float, y: Array) -> Array:
        S, c, s = y[0], math.cos(2.0 * y[1]), math.sin(2.0 * y[1])
        forces = (math.sin(t) - S * (1.0 + 3.0 * k * c), math.cos(t) - 3.0 * S * k * s)
        return np.linalg.solve([[k * s, 2.0 * S * k * c], [1.0 - k * c, 2.0 * S * k * s]], forces)

    def ends(_: float, y: Array) -> float:
        return k - math.cos(2.0 * y[1]) - _NEAR

    ends.terminal = True  # type: ignore[attr-defined]  # as SciPy asks for
    # The pressure under the footing grows with the distance r from the edge as N_gamma rho g r.
    start = (2.0 * N_gamma / (1.0 + k), -0.5 * math.pi)
    fan = scipy.integrate.solve_ivp(
        rate, (math.pi, -math.pi), start, events=ends, rtol=1e-9, atol=1e-12
    )
    return float(fan.t[-1])
