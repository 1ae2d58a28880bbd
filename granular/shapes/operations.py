"""Shapes and regions composed of others, by operations on signed distances."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import reduce
from typing import Any

import numpy as np

from granular.shapes.region import Region
from granular.shapes.shape import Measure, Shape, row_of
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import check_fields, finite, positive, truth, tuple_of

Corners = tuple[tuple[float, ...], tuple[float, ...]]


def united(shape: Region) -> list[Region]:
    """Return the parts of a union, including those of unions in it; else the shape itself."""
    if not isinstance(shape, Union):
        return [shape]
    return [part for one in shape.parts for part in united(one)]


def _solid(region: Region) -> Shape:
    """Return a part of a body, which must have a surface."""
    if not isinstance(region, Shape):
        raise TypeError(f"{region!r} must be a shape: a {type(region).__name__} has no surface")
    return region


def _joined(region: Region) -> Array:
    """Return the rows of a shape with one result."""
    shape = _solid(region)
    rows, results = shape.rows(), shape.results
    if results == 1:
        return rows
    return np.concatenate([rows, row_of("union", size=(results, 0.0, 0.0))[None]])


def _inverted(shape: Region) -> Array:
    """Return the rows of the complement of a shape, with one result."""
    rows = _joined(shape).copy()
    rows[-1, 1] = 1 - rows[-1, 1]
    return rows


def _followed(rows: Array, operation: str, size: float, *, inside: bool = False) -> Array:
    return np.concatenate([rows, row_of(operation, inside, size=(size, 0.0, 0.0))[None]])


def _arrays(shapes: Iterable[Region]) -> tuple[Array, ...]:
    return tuple(array for shape in shapes for array in _solid(shape).samples())


def _parts(name: str, value: Sequence[Region]) -> tuple[Region, ...]:
    parts = tuple_of(name, value, (Region,))
    if not parts:
        raise ValueError(f"{name} = () must hold at least one shape")
    for i, part in enumerate(parts):
        if part.dim != parts[0].dim:
            raise ValueError(f"{name}[{i}] = {part} must have dimension {parts[0].dim}")
    return parts


def _region(name: str, value: object, dim: int | None = None) -> Region:
    if not isinstance(value, Region):
        raise TypeError(f"{name} = {value!r} must be a shape or another region")
    if dim is not None and value.dim != dim:
        raise ValueError(f"{name} = {value} must have dimension {dim}")
    return value


def _shape(name: str, value: object) -> Shape:
    if not isinstance(value, Shape):
        raise TypeError(f"{name} = {value!r} must be a shape of granular.shapes")
    return value


def _common_box(
    regions: Sequence[Region], low: Callable[..., float], high: Callable[..., float]
) -> Corners:
    """Corners made of the `low` of the lower ends and the `high` of the upper ends of regions."""
    corners = zip(*(region._box for region in regions), strict=True)
    lows, highs = (zip(*ends, strict=True) for ends in corners)
    return tuple(map(low, lows)), tuple(map(high, highs))


def _check_band(name: str, distance: float, shape: Shape) -> None:
    """Refuse a distance from a mesh that is beyond its samples."""
    for leaf in shape.leaves():
        band = getattr(leaf, "band", math.inf)
        if distance > band:
            raise ValueError(
                f"{name} = {distance} must be at most {band:.6g} m from a mesh, 6 spacings: take a "
                "larger spacing"
            )


def least(pairs: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Least of several distances, and the normals that go with it."""
    distances, normals = (np.array(part) for part in zip(*pairs, strict=True))
    of = distances.argmin(axis=0)
    every = np.arange(len(of))
    return distances[of, every], normals[of, every]


def _greatest(pairs: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Greatest of several distances, and the normals that go with it."""
    away, normal = least([(-distance, normal) for distance, normal in pairs])
    return -away, normal


def _cut(part: Region, x: Array) -> tuple[Array, Array]:
    """Distance from the boundary of a part, even of a box, which alone has whole squares."""
    if isinstance(part, Joined | Difference):  # it may have parts which are no shapes
        return part.cut(x)
    return part.distance(x) if isinstance(part, Shape) else part.cut(x)


def _cuts(part: Region, x: Array, reach: float) -> BoolArray:
    """True for positions whose squares are cut by the boundary of a part."""
    return abs(_cut(part, x)[0]) <= reach if isinstance(part, Shape) else part.cuts(x, reach)


@dataclass(frozen=True)
class Joined(Shape):
    """A shape made of several ones."""

    parts: tuple[Region, ...]

    def __post_init__(self) -> None:
        check_fields(self, _parts, "parts")

    @property
    def dim(self) -> int:
        return self.parts[0].dim

    def samples(self) -> tuple[Any, ...]:
        return _arrays(self.parts)

    def leaves(self) -> list[Region]:
        return [leaf for part in self.parts for leaf in part.leaves()]

    def narrowest(self, inverted: bool = False) -> float:
        return min(_solid(part).narrowest() for part in self.parts)

    def is_endless(self, along: Array) -> bool:
        return all(_solid(part).is_endless(along) for part in self.parts)

    def cuts(self, x: Array, reach: float) -> BoolArray:
        return np.any([_cuts(part, x, reach) for part in self.parts], axis=0)


@dataclass(frozen=True)
class Union(Joined):
    """Several shapes as one; a bucket, for example, is a union of boxes.

    Its signed distance is the least of theirs. This is exact outside; where shapes overlap, the
    depth is underestimated. Shapes that form one surface should overlap rather than touch. Where
    they only touch, a point just below the surface is nearest to the face between them.

    Parameters
    ----------
    parts : sequence of shapes
        At least one shape, all of one dimension; for a fill also other regions.
    {raises}.
    """

    @property
    def results(self) -> int:
        return sum(_solid(part).results for part in self.parts)

    def rows(self) -> Array:
        return np.concatenate([_solid(part).rows() for part in self.parts])

    def bound(self, measure: Measure) -> tuple[Any, Any]:
        solids, rests = zip(*(_solid(part).bound(measure) for part in self.parts), strict=True)
        return reduce(measure.join, solids), reduce(np.minimum, rests)

    @property
    def bounds(self) -> Corners:
        return _common_box(self.parts, min, max)

    def cut(self, x: Array) -> tuple[Array, Array]:
        return least([_cut(part, x) for part in self.parts])

    def _inside(self, x: Array) -> BoolArray:
        return np.any([part.contains(x) for part in self.parts], axis=0)


@dataclass(frozen=True)
class Intersection(Joined):
    """The intersection of several shapes, such as a wedge of two half-spaces.

    Its signed distance is the greatest of theirs. This is exact inside and next to the faces;
    beyond an edge or corner it is less than the distance, as the faces are extended.

    Parameters
    ----------
    parts : sequence of shapes
        At least one shape, all of one dimension; for a fill also other regions.
    {raises}.
    """

    def rows(self) -> Array:
        rows = np.concatenate([_joined(part) for part in self.parts])
        return _followed(rows, "intersection", len(self.parts))

    def bound(self, measure: Measure) -> tuple[Any, Any]:
        solids, rests = zip(*(_solid(part).bound(measure) for part in self.parts), strict=True)
        return reduce(np.minimum, solids), reduce(measure.join, rests)

    @property
    def bounds(self) -> Corners:
        return _common_box(self.parts, max, min)

    def cut(self, x: Array) -> tuple[Array, Array]:
        return _greatest([_cut(part, x) for part in self.parts])

    def _inside(self, x: Array) -> BoolArray:
        return np.all([part.contains(x) for part in self.parts], axis=0)


@dataclass(frozen=True)
class Difference(Shape):
    """The difference of two shapes, such as a floor with an orifice: a box without a cylinder.

    Its signed distance is the greater of that of `shape` and of the negative one of `without`, as
    in an `Intersection`.

    Parameters
    ----------
    shape : shape
    without : shape
        The part to remove, of the same dimension. For a fill both may be other regions, too.
    {raises}.
    """

    shape: Region
    without: Region

    def __post_init__(self) -> None:
        check_fields(self, _region, "shape")
        check_fields(self, _region, "without", dim=self.shape.dim)

    @property
    def dim(self) -> int:
        return self.shape.dim

    def rows(self) -> Array:
        rows = np.concatenate([_joined(self.shape), _inverted(self.without)])
        return _followed(rows, "intersection", 2)

    def samples(self) -> tuple[Any, ...]:
        return _arrays((self.shape, self.without))

    def leaves(self) -> list[Region]:
        return [*self.shape.leaves(), *self.without.leaves()]

    def narrowest(self, inverted: bool = False) -> float:
        return min(_solid(self.shape).narrowest(), _solid(self.without).narrowest(True))

    def is_endless(self, along: Array) -> bool:
        return all(_solid(part).is_endless(along) for part in (self.shape, self.without))

    def bound(self, measure: Measure) -> tuple[Any, Any]:
        solid, rest = _solid(self.shape).bound(measure)
        hole, around = _solid(self.without).bound(measure)
        return np.minimum(solid, around), measure.join(rest, hole)

    @property
    def bounds(self) -> Corners:
        return self.shape._box

    def cuts(self, x: Array, reach: float) -> BoolArray:
        return _cuts(self.shape, x, reach) | _cuts(self.without, x, reach)

    def cut(self, x: Array) -> tuple[Array, Array]:
        away, outwards = _cut(self.without, x)
        return _greatest([_cut(self.shape, x), (-away, -outwards)])

    def _inside(self, x: Array) -> BoolArray:
        return self.shape.contains(x) & ~self.without.contains(x)


@dataclass(frozen=True)
class Altered(Shape):
    """A shape made of one other."""

    shape: Shape

    @property
    def dim(self) -> int:
        return self.shape.dim

    def samples(self) -> tuple[Any, ...]:
        return self.shape.samples()

    def leaves(self) -> list[Region]:
        return self.shape.leaves()

    def is_endless(self, along: Array) -> bool:
        return self.shape.is_endless(along)


@dataclass(frozen=True)
class Complement(Altered):
    """The complement of a shape, such as a vessel with the material inside the shape.

    Parameters
    ----------
    shape : shape

    Raises
    ------
    TypeError
        If `shape` is not a shape.
    """

    def __post_init__(self) -> None:
        check_fields(self, _shape, "shape")

    def rows(self) -> Array:
        return _inverted(self.shape)

    def narrowest(self, inverted: bool = False) -> float:
        return self.shape.narrowest(not inverted)

    def bound(self, measure: Measure) -> tuple[Any, Any]:
        solid, rest = self.shape.bound(measure)
        return rest, solid


@dataclass(frozen=True)
class Offset(Altered):
    """A shape whose surface is moved along its normals.

    Outwards, convex edges become round with the radius `by`, and concave ones stay sharp;
    inwards it is the other way round. Edges made by an operation stay sharp, as its distance is
    that of extended faces.

    Parameters
    ----------
    shape : shape
    by : float
        Distance between the surfaces [m], not 0; negative inwards.
    {raises}.
    """

    _: KW_ONLY
    by: float

    def __post_init__(self) -> None:
        check_fields(self, _shape, "shape")
        check_fields(self, finite, "by")
        if self.by == 0:
            raise ValueError("by = 0.0 must not be 0")
        _check_band("by", abs(self.by), self.shape)

    def rows(self) -> Array:
        if self.by > 0:
            return _followed(_joined(self.shape), "offset", self.by)
        return _followed(_inverted(self.shape), "offset", -self.by, inside=True)

    def narrowest(self, inverted: bool = False) -> float:
        return self.shape.narrowest(self.by < 0)

    def bound(self, measure: Measure) -> tuple[Any, Any]:
        solid, rest = self.shape.bound(measure)
        if self.by > 0:
            return solid + measure.growth * self.by, rest
        return solid, rest - measure.growth * self.by


@dataclass(frozen=True)
class Shell(Altered):
    """The wall along the surface of a shape, which is closed: a vessel with an outer side.

    Parameters
    ----------
    shape : shape
        Its surface is the inner one of the wall; where `inward`, the outer one.
    thickness : float
        Thickness of the wall [m], > 0.
    inward : bool
        If True, the wall is inside the surface of the shape.
    {raises}.
    """

    _: KW_ONLY
    thickness: float
    inward: bool = False

    def __post_init__(self) -> None:
        check_fields(self, _shape, "shape")
        check_fields(self, positive, "thickness")
        check_fields(self, truth, "inward")
        _check_band("thickness", self.thickness, self.shape)

    def rows(self) -> Array:
        rows = _inverted(self.shape) if self.inward else _joined(self.shape)
        return _followed(rows, "shell", 0.5 * self.thickness)

    def narrowest(self, inverted: bool = False) -> float:
        width = np.inf if inverted else self.thickness
        return min(width, self.shape.narrowest(self.inward))

    def bound(self, measure: Measure) -> tuple[Any, Any]:
        solid, rest = self.shape.bound(measure)
        if self.inward:
            solid, rest = rest, solid
        return np.minimum(solid + measure.growth * self.thickness, rest), np.inf
