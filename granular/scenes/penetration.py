"""A ball or a cone that is driven into a bed at a constant speed, in 2D and 3D."""

from __future__ import annotations

import math
from typing import Any

from granular.materials import Material
from granular.mpm import schemes
from granular.mpm.bodies import Body
from granular.mpm.motion import Motion
from granular.mpm.schemes import Scheme
from granular.scenes._build import Parts, dimension, gravity_down, soft_beads
from granular.scenes._registry import scene_function
from granular.scenes._tools import bed
from granular.shapes import Box, Cylinder, Frustum, Shape, Sphere, Union
from granular.tools.checks import in_range, non_negative, one_of, positive


@scene_function("mpm")
def penetration(
    *,
    kind: str = "ball",
    diameter: float = 0.08,
    cone_deg: float = 60.0,
    speed: float = 0.1,
    ramp: float = 0.1,
    friction: float = 0.0,
    width: float = 0.8,
    soil: float = 0.32,
    headroom: float = 0.08,
    dim: int | None = None,
    axisymmetric: bool = False,
    cell: float = 0.01,
    points_per_cell: int | None = None,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 1.25,
    material: Material = soft_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Intruder driven vertically into a level bed, whose surface is at z = 0 (y = 0 in 2D).

    All numbers are chosen here. The lowest point of the intruder begins at the surface, in the
    middle of a square bed, and goes down by ``speed (duration - ramp/2)``. In 2D a ball is a disc,
    and a cone a wedge, which has a shaft of its diameter; with `axisymmetric` they are round, and
    so is the bed, of the diameter `width`. The floor is no_slip, the sides are
    free_slip.

    The force, `granular.measure.body_force`, does not depend on the speed while the inertial number
    is small. That on a disc grows linearly with the depth; that on a cone, as long as its shaft is
    above the bed, with the square (2D) or cube (3D) of the depth z, because z is then the only
    length. Contact points stay away from sharp edges, so that a cone of 60 degrees acts as if it
    were deeper by a cell; one of 120 degrees does not.

    Parameters
    ----------
    kind : {"ball", "cone"}
        Intruder.
    diameter : float
        Diameter [m].
    cone_deg : float
        Angle at the apex of a cone, from side to side [deg], 0 < angle < 180.
    speed : float
        Speed downwards [m/s].
    ramp : float
        Time in which the intruder takes up its speed [s].
    friction : float
        Coefficient of friction between intruder and bed, >= 0.
    width, soil, headroom : float
        Extent of the bed along x (and y), its depth, and the height above it [m], whole cells.
    dim : {2, 3}
        Dimension, 2 by default.
    axisymmetric : bool
        Whether the plane is one of radius and height.
    {common}; also if the intruder would reach the floor or the sides.
    """
    cell, dim = positive("cell", cell), dimension(dim, axisymmetric, 2)
    speed, ramp = positive("speed", speed), positive("ramp", ramp)
    deepest = speed * max(positive("duration", duration) - ramp / 2, ramp / 2)
    if positive("diameter", diameter) >= positive("width", width):
        raise ValueError(f"diameter = {diameter} must be less than width = {width}")
    if deepest >= positive("soil", soil):
        raise ValueError(
            f"duration = {duration} must be so short that the intruder stays above the floor at "
            f"soil = {soil}: it goes down by {deepest:.6g}"
        )
    level = (0.0,) * (dim - 1)
    sides = (("width/2", width / 2),) if axisymmetric else (("width", width),) * (dim - 1)
    count = 2**dim if points_per_cell is None else points_per_cell
    filling: dict[str, Any] = {"points_per_cell": count, "jitter": jitter}
    parts = bed(sides, soil, headroom, cell, axisymmetric=axisymmetric, **filling)
    middle = 0.0 if axisymmetric else 0.5 * parts["grid"].upper[0]
    # The shaft is longer than the path, so that the bed never closes above it.
    shape = _shape(kind, 0.5 * diameter, cone_deg, soil + headroom, dim)
    return Parts(
        **parts,
        bodies=(
            Body(
                shape,
                (*(middle,) * (dim - 1), 0.0),
                motion=Motion(times=(0.0, ramp), velocity=((*level, 0.0), (*level, -speed))),
                friction=non_negative("friction", friction),
            ),
        ),
        gravity=gravity_down(dim, gravity),
    )


def _shape(kind: str, radius: float, cone_deg: float, shaft: float, dim: int) -> Shape:
    """Intruder whose lowest point is the origin of its coordinates."""
    level = (0.0,) * (dim - 1)
    up = (*level, 1.0)
    cone = in_range("cone_deg", cone_deg, 0.0, 180.0, open_low=True, open_high=True)
    if one_of("kind", kind, ("ball", "cone")) == "ball":
        if dim == 2:
            return Cylinder(radius, center=(0.0, radius))
        return Sphere(radius, center=(0.0, 0.0, radius))
    tip = radius / math.tan(math.radians(cone) / 2)
    middle = (*level, tip + shaft / 2)
    rod: Shape = (
        Box(size=(2 * radius, shaft), center=middle)
        if dim == 2
        else Cylinder(radius, center=middle, axis=up, length=shaft)
    )
    return Union((Frustum((0.0, radius), tip, center=(*level, tip / 2), axis=up), rod))
