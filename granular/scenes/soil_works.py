"""A slope, a retaining wall and a footing, in 2D."""

from __future__ import annotations

import math
from typing import Any

from granular.materials import DruckerPrager, Material
from granular.model.fill import Fill
from granular.model.grid import Grid
from granular.mpm import schemes
from granular.mpm.bodies import Body
from granular.mpm.motion import Motion
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import HEADROOM, Parts, enough_cells, smooth_sides, whole_cells
from granular.scenes._registry import scene_function
from granular.shapes import Box, HalfSpace, Polygon
from granular.tools.checks import finite, in_range, non_negative, positive, truth

clayey_sand = DruckerPrager(
    E=2e7, mu=math.tan(math.radians(20.0)), cohesion=4900.0, rho_c=2000.0, rho_s=2700.0
)
"""Soil of the slope: bands slide at 20 degrees, and the cohesion is 0.05 rho g H at 5 m."""

dense_sand = DruckerPrager(E=2e7, mu=0.5, rho_c=1600.0)
"""Soil of the wall and the footing, whose friction angle in uniform plane strain is 30 degrees."""


@scene_function("mpm")
def slope(
    *,
    height: float = 5.0,
    angle_deg: float = 26.565,
    crest: float = 5.0,
    toe: float = 5.0,
    depth: float = 0.0,
    cell: float = 0.25,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    gravity: float = 9.8,
    ramp: float = 1.0,
    duration: float = 6.0,
    material: Material = clayey_sand,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Slope of soil under its own weight, which grows within a second.

    The numbers are those of example 1 of Griffiths & Lane (1999, Geotechnique 49, 387): two
    horizontal to one vertical, a friction angle of 20 degrees and a cohesion of 0.05 rho g H. Its
    factor of safety is 1.38 by the charts of Bishop & Morgenstern (1960, Geotechnique 10, 129), and
    1.4 by finite elements; `granular.stability.factor_of_safety` finds that of a scene.

    Chosen here: a no_slip floor and free_slip sides. The law does not dilate; its bands slide at
    tan(phi) = mu, which is the friction angle meant here.

    Parameters
    ----------
    height, angle_deg : float
        Height of the slope [m] and its angle to the horizontal [deg], from 5 to 90.
    crest, toe : float
        Lengths of level ground above and in front of the slope [m].
    depth : float
        Depth of the ground below the toe [m], 0 for a slope on a firm base.
    {common}.
    """
    cell, height = positive("cell", cell), positive("height", height)
    crest, toe = positive("crest", crest), positive("toe", toe)
    depth = non_negative("depth", depth)
    run = height / math.tan(math.radians(in_range("angle_deg", angle_deg, 5.0, 90.0)))
    columns = enough_cells(crest + run + toe, cell)
    rows = enough_cells(depth + height, cell) + HEADROOM
    length, top = columns * cell, depth + height
    ground = ((length, depth), (length, 0.0), (0.0, 0.0)) if depth else ((0.0, 0.0),)
    outline = ((0.0, top), (crest, top), (crest + run, depth), *ground)
    grid = Grid((0.0, 0.0), cell, (columns, rows))
    return Parts(
        grid=grid,
        fills=(Fill(Polygon(outline), points_per_cell, jitter=jitter),),
        walls=(Wall(1, 0.0), *smooth_sides(grid)),
    )


@scene_function("mpm")
def retaining_wall(
    *,
    height: float = 1.0,
    length: float = 4.0,
    speed: float = 0.02,
    travel: float = 0.03,
    friction: float = 0.0,
    base_friction: float = 0.0,
    K0: float = 0.5,
    cell: float = 0.0625,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    gravity: float = 9.8,
    duration: float | None = None,
    material: Material = dense_sand,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Ground behind an upright wall that gives way, or is pushed into the ground.

    All numbers are chosen here. The wall is ``bodies[0]``, at x = 0, and the ground is level behind
    it. Compare the force on the wall, `measure.body_force`, with `theory.earth_pressure`: Rankine's
    coefficients hold for a smooth wall (`friction` 0), and for all of the ground at once if the
    base is smooth, too. With a rough base a wedge slides instead.

    Parameters
    ----------
    height, length : float
        Height of the ground and its length behind the wall [m], whole cells.
    speed : float
        Speed of the wall [m/s]: positive into the ground (passive), negative away from it (active).
    travel : float
        Distance that the wall moves [m]; less than half of the height.
    friction, base_friction : float
        Coefficients of friction of the wall, and of the base.
    K0 : float
        Ratio of the horizontal to the vertical stress at the start, see `Fill`.
    duration : float, optional
        Duration [s]; by default the time in which the wall moves by `travel`.
    {common}; also if `speed` is 0.
    """
    cell, height = positive("cell", cell), positive("height", height)
    n_x, n_y = whole_cells("length", length, cell), whole_cells("height", height, cell)
    travel = in_range("travel", travel, 0.0, height / 2, open_low=True)
    if finite("speed", speed) == 0.0:
        raise ValueError("speed = 0 must be positive or negative")
    begin = 0.1 * travel / abs(speed)
    motion = Motion(times=(0.0, begin), velocity=((0.0, 0.0), (speed, 0.0)))
    behind = enough_cells(travel, cell) + HEADROOM
    wall = Body(
        HalfSpace((1.0, 0.0)),
        (0.0, 0.0),
        motion=motion,
        friction=non_negative("friction", friction),
    )
    base = non_negative("base_friction", base_friction)
    grid = Grid((-behind * cell, 0.0), cell, (behind + n_x, n_y + HEADROOM))
    region = Box((0.0, 0.0), (n_x * cell, n_y * cell))
    fill = Fill(region, points_per_cell, jitter=jitter, lithostatic=True, K0=positive("K0", K0))
    return Parts(
        grid=grid,
        fills=(fill,),
        walls=(
            Wall(1, 0.0, kind="coulomb", friction=base),
            Wall(0, grid.upper[0], kind="free_slip"),
        ),
        bodies=(wall,),
        duration=travel / abs(speed) + begin / 2 if duration is None else duration,
    )


@scene_function("mpm")
def footing(
    *,
    width: float = 1.0,
    rough: bool = True,
    length: float = 4.0,
    soil: float = 2.0,
    speed: float = 0.005,
    settlement: float = 0.01,
    cell: float = 0.0625,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    gravity: float = 9.8,
    duration: float | None = None,
    material: Material = dense_sand,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Half of a strip footing that is pushed into level ground, at a plane of symmetry.

    All numbers are chosen here. The footing is ``bodies[0]``, and the surface of the ground is at
    y = 0. Compare the force on it, `measure.body_force`, with `theory.bearing_capacity`: without a
    surcharge it is ``c N_c B + N_gamma rho g B^2/2`` on the whole footing, of width B.

    Parameters
    ----------
    width : float
        Width of the whole footing [m], at least eight cells.
    rough : bool
        True for a footing on which the soil does not slide, False for a smooth one.
    length, soil : float
        Length of the ground from the plane of symmetry, and its depth [m], whole cells. The
        mechanism of a rough footing reaches two widths to the side at a friction angle of 30
        degrees, and four at 40.
    speed, settlement : float
        Speed of the footing [m/s] and the distance that it moves down [m].
    duration : float, optional
        Duration [s]; by default the time in which the footing moves by `settlement`.
    {common}.
    """
    cell, width = positive("cell", cell), positive("width", width)
    n_x, n_y = whole_cells("length", length, cell), whole_cells("soil", soil, cell)
    if width < 8 * cell or width >= length:
        raise ValueError(
            f"width = {width} must be at least 8 cells of {cell}, and less than length = {length}"
        )
    speed, settlement = positive("speed", speed), positive("settlement", settlement)
    begin = 0.1 * settlement / speed
    motion = Motion(times=(0.0, begin), velocity=((0.0, 0.0), (0.0, -speed)))
    slab = Box(size=(width, width), center=(0.0, width / 2))
    friction = 1.0 if truth("rough", rough) else 0.0
    above = enough_cells(width / 4, cell) + HEADROOM
    grid = Grid((0.0, -n_y * cell), cell, (n_x, n_y + above))
    region = Box((0.0, -n_y * cell), (n_x * cell, 0.0))
    return Parts(
        grid=grid,
        fills=(Fill(region, points_per_cell, jitter=jitter, lithostatic=True),),
        walls=(Wall(1, grid.lower[1]), *smooth_sides(grid)),
        bodies=(Body(slab, (0.0, 0.0), motion=motion, friction=friction),),
        duration=settlement / speed + begin / 2 if duration is None else duration,
        parameters={"half": True},
    )
