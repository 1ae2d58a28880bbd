"""A belt that draws material from below a gate, in 2D and 3D."""

from __future__ import annotations

from typing import Any

from granular.materials import Material
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.mpm import schemes
from granular.mpm.bodies import Body
from granular.mpm.motion import Motion
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import (
    HEADROOM,
    MARGIN,
    Parts,
    cells_across,
    down_slope,
    soft_beads,
    whole_cells,
)
from granular.scenes._registry import scene_function
from granular.shapes import Box, HalfSpace
from granular.tools.checks import finite, in_range, non_negative, positive


@scene_function("mpm")
def conveyor(
    *,
    speed: float = 0.5,
    opening: float = 0.1,
    stock: float = 0.4,
    height: float = 0.3,
    run: float = 0.8,
    gate: float = 0.06,
    angle_deg: float = 0.0,
    width: float = 0.0,
    friction: float = 0.6,
    gate_friction: float = 0.0,
    ramp: float = 0.2,
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
    """Belt that draws material from a bin through a gate; body 0 is the belt and body 1 the gate.

    All numbers are chosen here. The belt is a half-space that moves along its own plane, up a slope
    if it is inclined: gravity is tilted, not the grid. The bin lies on it, between a smooth back
    wall and the gate, whose inner face is at x = 0. Points that cross the end of the belt leave for
    good; `granular.measure.discharge` and `mass_history` count them.

    What has come to ride on the belt has its velocity, so that it carries rho h speed, h the
    thickness behind the gate, which is nearly the opening. The top of a layer is drawn along by its
    own friction mu only, within about speed^2/(2 g (mu cos(angle) - sin(angle))) of the gate.

    Parameters
    ----------
    speed : float
        Velocity of the belt along x [m/s].
    opening : float
        Height of the lower edge of the gate above the belt [m], less than `height`.
    stock, height : float
        Length and height of the fill of the bin [m], whole cells.
    run : float
        Length of belt from the inner face of the gate on [m], whole cells.
    gate : float
        Thickness of the gate [m].
    angle_deg : float
        Angle by which the belt rises along x [deg], 0 <= angle < 90.
    width : float
        Width between free_slip sides [m], whole cells; 0 for 2D.
    friction, gate_friction : float
        Coulomb friction coefficients of the belt and of the gate, >= 0.
    ramp : float
        Time in which the belt takes up its velocity [s].
    {common}; also if the gate does not end within the run.
    """
    cell, speed, ramp = positive("cell", cell), finite("speed", speed), positive("ramp", ramp)
    lengths = (("stock", stock), ("run", run), ("height", height))
    n_stock, n_run, n_z = (whole_cells(name, value, cell) for name, value in lengths)
    opening = in_range("opening", opening, 0.0, height, open_low=True, open_high=True)
    if positive("gate", gate) >= run:
        raise ValueError(f"gate = {gate} must be less than run = {run}")
    side = cells_across("width", width, cell)
    dim, level = 2 + len(side), (0.0,) * len(side)
    grid = Grid(
        (-n_stock * cell, *level, -MARGIN * cell),
        cell,
        (n_stock + n_run, *side, n_z + MARGIN + HEADROOM),
        open_sides=frozenset({"x+"}),
    )
    fill = Box((grid.lower[0], *level, 0.0), (0.0, *(n * cell for n in side), n_z * cell))
    # The gate ends above the grid and beyond its sides.
    tall = 2 * (grid.upper[-1] - opening)
    across = tuple(2 * n * cell for n in side)
    middle = tuple(0.5 * n * cell for n in side)
    down, *_, up = down_slope(dim, gravity, angle_deg)
    return Parts(
        grid=grid,
        fills=(
            Fill(
                fill,
                2**dim if points_per_cell is None else points_per_cell,
                jitter=jitter,
                lithostatic=True,
            ),
        ),
        walls=(
            Wall(0, grid.lower[0], kind="free_slip"),
            *(Wall(1, at, kind="free_slip") for n in side for at in (0.0, n * cell)),
        ),
        bodies=(
            Body(
                HalfSpace((0.0,) * (dim - 1) + (1.0,)),
                (0.0,) * dim,
                motion=Motion(
                    times=(0.0, ramp), velocity=((0.0,) * dim, (speed, *(0.0,) * (dim - 1)))
                ),
                friction=non_negative("friction", friction),
            ),
            Body(
                Box(size=(gate, *across, tall)),
                (0.5 * gate, *middle, opening + 0.5 * tall),
                friction=non_negative("gate_friction", gate_friction),
            ),
        ),
        gravity=Gravity((0.0,), ((-down, *level, up),)),
    )
