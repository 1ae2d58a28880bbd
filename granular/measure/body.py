"""Motion of the rigid bodies of a record, and the force of the material on them."""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from granular.measure.cut_forces import whole_forces
from granular.measure.result import ANGULAR_IMPULSE, ENERGY, FORCE, IMPULSE, TORQUE, Result
from granular.mpm.bodies import split
from granular.mpm.scene import Scene
from granular.record.reader import Trajectory
from granular.tools.arrays import Array
from granular.tools.checks import integer, truth


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyMotion(
    Result,
    times="s",
    position="m",
    velocity="m/s",
    angular_velocity="rad/s",
    impulse=IMPULSE,
    angular_impulse=ANGULAR_IMPULSE,
    work=ENERGY,
    applied_force=FORCE,
    applied_torque=TORQUE,
):
    """Motion of a body at the frames of a record.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Times of the frames [s].
    position, velocity : ndarray, shape (k, dim)
        Position [m] and velocity [m/s] of the body.
    quaternion : ndarray, shape (k, 4)
        Orientation, the scalar part first.
    angular_velocity : ndarray, shape (k,) in 2D, (k, 3) in 3D
        [rad/s].
    impulse : ndarray, shape (k, dim)
        Impulse of the material on the body since the run began [N s; in 2D per metre of depth].
    angular_impulse : ndarray, shape (k,) in 2D, (k, 3) in 3D
        Angular impulse since then about the position, which moves with the body [N m s].
    work : ndarray, shape (k,)
        Work of the contact on the material since then [J; in 2D per metre of depth], without the
        dissipation by friction at the surface of the body.
    driven : ndarray of bool, shape (k,)
        Whether another program has set its velocity, by `set_motion`.
    applied_force, applied_torque : ndarray
        Force [N], shape (k, dim), and torque [N m] that it has set by `apply_load`; on the modelled
        part, whatever `total` is.
    """

    times: Array
    position: Array
    velocity: Array
    quaternion: Array
    angular_velocity: Array
    impulse: Array
    angular_impulse: Array
    work: Array
    driven: NDArray[np.bool_]
    applied_force: Array
    applied_torque: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class MeanForce(Result, times="s", force=FORCE, torque=TORQUE):
    """Force and torque of the material on a body, a wall or a block, averaged between frames.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Middles of the averaging windows [s].
    force : ndarray, shape (k, dim)
        Force of the material [N; in 2D per metre of depth].
    torque : ndarray, shape (k,) in 2D, (k, 3) in 3D
        Torque of the material [N m], about the position of a body; of a wall or a block about the
        origin of the coordinates.
    """

    times: Array
    force: Array
    torque: Array


def body_motion(record: Trajectory, body: int = 0, *, total: bool = True) -> BodyMotion:
    """Pose and velocities of a body, and the impulse on it, at the frames of a record.

    Parameters
    ----------
    body : int
        Index into the bodies of the scene, >= 0.
    total : bool
        True for the whole body, also if planes of symmetry cut it (`granular.model.symmetric`):
        across a plane the forces cancel, along it they double. False for the part that is modelled.
        A body that no plane cuts has another body as its image, and is not changed. Around the axis
        of an axisymmetric grid radial forces cancel; False gives their integral around the rings.

    Raises
    ------
    ValueError
        If the scene has no such body, or the record does not store its motion.
    """
    count = record.bodies.shape[1]
    if not count:
        raise ValueError(f"record = {record!r} must be one of a scene with bodies")
    numbers = record.bodies[:, integer("body", body, 0, count - 1)]
    scene = cast(Scene, record.scene)
    parts = split(numbers, scene.dim)
    if truth("total", total):
        solid = scene.bodies[body]
        arms = np.subtract([solid.position], scene.grid.lower)
        force, turning, size = whole_forces(
            scene, solid, parts["impulse"], parts["angular_impulse"], arms
        )
        work = parts["work"] * size
        parts |= {"impulse": force, "angular_impulse": turning, "work": work}
    return BodyMotion(times=record.times, **cast(dict[str, Any], parts))


def body_force(
    record: Trajectory, body: int = 0, *, window: int = 1, total: bool = True
) -> MeanForce:
    """Window averages of the force and the torque of the material on a body.

    Each average is a difference of impulses over a difference of times, hence the exact mean over
    all steps in between. Forces of single steps are not used: elastic waves and points that cross
    cells make them noisy.

    Parameters
    ----------
    body : int
        Index into the bodies of the scene, >= 0.
    window : int
        Length of a window in intervals between frames, >= 1; windows do not overlap.
    total : bool
        As in `body_motion`: True for the force on the whole body, False for that on the part that
        is modelled.

    Raises
    ------
    ValueError
        If there is no such body, or a window is longer than the record.
    """
    motion = body_motion(record, body, total=total)
    times, force, torque = window_means(
        motion.times, window, motion.impulse, motion.angular_impulse
    )
    return MeanForce(times=times, force=force, torque=torque)


def window_means(times: Array, window: int, *impulses: Array) -> tuple[Array, ...]:
    """Middles of windows of some intervals between frames, and the mean rates of impulses there."""
    step = integer("window", window, 1)
    if len(times) <= step:
        raise ValueError(f"window = {step} must be less than the {len(times)} frames")
    ends = times[::step]
    span = np.diff(ends)

    def rate(impulse: Array) -> Array:
        change = np.diff(impulse[::step], axis=0)
        return change / span.reshape(-1, *[1] * (change.ndim - 1))

    return (ends[:-1] + span / 2, *map(rate, impulses))
