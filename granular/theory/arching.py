"""Arching of cohesive material in hoppers: Jenike's flow factor and the outlet that does not arch.

Jenike (1964, "Storage and flow of solids", Bulletin 123 of the Utah Engineering Experiment Station)
compares two stresses at the outlet of a hopper in mass flow. The material was consolidated there by
the major stress s1 of flow, and has the strength f = F(s1), the *flow function* of the material. As
an arch that carries its own weight it would bear the stress a = s1/ff at its abutments, with the
*flow factor* ff of the hopper. It flows where F(s1) < s1/ff. Both stresses grow with the width of
the hopper, as a = rho g B/H, so that the outlet at which they are equal is the smallest that flows.

The stress of flow is that of the radial field, which is rho g r times a function of the angle t to
the axis. With the stress N across a ray, R along it and T on it, the equilibrium is

    T' = 2 R - N + m (R - s1 - T cot t) + cos t,   N' = 3 T + m (T - (N - s1) cot t) + sin t,

m = 0 in a plane hopper and 1 in a cone, whose stress around the axis is s1. The material yields
everywhere: N and R = s (1 +- sin d cos 2x) and T = s sin d sin 2x, with the mean stress s and the
angle x between s1 and the normal of the ray, so that s1 = s (1 + sin d). Here x is 0 on the axis,
and at the wall, where T = N tan w, it is (w + arcsin(sin w/sin d))/2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from granular.model.gravity import EARTH
from granular.tools.arrays import Array
from granular.tools.checks import in_range, integer, non_negative, positive

STRESSES = np.geomspace(1.0, 1e7, 281)
"""Consolidation stresses [Pa] between which a flow function and a flow factor are compared."""


@dataclass(frozen=True, kw_only=True)
class CriticalOutlet:
    """Smallest outlet through which a cohesive material flows, by Jenike's method.

    Attributes
    ----------
    outlet : float
        Width of the slot or diameter of the circle [m]: 0 if the material never arches, inf if it
        arches at any width.
    strength, consolidation : float
        Unconfined yield strength and major stress of flow there [Pa].
    flow_factor : float
        Major stress of flow over the stress at the abutments of an arch.
    """

    outlet: float
    strength: float
    consolidation: float
    flow_factor: float


def flow_factor(angle_deg: float, wall_deg: float, effective_deg: float, *, dim: int = 2) -> float:
    """Flow factor of a hopper: the major stress of flow over that of an arch (Jenike 1964).

    It is computed from the radial stress field, s1 H/(2 rho g r sin a) at the wall, with H of
    `arch_factor`.

    Parameters
    ----------
    angle_deg : float
        Half angle a of the hopper to the vertical [deg], 1 to 70.
    wall_deg : float
        Angle of wall friction [deg], >= 0 and less than `effective_deg`.
    effective_deg : float
        Effective angle of internal friction d [deg], from 20 to 70. For a law without dilation it
        is `EarthPressure.coaxial_deg` of `earth_pressure(mu)`.
    dim : {2, 3}
        2 for a plane hopper, 3 for a cone.
    {raises}. Also where there is no radial stress field, as in hoppers far beyond the angle of
    mass flow (`mass_flow_limit`).
    """
    dim = integer("dim", dim, 2, 3)
    angle = math.radians(in_range("angle_deg", angle_deg, 1.0, 70.0))
    effective = in_range("effective_deg", effective_deg, 20.0, 70.0)
    wall = math.radians(in_range("wall_deg", wall_deg, 0.0, effective, open_high=True))
    major = _major_stress_at_wall(angle, wall, math.sin(math.radians(effective)), dim)
    if not major > 0.0:
        raise ValueError(
            f"angle_deg = {angle_deg}, wall_deg = {wall_deg}, effective_deg = {effective_deg}: the "
            "hopper has no radial stress field, and so no flow factor; mass_flow_limit returns the "
            "largest angle of mass flow"
        )
    return major * arch_factor(angle_deg, dim=dim) / (2.0 * math.sin(angle))


def arch_factor(angle_deg: float, *, dim: int = 2) -> float:
    """Width of an arch that is loaded by its weight alone, over a/(rho g): Jenike's H.

    Fits of his chart, 1 + a/180 for a long slot and 2 + a/60 for a circle (Rhodes 2008,
    "Introduction to particle technology", 2nd edition, chapter 10).

    Parameters
    ----------
    angle_deg : float
        Half angle a of the hopper to the vertical [deg], 0 to 70.
    dim : {2, 3}
        2 for a slot, at least three times as long as wide, 3 for a circular outlet.
    {raises}.
    """
    angle = in_range("angle_deg", angle_deg, 0.0, 70.0)
    return 1.0 + angle / 180.0 if integer("dim", dim, 2, 3) == 2 else 2.0 + angle / 60.0


def critical_outlet(
    strength: float | Callable[[float], float],
    *,
    angle_deg: float,
    wall_deg: float,
    effective_deg: float,
    density: float,
    dim: int = 2,
    gravity: float = EARTH,
) -> CriticalOutlet:
    """Smallest outlet of a hopper in mass flow above which no arch forms (Jenike 1964).

    The width is H f/(rho g) at the strength f where the flow function meets the line s1/ff. If they
    meet more than once, it is at the largest stress.

    Parameters
    ----------
    strength : float or callable
        Unconfined yield strength f [Pa], >= 0: a number if it does not depend on the stress, as for
        a law with a constant cohesion (`unconfined_strength`), or the flow function, which returns
        it for a consolidation stress s1 in Pa. It is compared from 1 Pa to 10 MPa.
    angle_deg, wall_deg, effective_deg : float
        As those of `flow_factor` [deg].
    density : float
        Bulk density at the outlet [kg/m3].
    dim : {2, 3}
        2 for a plane hopper with a slot, 3 for a cone.
    {raises}. Also if the flow function returns what is not a number >= 0.
    """
    factor = flow_factor(angle_deg, wall_deg, effective_deg, dim=dim)
    scale = arch_factor(angle_deg, dim=dim) / (
        positive("density", density) * positive("gravity", gravity)
    )
    if not callable(strength):
        value = non_negative("strength", strength)
        consolidation = factor * value
    else:
        consolidation = _meeting(strength, factor)
        value = consolidation / factor
    return CriticalOutlet(
        outlet=scale * value, strength=value, consolidation=consolidation, flow_factor=factor
    )


def _meeting(flow_function: Callable[[float], float], factor: float) -> float:
    """The largest stress at which the flow function crosses s1/ff from above; 0 or inf if none."""
    from scipy.optimize import brentq  # not with the package: it takes time and memory

    def excess(stress: float) -> float:
        name = f"strength({stress:.6g})"
        return non_negative(name, flow_function(stress)) - stress / factor

    stronger = np.array([excess(float(stress)) for stress in STRESSES]) > 0.0
    if stronger[-1]:
        return math.inf
    if not stronger.any():
        return 0.0
    last = int(np.flatnonzero(stronger)[-1])
    return float(brentq(excess, STRESSES[last], STRESSES[last + 1], rtol=1e-12))


def _major_stress_at_wall(angle: float, wall: float, sine: float, dim: int) -> float:
    """s1/(rho g r) at the wall of the radial stress field; nan if there is none.

    The field is integrated from the axis with the mean stress there that leads to the friction of
    the wall. A smaller one turns the major stress faster.
    """
    from scipy.integrate import solve_ivp  # not with the package: it takes time and memory

    m = dim - 2
    at_wall = 0.5 * (wall + math.asin(math.sin(wall) / sine))
    # There a slip line is parallel to the ray, and the derivatives are infinite.
    slip = 0.5 * math.acos(-sine)
    first = 1e-6 * angle  # so near to the axis, where the cotangent is infinite

    def equilibrium(t: float, y: Array) -> tuple[float, float]:
        s, x = y
        c, q, cot = math.cos(2 * x), math.sin(2 * x), 1.0 / math.tan(t)
        N, R, T, major = s * (1 + sine * c), s * (1 - sine * c), s * sine * q, s * (1 + sine)
        dN = 3 * T + math.sin(t) + m * (T - (N - major) * cot)
        dT = 2 * R - N + math.cos(t) + m * (R - major - T * cot)
        # N' and T' are linear in s' and x'.
        turn = (1 + sine * c) * dT - sine * q * dN
        return (c * dN + q * dT) / (c + sine), turn / (2 * s * sine * (c + sine))

    def slips(t: float, y: Array) -> float:
        return slip - 1e-3 - float(y[1])

    def vanishes(t: float, y: Array) -> float:
        return float(y[0]) - 1e-9

    slips.terminal = vanishes.terminal = True  # type: ignore[attr-defined]

    def ray(log_stress: float) -> tuple[float, float]:
        """The mean stress and the angle x at the wall; infinite where the field ends before."""
        s = math.exp(log_stress)
        rate = (1 - s * ((2 * dim - 1) * sine - 1)) / (2 * (dim - 1) * s * sine)
        if first * abs(rate) >= slip - 1e-3:
            return math.nan, math.copysign(math.inf, rate)
        end = solve_ivp(
            equilibrium,
            (first, angle),
            (s, rate * first),
            method="DOP853",
            rtol=1e-9,
            atol=1e-12,
            events=(slips, vanishes),
        )
        if end.status != 0:
            return math.nan, math.inf if end.t_events[0].size else -math.inf
        return float(end.y[0, -1]), float(end.y[1, -1])

    low, high = math.log(1e-6), math.log(1e3)
    for _ in range(45):  # to 1e-12 of the stress
        middle = 0.5 * (low + high)
        if ray(middle)[1] > at_wall:
            low = middle
        else:
            high = middle
    stress, turned = ray(low)
    return stress * (1 + sine) if abs(turned - at_wall) < 1e-6 else math.nan
