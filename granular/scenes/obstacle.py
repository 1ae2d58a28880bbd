"""A layer that slides down a bed against a wall or a pillar, in 2D and 3D."""

from __future__ import annotations

from typing import Any

from granular.materials import Material
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.mpm import schemes
from granular.mpm.bodies import Body
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import (
    MARGIN,
    Parts,
    cells_across,
    down_slope,
    enough_cells,
    soft_beads,
    whole_cells,
)
from granular.scenes._registry import scene_function
from granular.shapes import Box, Cylinder, HalfSpace
from granular.tools.checks import non_negative, one_of, positive


@scene_function("mpm")
def obstacle(
    *,
    kind: str = "wall",
    angle_deg: float = 30.0,
    height: float = 0.1,
    length: float = 0.6,
    speed: float = 0.0,
    gap: float = 0.4,
    tall: float = 0.2,
    thick: float = 0.1,
    behind: float = 0.5,
    width: float = 0.0,
    across: float = 0.2,
    friction: float = 0.3,
    obstacle_friction: float = 0.0,
    headroom: float = 0.3,
    cell: float = 0.01,
    points_per_cell: int | None = None,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 2.0,
    material: Material = soft_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Flow against an obstacle on an incline, with x down the slope; body 0 is the obstacle
    and body 1 the bed.

    All numbers are chosen here. A layer begins on the bed, at rest or with a velocity along it, its
    front at x = 0 and the face of the obstacle at x = gap. Gravity is tilted, not the grid. Points
    that cross the lower end of the domain leave for good. The bed is a body too: a Coulomb wall of
    the grid would take up a part of the force at the base of the obstacle, namely the friction of
    one cell.

    `granular.measure.body_force` is the force on the obstacle, per metre of depth in 2D. Compare
    the impact of a fast layer with its momentum flux rho height v^2, and the force of the deposit
    at rest with `granular.theory.earth_pressure`.

    Parameters
    ----------
    kind : {"wall", "cylinder"}
        Obstacle: a wall, `thick` along x and `tall`; or a pillar, an upright cylinder of diameter
        `across`, as tall. In 2D the cylinder lies across the flow, half above the bed, with the
        radius `tall`.
    angle_deg : float
        Inclination of the bed [deg], 0 <= angle < 90.
    height, length : float
        Height of the layer across the slope and its length along it [m], whole cells.
    speed : float
        Initial velocity of the layer down the slope [m/s], >= 0.
    gap : float
        Distance of the face of the obstacle from the layer [m], >= 0.
    tall, thick, across : float
        Height of the obstacle above the bed, its thickness along the flow (of a wall), and its
        width across (of a wall in 3D, or the diameter of the pillar) [m].
    behind : float
        Length of bed behind the face of the obstacle [m].
    width : float
        Width of the channel between free_slip sides [m], whole cells; 0 for 2D. The obstacle is in
        its middle, and a wall as wide as the channel closes it.
    friction, obstacle_friction : float
        Coulomb friction coefficients of the bed and of the obstacle, >= 0.
    headroom : float
        Height of the domain above the layer or the obstacle, whichever is higher [m].
    {common}; also if the obstacle is wider than the channel.
    """
    cell, gap = positive("cell", cell), non_negative("gap", gap)
    n_x, n_z = whole_cells("length", length, cell), whole_cells("height", height, cell)
    side = cells_across("width", width, cell)
    dim, y = 2 + len(side), (0.5 * width,) * len(side)
    shape, half = _shape(kind, width if side else 0.0, tall=tall, thick=thick, across=across)
    top = max(height, positive("tall", tall)) + positive("headroom", headroom)
    reach = gap + positive("behind", behind)
    grid = Grid(
        (-n_x * cell, *(0.0,) * len(side), -MARGIN * cell),
        cell,
        (n_x + enough_cells(reach, cell), *side, enough_cells(top, cell) + MARGIN),
        open_sides=frozenset({"x+"}),
    )
    moving = (non_negative("speed", speed), *(0.0,) * (dim - 1))
    count = 2**dim if points_per_cell is None else points_per_cell
    layer = Box((*grid.lower[:-1], 0.0), (0.0, *(n * cell for n in side), n_z * cell))
    return Parts(
        grid=grid,
        fills=(Fill(layer, count, velocity=moving, jitter=jitter, lithostatic=True),),
        walls=(
            Wall(0, grid.lower[0], kind="free_slip"),
            *(Wall(1, at, kind="free_slip") for n in side for at in (0.0, n * cell)),
        ),
        bodies=(
            Body(
                shape,
                (gap + half, *y, 0.0),
                friction=non_negative("obstacle_friction", obstacle_friction),
            ),
            Body(
                HalfSpace((0.0,) * (dim - 1) + (1.0,)),
                (0.0,) * dim,
                friction=non_negative("friction", friction),
            ),
        ),
        gravity=Gravity((0.0,), (down_slope(dim, gravity, angle_deg),)),
    )


def _shape(
    kind: str, width: float, *, tall: float, thick: float, across: float
) -> tuple[Box | Cylinder, float]:
    """Shape about the middle of its base, and half of its length along x [m].

    It goes as deep below the bed as it is tall.
    """
    wall = one_of("kind", kind, ("wall", "cylinder")) == "wall"
    tall, thick, across = (
        positive("tall", tall),
        positive("thick", thick),
        positive("across", across),
    )
    if not width:
        if wall:
            return Box(size=(thick, 2 * tall)), 0.5 * thick
        return Cylinder(tall, center=(0.0, 0.0)), tall
    if across > width:
        raise ValueError(f"across = {across} must be <= width = {width}")
    if wall:
        # A wall as wide as the channel ends beyond its sides, so that nothing flows past its edges.
        whole = 2 * across if across == width else across
        return Box(size=(thick, whole, 2 * tall)), 0.5 * thick
    axis = (0.0, 0.0, 1.0)
    pillar = Cylinder(0.5 * across, center=(0.0,) * 3, axis=axis, length=2 * tall)
    return pillar, 0.5 * across
