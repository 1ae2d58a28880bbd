"""Patches of walls and bodies on which the core adds up the impulses of the material."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from granular.mpm.axis_nodes import c0_lines, node_positions
from granular.mpm.walls import Wall, WallOrBlock
from granular.tools.arrays import Array, IntArray

if TYPE_CHECKING:
    from granular.mpm.scene import Scene


DEEPEST = 2.0
"""Largest depth of a node of a block that receives an impulse [cells]: the reach of splines, from
points that are up to half a cell within the block."""


def watched_solids(scene: Scene) -> int:
    """Number of the walls that the core watches; bodies are numbered behind them."""
    return len(scene.walls) + sum(inflow.driven for inflow in scene.inflows)


def in_order(places: IntArray, numbers: Array) -> tuple[IntArray, Array]:
    """Return patches in the order of their solids and places, whatever they were touched in."""
    order = np.lexsort(places.T[::-1])
    return places[order], numbers[order]


def patch_fields(scene: Scene, places: IntArray, numbers: Array) -> dict[str, NDArray[Any]] | None:
    """Fields of the patches for a frame; None as long as nothing was touched.

    Parameters
    ----------
    scene : Scene
    places, numbers : ndarray
        The patches, as of the core.

    Returns
    -------
    dict of str to ndarray
        ``x`` (n, dim), the place [m]: of a node of a wall, or of the middle of a cell of a body in
        coordinates of the body. ``solid`` (n,), the index of a wall or block, or that of a body
        less the number of bodies, which is negative. ``impulse`` (n, dim) of the material since
        the start [N s; in 2D per metre of depth], ``tangential`` (n, dim), its part along the
        surface, and ``normal`` (n,), its part into the solid.
    """
    solid, at = places[:, 0], places[:, 1:]
    first = watched_solids(scene)
    known = (solid < len(scene.walls)) | (solid >= first)  # not those of inflows
    solid, at, numbers = solid[known], at[known], numbers[known]
    if not len(solid):
        return None
    dim, of_body = scene.dim, solid >= first
    x = (at[:, :dim] + 0.5) * scene.grid.cell
    impulse, tangential, normal = numbers[:, :dim].copy(), numbers[:, 3 : 3 + dim], numbers[:, 6]
    tangential, normal = tangential.copy(), normal.copy()
    positions = node_places(scene)
    for index in np.unique(solid[~of_body]):
        mine = solid == index
        x[mine] = np.transpose([positions[d][at[mine, d]] for d in range(dim)])
        into = into_wall(scene, scene.walls[index], x[mine], impulse[mine])
        normal[mine] = (into * impulse[mine]).sum(axis=1)
        tangential[mine] = np.where(into == 0, impulse[mine], 0.0)
    solid = np.where(of_body, solid - first - len(scene.bodies), solid)
    moment = {"impulse": impulse, "tangential": tangential, "normal": normal}
    return {"x": x, "solid": solid, **moment}


def node_places(scene: Scene) -> list[Array]:
    """Positions of the nodes along each axis [m]."""
    grid = scene.grid
    lines = (c0_lines(grid, scene.walls, axis) for axis in range(grid.dim))
    return [
        low + grid.cell * np.asarray(node_positions(scene.scheme.basis, n, periodic, line))
        for low, n, periodic, line in zip(grid.lower, grid.shape, grid.periodic, lines, strict=True)
    ]


def into_wall(scene: Scene, wall: WallOrBlock, x: Array, impulse: Array) -> Array:
    """Directions into a wall or block at its nodes, shape (n, dim), in its normal components.

    At an edge of a block there are several. A wall within the grid has two sides: there it is the
    direction of the impulse.
    """
    grid = scene.grid
    near = grid.slack * grid.cell
    into = np.zeros(x.shape)
    if isinstance(wall, Wall):
        sides = {grid.lower[wall.axis]: -1.0, grid.upper[wall.axis]: 1.0}
        side = next((sides[end] for end in sides if abs(wall.at - end) < near), 0.0)
        into[:, wall.axis] = side if side else np.sign(impulse[:, wall.axis])
        return into
    depth = np.full((*x.shape, 2), np.inf)
    for axis in range(grid.dim):
        low, high = wall.extent(grid, axis)
        if low > grid.lower[axis] + near:  # ends of the grid have no face
            depth[:, axis, 0] = x[:, axis] - low
        if high < grid.upper[axis] - near:
            depth[:, axis, 1] = high - x[:, axis]
    # The nodes of splines lie behind the face; in corners they belong to several.
    nearest = np.minimum(depth.min(axis=(1, 2)), DEEPEST * grid.cell)[:, None, None]
    faces = depth < nearest + near
    into[:] = faces[..., 0] * 1.0 - faces[..., 1]
    return into


def stored_patches(arrays: Mapping[str, NDArray[Any]]) -> tuple[IntArray, Array] | None:
    """The patches of a checkpoint, for the core; None if it has none."""
    if "patch_places" not in arrays:
        return None
    if "patch_numbers" not in arrays:
        raise ValueError("the checkpoint must have patch_numbers as well as patch_places")
    return np.asarray(arrays["patch_places"]), np.asarray(arrays["patch_numbers"])
