"""A drum that turns about a level axis, partly filled, in 2D and as a slice in 3D."""

from __future__ import annotations

import math
from typing import Any

import scipy

from granular.materials import Material
from granular.model.fill import Fill
from granular.model.grid import Grid
from granular.mpm import schemes
from granular.mpm.bodies import Body
from granular.mpm.motion import Motion
from granular.mpm.schemes import Scheme
from granular.scenes._build import MARGIN, Parts, cells_across, enough_cells, soft_beads
from granular.scenes._registry import scene_function
from granular.shapes import Cylinder, Polygon, Prism
from granular.tools.checks import finite, in_range, non_negative, positive


@scene_function("mpm")
def rotating_drum(
    *,
    radius: float = 0.1,
    width: float = 0.0,
    fill_fraction: float = 0.5,
    omega: float = 1.0,
    friction: float | None = 0.7,
    cell: float = 0.005,
    points_per_cell: int | None = None,
    jitter: float = 0.0,
    gravity: float = 9.8,
    duration: float = 4.0,
    material: Material = soft_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Rotating drum: a bed that turns with the wall, below a layer that flows down its surface.

    The drum, ``bodies[0]``, turns about the origin from the start. The fill is level at first and
    under its own weight; it rises with the drum until its surface yields. With omega > 0 it rises
    at larger x, so that the slope of the surface is positive. In 3D the axis is y, and the slice
    is periodic along it. `measure.drum_flow` returns the slope, and the thickness, speed and flux
    of the flowing layer.

    Chosen here: E is a thousandth of that of `glass_beads`, so that the time steps are thirty times
    longer. With a radius of 0.1 m p/E is below 0.002.

    Parameters
    ----------
    radius : float
        Radius R of the drum [m].
    width : float
        Length of the slice along the axis [m], whole cells; 0 for a 2D scene.
    fill_fraction : float
        Part of the section of the drum that is filled, 0.05 to 0.95.
    omega : float
        Angular velocity [rad/s], counter-clockwise for an observer at smaller y. The Froude number
        ``omega**2 radius/gravity`` is added to the parameters.
    friction : float or None
        Coefficient of Coulomb friction of the drum. The default exceeds that of the grains, so that
        material that is pressed to the drum does not slip. None for a wall that material sticks to:
        it holds single points and carries them round.
    {common}.
    """
    cell, radius = positive("cell", cell), positive("radius", radius)
    n = enough_cells(radius, cell) + MARGIN
    across = cells_across("width", width, cell)
    fraction = in_range("fill_fraction", fill_fraction, 0.05, 0.95)
    omega, g = finite("omega", omega), positive("gravity", gravity)
    dim = 2 + len(across)
    level = radius * _level(fraction)
    corners = ((-radius, -radius), (radius, -radius), (radius, level), (-radius, level))
    end = across[0] * cell if across else 0.0
    origin = (0.0,) * dim
    # About -y the rotation is from x to z, as it is from x to y in 2D.
    turning: Any = (0.0, -omega, 0.0) if across else omega
    axis = (0.0, 1.0, 0.0) if across else None
    sticky = friction is None
    return Parts(
        grid=Grid(
            (-n * cell, *(0.0,) * len(across), -n * cell),
            cell,
            (2 * n, *across, 2 * n),
            periodic=(False, *(True,) * len(across), False),
        ),
        fills=(
            Fill(
                Prism(corners, end, axis="y", center=(0.0, 0.5 * end, 0.0))
                if across
                else Polygon(corners),
                2**dim if points_per_cell is None else points_per_cell,
                jitter=jitter,
                lithostatic=True,
            ),
        ),
        bodies=(
            Body(
                Cylinder(radius, center=origin, axis=axis, inside=True),
                origin,
                motion=Motion(angular_velocity=(turning,)),
                contact="sticky" if sticky else "separating",
                friction=0.0 if friction is None else non_negative("friction", friction),
                rough=sticky,
            ),
        ),
        parameters={"froude": omega**2 * radius / g},
    )


def _level(fraction: float) -> float:
    """Height of the level surface above the axis, over the radius, for a filled fraction."""

    def excess(h: float) -> float:
        return math.acos(-h) + h * math.sqrt(1.0 - h * h) - math.pi * fraction

    return float(scipy.optimize.brentq(excess, -1.0, 1.0, xtol=1e-15))
