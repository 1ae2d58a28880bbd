"""Slides on a Coulomb slope: earth pressure in a layer that slides, and a block on a bent slope.

The friction on a mass that is in contact with a plane and slides everywhere is mu times its weight
across the plane, whatever its shape, so that its centre moves like a block.
"""

from __future__ import annotations

import math

from granular.model.gravity import EARTH
from granular.tools.checks import in_range, non_negative, positive


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
    {raises}.
    """
    mu = in_range("mu", mu, 0.0, 1.0, open_low=True, open_high=True)
    cos2 = 1.0 - mu**2
    base = in_range("base", base, 0.0, mu / math.sqrt(cos2))
    return 2.0 * (1.0 - math.sqrt(max(1.0 - cos2 * (1.0 + base**2), 0.0))) / cos2 - 1.0


def block_runout(
    *, angle_deg: float, bend: float, mu: float, distance: float, gravity: float = EARTH
) -> float:
    """Run-out of a block that slides down a plane, through an arc, onto level ground.

    The arc, of radius R, touches both planes, which would meet in the origin. On the arc the block
    also presses with v^2/R: ``d(v^2)/dphi = 2 g R (sin(psi) - mu cos(psi)) - 2 mu v^2``, psi the
    slope, falling from the angle of the plane to 0. Without this additional pressure the drop
    divided by the horizontal distance, the energy line, is mu, wherever the block stops. With it,
    it is more.

    Parameters
    ----------
    angle_deg : float
        Inclination of the plane [deg], 0 < angle < 90.
    bend : float
        Radius of the arc R [m], >= 0. The result for 0 is the limit of a small arc, on which
        friction reduces v^2 by the factor exp(-2 mu angle).
    mu : float
        Friction coefficient, 0 < mu < tan(angle).
    distance : float
        Horizontal distance of the start from the origin [m], at least that of the arc's upper end.
    gravity : float
        Magnitude of gravity [m/s2], > 0; the result does not depend on it.

    Returns
    -------
    float
        Distance from the origin at which the block stops on level ground [m].
    {raises}; also if the block stops on the arc.
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
