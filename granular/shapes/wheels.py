"""Wheels with grousers, made of a cylinder and boxes."""

from __future__ import annotations

import math

from granular.shapes.boxes import Box
from granular.shapes.operations import Union
from granular.shapes.round import Cylinder
from granular.shapes.shape import MOST_SHAPES, Shape
from granular.tools.checks import integer, non_negative, positive

ROOT = 0.5
"""Radius at which the grousers begin inside the wheel, over that of the wheel."""


def wheel(
    radius: float,
    width: float | None = None,
    *,
    grousers: int = 0,
    height: float = 0.0,
    thickness: float | None = None,
) -> Shape:
    """Return the shape of a wheel about its axle, which is the y axis in 3D.

    Grousers are bars across the tread, evenly spaced; the first one points downwards.

    Parameters
    ----------
    radius : float
        Radius of the wheel without grousers [m], > 0.
    width : float, optional
        Width of the tread [m], > 0; without it the shape is 2D.
    grousers : int
        Number of grousers, >= 0.
    height : float
        Height of the grousers above the tread [m], > 0 if there are some, else 0.
    thickness : float, optional
        Thickness of a grouser along the tread [m], > 0; by default half of its height. In a run
        the material on its two sides is kept apart if it is three cells thick.
    {raises}.

    Examples
    --------
    >>> shape = gr.shapes.wheel(0.15, 0.1, grousers=12, height=0.015, thickness=0.01)
    """
    radius = positive("radius", radius)
    count = integer("grousers", grousers, 0, MOST_SHAPES - 2)
    height = non_negative("height", height)
    if bool(count) != bool(height):
        raise ValueError(f"height = {height} must be > 0 with grousers, and 0 without")
    if width is None:
        tread = Cylinder(radius, center=(0.0, 0.0))
    else:
        width = positive("width", width)
        tread = Cylinder(radius, center=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0), length=width)
    if not count:
        return tread
    thick = positive("thickness", height / 2 if thickness is None else thickness)
    if thick * count >= 2 * math.pi * radius:
        raise ValueError(f"thickness = {thick} must leave gaps between {count} grousers")
    bars = (_grouser(radius, width, height, thick, 360.0 * k / count) for k in range(count))
    return Union((tread, *bars))


def _grouser(radius: float, width: float | None, height: float, thick: float, angle: float) -> Box:
    """A bar at an angle from below [deg], against the clock in the x-z plane seen from -y."""
    root = ROOT * radius
    length, middle = radius + height - root, (radius + height + root) / 2
    across, up = math.sin(math.radians(angle)) * middle, -math.cos(math.radians(angle)) * middle
    if width is None:
        return Box(size=(thick, length), center=(across, up), rotation_deg=angle)
    return Box(
        size=(thick, width, length), center=(across, 0.0, up), rotation_deg=(0.0, -angle, 0.0)
    )
