"""Surfaces of round, extended and composed shapes of bodies, as polygons to draw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np

from granular.shapes.measures import extents
from granular.shapes.shape import Shape
from granular.tools.arrays import Array, BoolArray, IndexArray

Patches = tuple[Array, list[tuple[int, ...]]]
"""Vertices, shape (n, 3), and polygons as tuples of indices of vertices."""

SIDES = 64
"""Number of sides of the prisms and cones that represent round surfaces."""
SKIN = 0.02
"""Thickness at which unbounded 2D solids are drawn, in sizes of the grid."""
CELLS = {2: 128, 3: 64}
"""Number of intervals along the longest side, where an operation is drawn by its distance."""


def thickened(line: Array, half: float, *, radial: bool) -> Array:
    """Outline, shape (n, 2), of the wall of a half thickness about an open line.

    It runs along the right of the line and back. Where `radial`, the wall has no round end on the
    axis, the first coordinate being the distance from it.
    """
    around = np.concatenate([line, line[-2:0:-1]])
    edge = np.roll(around, -1, axis=0) - around
    edge /= np.linalg.norm(edge, axis=1)[:, None]
    outline: list[Array] = []
    for at, before, after in zip(around, np.roll(edge, 1, axis=0), edge, strict=True):
        cosine, turn = before @ after, before[0] * after[1] - before[1] * after[0]
        right = np.array([[before[1], -before[0]], [after[1], -after[0]]])
        if cosine < -1 + 1e-9 and radial and at[0] == 0:
            outline += list(at + half * right)
        elif turn > 0 or cosine < -1 + 1e-9:
            whole = math.pi if cosine < -1 + 1e-9 else math.atan2(turn, cosine)
            angle = math.atan2(right[0, 1], right[0, 0]) + whole * np.linspace(0, 1, SIDES // 4)
            outline += list(at + half * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        else:
            outline.append(at + half * right.sum(axis=0) / (1 + cosine))
    return np.array(outline)


def _triangles(x: Array) -> list[tuple[int, ...]]:
    """Triangles of a simple polygon that runs anticlockwise: ears are cut off one by one."""
    left = list(range(len(x)))
    triangles = []

    def area(a: Array, b: Array, c: Array) -> Array:
        return np.asarray((b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0]))

    def is_ear(k: int) -> bool:
        i, j, m = left[k - 1], left[k], left[(k + 1) % len(left)]
        a, b, c = x[i], x[j], x[m]
        if not area(a, b, c) > 0:
            return False
        others = x[[q for q in left if q not in (i, j, m)]]
        within = (area(a, b, others) >= 0) & (area(b, c, others) >= 0) & (area(c, a, others) >= 0)
        return not within.any()

    while len(left) > 3:
        ear = next((k for k in range(len(left)) if is_ear(k)), 0)
        triangles.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return [*triangles, tuple(left)]


def extended(outline: Array, half: float, dim: int) -> Patches:
    """Surface of a polygon extended along the third axis; in 2D the polygon itself."""
    n, flat = len(outline), _triangles(outline)
    lower = np.column_stack([outline, np.full(n, -half if dim == 3 else 0.0)])
    if dim == 2:
        return lower, flat
    sides: list[tuple[int, ...]] = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    caps = [face[::-1] for face in flat] + [tuple(n + i for i in face) for face in flat]
    return np.concatenate([lower, lower * [1, 1, -1]]), sides + caps


def revolved(outline: Array, dim: int) -> Patches:
    """Surface that a closed outline (r, z) sweeps about the third axis; in 2D its two sections.

    Edges on the axis are left out.
    """
    n = len(outline)
    if dim == 2:
        flat = _triangles(outline)
        right = np.stack([outline[:, 0], np.zeros(n), outline[:, 1]], axis=1)
        return np.concatenate([right, right * [-1, 1, 1]]), flat + [
            tuple(n + i for i in face[::-1]) for face in flat
        ]
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    r, z = outline[:, 0], np.broadcast_to(outline[:, 1], (SIDES, n))
    vertices = np.stack([np.cos(angle)[:, None] * r, np.sin(angle)[:, None] * r, z], axis=2)
    faces: list[tuple[int, ...]] = []
    for i, k in product(range(n), range(SIDES)):
        j, m = (i + 1) % n, (k + 1) % SIDES
        if r[i] > 0 or r[j] > 0:
            faces.append((k * n + i, m * n + i, m * n + j, k * n + j))
    return vertices.reshape(-1, 3), faces


def _indices(counts: IndexArray) -> IndexArray:
    """Indices of all cells, shape (*counts, dim)."""
    return np.moveaxis(np.asarray(np.indices(tuple(int(n) for n in counts))), 0, -1)


def _sampling(shape: Shape, size: float) -> tuple[Array, IndexArray, float]:
    """Lower corner and number of cells of a grid about the surface of a shape, and its spacing."""
    dim = shape.dim
    far = np.minimum(extents(shape, np.eye(3), np.zeros((1, 3)))[:dim], size)
    lower, upper = -far, far
    for _ in range(3):  # towards a part away from the position of the body
        step = (upper - lower).max() / 32
        counts = np.maximum(np.ceil((upper - lower) / step - 1e-9).astype(int), 1)
        middles = lower + step * (_indices(counts).reshape(-1, dim) + 0.5)
        near = middles[abs(shape.distance(middles)[0]) < step * math.sqrt(dim)]
        if not len(near):
            break
        lower = np.maximum(lower, near.min(axis=0) - step)
        upper = np.minimum(upper, near.max(axis=0) + step)
    step = (upper - lower).max() / CELLS[dim]
    counts = np.ceil((upper - lower) / step + 1.98).astype(int)  # a cell beyond on each side
    return 0.5 * (lower + upper) - 0.5 * step * counts, counts, step


def contoured(shape: Shape, size: float) -> Patches:
    """Surface of any shape by its signed distance; in 2D the area of its solid.

    The cells of a grid with their centres in the solid are drawn, after the corners of those at the
    surface have been moved onto it. Unbounded solids end at the distance `size`; in 2D a skin of
    them is drawn.
    """
    dim = shape.dim
    lower, counts, step = _sampling(shape, size)
    middles = lower + step * (_indices(counts) + 0.5)
    distance = shape.distance(middles.reshape(-1, dim))[0].reshape(counts)
    solid = distance < 0
    bounded = bool(np.isfinite(extents(shape, np.eye(3), np.zeros((1, 3)))[:dim]).all())
    drawn = solid if bounded else solid & (distance > -max(SKIN * size, 2 * step))
    corners = _cell_corners(drawn) if dim == 2 else _outer_faces(solid)
    used, faces = np.unique(corners, return_inverse=True)
    at = np.stack(np.unravel_index(used, counts + 1), axis=-1)
    vertices = np.pad(lower + step * at, ((0, 0), (0, 3 - dim)))
    open_cells = [
        _has_open_cell(solid, at, offset) for offset in _indices(np.full(dim, 2)).reshape(-1, dim)
    ]
    _move_onto(shape, vertices, np.logical_or.reduce(open_cells))
    polygons = faces.reshape(corners.shape)
    return vertices, [tuple(int(i) for i in polygon) for polygon in polygons]


def _has_open_cell(solid: BoolArray, at: IndexArray, offset: IndexArray) -> BoolArray:
    """True for corners of which the cell on one side exists and is not in the solid."""
    cell, counts = at - offset, np.array(solid.shape)
    exists = ((cell >= 0) & (cell < counts)).all(axis=1)
    return np.asarray(exists & ~solid[tuple(np.clip(cell, 0, counts - 1).T)])


def _move_onto(shape: Shape, vertices: Array, which: BoolArray) -> None:
    """Move vertices along the normal until they lie on the surface; at an edge that takes a few."""
    places = vertices[which][:, : shape.dim]
    for _ in range(20):
        distance, normal = shape.distance(places)
        places = places - distance[:, None] * normal
    vertices[np.flatnonzero(which), : shape.dim] = places


def _numbers(at: IndexArray, shape: Sequence[int]) -> IndexArray:
    return np.ravel_multi_index(tuple(np.moveaxis(at, -1, 0)), tuple(n + 1 for n in shape))


def _cell_corners(drawn: BoolArray) -> IndexArray:
    """Numbers of the corners of the cells that are drawn in 2D, shape (n, 4)."""
    around = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    return _numbers(np.argwhere(drawn)[:, None] + around, drawn.shape)


def _outer_faces(solid: BoolArray) -> IndexArray:
    """Numbers of the corners of the faces between cells in the solid and others, shape (n, 4)."""
    faces = []
    for axis in range(3):
        low = np.moveaxis(solid, axis, 0)
        first, second = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        around = np.array([0 * first, first, first + second, second])
        for sign in (1, -1):
            is_face = (low[:-1] if sign > 0 else low[1:]) & ~(low[1:] if sign > 0 else low[:-1])
            at = np.argwhere(np.moveaxis(is_face, 0, axis)) + np.eye(3, dtype=int)[axis]
            faces.append(_numbers(at[:, None] + around[::sign], solid.shape))
    return np.concatenate(faces)
