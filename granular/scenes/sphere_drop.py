"""A ball that falls on a bed, in 3D, or a disc in 2D."""

from __future__ import annotations

import math
from typing import Any

from granular.materials import Material
from granular.mpm import schemes
from granular.mpm.bodies import Body
from granular.mpm.motion import Motion
from granular.mpm.schemes import Scheme
from granular.scenes._build import Parts, dimension, soft_beads
from granular.scenes._registry import scene_function
from granular.scenes._tools import bed
from granular.shapes import Cylinder, Shape, Sphere
from granular.tools.checks import non_negative, positive


@scene_function("mpm")
def sphere_drop(
    *,
    drop: float = 0.2,
    diameter: float = 0.0254,
    density: float = 2200.0,
    friction: float = 0.3,
    width: float = 0.16,
    soil: float = 0.08,
    headroom: float = 0.04,
    dim: int | None = None,
    axisymmetric: bool = False,
    cell: float = 0.004,
    points_per_cell: int | None = None,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 0.15,
    material: Material = soft_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Ball that falls on a level bed, whose surface is at z = 0 (y = 0 in 2D), and makes a crater.

    The diameter of an inch and the density of Teflon are among those of Uehara et al. (2003); all
    other numbers are chosen here. The run begins when the ball touches the middle of the bed, with
    the velocity ``sqrt(2 gravity drop)``. It moves and turns freely. In 2D it is a disc. With
    `axisymmetric` it is a ball on a round bed of the diameter `width`, and falls along the axis
    without turning. The floor is no_slip, the sides are free_slip; material that is thrown higher
    than `headroom` leaves.

    Compare the final depth of the lowest point of the ball with `granular.theory.crater_depth`,
    with the total distance of the fall, `drop` plus depth.

    Parameters
    ----------
    drop : float
        Height of the lowest point of the ball above the bed when it is released [m], >= 0.
    diameter : float
        Diameter of the ball [m].
    density : float
        Density of the ball [kg/m3].
    friction : float
        Coefficient of friction between ball and bed, >= 0.
    width, soil, headroom : float
        Extent of the bed along x (and y), its depth, and the height above it [m], whole cells.
    dim : {2, 3}
        Dimension, 3 by default.
    axisymmetric : bool
        Whether to simulate a plane of radius and height.
    {common}; also if the ball is wider than the bed.
    """
    cell, dim = positive("cell", cell), dimension(dim, axisymmetric, 3)
    radius, density = 0.5 * positive("diameter", diameter), positive("density", density)
    if diameter >= positive("width", width):
        raise ValueError(f"diameter = {diameter} must be less than width = {width}")
    speed = math.sqrt(2 * positive("gravity", gravity) * non_negative("drop", drop))
    level = (0.0,) * (dim - 1)
    sides = (("width/2", width / 2),) if axisymmetric else (("width", width),) * (dim - 1)
    count = 2**dim if points_per_cell is None else points_per_cell
    filling: dict[str, Any] = {"points_per_cell": count, "jitter": jitter}
    filling |= {"axisymmetric": axisymmetric, "open_sides": {"xyz"[dim - 1] + "+"}}
    parts = bed(sides, soil, headroom, cell, **filling)
    middle = 0.0 if axisymmetric else 0.5 * parts["grid"].upper[0]
    shape, mass, inertia = _ball(radius, density, dim, axisymmetric)
    return Parts(
        **parts,
        bodies=(
            Body(
                shape,
                (*(middle,) * (dim - 1), radius),
                motion=Motion(velocity=((*level, -speed),)),
                friction=non_negative("friction", friction),
                free="y" if axisymmetric else "xyz"[:dim],
                mass=mass,
                inertia=inertia,
            ),
        ),
    )


def _ball(radius: float, density: float, dim: int, axisymmetric: bool) -> tuple[Shape, float, Any]:
    """Shape, mass and moment of inertia of a ball, or of a disc per metre of depth."""
    if axisymmetric:
        return Cylinder(radius, center=(0.0, 0.0)), 4 / 3 * math.pi * radius**3 * density, None
    if dim == 2:
        mass = math.pi * radius**2 * density
        return Cylinder(radius, center=(0.0, 0.0)), mass, 0.5 * mass * radius**2
    mass = 4 / 3 * math.pi * radius**3 * density
    return Sphere(radius, center=(0.0, 0.0, 0.0)), mass, (0.4 * mass * radius**2,) * 3
