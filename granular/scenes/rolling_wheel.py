"""A wheel that rolls down a ramp onto a bed, in 2D."""

from __future__ import annotations

import math
from typing import Any

from granular.materials import Material
from granular.mpm import schemes
from granular.mpm.bodies import Body, mass_properties
from granular.mpm.schemes import Scheme
from granular.scenes._build import Parts, enough_cells, soft_beads
from granular.scenes._registry import scene_function
from granular.scenes._tools import bed_beyond
from granular.shapes import Cylinder, Polygon
from granular.tools.checks import in_range, non_negative, positive


@scene_function("mpm")
def rolling_wheel(
    *,
    radius: float = 0.06,
    density: float = 1500.0,
    friction: float = 0.5,
    angle_deg: float = 20.0,
    run: float = 0.3,
    length: float = 0.6,
    soil: float = 0.08,
    cell: float = 0.01,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 1.2,
    material: Material = soft_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Wheel that is released on a rigid ramp and rolls down onto a level bed, where it sinks in.

    The scene is 2D, and all numbers are chosen here. The surface of the bed is at y = 0, and the
    ramp ends there, at x = 0. The wheel is a homogeneous disc that moves and turns freely. On the
    ramp it rolls without slip, with the acceleration 2/3 gravity sin(angle), if `friction` is at
    least tan(angle)/3. The floor is no_slip, the sides are free_slip, the upper end is open.

    Parameters
    ----------
    radius, density : float
        Radius [m] and density [kg/m3] of the wheel.
    friction : float
        Coefficient of friction of wheel and ramp, with each other and with the bed, >= 0.
    angle_deg : float
        Angle of the ramp [degrees], above 0 and below 60.
    run : float
        Distance along the ramp from the first point of contact to its lower end [m].
    length, soil : float
        Length of the bed and its depth [m], whole cells.
    {common}; also if the wheel is wider than the bed.
    """
    cell, radius = positive("cell", cell), positive("radius", radius)
    if 2 * radius >= positive("length", length):
        raise ValueError(f"radius = {radius} must be less than length/2 = {length / 2}")
    angle = math.radians(in_range("angle_deg", angle_deg, 0.0, 60.0, open_low=True, open_high=True))
    run, friction = positive("run", run), non_negative("friction", friction)
    start = (
        radius * math.sin(angle) - run * math.cos(angle),
        radius * math.cos(angle) + run * math.sin(angle),
    )
    behind = enough_cells(radius - start[0], cell) + 2
    above = enough_cells(start[1] + radius, cell) + 2
    filling = {"points_per_cell": points_per_cell, "jitter": jitter}
    parts = bed_beyond(length, soil, cell, behind=behind, above=above, **filling)
    left, bottom = parts["grid"].lower
    far = left - radius
    ramp = Polygon(((far, bottom), (0.0, bottom), (0.0, 0.0), (far, -far * math.tan(angle))))
    wheel = Cylinder(radius, center=(0.0, 0.0))
    whole = mass_properties(wheel, positive("density", density))
    return Parts(
        **parts,
        bodies=(
            Body(ramp, (0.0, 0.0), friction=friction),
            Body(
                wheel, start, friction=friction, free="xy", mass=whole.mass, inertia=whole.inertia
            ),
        ),
    )
