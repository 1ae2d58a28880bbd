"""Beds, and motions made of legs, shared by the scenes with tools in soil."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from granular.mpm.bodies import Motion
from granular.mpm.body_limits import THIN, keeps_sides
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import block, gravity_down, smooth_sides, whole_cells
from granular.tools.checks import positive

Leg = tuple[float, tuple[float, ...], float]
"""Duration [s], velocity [m/s], angular velocity about y [rad/s]."""


def legs(parts: Sequence[Leg], ramp: float) -> Motion:
    """Motion of successive legs of constant velocity, joined by ramps of `ramp` seconds.

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
    *,
    length: float,
    width: float,
    depth: float,
    headroom: float,
    cell: float,
    points_per_cell: int,
    jitter: float,
    gravity: float,
) -> dict:
    """Grid, fill, walls and gravity of a level bed with its surface at z = 0.

    x and y begin at 0. The floor is no_slip and the sides are free_slip.
    """
    cell = positive("cell", cell)
    lengths = (("length", length), ("width", width), ("soil", depth))
    n_x, n_y, n_z = (whole_cells(name, value, cell) for name, value in lengths)
    n_up = whole_cells("headroom", headroom, cell)
    z = -n_z * cell
    soil = block(
        cell,
        (n_x, n_y, n_z + n_up),
        (n_x * cell, n_y * cell, 0.0),
        lower=(0.0, 0.0, z),
        points_per_cell=points_per_cell,
        jitter=jitter,
        lithostatic=True,
    )
    walls = (Wall(2, z, kind="no_slip"), *smooth_sides(soil["grid"]))
    return soil | {"walls": walls, "gravity": gravity_down(3, gravity)}
