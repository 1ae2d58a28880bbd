"""Force of the material on the walls and blocks of a record."""

from dataclasses import dataclass

import numpy as np

from granular.checks import integer
from granular.measure.averaging_grid import Array
from granular.measure.body import window_means
from granular.mpm.walls import split_impulses
from granular.record.reader import Trajectory


@dataclass(frozen=True, eq=False, kw_only=True)
class WallForce:
    """Force and torque of the material on a wall or block, averaged between frames.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Middles of the averaging windows [s].
    force : ndarray, shape (k, dim)
        Force of the material on the wall [N; in 2D per metre of depth].
    torque : ndarray, shape (k,) in 2D, (k, 3) in 3D
        Torque of the material about the origin of the coordinates [N m].
    """

    times: Array
    force: Array
    torque: Array


def wall_force(record: Trajectory, wall: int = 0, *, window: int = 1) -> WallForce:
    """Window averages of the force and the torque of the material on a wall or block.

    Each average is a difference of impulses over a difference of times, hence the exact mean over
    all steps in between. See `granular.mpm.simulation.Simulation.walls` for what counts for which
    wall.

    Parameters
    ----------
    record : Trajectory
        Of a simulation that was made with `wall_forces`.
    wall : int
        Index into the walls of the scene, >= 0.
    window : int
        Length of a window in intervals between frames, >= 1; windows do not overlap.

    Returns
    -------
    WallForce

    Raises
    ------
    ValueError
        If there is no such wall, the record does not hold the impulses, or a window is longer than
        the record.
    """
    count = record.walls.shape[1]
    if not count:
        raise ValueError(f"record = {record!r} must be one of a simulation with wall_forces")
    numbers = record.walls[:, integer("wall", wall, 0, count - 1)]
    parts = split_impulses(numbers, record.scene.dim)
    times, force, torque = window_means(
        np.asarray(record.times), window, parts["impulse"], parts["angular_impulse"]
    )
    return WallForce(times=times, force=force, torque=torque)
