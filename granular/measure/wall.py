"""Force of the material on the walls and blocks of a record."""

from typing import cast

import numpy as np

from granular.measure.body import MeanForce, window_means
from granular.measure.cut_forces import whole_forces
from granular.mpm.scene import Scene
from granular.mpm.walls import split_impulses
from granular.record.reader import Trajectory
from granular.tools.checks import integer, truth


def wall_force(
    record: Trajectory, wall: int = 0, *, window: int = 1, total: bool = True
) -> MeanForce:
    """Window averages of the force and the torque of the material on a wall or block.

    Each average is a difference of impulses over a difference of times, hence the exact mean over
    all steps in between. See `granular.mpm.simulation.Simulation.walls` for the impulses that count
    for each wall.

    Parameters
    ----------
    record : Trajectory
        Of a simulation that was made with `wall_forces`.
    wall : int
        Index into the walls of the scene, >= 0.
    window : int
        Length of a window in intervals between frames, >= 1; windows do not overlap.
    total : bool
        True for the whole wall or block, also if planes of symmetry cut it
        (`granular.model.symmetric`): across a plane the forces cancel, along it they double. False
        for the part that is modelled.
        A wall that no plane cuts has another wall as its image, and is not changed; nor is the wall
        on the plane. Around the axis of an axisymmetric grid radial forces cancel; False gives
        their integral around the wall, the pressure times its area.

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
    scene = cast(Scene, record.scene)
    parts = split_impulses(numbers, scene.dim)
    force, torque = parts["impulse"], parts["angular_impulse"]
    if truth("total", total):
        arms = np.negative([scene.grid.lower])  # of the origin, about which the torque is
        force, torque, _ = whole_forces(scene, scene.walls[wall], force, torque, arms)
    times, force, torque = window_means(np.asarray(record.times), window, force, torque)
    return MeanForce(times=times, force=force, torque=torque)
