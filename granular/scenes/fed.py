"""Scenes with inflow: a heap below a spout, a chute with a feeder, a silo that stays full."""

from __future__ import annotations

from typing import Any

from granular.materials import Material
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.model.inflow import Inflow
from granular.mpm import schemes
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import (
    HEADROOM,
    Parts,
    down_slope,
    smooth_sides,
    soft_beads,
    whole_cells,
)
from granular.scenes._registry import scene_function
from granular.shapes import Box
from granular.tools.checks import finite, positive


@scene_function("mpm")
def conveyor_heap(
    *,
    rate: float = 20.0,
    spout: float = 0.04,
    drop: float = 0.24,
    fall_speed: float = 0.5,
    length: float = 1.0,
    belt_speed: float = 0.0,
    cell: float = 0.01,
    points_per_cell: int = 4,
    gravity: float = 9.81,
    duration: float = 2.0,
    material: Material = soft_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Heap that grows below a spout, on ground at rest or on a belt that carries it away.

    All numbers are chosen here. Material falls from the spout in the middle, x = 0, onto no-slip
    ground. Points leave for good at both ends of the ground.

    On ground at rest the heap keeps its slope while it grows, near the angle of friction, and holds
    the rate times the time. On a belt that is faster than the heap grows, a layer of the height
    rate/(rho belt_speed) is carried away.

    Parameters
    ----------
    rate : float
        Mass that falls per time and width [kg/(s m)], at most that of a full spout.
    spout : float
        Width of the spout [m], an even number of cells.
    drop : float
        Height of the spout above the ground [m], whole cells.
    fall_speed : float
        Velocity downwards at the spout [m/s].
    length : float
        Length of the ground [m], an even number of cells, more than the spout.
    belt_speed : float
        Velocity of the ground along x [m/s].
    {common}; also if the rate exceeds that of a full spout.
    """
    cell = positive("cell", cell)
    n_half = whole_cells("length/2", positive("length", length) / 2, cell)
    n_spout = whole_cells("spout/2", positive("spout", spout) / 2, cell)
    n_drop = whole_cells("drop", drop, cell)
    if n_spout >= n_half:
        raise ValueError(f"spout = {spout} must be less than length = {length}")
    fall_speed, speed = positive("fall_speed", fall_speed), finite("belt_speed", belt_speed)
    grid = Grid(
        (-n_half * cell, 0.0),
        cell,
        (2 * n_half, n_drop + HEADROOM),
        open_sides=frozenset({"x-", "x+"}),
    )
    above = Box((-n_spout * cell, (n_drop - 1) * cell), (n_spout * cell, n_drop * cell))
    return Parts(
        grid=grid,
        fills=(),
        inflows=(Inflow(above, (0.0, -fall_speed), points_per_cell, rate=positive("rate", rate)),),
        walls=(Wall(1, 0.0, velocity=(speed, 0.0) if speed else None),),
    )


@scene_function("mpm")
def chute_fed(
    *,
    angle_deg: float = 27.0,
    height: float = 0.08,
    speed: float = 1.1,
    length: float = 2.0,
    feeder: float = 0.1,
    cell: float = 0.01,
    points_per_cell: int = 4,
    gravity: float = 9.81,
    duration: float = 4.0,
    material: Material = soft_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Rough chute that a feeder supplies with a layer at a given velocity.

    All numbers are chosen here. Within the feeder the layer moves as a block, in equilibrium across
    the slope; then it is free. Far from the feeder it flows as a steady layer that carries the same
    mass, rho height speed, whose thickness and profile are those of `granular.theory.bagnold_mean`
    and `bagnold_profile`; the default speed is that of the layer in the feeder. The layer becomes
    steady over a length of the order of speed height^2 over the viscosity, 1 m here. A flow that is
    slower than its waves, sqrt(g cos(angle) height), thins towards the open end. Points leave for
    good at the end of the chute.

    Parameters
    ----------
    angle_deg : float
        Slope of the chute [deg], 0 <= angle < 90.
    height, speed : float
        Thickness, whole cells, and velocity of the layer in the feeder [m, m/s].
    length, feeder : float
        Lengths of the chute and of the feeder at its beginning [m], whole cells.
    {common}; also if the feeder is longer than the chute.
    """
    cell, speed = positive("cell", cell), positive("speed", speed)
    lengths = (("length", length), ("feeder", feeder), ("height", height))
    n_x, n_feeder, n_y = (whole_cells(name, value, cell) for name, value in lengths)
    if n_feeder >= n_x:
        raise ValueError(f"feeder = {feeder} must be less than length = {length}")
    grid = Grid((0.0, 0.0), cell, (n_x, n_y + HEADROOM), open_sides=frozenset({"x+"}))
    box = Box((0.0, 0.0), (n_feeder * cell, n_y * cell))
    return Parts(
        grid=grid,
        fills=(),
        inflows=(Inflow(box, (speed, 0.0), points_per_cell, lithostatic=True, driven=True),),
        walls=(Wall(1, 0.0),),
        gravity=Gravity((0.0,), (down_slope(2, gravity, angle_deg),)),
    )


@scene_function("mpm")
def silo_fed(
    *,
    orifice: float = 0.12,
    width: float = 0.6,
    height: float = 0.5,
    fall_speed: float = 1.0,
    cell: float = 0.02,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 5.0,
    material: Material = soft_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Right half of a silo that stays full, as new material enters at the top.

    All numbers are chosen here. The inlet has the width of the silo and would feed
    rho fall_speed width/2, far more than the orifice lets out. The material in the silo chokes it,
    so that the silo stays full and the flow becomes steady: as much mass enters as leaves. No-slip
    bottom, smooth sides, and the plane of symmetry at x = 0; the orifice is open from the start.
    Points leave for good as they cross the bottom, y = 0.

    Parameters
    ----------
    orifice, width : float
        Full widths of the opening and of the silo [m], even numbers of cells.
    height : float
        Height of the fill, and of the inlet above the bottom [m], whole cells.
    fall_speed : float
        Velocity downwards at the inlet [m/s].
    points_per_cell, jitter
        See `granular.Fill` and `granular.Inflow`.
    {common}; also if the orifice leaves no bottom.
    """
    cell = positive("cell", cell)
    n_x = whole_cells("width/2", positive("width", width) / 2, cell)
    n_open = whole_cells("orifice/2", positive("orifice", orifice) / 2, cell)
    n_y = whole_cells("height", height, cell)
    if n_open >= n_x:
        raise ValueError(f"orifice = {orifice} must be less than width = {width}")
    x, top, edge = n_x * cell, n_y * cell, n_open * cell
    grid = Grid((0.0, 0.0), cell, (n_x, n_y + HEADROOM), open_sides=frozenset({"y-"}))
    inlet = Box((0.0, top - cell), (x, top))
    return Parts(
        grid=grid,
        fills=(
            Fill(
                Box((0.0, 0.0), (x, top - cell)), points_per_cell, jitter=jitter, lithostatic=True
            ),
        ),
        inflows=(Inflow(inlet, (0.0, -positive("fall_speed", fall_speed)), points_per_cell),),
        walls=(
            Wall(1, 0.0, span=((edge, x),)),
            # Open from the start, so that the rules for points near outlets apply near it.
            Wall(1, 0.0, span=((0.0, edge),), opens_at=0.0),
            *smooth_sides(grid),
        ),
        parameters={"half": True},
    )
