"""Force of the material on the walls and blocks of a record."""

import numpy as np

from granular.checks import integer
from granular.measure.body import MeanForce, window_means
from granular.mpm.walls import split_impulses
from granular.record.reader import Trajectory


def wall_force(record: Trajectory, wall: int = 0, *, window: int = 1) -> MeanForce:
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
    MeanForce

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
    return MeanForce(times=times, force=force, torque=torque)
