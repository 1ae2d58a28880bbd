"""Forces on whole bodies and walls, of which a plane of symmetry cuts off a part, or rings."""

from collections.abc import Sequence

import numpy as np

from granular.model.symmetric import mirror_axes
from granular.mpm.bodies import Body
from granular.mpm.scene import Scene
from granular.mpm.walls import WallOrBlock
from granular.shapes.shape import turned
from granular.tools.arrays import Array


def cut_axes(scene: Scene, part: Body | WallOrBlock) -> tuple[int, ...]:
    """Axes normal to the planes of symmetry that cut a body, wall or block.

    A body or wall that only touches a plane, or is apart from it, has another one as its image in
    the whole set-up; a wall on the plane of symmetry does not belong to the whole set-up.
    """
    return tuple(axis for axis in mirror_axes(scene) if _is_cut(scene, part, axis))


def _is_cut(scene: Scene, part: Body | WallOrBlock, axis: int) -> bool:
    grid = scene.grid
    plane, near = grid.lower[axis], grid.slack * grid.cell
    if not isinstance(part, Body):
        return part.axis != axis and part.extent(grid, axis)[0] <= plane + near
    along = turned(part.rotation_deg).inv().apply(np.eye(3)[axis])
    low, _ = part.shape.ends(along[None])
    return float(part.position[axis] + low[0]) < plane - near


def whole_forces(
    scene: Scene, part: Body | WallOrBlock, forces: Array, torques: Array, arms: Array
) -> tuple[Array, Array, float]:
    """Forces (n, dim) and torques on the whole of a body or wall, and its size over that modelled.

    The torques are about points at distances `arms` (n, dim) from the planes of symmetry. Around
    an axis of symmetry the radial forces cancel, and nothing is left to turn a ring.
    """
    if scene.grid.axisymmetric:
        return forces * [0.0, 1.0], np.zeros_like(torques), 1.0
    axes = cut_axes(scene, part)
    turning = torques_of_whole(axes, torques, forces, arms)
    return of_whole(axes, forces), turning, 2.0 ** len(axes)


def of_whole(axes: Sequence[int], vectors: Array) -> Array:
    """Sum of vectors (n, dim) and of their images at planes normal to some axes.

    The component normal to a plane cancels, the others are doubled.
    """
    total = vectors * 2.0 ** len(axes)
    total[:, list(axes)] = 0.0
    return total


def torques_of_whole(
    axes: Sequence[int], torques: Array, forces: Array, arms: Array | None = None
) -> Array:
    """The same for torques, shape (n,) in 2D and (n, 3) in 3D, of some forces (n, dim).

    An image has the component normal to its plane, and the opposite of the others; in 2D the torque
    is in the plane of symmetry. The torques are about points whose distances from the planes are
    `arms` (n, dim), by default 0.
    """
    if not axes:
        return torques
    flat = forces.shape[1] == 2
    turning = np.zeros((len(forces), 3))
    turning[:, slice(2, 3) if flat else slice(3)] = torques.reshape(len(forces), -1)
    arm, force, whole = np.zeros((3, len(forces), 3))
    force[:, : forces.shape[1]] = forces
    whole[:, : forces.shape[1]] = of_whole(axes, forces)
    if arms is not None:
        arm[:, list(axes)] = arms[:, list(axes)]
    turning = turning + np.cross(arm, force)  # about the planes
    for axis in axes:
        turning[:, np.arange(3) != axis] = 0.0
    turning = 2.0 ** len(axes) * turning - np.cross(arm, whole)
    return turning[:, 2] if flat else turning
