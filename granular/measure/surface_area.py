"""Area of the surfaces of walls and bodies, patch by patch."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granular.model.grid import Grid
from granular.mpm.bodies import Body
from granular.mpm.body_distances import distance_from_bodies, periods
from granular.mpm.patches import node_places
from granular.mpm.rigid_contact import moves_freely
from granular.mpm.scene import Scene
from granular.mpm.walls import WallOrBlock
from granular.shapes.shape import turned
from granular.tools.arrays import Array, BoolArray

FINER = {2: 16, 3: 6}
"""Samples along a cell from which the area of the surface in it is computed, by dimension."""

HALF_WIDTH = 1.5
"""Half of the width, in distances of samples, over which a surface is smoothed. The sum of its
cosine over samples of a flat surface along the axes is exact."""

MOST_SAMPLES = 200_000
"""Number of samples computed at once."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Patches of a surface: middles (n, dim) [m], in coordinates of a body, and areas (n,).

    In an axisymmetric grid the areas are those of rings [m2].
    """

    x: Array
    area: Array


def wall_surface(scene: Scene, wall: int) -> Surface:
    """Nodes of a wall or of the faces of a block, each with its share of the area.

    Those within a body, as it is at the start, or below a block have none.
    """
    grid, solid = scene.grid, scene.walls[wall]
    near = grid.slack * grid.cell
    axes = node_places(scene)
    parts: list[tuple[Array, Array]] = []
    faces = {(axis, float(low[axis])): (low, high) for low, high, axis, _ in solid.faces(grid)}
    for (axis, at), (low, high) in faces.items():
        inner = grid.lower[axis] + near < at < grid.upper[axis] - near
        if not inner and solid.axis is None:
            continue  # a face of a block at an end of the grid
        lines = [np.array([at]) if d == axis else axes[d] for d in range(grid.dim)]
        shares = [
            np.ones(1) if d == axis else _shares(axes[d], low[d], high[d]) for d in range(grid.dim)
        ]
        if grid.axisymmetric:
            shares[0] = 2 * np.pi * (lines[0] if axis == 0 else _moments(axes[0], low[0], high[0]))
        places = np.stack([a.ravel() for a in np.meshgrid(*lines, indexing="ij")], axis=1)
        area = np.prod(np.meshgrid(*shares, indexing="ij"), axis=0).ravel()
        if scene.bodies:
            area[distance_from_bodies(grid, scene.bodies)(places)[0] < -near] = 0.0
        for block in scene.walls:
            if block is not solid and block.axis is None:
                area[_covered(grid, block, axis, places)] = 0.0
        parts.append((places[area > 0], area[area > 0]))
    return Surface(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _covered(grid: Grid, block: WallOrBlock, axis: int, x: Array) -> BoolArray:
    """True for places on a face normal to an axis that a block covers, but not at its edges."""
    near = grid.slack * grid.cell
    covered = np.ones(len(x), dtype=bool)
    for d in range(grid.dim):
        low, high = block.extent(grid, d)
        edge = -near if d == axis else near
        covered &= (x[:, d] > low + edge) & (x[:, d] < high - edge)
    return covered


def _shares(nodes: Array, low: float, high: float) -> Array:
    """Length of the part from `low` to `high` that is nearest to each node of an axis."""
    return np.diff(_ends(nodes, low, high))


def _moments(nodes: Array, low: float, high: float) -> Array:
    """Integral of the coordinate over the same parts [m2]."""
    return np.diff(_ends(nodes, low, high) ** 2 / 2)


def _ends(nodes: Array, low: float, high: float) -> Array:
    """Ends of the parts from `low` to `high` that are nearest to each node of an axis."""
    middles = np.concatenate([[-np.inf], (nodes[:-1] + nodes[1:]) / 2, [np.inf]])
    return np.clip(middles, low, high)


def body_surface(scene: Scene, index: int) -> Surface:
    """Cells of the grid of a body that its surface crosses, each with the area in it.

    The area is the volume in which the surface is smoothed, over the width, by samples. What lies
    at an end of the domain or on another body does not count for a body that does not move.
    """
    grid, body = scene.grid, scene.bodies[index]
    cell, dim = grid.cell, grid.dim
    centres = _near_surface(grid, body)
    finer = FINER[dim]
    step = cell / finer
    offsets = (np.arange(finer) + 0.5) * step - cell / 2
    offsets = np.stack(np.meshgrid(*[offsets] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    others = [other for k, other in enumerate(scene.bodies) if k != index]
    area = np.empty(len(centres))
    chunk = max(MOST_SAMPLES // len(offsets), 1)
    for begin in range(0, len(centres), chunk):
        part = slice(begin, begin + chunk)
        x = (centres[part, None] + offsets).reshape(-1, dim)
        smooth = _smoothed(body, x, HALF_WIDTH * step)
        keep = np.flatnonzero(smooth)
        if not may_move(body):
            smooth[keep] *= _exposed(grid, body, others, x[keep])
        if grid.axisymmetric:
            smooth *= 2 * np.pi * np.maximum(_in_scene(body, x)[:, 0], 0.0)
        area[part] = smooth.reshape(-1, len(offsets)).sum(axis=1) * step**dim
    return Surface(centres[area > 0], area[area > 0])


def body_cells(scene: Scene, index: int) -> int:
    """Number of cells that the surface of a body may cross, about the domain."""
    return len(_near_surface(scene.grid, scene.bodies[index]))


def _near_surface(grid: Grid, body: Body) -> Array:
    """Centres of the cells that the surface may cross, in coordinates of the body, shape (n, dim).

    Of a body that reaches beyond the domain, those about the domain.
    """
    dim, cell = grid.dim, grid.cell
    ends = np.array([grid.lower, grid.upper]).T
    corners = np.stack([a.ravel() for a in np.meshgrid(*ends, indexing="ij")], axis=1)
    local = _in_body(body, corners)
    low, high = local.min(axis=0) - cell, local.max(axis=0) + cell
    own_low, own_high = (np.asarray(end[:dim], dtype=float) for end in body.shape.bounds)
    if may_move(body):
        low = np.where(np.isfinite(own_low), own_low - cell, low)
        high = np.where(np.isfinite(own_high), own_high + cell, high)
    else:
        low, high = np.maximum(low, own_low - cell), np.minimum(high, own_high + cell)
    axes = [
        (np.arange(math.floor(a / cell), math.ceil(b / cell)) + 0.5) * cell
        for a, b in zip(low, high, strict=True)
    ]
    near: list[Array] = []
    for first in axes[0]:  # a slice at a time: all cells of a large box would take much memory
        rest = np.meshgrid([first], *axes[1:], indexing="ij")
        x = np.stack([a.ravel() for a in rest], axis=1)
        near.append(x[np.abs(body.shape.distance(x)[0]) < 0.5 * math.sqrt(dim) * cell])
    return np.concatenate(near) if near else np.empty((0, dim))


def _smoothed(body: Body, x: Array, half: float) -> Array:
    """Density [1/m] of the surface of a body, smoothed over its distance: a cosine."""
    distance = body.shape.distance(x)[0]
    if body.shape.narrowest() < 2 * half:  # its faces are smoothed into the open
        distance = distance - half
    inside = np.abs(distance) < half
    return np.where(inside, (1 + np.cos(np.pi * distance / half)) / (2 * half), 0.0)


def _exposed(grid: Grid, body: Body, others: list[Body], x: Array) -> BoolArray:
    """True where material may be half a cell in front of the surface of a body."""
    distance, normal = body.shape.distance(x)
    ahead = x + (0.5 * grid.cell - distance)[:, None] * normal
    place = _in_scene(body, ahead)
    wraps = np.isfinite(periods(grid, body)[: grid.dim])  # it has images
    within = (place > np.array(grid.lower)) & (place < np.array(grid.upper)) | wraps
    is_open: BoolArray = np.asarray(within.all(axis=1))
    if others:
        is_open &= distance_from_bodies(grid, others)(place)[0] > 0
    return is_open


def may_move(body: Body) -> bool:
    """True if a body moves by a motion or by forces."""
    return moves_freely(body) or bool(np.any(body.motion.rows()[:, 1:]))


def _rotation(body: Body) -> Array:
    """Rotation from the coordinates of a body to the scene at the start, shape (dim, dim)."""
    dim = body.shape.dim
    return turned(body.rotation_deg).as_matrix()[:dim, :dim]


def _in_scene(body: Body, x: Array) -> Array:
    """Positions (n, dim) in the scene at the start, from those in coordinates of the body."""
    return x @ _rotation(body).T + np.asarray(body.position)


def _in_body(body: Body, x: Array) -> Array:
    """Positions (n, dim) in coordinates of the body at the start."""
    return (x - np.asarray(body.position)) @ _rotation(body)
