"""Slides on a Coulomb slope: a block on a bent slope, and a thin cap that spreads as it slides.

A mass that rests on a plane everywhere and slides everywhere feels mu times its weight across the
plane, whatever its shape, so that its centre moves as a block does. The thickness of a thin layer
adds its spreading (Savage & Hutter 1989, J. Fluid Mech. 199, 177, sections 3 and 4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from granular.checks import array, in_range, non_negative, positive

__all__ = ["SpreadingCap", "block_runout", "sliding_earth_pressure", "spreading_cap"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class SpreadingCap:
    """A thin parabolic cap that slides down a plane.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Times since the release from rest [s].
    centre : ndarray, shape (k,)
        Distance that the centre of mass has moved along the plane [m].
    half_length : ndarray, shape (k,)
        Distance of both ends from the centre [m].
    """

    times: Array
    centre: Array
    half_length: Array


def sliding_earth_pressure(mu: float, base: float) -> float:
    """Active coefficient of earth pressure above a base that slides (Savage & Hutter 1989).

    Ratio of the normal stress along the base to that across it, where Mohr's circle touches the
    yield line with sin(phi) = mu, and the shear stress on the base is `base` times the normal one:
    ``2 (1 - sqrt(1 - cos(phi)^2 (1 + base^2)))/cos(phi)^2 - 1``.

    Parameters
    ----------
    mu : float
        Friction tau/p of the material in uniform coaxial plane strain, 0 < mu < 1.
    base : float
        Friction coefficient of the base, from 0 to tan(phi).

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """
    mu = in_range("mu", mu, 0.0, 1.0, open_low=True, open_high=True)
    cos2 = 1.0 - mu**2
    base = in_range("base", base, 0.0, mu / math.sqrt(cos2))
    return 2.0 * (1.0 - math.sqrt(max(1.0 - cos2 * (1.0 + base**2), 0.0))) / cos2 - 1.0


def spreading_cap(
    times: ArrayLike,
    *,
    angle_deg: float,
    mu: float,
    half_length: float,
    thickness: float,
    K: float = 1.0,
    gravity: float = 9.81,
) -> SpreadingCap:
    """Thin parabolic cap that slides down a plane in 2D (Savage & Hutter 1989).

    With the normal stress K rho g h cos(angle) along the plane, the depth-averaged equations keep
    the parabola ``h = h_m (1 - s^2/L^2)``, h_m L constant, and a velocity linear in the distance s
    from the centre. The centre is that of a block, ``g (sin(angle) - mu cos(angle)) t^2/2``, and
    ``L'' = 2 K g cos(angle) h_0 L_0/L^2``.

    Parameters
    ----------
    times : array_like, shape (k,)
        Times [s], >= 0, ascending.
    angle_deg : float
        Inclination [deg], 0 < angle < 90.
    mu : float
        Friction coefficient of the base, below tan(angle).
    half_length, thickness : float
        Initial half-length along the plane and thickness across it in the middle [m].
    K : float
        Coefficient of earth pressure along the plane, > 0: 1 in a liquid, less (active) in material
        that spreads, see `sliding_earth_pressure`.
    gravity : float
        [m/s2]

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """
    t = array("times", times, (None,))
    if not len(t) or t[0] < 0 or not (np.diff(t) > 0).all():
        raise ValueError("times must be ascending, from 0 on")
    angle = math.radians(in_range("angle_deg", angle_deg, 0.0, 90.0, open_low=True, open_high=True))
    mu = in_range("mu", mu, 0.0, math.tan(angle), open_high=True)
    L0, h0 = positive("half_length", half_length), positive("thickness", thickness)
    g = positive("gravity", gravity)
    push = 2.0 * positive("K", K) * g * math.cos(angle) * h0 * L0
    # The last time alone would be an empty interval if it were 0.
    end = max(float(t[-1]), 1e-9)
    solved = scipy.integrate.solve_ivp(
        lambda _, y: (y[1], push / y[0] ** 2),
        (0.0, end),
        (L0, 0.0),
        t_eval=t,
        rtol=1e-9,
        atol=1e-12,
    )
    pull = g * (math.sin(angle) - mu * math.cos(angle))
    return SpreadingCap(times=t, centre=0.5 * pull * t**2, half_length=solved.y[0])


def block_runout(
    *, angle_deg: float, bend: float, mu: float, distance: float, gravity: float = 9.81
) -> float:
    """Run-out of a block that slides down a plane, through an arc, onto level ground.

    The arc, of radius R, touches both planes, which would meet in the origin. On the arc the block
    also presses with v^2/R: ``d(v^2)/dphi = 2 g R (sin(psi) - mu cos(psi)) - 2 mu v^2``, psi the
    slope, falling from the angle of the plane to 0. Without that press the drop divided by the
    horizontal distance is mu, wherever the block stops: the energy line. With it, it is more.

    Parameters
    ----------
    angle_deg : float
        Inclination of the plane [deg], 0 < angle < 90.
    bend : float
        Radius of the arc R [m], >= 0; without an arc the block keeps its horizontal velocity only
        if it is turned without a loss, which is what is taken for R -> 0: the loss is then the
        factor exp(-2 mu angle) of v^2.
    mu : float
        Friction coefficient, 0 < mu < tan(angle).
    distance : float
        Horizontal distance of the start from the origin [m], at least that of the arc's upper end.
    gravity : float
        [m/s2]

    Returns
    -------
    float
        Distance from the origin at which the block stops on level ground [m].

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range; also if the block stops on the arc.
    """
    angle = math.radians(in_range("angle_deg", angle_deg, 0.0, 90.0, open_low=True, open_high=True))
    mu = in_range("mu", mu, 0.0, math.tan(angle), open_low=True, open_high=True)
    g, R = positive("gravity", gravity), non_negative("bend", bend)
    tangent = R * math.tan(angle / 2)
    least = tangent * math.cos(angle)
    x = in_range("distance", distance, least, math.inf, open_high=True)
    # v^2 where the arc begins, and the solution on it: A sin(psi) + B cos(psi) + C exp(-2 mu phi).
    first = 2.0 * g * (math.tan(angle) - mu) * (x - least)
    B = 2.0 * g * R * (1.0 - 2.0 * mu**2) / (1.0 + 4.0 * mu**2)
    A = 2.0 * mu * (B + g * R)
    rest = first - A * math.sin(angle) - B * math.cos(angle)
    last = B + rest * math.exp(-2.0 * mu * angle)
    if last < 0.0:
        raise ValueError(f"distance = {distance} must be more: the block stops on the arc")
    return tangent + last / (2.0 * mu * g)
