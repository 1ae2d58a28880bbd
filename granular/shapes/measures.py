"""Measures of the shapes of bodies, from the rows that describe them for the core."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from granular import _core
from granular.checks import LEAST
from granular.shapes.operations import operands
from granular.shapes.shape import PARTS, Array, Shape, row_of

__all__ = [
    "are_endless",
    "bounds",
    "extents",
    "hull",
    "largest_speed",
    "mesh_size",
    "mesh_thickness",
    "reach",
    "thicknesses",
    "whole_parts",
]

TINY = 1e-12
"""Largest cosine that is taken for that of a right angle."""
HULL = 256
"""Corners of a polygon about a disc, 8e-5 of the radius beyond it."""
CHAINS = (PARTS["polygon"], PARTS["revolved"])
ARRAYS = (PARTS["sampled"], PARTS["height_map"], *CHAINS)
BEHIND = (PARTS["half_space"], PARTS["height_map"])
"""Kinds of parts that are all that lies behind a surface without end."""


@dataclass(frozen=True, eq=False)
class Cover:
    """Box with rounded edges that contains a part.

    The part lies within `beyond` of the sums of a point of a box and one of a disc about the third
    axis.
    """

    center: Array
    axes: Array
    """As columns."""
    half: Array
    """Half lengths of the box along the axes, may be infinite."""
    radius: float
    """Of the disc."""
    beyond: float

    def turned(self, rotation: Array) -> Cover:
        """Return the same after a rotation about the origin."""
        return Cover(rotation @ self.center, rotation @ self.axes, self.half, *self._radii())

    def flat(self) -> Cover:
        """Return its section in 2D, of what is endless along z."""
        half = self.half.copy()
        half[2] = 0.0 if math.isinf(half[2]) else half[2]
        return Cover(self.center, self.axes, half, *self._radii())

    def _radii(self) -> tuple[float, float]:
        return self.radius, self.beyond


def arrays_of(shape: Shape) -> list[Any]:
    """Return the array (or tables) of each row of a shape; None where it has none."""
    arrays = iter(shape.samples())
    return [next(arrays) if row[0] in ARRAYS else None for row in shape.rows()]


def _cover(row: Array, array: Any, dim: int) -> Cover | None:
    """Cover of a part; None for operations and half-spaces."""
    if operands(row) or row[0] in BEHIND:
        return None
    half, radius, beyond = np.array(row[14:]), 0.0, 0.0
    if row[0] == PARTS["cylinder"]:
        half, radius = np.array([0.0, 0.0, row[15]]), row[14]
    elif row[0] == PARTS["capsule"]:
        half, beyond = np.array([0.0, 0.0, row[15]]), row[14]
    elif row[0] == PARTS["torus"]:
        half, radius, beyond = np.zeros(3), row[14], row[15]
    elif array is not None and row[0] in CHAINS:
        first, second = abs(array[0]).max(axis=0)
        half, beyond = np.array([first, second, row[14]]), row[15]
        if row[0] == PARTS["revolved"]:
            half, radius = np.array([0.0, 0.0, second]), first
    cover = Cover(row[2:5], row[5:14].reshape(3, 3), half, float(radius), float(beyond))
    return cover.flat() if dim == 2 else cover


def _folded(
    shape: Shape, of_cover: Callable[[Cover], Any], growth: float, join: Callable = np.maximum
) -> Any:
    """Bound in a shape of a convex function that grows by `growth` a metre at most.

    It follows from bounds in the covers of the parts: of a union the greater of two, of an
    intersection the lesser. Of each result the bounds in the solid and in the rest are kept, as a
    difference contains the rest of what is taken away.
    """
    stack: list[tuple[Any, Any]] = []
    for row, array in zip(shape.rows(), arrays_of(shape), strict=True):
        cover = _cover(row, array, shape.dim)
        solid, rest = (math.inf if cover is None else of_cover(cover)), math.inf
        if count := operands(row):
            taken, stack = stack[-count:], stack[:-count]
            solid, rest = taken[0]
            union = row[0] == PARTS["union"]
            for other, other_rest in taken[1:]:
                solid = (join if union else np.minimum)(solid, other)
                rest = (np.minimum if union else join)(rest, other_rest)
            if row[0] == PARTS["offset"]:
                solid = solid + growth * row[14]
            if row[0] == PARTS["shell"]:
                solid, rest = np.minimum(solid + 2 * growth * row[14], rest), math.inf
        stack.append((rest, solid) if row[1] else (solid, rest))
    bound = stack[0][0]
    for solid, _ in stack[1:]:
        bound = join(bound, solid)
    return bound


def reach(shape: Shape) -> float:
    """Radius about the position of the body that contains the solid [m]; may be infinite."""

    def farthest(cover: Cover) -> float:
        around = math.hypot(float(np.linalg.norm(cover.half)), cover.radius)
        return float(np.linalg.norm(cover.center)) + around + cover.beyond

    return float(_folded(shape, farthest, 1.0))


def bounds(shape: Shape, directions: Array) -> tuple[Array, Array]:
    """Least and largest coordinates [m] along directions, the rows (n, 3); may be infinite."""

    def ahead(cover: Cover) -> Array:
        centred = replace(cover, center=np.zeros(3))
        half = np.array([_along(centred, e) for e in directions])
        return np.concatenate([half - directions @ cover.center, half + directions @ cover.center])

    low, high = np.broadcast_to(_folded(shape, ahead, 1.0), 2 * len(directions)).reshape(2, -1)
    return -low, high


def hull(shape: Shape) -> tuple[Array, float] | None:
    """Places (n, 3), and a distance from their convex hull within which a shape of one part lies.

    None for shapes of several parts, and endless ones.
    """
    rows = shape.rows()
    cover = None if len(rows) > 1 or rows[0, 1] else _cover(rows[0], arrays_of(shape)[0], shape.dim)
    if cover is None or not np.isfinite(cover.half).all():
        return None
    places = np.array(list(product((-1, 1), repeat=3))) * cover.half
    if cover.radius:
        angle = 2 * math.pi * np.arange(HULL) / HULL
        circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(HULL)], axis=1)
        circle *= cover.radius / math.cos(math.pi / HULL)  # a polygon about the disc
        places = (places[:, None] + circle).reshape(-1, 3)
    return np.unique(cover.center + places @ cover.axes.T, axis=0), cover.beyond


def extents(shape: Shape, rotation: Array, turning: Array) -> Array:
    """Largest distances from the position of a body to its surface along x, y and z [m].

    Parameters
    ----------
    shape : Shape
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
    turns = turning[(abs(turning) > LEAST).any(axis=1)]  # less has no direction: its square is 0
    if not len(turns):

        def along(cover: Cover) -> Array:
            placed = cover.turned(rotation)
            return np.array([_along(placed, e) for e in np.eye(3)])

        return np.full(3, _folded(shape, along, 1.0))
    about = turns[0] / np.linalg.norm(turns[0])
    if np.linalg.norm(np.cross(turns, about), axis=1).max() > TINY * np.linalg.norm(turns):
        return np.full(3, reach(shape))

    def swept(cover: Cover) -> Array:
        placed = cover.turned(rotation)
        return np.array([_swept(placed, about, d) for d in range(3)])

    return np.full(3, _folded(shape, swept, 1.0))


def _along(cover: Cover, e: Array) -> float:
    """Largest distance of a cover from the position along a direction, without turning."""
    shares, half = abs(cover.axes.T @ e), cover.half.copy()
    shares[shares <= TINY] = 0.0
    half[shares == 0.0] = 0.0  # no product of zero and infinity
    box = float(abs(cover.center @ e) + half @ shares)
    return box + cover.radius * math.hypot(*shares[:2]) + cover.beyond


def _swept(cover: Cover, about: Array, d: int) -> float:
    """The same along axis `d` in all turns about an axis; of an oblique disc, a bound."""
    half = cover.half.copy()
    cosine, sine = abs(float(about[d])), float(np.linalg.norm(np.delete(about, d)))

    def far(places: Array) -> Array:
        off = np.linalg.norm(np.cross(places, about), axis=-1)
        return cosine * abs(places @ about) + sine * off

    half[far(cover.axes.T) <= TINY] = 0.0  # an axis of rotation that is endless along itself
    if not np.isfinite(half).all():
        return math.inf
    signs = np.array(list(product((-1, 1), repeat=3)))
    tilt = float(np.linalg.norm(np.cross(cover.axes[:, 2], about)))
    box = float(far(cover.center + signs * half @ cover.axes.T).max())
    return box + cover.radius * (cosine * tilt + sine) + cover.beyond


def largest_speed(shape: Shape, rotation: Array, velocity: Array, turning: Array) -> float:
    """Bound on the speed [m/s] of the points of a body, `rotation` being that at the start.

    Velocities and angular velocities have the shape (k, 3). The speed is a convex function of
    position: its maximum over a box is at a corner.
    """
    signs = np.array(list(product((-1, 1), repeat=3)))
    fastest = float(np.linalg.norm(turning, axis=1).max())

    def in_box(cover: Cover) -> float:
        placed = cover.turned(rotation)
        half = placed.half + np.array([placed.radius, placed.radius, 0.0])
        endless = np.isinf(half)
        if np.cross(turning[:, None], placed.axes.T[endless]).any():
            return math.inf
        half[endless] = 0.0
        arms = placed.center + signs * half @ placed.axes.T
        speeds = velocity[:, None] + np.cross(turning[:, None], arms)
        return float(np.linalg.norm(speeds, axis=2).max()) + fastest * placed.beyond

    return float(_folded(shape, in_box, fastest))


def whole_parts(rows: Array) -> list[slice]:
    """Return the rows of each part whose union is the body, with those it is made of."""
    parts: list[slice] = []
    for k, row in enumerate(rows):
        count = operands(row)
        first = parts[-count].start if count else k
        parts = [*parts[: len(parts) - count], slice(first, k + 1)]
    return parts


def thicknesses(shape: Shape) -> tuple[float, float]:
    """Least edge [m] of its boxes, whose two sides are kept apart, and thickness of the others.

    The thickness is the diameter of the largest ball in a part, or in one that an operation takes,
    and of a mesh that of its thinnest walls; inf if there is none.
    """
    rows, arrays = shape.rows(), arrays_of(shape)
    boxes = [part.start for part in whole_parts(rows) if part.stop == part.start + 1]
    boxes = [k for k in boxes if rows[k, 0] == PARTS["box"] and not rows[k, 1]]
    box = min((2 * rows[k, 14 : 14 + shape.dim].min() for k in boxes), default=math.inf)
    other = math.inf
    for k in range(len(rows) - 1, -1, -1):
        if k not in boxes and not rows[k, 1]:
            other = min(other, _thickness(rows[k], arrays[k], shape.dim))
    return float(box), float(other)


def mesh_thickness(shape: Shape) -> float:
    """Thickness [m] of the thinnest walls of the meshes in a shape; inf if there is none."""
    parts = zip(shape.rows(), arrays_of(shape), strict=True)
    thicknesses = (_thickness(row, array, 3) for row, array in parts if row[0] == PARTS["sampled"])
    return min(thicknesses, default=math.inf)


def mesh_size(shape: Shape) -> float:
    """Longest edge [m] of the boxes about the meshes in a shape; 0 if there is none."""
    meshes = [row for row in shape.rows() if row[0] == PARTS["sampled"]]
    return max((2 * float(row[14:].max()) for row in meshes), default=0.0)


def _thickness(row: Array, array: Any, dim: int) -> float:
    kind, size = row[0], row[14:]
    if kind == PARTS["box"]:
        return 2 * float(size[:dim].min())
    if kind == PARTS["cylinder"]:
        return 2 * float(size[:2].min())
    if kind == PARTS["capsule"] or kind == PARTS["shell"]:
        return 2 * float(size[0])
    if kind == PARTS["torus"]:
        return 2 * float(size[1])
    if array is None or kind == PARTS["height_map"]:
        return math.inf
    if kind == PARTS["sampled"]:
        return float(array[0][4])
    across = 2 * (float(size[1]) or _inradius(row, array))
    return min(across, 2 * float(size[0])) if kind == PARTS["polygon"] else across


def _inradius(row: Array, array: Array) -> float:
    """Radius [m] of the largest circle in a polygon or in the section of a solid of revolution.

    It touches the surface: the largest circles that touch it at some places are found by bisection.
    """
    revolved = row[0] == PARTS["revolved"]
    own = row_of("revolved" if revolved else "polygon", size=(0.0 if revolved else math.inf, 0, 0))
    a, b = array[0], np.roll(array[0], -1, axis=0)
    edge = b - a
    if revolved:
        kept = (a[:, 0] > 0) | (b[:, 0] > 0)
        a, edge = a[kept], edge[kept]
    share = (np.arange(count := max(64 // len(a), 1)) + 0.5)[:, None, None] / count
    start = (a + share * edge).reshape(-1, 2)
    inward = np.stack([-edge[:, 1], edge[:, 0]], axis=1) / np.linalg.norm(edge, axis=1)[:, None]
    inward = np.tile(inward, (count, 1))
    low, high = np.zeros(len(start)), np.full(len(start), np.linalg.norm(np.ptp(array[0], axis=0)))
    for _ in range(40):
        radius = 0.5 * (low + high)
        at = np.zeros((len(start), 3))
        at[:, [0, 2] if revolved else [0, 1]] = start + radius[:, None] * inward
        depth = -_core.body_distance(own[None], (array,), at)[0]
        touches = depth > radius * (1 - 1e-9)
        low, high = np.where(touches, radius, low), np.where(touches, high, radius)
    return float(low.max())


def are_endless(shape: Shape, along: Array) -> bool:
    """True if a shape is the same everywhere along a direction."""
    for row in shape.rows():
        share = abs(row[5:14].reshape(3, 3).T @ along)
        kind, size = row[0], row[14:]
        if operands(row):
            continue
        if kind in BEHIND:
            endless = share[2] < TINY
        else:
            lengths = [0.0, 0.0, size[1]] if kind == PARTS["cylinder"] else size
            if kind == PARTS["polygon"]:
                lengths = [0.0, 0.0, size[0]]
            endless = any(
                s > 1 - TINY and length == math.inf
                for s, length in zip(share, lengths, strict=True)
            )
        if not endless:
            return False
    return True
