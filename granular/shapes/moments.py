"""Volume and moments of shapes, from formulas of their parts where these do not overlap.

Parts of a union that are apart are added, and parts that are cut out of the inside of a shape are
subtracted: these sums are exact. Only parts that overlap need quadrature, each cluster in its own
box.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from granular import _core
from granular.shapes.boxes import Box
from granular.shapes.measures import hull
from granular.shapes.mesh import Mesh
from granular.shapes.operations import Difference, Intersection, Union, united
from granular.shapes.quadrature import Moments, Sides, is_empty, joined, moments
from granular.shapes.region import Region
from granular.shapes.round import Capsule, Cylinder, Sphere, Torus
from granular.shapes.sections import Polygon, Prism
from granular.shapes.shape import MOST_SHAPES, Shape, frame_of
from granular.shapes.triangles import Triangles
from granular.tools.arrays import Array, BoolArray

PROBES = 20_000
"""Points of a mesh at which it is tested whether parts of it overlap."""
MOST_CELLS = {2: 100_000, 3: 300_000}
"""Cells of a shape that are halved at most, by the dimension."""
MOST_WORK = 4_000_000
"""Product of the cells that are halved and the parts of the shape at most."""
MOST_OF_MESH = 20_000
"""Cells of a mesh that are halved at most."""
MOST_TRIANGLES = 2_000_000_000
"""Product of these cells and the triangles at most."""
STEEP = math.sqrt(3.0)
"""Largest slope of samples that are interpolated linearly, of a distance of slope 1."""
TOUCH = 1e-12
"""Overlap of boxes, over their size, up to which they only touch."""
CONVEX = (Box, Cylinder, Capsule, Sphere)


def moments_of(shape: Shape, tolerance: float) -> Moments | None:
    """Return the moments of a shape of finite size; None if it is empty."""
    if (exact := _formula(shape)) is not None:
        return exact
    if isinstance(shape, Mesh):
        return _of_mesh(shape, tolerance)
    if isinstance(shape, Union):
        clusters = _clusters(_flat(shape))
        if len(clusters) > 1:
            return _added(clusters, tolerance)
        if len(clusters[0]) == 1:
            return moments_of(clusters[0][0], tolerance)
    if isinstance(shape, Difference):
        return _of_difference(shape, tolerance)
    return _of_cells(shape, tolerance)


def has_no_inside(shape: Shape) -> bool:
    """True if an operation on shapes of finite size is certainly empty."""
    if len(shape.rows()) == shape.results or _is_sampled(shape):  # no operation, or rounded edges
        return False
    low, high = np.array(shape.bounds)
    return bool(np.isfinite([low, high]).all()) and is_empty(_OfShape(shape), low, high)


def _is_sampled(shape: Shape) -> bool:
    """True if a mesh, whose samples round edges, is a part of a shape."""
    return any(isinstance(leaf, Mesh) for leaf in shape.leaves())


def _added(shapes: Sequence[Sequence[Shape]], tolerance: float) -> Moments | None:
    """Sum over unions that are apart; the errors of far ones count twice at most."""
    terms = [moments_of(_union(parts), 0.5 * tolerance) for parts in shapes]
    return joined([(1.0, part) for part in terms if part is not None])


def _of_difference(shape: Difference, tolerance: float) -> Moments | None:
    """Those of a shape less the parts that are wholly in it; other parts by quadrature."""
    bases = _clusters(_flat(shape.shape))
    if len(bases) > 1:
        return _added([[Difference(_union(b), shape.without)] for b in bases], tolerance)
    base = _union(bases[0])
    cut = [part for part in _flat(shape.without) if not _apart(base, part)]
    if not cut:
        return moments_of(base, tolerance)
    clusters = _clusters(cut)
    inner = [parts for parts in clusters if all(_within(part, base) for part in parts)]
    rest = [part for parts in clusters if parts not in inner for part in parts]
    left = Difference(base, _union(rest)) if rest else base
    whole = _of_cells(left, tolerance) if rest else moments_of(left, 0.5 * tolerance)
    if whole is None or not inner:
        return whole
    gone = [moments_of(_union(parts), 0.5 * tolerance) for parts in inner]
    total = joined([(1.0, whole), *((-1.0, part) for part in gone if part is not None)])
    if total is not None and total.error <= tolerance:
        return total
    direct = _of_cells(Difference(base, _union(cut)), tolerance)
    return direct if total is None or direct is None or direct.error < total.error else total


def _of_cells(shape: Shape, tolerance: float) -> Moments | None:
    """Quadrature of the signed distance of a shape."""
    low, high = np.array(shape.bounds)
    if not (low < high).all():
        return None
    most = min(MOST_CELLS[shape.dim], MOST_WORK // len(shape.rows()))
    return moments(_OfShape(shape), low, high, tolerance, most)


@dataclass(frozen=True)
class _OfShape:
    """A shape as a solid for the quadrature."""

    shape: Shape

    @cached_property
    def _numbers(self) -> tuple[Array, tuple[Any, ...]]:
        return self.shape.rows(), self.shape.samples()

    def depth(self, x: Array) -> Array:
        """Distance from the surface, positive inside."""
        return -_core.body_distance(*self._numbers, x)[0]

    def sides(self, x: Array, radius: float) -> Sides:
        depth = self.depth(x)
        if _is_sampled(self.shape):
            radius = STEEP * radius
        return np.where(abs(depth) < radius, 0, -np.sign(depth)).astype(np.int8)

    def inside(self, x: Array) -> BoolArray:
        return self.depth(x) > 0


def _of_mesh(mesh: Mesh, tolerance: float) -> Moments | None:
    """Moments by the theorem of Gauss, and by quadrature of parts that overlap, and of sheets."""
    whole = mesh.triangles()
    if not whole.closed:
        return _of_triangles(whole, tolerance)
    overlapping = whole.overlaps(PROBES)
    if not overlapping.any():
        return whole.moments()
    terms = []
    for group in whole.clusters():
        part = whole.part(group)
        if overlapping[group].any():
            terms.append(_of_triangles(part, 0.5 * tolerance))
        else:
            terms.append(part.moments())
    return joined([(1.0, part) for part in terms if part is not None])


def _of_triangles(triangles: Triangles, tolerance: float) -> Moments | None:
    low, high = triangles.bounds(np.eye(3))
    most = min(MOST_OF_MESH, MOST_TRIANGLES // triangles.count)
    return moments(triangles, low, high, tolerance, most)


# ---- which parts are apart ----


def _flat(shape: Region) -> list[Shape]:
    """Parts of a union, and of unions in it."""
    parts: Any = united(shape)
    if len(parts) > MOST_SHAPES and isinstance(shape, Union):
        parts = shape.parts
    return list(parts)


def _union(parts: Sequence[Shape]) -> Shape:
    return parts[0] if len(parts) == 1 else Union(tuple(parts))


def _clusters(parts: Sequence[Shape]) -> list[list[Shape]]:
    """Parts in groups, of which each is apart from all others."""
    low, high = np.array([part.bounds for part in parts]).transpose(1, 0, 2)
    meet = ~_separate(low[:, None], high[:, None], low[None], high[None])
    pairs = np.argwhere(np.triu(meet, 1))
    count, label = len(parts), np.arange(len(parts))
    for i, j in pairs.tolist():
        if label[i] != label[j] and not _apart(parts[i], parts[j]):
            label[label == label[j]] = label[i]
    groups = [[parts[k] for k in np.flatnonzero(label == group).tolist()] for group in range(count)]
    return [group for group in groups if group]


def _separate(low: Array, high: Array, other_low: Array, other_high: Array) -> BoolArray:
    """True for boxes that have no common inside."""
    with np.errstate(invalid="ignore"):
        slack = TOUCH * np.fmin(abs(high - low), abs(other_high - other_low))
    slack = np.where(np.isfinite(slack), slack, 0.0)
    beyond = (low >= other_high - slack) | (other_low >= high - slack)
    return np.asarray(beyond.any(axis=-1))


def _apart(a: Shape, b: Shape) -> bool:
    """True if two shapes certainly do not overlap."""
    axes = np.eye(3)[: a.dim]
    if len(a.rows()) + len(b.rows()) <= 2:
        axes = np.concatenate([axes, frame_of(a)[1].T, frame_of(b)[1].T])
        axes = axes[abs(axes[:, a.dim :]).max(axis=1, initial=0.0) == 0]
    (low, high), (other_low, other_high) = a.ends(axes), b.ends(axes)
    if _separate(low, high, other_low, other_high):
        return True
    if _is_sampled(a) or _is_sampled(b):
        return False
    low, high = np.maximum(low, other_low)[: a.dim], np.minimum(high, other_high)[: a.dim]
    both = _OfShape(Intersection((a, b)))
    return bool(np.isfinite([low, high]).all()) and is_empty(both, low, high)


def _within(part: Shape, base: Shape) -> bool:
    """True if a shape is certainly within another one."""
    low, high = np.array(part.bounds)
    if not np.isfinite([low, high]).all() or _is_sampled(part) or _is_sampled(base):
        return False
    about = hull(part)
    if about is not None:
        places, beyond = about
        depth = _OfShape(base).depth(places)
        convex = isinstance(base, CONVEX) and not base.inside
        slack = 1e-12 * float((high - low).max())
        if (convex or len(places) == 1) and (depth >= beyond - slack).all():
            return True
    return is_empty(_OfShape(Difference(part, base)), low, high)


# ---- formulas ----


def _formula(shape: Shape) -> Moments | None:
    """Return the moments of shapes that have a formula; None for others."""
    dim = shape.dim
    if shape.inside or len(shape.rows()) > 1:
        return None
    if isinstance(shape, (Polygon, Prism)):
        return _of_polygon(shape)
    if isinstance(shape, Box):
        volume, inertia = _of_box(0.5 * np.array(shape.size))
    elif isinstance(shape, Cylinder):
        volume, inertia = _of_cylinder(shape.radius, 0.5 * shape.length, dim)
    elif isinstance(shape, Sphere) and dim == 2:
        volume, inertia = _of_cylinder(shape.radius, math.inf, dim)
    elif isinstance(shape, (Capsule, Sphere)):
        volume, inertia = _of_capsule(shape.radius, 0.5 * getattr(shape, "length", 0.0), dim)
    elif isinstance(shape, Torus):
        volume, inertia = _of_torus(shape.radius, shape.tube)
    else:
        return None
    if not math.isfinite(volume):
        return None
    place, turn = frame_of(shape)
    center = np.array(place[:dim])
    if dim == 2:
        return Moments(volume, center, 0.5 * volume * inertia[2] * np.eye(2), 0.0)
    squares = 0.5 * sum(inertia) - np.array(inertia)
    return Moments(volume, center, volume * turn @ np.diag(squares) @ turn.T, 0.0)


def _of_polygon(shape: Polygon | Prism) -> Moments | None:
    """Return the moments of a polygon, by the theorem of Green, or of its extension in 3D."""
    dim = shape.dim
    place, turn = frame_of(shape)
    length = getattr(shape, "length", 1.0)
    if shape.thickness is not None or not math.isfinite(length):
        return None
    vertices = np.asarray(shape.samples()[0])[0]  # about that point
    first = vertices[0]
    x = vertices - first
    following = np.roll(x, -1, axis=0)
    cross = x[:, 0] * following[:, 1] - x[:, 1] * following[:, 0]
    area = 0.5 * float(cross.sum())
    middle = cross @ (x + following) / (6 * area)
    products = [np.einsum("n,ni,nj", cross, a, b) for a in (x, following) for b in (x, following)]
    flat = (products[0] + 0.5 * (products[1] + products[2]) + products[3]) / 12
    flat -= area * np.outer(middle, middle)
    second = np.zeros((3, 3))
    second[:2, :2] = math.copysign(length, area) * flat
    second[2, 2] = abs(area) * length**3 / 12
    center = place + turn @ np.array([*(first + middle), 0.0])
    second = turn @ second @ turn.T
    return Moments(abs(area) * length, center[:dim], second[:dim, :dim], 0.0)


def _of_box(half: Array) -> tuple[float, list[float]]:
    """Volume, and moments about the axes over the mass, from half edges; in 2D of a rectangle."""
    squares = [float(x) ** 2 / 3 for x in half] + [0.0] * (3 - len(half))
    return math.prod(2 * float(x) for x in half), [sum(squares) - square for square in squares]


def _of_cylinder(radius: float, half: float, dim: int) -> tuple[float, list[float]]:
    """The same of a cylinder about its axis, the third; in 2D of a disc."""
    if dim == 2:
        return math.pi * radius**2, [0.0, 0.0, radius**2 / 2]
    across = radius**2 / 4 + half**2 / 3
    return 2 * math.pi * radius**2 * half, [across, across, radius**2 / 2]


def _of_capsule(radius: float, half: float, dim: int) -> tuple[float, list[float]]:
    """The same of a cylinder and two half balls; in 2D of a rectangle and two half discs."""
    if dim == 2:
        straight, ends = 4 * radius * half, math.pi * radius**2
        moment = straight * (half**2 + radius**2) / 3
        moment += ends * (radius**2 / 2 + half**2 + 8 * half * radius / (3 * math.pi))
        return straight + ends, [0.0, 0.0, moment / (straight + ends)]
    straight, ends = 2 * math.pi * radius**2 * half, 4 / 3 * math.pi * radius**3
    about = straight * radius**2 / 2 + ends * 2 / 5 * radius**2
    across = straight * (radius**2 / 4 + half**2 / 3)
    across += ends * (2 / 5 * radius**2 + half**2 + 3 / 4 * half * radius)
    volume = straight + ends
    return volume, [across / volume, across / volume, about / volume]


def _of_torus(radius: float, tube: float) -> tuple[float, list[float]]:
    """The same of a torus about its axis, the third."""
    across = radius**2 / 2 + 5 / 8 * tube**2
    return 2 * math.pi**2 * radius * tube**2, [across, across, radius**2 + 3 / 4 * tube**2]
