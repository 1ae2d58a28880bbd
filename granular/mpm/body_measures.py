"""Measures of the shapes of bodies, from the rows that describe them for the core."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from granular.mpm.body_shapes import BOX, CYLINDER, HALF_SPACE, HEIGHT_MAP, Array

__all__ = ["are_endless", "corners", "deepest", "extents", "reach", "thicknesses"]

BEHIND = (HALF_SPACE, HEIGHT_MAP)
"""Kinds of parts that are all that lies behind a surface without end."""
MESH_TABLES = 5
"""Number of tables of a mesh."""
TINY = 1e-12
"""Largest cosine that is taken for that of a right angle."""


def reach(rows: Array, dim: int) -> float:
    """Radius about the position of the body that contains the surface [m]; may be infinite."""
    farthest = 0.0
    for kind, inside, *numbers in rows:
        center, size = np.array(numbers[:3]), np.array(numbers[12:])
        if inside or kind in BEHIND:
            return math.inf
        extent = size[: dim - 1 if kind == CYLINDER else dim]
        farthest = max(farthest, float(np.linalg.norm(center) + np.linalg.norm(extent)))
    return farthest


def extents(rows: Array, dim: int, rotation: Array, turning: Array) -> Array:
    """Largest distances from the position of a body to its surface along x, y and z [m].

    Parameters
    ----------
    rows : ndarray, shape (parts, 17)
    dim : int
    rotation : ndarray, shape (3, 3)
        Rotation of the body at the start.
    turning : ndarray, shape (k, 3)
        Angular velocities of its motion. If they have one direction a, a point p sweeps a circle
        about a, and reaches |p.a| |a.e| + |p - (p.a) a| sqrt(1 - (a.e)^2) along e. If they have
        several, all orientations count.

    Returns
    -------
    ndarray, shape (3,)
        May be infinite.
    """
    turns = turning[turning.any(axis=1)]
    if not len(turns):
        return np.array([max(_along(row, dim, rotation, e) for row in rows) for e in np.eye(3)])
    about = turns[0] / np.linalg.norm(turns[0])
    if np.linalg.norm(np.cross(turns, about), axis=1).max() > TINY * np.linalg.norm(turns):
        return np.full(3, reach(rows, dim))
    return np.array([max(_swept(row, dim, rotation, about, d) for row in rows) for d in range(3)])


def _placed(row: Array, dim: int, rotation: Array) -> tuple[Array, Array, Array, float]:
    """Centre and axes (as columns) of a part at the start, half lengths along them, and a radius.

    A cylinder is its axis and the radius about it.
    """
    size, radius = np.array(row[14:]), 0.0
    if row[0] == CYLINDER:
        size, radius = np.array([0.0, 0.0, row[15]]), float(row[14])
    if dim == 2:
        size[2] = 0.0
    return rotation @ row[2:5], rotation @ row[5:14].reshape(3, 3), size, radius


def _along(row: Array, dim: int, rotation: Array, direction: Array) -> float:
    """Largest distance of a part from the position along a direction, without turning."""
    if row[1] or row[0] in BEHIND:
        return math.inf
    center, axes, size, radius = _placed(row, dim, rotation)
    shares = abs(axes.T @ direction)
    shares[shares <= TINY] = 0.0
    size[shares == 0.0] = 0.0  # no product of zero and infinity
    return float(abs(center @ direction) + size @ shares + radius * math.hypot(*shares[:2]))


def _swept(row: Array, dim: int, rotation: Array, about: Array, d: int) -> float:
    """The same along axis `d` in all turns about an axis; of an oblique cylinder, a bound."""
    if row[1] or row[0] in BEHIND:
        return math.inf
    center, axes, size, radius = _placed(row, dim, rotation)
    cosine, sine = abs(float(about[d])), float(np.linalg.norm(np.delete(about, d)))

    def far(places: Array) -> Array:
        off = np.linalg.norm(np.cross(places, about), axis=-1)
        return cosine * abs(places @ about) + sine * off

    size[far(axes.T) <= TINY] = 0.0  # an axis of rotation that is endless along itself
    if not np.isfinite(size).all():
        return math.inf
    signs = np.array(list(product((-1, 1), repeat=3)))
    tilt = float(np.linalg.norm(np.cross(axes[:, 2], about)))
    return float(far(center + signs * size @ axes.T).max() + radius * (cosine * tilt + sine))


def thicknesses(rows: Array, dim: int) -> tuple[float, float]:
    """Least edge of the boxes and least diameter or length of the cylinders [m]; inf if none."""
    box = cylinder = math.inf
    for kind, inside, *numbers in rows:
        size = numbers[12:]
        if kind == BOX:
            box = min(box, *(2 * edge for edge in size[:dim]))
        elif kind == CYLINDER and not inside:
            cylinder = min(cylinder, 2 * size[0], 2 * size[1])
    return box, cylinder


def deepest(samples: Sequence[tuple[NDArray, ...]]) -> float:
    """Least diameter [m], over the meshes, of the largest ball inside; inf if none."""
    meshes = [(tables[1], tables[3]) for tables in samples if len(tables) == MESH_TABLES]
    return min(
        (-2 * float(fine.min(initial=coarse.min())) for coarse, fine in meshes), default=math.inf
    )


def corners(rows: Array) -> Array:
    """Corners of boxes around the parts, shape (8 parts, 3); infinite extents count as 0."""
    found = []
    signs = np.array(list(product((-1, 1), repeat=3)))
    for kind, _, *numbers in rows:
        center, matrix, size = np.array(numbers[:3]), np.array(numbers[3:12]), numbers[12:]
        half = np.array([size[0], size[0], size[1]] if kind == CYLINDER else size)
        half[~np.isfinite(half)] = 0.0
        found.append(center + signs * half @ matrix.reshape(3, 3).T)
    return np.concatenate(found)


def are_endless(rows: Array, along: Array) -> bool:
    """True if all parts are infinite along a direction."""
    for kind, _, *numbers in rows:
        matrix, size = np.array(numbers[3:12]).reshape(3, 3), numbers[12:]
        share = abs(matrix.T @ along)
        if kind in BEHIND:
            endless = share[2] < 1e-12
        else:
            lengths = [0.0, 0.0, size[1]] if kind == CYLINDER else size
            endless = any(
                s > 1 - 1e-12 and length == math.inf
                for s, length in zip(share, lengths, strict=True)
            )
        if not endless:
            return False
    return True
