"""Contact of free bodies with solids: the data of shapes, walls and blocks for the core."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from granular.model.grid import Grid, combined
from granular.mpm.walls import WallOrBlock
from granular.shapes.boxes import Box
from granular.shapes.measures import reach
from granular.shapes.round import Capsule, Cylinder, Frustum, Sphere
from granular.shapes.sections import Polygon
from granular.shapes.shape import Shape, frame_of, padded
from granular.tools.arrays import Array

if TYPE_CHECKING:
    from granular import _core
    from granular.mpm.bodies import Body
    from granular.mpm.scene import Scene


FAR = 1e50
"""Position [m] of a side that is infinitely far, as in the core."""

SPACING = 0.5
"""Distance [cells] of the sample points of a surface at which it touches others."""

MOST_ACROSS = {2: 400, 3: 24}
"""Largest number of sample points along the edge of a cube of the volume of a body, by
dimension."""

MOST_PLACES = 2_000_000
"""Largest number of points about a body from which the sample points on its surface are selected. A
body as long as wide needs 170,000 of them at most; one that needs more is longer than wide by
10,000 times in 2D and by 1,000 in 3D, or far from its position."""

BAND = 2.5
"""Distance from the surface [spacings] from which points are projected on it: those outside reach
the corners, also obtuse ones."""


def moves_freely(body: Body) -> bool:
    """True if forces move or turn a body."""
    return bool(body.free) or body.inertia is not None


def contact_balls(shape: Shape, cell: float, name: str = "shape") -> Array:
    """Balls with which a shape touches others, shape (n, 4): centre in its coordinates and radius.

    A ball, a disc in 2D and a rod with round ends are exact. For other shapes these are points of
    the surface, half a cell apart, with all corners, of the radius 0. An endless shape has none;
    one that would need more than `MOST_PLACES` is refused by its `name`.
    """
    dim = shape.dim
    if not math.isfinite(reach(shape)):
        return np.zeros((0, 4))
    if isinstance(shape, Capsule):
        count = math.ceil(shape.length / (SPACING * cell)) + 1
        _check_count(name, shape.length, count)
        along = np.linspace(-1, 1, count)[:, None] * 0.5 * shape.length
        centre, axes = frame_of(shape)
        return np.column_stack([centre + along * axes[:, 2], np.full(count, shape.radius)])
    if isinstance(shape, Sphere) or (isinstance(shape, Cylinder) and dim == 2 and not shape.inside):
        return np.array([[*padded(shape.center), shape.radius]])
    places = _surface(shape, cell, name)
    return np.column_stack([places, np.zeros((len(places), 4 - dim))])


def balls_of(scene: Scene) -> list[Array]:
    """Balls of each body of a scene; they are made once for each shape."""
    balls: dict[Shape, Array] = {}
    for i, body in enumerate(scene.bodies):
        if body.shape not in balls:
            name = f"bodies[{i}].shape"
            balls[body.shape] = contact_balls(body.shape, scene.grid.cell, name)
    return [balls[body.shape] for body in scene.bodies]


def _check_count(name: str, size: float, count: float) -> None:
    if count > MOST_PLACES:
        raise ValueError(
            f"{name} reaches over {size:.4g} m, must be shorter, or endless, or about its position:"
            f" its contact needs {count:.2g} sample points, must be at most {MOST_PLACES}"
        )


def _surface(shape: Shape, cell: float, name: str) -> Array:
    """Sample points of the surface of a finite shape, shape (n, dim), with all its corners."""
    dim = shape.dim
    low, high = np.array(shape.bounds)
    half = 0.5 * (high - low)
    width = max(SPACING * cell, 2 * math.prod(half) ** (1 / dim) / MOST_ACROSS[dim])
    lines = []
    _check_count(name, 2 * max(half), math.prod(2 * (half / width + BAND) + 2))
    for first, last, far in zip(low, high, half + BAND * width, strict=True):
        count = math.ceil(2 * far / width) + 1
        lines.append(np.linspace(first - BAND * width, last + BAND * width, count))
    places = combined(lines)
    phi = shape.distance(places)[0]
    places = places[abs(phi) <= BAND * width]
    for _ in range(4):  # edges of intersections, where distances are bounds, take several
        phi, normal = shape.distance(places)
        places = places - phi[:, None] * normal
    places = np.concatenate([_corners(shape), places])
    places = places[abs(shape.distance(places)[0]) <= 1e-6 * width]
    return _thinned(places, width)


def _corners(shape: Shape) -> Array:
    """Corners of the boxes and polygons that a shape consists of, shape (n, dim)."""
    dim, corners = shape.dim, [np.zeros((0, shape.dim))]
    for leaf in shape.leaves():
        parts = []
        if isinstance(leaf, Box):
            parts = [(*frame_of(leaf), 0.5 * np.array(leaf.size))]
        elif isinstance(leaf, Frustum):
            parts = [(at, axes, np.array(half[:dim])) for at, axes, half in leaf.walls]
        elif isinstance(leaf, Polygon):
            centre, axes = frame_of(leaf)
            corners.append(centre[:dim] + leaf.samples()[0][0] @ axes[:dim, :dim].T)
        for centre, axes, half in parts:
            box = combined([np.array([-s, s]) for s in half])
            corners.append(centre[:dim] + box @ axes[:dim, :dim].T)
    return np.concatenate(corners)


def _thinned(places: Array, width: float) -> Array:
    """Select one of the points in each cell of a fine grid: the one on which most were projected.

    Many points are projected on a corner, fewer on an edge, and fewest on a face.
    """
    _, first, count = np.unique(
        np.rint(places / (1e-6 * width)), axis=0, return_index=True, return_counts=True
    )
    order = np.lexsort((first, -count))
    points = places[first[order]]
    chosen = np.unique(np.floor(points / (0.7 * width) + 0.5), axis=0, return_index=True)[1]
    thinned: Array = points[np.sort(chosen)]
    return thinned


def obstacles(scene: Scene) -> Array:
    """Walls and blocks of a scene as the core needs them, shape (n, 12): see `touch_solids` there.

    A wall at an end of the domain, and a block that reaches it, are extended beyond it.
    """
    rows = [row_of_wall(scene.grid, wall)[None] for wall in scene.walls]
    return np.concatenate([np.zeros((0, 12)), *rows])


def row_of_wall(grid: Grid, wall: WallOrBlock) -> Array:
    """Row of a wall, see `obstacles`; within the grid its lower and upper sides are the same."""
    row, near = np.zeros(12), grid.slack * grid.cell
    for axis in range(grid.dim):
        low, high = wall.extent(grid, axis)
        begins, ends = low <= grid.lower[axis] + near, high >= grid.upper[axis] - near
        if grid.periodic[axis]:
            begins = ends = begins and ends
        row[axis], row[3 + axis] = (-FAR if begins else low), (FAR if ends else high)
    if wall.velocity is not None:
        row[6 : 6 + grid.dim] = wall.velocity
    row[9] = FAR if wall.rule.sticks else wall.friction
    row[10] = min(wall.opens_at, FAR)
    flat = wall.axis is not None and row[wall.axis] == row[3 + wall.axis]
    row[11] = wall.axis if flat else -1
    return row


def touch_solids(engine: _core.Engine, scene: Scene) -> None:
    """Let the free bodies of a scene touch walls, blocks and other bodies."""
    if not any(moves_freely(body) for body in scene.bodies):
        return
    balls = balls_of(scene)
    first = np.cumsum([0, *map(len, balls)])
    restitution = np.array([body.restitution for body in scene.bodies])
    engine.touch_solids(np.concatenate(balls), first, restitution, obstacles(scene))
