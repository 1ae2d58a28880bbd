"""Axisymmetric scenes: the axis of symmetry, and what has none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from granular.materials.base import Material
from granular.materials.own import OwnLaw
from granular.model.gravity import Gravity
from granular.model.grid import Grid, combined
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall, WallOrBlock

if TYPE_CHECKING:
    from granular.mpm.bodies import Body


def axis_wall(grid: Grid) -> Wall:
    """Free-slip wall that holds the nodes of the axis of symmetry of a grid."""
    return Wall(0, grid.lower[0], kind="free_slip")


def planar_laws(materials: Sequence[Material]) -> list[OwnLaw]:
    """User-defined laws that do not say that they contain the hoop strain."""
    return [law for law in materials if isinstance(law, OwnLaw) and not law.axisymmetric]


def check_laws(materials: Sequence[Material]) -> None:
    """Refuse user-defined laws that do not say that they contain the hoop strain."""
    for law in planar_laws(materials):
        raise ValueError(
            f"the law {law.name!r} must be made with axisymmetric=True to run on an axisymmetric "
            "grid. What it computes from its gradient must then contain the hoop strain "
            "gradient[2, 2], as the trial stress and log_density do"
        )


def check_axisymmetry(
    grid: Grid,
    gravity: Gravity,
    walls: Sequence[WallOrBlock],
    scheme: Scheme,
    bodies: Sequence[Body],
) -> None:
    """Refuse parts of a scene that have no axis of symmetry, or are not available for rings."""
    across = [vector for vector in gravity.vectors if vector[0] != 0.0]
    if across:
        raise ValueError(
            f"gravity = {tuple(across[0])} must have no radial component in an axisymmetric grid: "
            "it acts along the axis"
        )
    for i, wall in enumerate(walls):
        if grid.has_axis and wall.axis == 0 and wall.extent(grid, 0)[0] == grid.lower[0]:
            raise ValueError(
                f"walls[{i}] = {wall} must not stand at r = 0, the axis of symmetry, which needs "
                "no wall"
            )
    if scheme.basis == "ugimp":
        raise ValueError(
            'basis = "ugimp" must be "linear" or "quadratic" in an axisymmetric grid: functions '
            "that end at the axis, over r, have no bound"
        )
    for i, body in enumerate(bodies):
        _check_body(f"bodies[{i}]", grid, body)


def _check_body(name: str, grid: Grid, body: Body) -> None:
    """Refuse a body that does not remain one of revolution about the axis."""
    if "x" in body.free:
        raise ValueError(f"{name}.free = {body.free!r} must not name x, the radius, along which a "
                         "body of revolution does not move")  # fmt: skip
    if body.inertia is not None or body.turns:
        raise ValueError(f"{name} must not turn in an axisymmetric grid")
    radial = body.motion.rows()[:, 1]
    if radial.any():
        raise ValueError(
            f"{name}.motion has the radial velocity {radial[radial.nonzero()][0]:g} m/s, must be "
            "0: a body of revolution moves along its axis"
        )
    if not _is_mirrored(grid, body):
        raise ValueError(
            f"{name} at {body.position} must be symmetric about r = 0, which it reaches: only its "
            "part at r > 0 is turned about the axis"
        )


SAMPLES = 41
"""Number of positions along each axis at which the two halves of a body are compared."""


def _is_mirrored(grid: Grid, body: Body) -> bool:
    """True if a body is symmetric about r = 0, or does not reach beyond it."""
    reaches = body.extents()[:2]
    low = np.maximum(np.array(body.position) - reaches, [0.0, grid.lower[1]])
    high = np.minimum(np.array(body.position) + reaches, grid.upper)
    x = combined([np.linspace(a, max(b, a), SAMPLES) for a, b in zip(low, high, strict=True)])
    here, there = body.distance(x)[0], body.distance(x * [-1.0, 1.0])[0]
    beyond = there < -MIRRORED * grid.cell
    return not beyond.any() or bool(np.abs(here - there).max() <= MIRRORED * grid.cell)


MIRRORED = 1e-6
"""Largest difference of the distances from the halves of a symmetric body [cells]."""
