"""Beds, and motions made of legs, shared by the scenes with tools in soil."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import Any

from granular.model.grid import Grid
from granular.mpm.body_limits import THIN, keeps_sides
from granular.mpm.motion import Motion
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import Parts, block, smooth_sides, whole_cells
from granular.tools.checks import positive

Leg = tuple[float, tuple[float, ...], float]
"""Duration [s], velocity [m/s], angular velocity about y [rad/s]."""


def legs(parts: Sequence[Leg], ramp: float) -> Motion:
    """Motion in successive legs of constant velocity, joined by ramps of `ramp` seconds.

    A ramp lies half in the leg before and half in the leg after it, so that each leg moves the body
    as far as without ramps. The first and the last leg must be at rest.

    Raises
    ------
    ValueError
        If a leg is not longer than the ramp.
    """
    if not all(duration > ramp for duration, *_ in parts):
        raise ValueError(
            f"ramp = {ramp} must be less than the shortest part of the motion, "
            f"{min(duration for duration, *_ in parts):.6g} s"
        )
    times, velocity, turning, now = [0.0], [parts[0][1]], [parts[0][2]], 0.0
    for before, after in pairwise(parts):
        now += before[0]
        for end, (_, v, w) in ((now - ramp / 2, before), (now + ramp / 2, after)):
            times.append(end)
            velocity.append(v)
            turning.append(w)
    return Motion(
        times=tuple(times),
        velocity=tuple(velocity),
        angular_velocity=tuple((0.0, w, 0.0) for w in turning),
    )


def thickness_of(name: str, thickness: float, cell: float, scheme: Scheme) -> float:
    """Thickness of a body, increased if necessary to the least that the scheme can represent."""
    thickness = positive(name, thickness)
    if isinstance(scheme, Scheme) and keeps_sides(scheme):
        return thickness
    return max(thickness, THIN * cell)


def bed(
    level: Sequence[tuple[str, float]],
    soil: float,
    headroom: float,
    cell: float,
    *,
    open_sides: Collection[str] = (),
    **fill: Any,
) -> Parts:
    """Grid, fill and walls of a level bed with its surface at elevation 0.

    `level` has the names and lengths of its horizontal axes, which begin at 0, and `fill` further
    arguments of `block`. The floor is no_slip and the sides are free_slip.
    """
    cell = positive("cell", cell)
    *across, n_z = (whole_cells(name, value, cell) for name, value in (*level, ("soil", soil)))
    cells = (*across, n_z + whole_cells("headroom", headroom, cell))
    upper, lower = (*(n * cell for n in across), 0.0), (*(0.0 for _ in across), -n_z * cell)
    return _on_floor(
        block(cell, cells, upper, lower=lower, open_sides=open_sides, lithostatic=True, **fill)
    )


def bed_beyond(
    length: float, soil: float, cell: float, *, behind: int, above: int, **fill: Any
) -> Parts:
    """Grid, fill and walls of a bed in 2D, with its surface at y = 0 and its beginning at x = 0.

    The grid begins `behind` cells before the bed, is open above, and ends `above` cells over it.
    """
    n_x, n_y = whole_cells("length", length, cell), whole_cells("soil", soil, cell)
    lower, cells = (-behind * cell, -n_y * cell), (behind + n_x, n_y + above)
    upper, base = (n_x * cell, 0.0), (0.0, lower[1])
    fill |= {"lithostatic": True}
    return _on_floor(block(cell, cells, upper, lower=lower, base=base, open_sides={"y+"}, **fill))


def _on_floor(parts: Parts) -> Parts:
    """Add a no_slip floor and free_slip sides to the grid and the fill of a bed."""
    grid: Grid = parts["grid"]
    floor = Wall(grid.dim - 1, grid.lower[-1], kind="no_slip")
    return parts | {"walls": (floor, *smooth_sides(grid))}
