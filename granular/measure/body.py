"""What the rigid bodies of a record did, and what the material did to them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granular.checks import integer
from granular.mpm.bodies import split

if TYPE_CHECKING:
    from granular.record.reader import Trajectory

__all__ = ["BodyForce", "BodyMotion", "body_force", "body_motion"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyMotion:
    """A body at the frames of a record.

    Attributes
    ----------
    times : ndarray, shape (k,)
        [s].
    position, velocity : ndarray, shape (k, dim)
        [m], [m/s].
    quaternion : ndarray, shape (k, 4)
        Orientation, the scalar part first.
    angular_velocity : ndarray, shape (k,) in the plane, (k, 3) in space
        [rad/s].
    impulse : ndarray, shape (k, dim)
        Of the material on the body since the run began [N s, per metre of depth in the plane].
    angular_impulse : ndarray, shape (k,) in the plane, (k, 3) in space
        The same about the position, which moves with the body [N m s].
    """

    times: Array
    position: Array
    velocity: Array
    quaternion: Array
    angular_velocity: Array
    impulse: Array
    angular_impulse: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyForce:
    """Force and torque of the material on a body, averaged between frames.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Middles of the windows [s].
    force : ndarray, shape (k, dim)
        [N, per metre of depth in the plane].
    torque : ndarray, shape (k,) in the plane, (k, 3) in space
        About the position of the body [N m].
    """

    times: Array
    force: Array
    torque: Array


def body_motion(record: Trajectory, body: int = 0) -> BodyMotion:
    """Pose, velocities and what a body has felt, at the frames of a record.

    Parameters
    ----------
    record : Trajectory
    body : int
        Place in the bodies of the scene, >= 0.

    Returns
    -------
    BodyMotion

    Raises
    ------
    ValueError
        If the scene has no such body, or the record does not tell of it.
    """
    count = record.bodies.shape[1]
    if not count:
        raise ValueError(f"record = {record!r} must be one of a scene with bodies")
    numbers = record.bodies[:, integer("body", body, 0, count - 1)]
    return BodyMotion(times=record.times, **split(numbers, record.scene.dim))


def body_force(record: Trajectory, body: int = 0, *, window: int = 1) -> BodyForce:
    """Window averages of the force and the torque of the material on a body.

    They are differences of impulses over times, hence exact means over all steps between; forces
    of single steps are noise of the waves and of points that cross cells.

    Parameters
    ----------
    record : Trajectory
    body : int
        Place in the bodies of the scene, >= 0.
    window : int
        Intervals between frames that a window takes, >= 1; windows do not overlap.

    Returns
    -------
    BodyForce

    Raises
    ------
    ValueError
        If there is no such body, or there are fewer frames than a window takes.
    """
    motion = body_motion(record, body)
    step = integer("window", window, 1)
    if len(motion.times) <= step:
        raise ValueError(f"window = {step} must be less than the {len(motion.times)} frames")
    times = motion.times[::step]
    span = np.diff(times)

    def rate(impulse: Array) -> Array:
        change = np.diff(impulse[::step], axis=0)
        return change / span.reshape(-1, *[1] * (change.ndim - 1))

    return BodyForce(
        times=times[:-1] + span / 2,
        force=rate(motion.impulse),
        torque=rate(motion.angular_impulse),
    )
