"""Bodies of several shapes: operations on signed distances."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from granular.checks import check_fields, finite, positive, truth, tuple_of
from granular.shapes.shape import MOST_SHAPES, PARTS, Array, Shape, row_of

__all__ = ["Complement", "Difference", "Intersection", "Offset", "Shell", "Union"]

JOINS = (PARTS["union"], PARTS["intersection"])
OPERATIONS = (*JOINS, PARTS["offset"], PARTS["shell"])


def operands(row: Array) -> int:
    """Return the number of results before it that a part takes; 0 for a shape."""
    if row[0] in JOINS:
        return int(row[14])
    return int(row[0] in OPERATIONS)


def _joined(shape: Shape) -> Array:
    """Return the rows of a shape with one result."""
    rows = shape.rows()
    results = sum(1 - operands(row) for row in rows)
    if results == 1:
        return rows
    return np.concatenate([rows, row_of("union", size=(results, 0.0, 0.0))[None]])


def _inverted(shape: Shape) -> Array:
    """Return the rows of all that is outside of a shape, with one result."""
    rows = _joined(shape).copy()
    rows[-1, 1] = 1 - rows[-1, 1]
    return rows


def _followed(rows: Array, operation: str, size: float, *, inside: bool = False) -> Array:
    return np.concatenate([rows, row_of(operation, inside, size=(size, 0.0, 0.0))[None]])


def _arrays(shapes: Iterable[Shape]) -> tuple[Array, ...]:
    return tuple(array for shape in shapes for array in shape.samples())


def _parts(name: str, value: Sequence[Shape]) -> tuple[Shape, ...]:
    parts = tuple_of(name, value, (Shape,))
    if not 1 <= len(parts) <= MOST_SHAPES:
        raise ValueError(f"{name}: {len(parts)} shapes must be from 1 to {MOST_SHAPES}")
    for i, part in enumerate(parts):
        if part.dim != parts[0].dim:
            raise ValueError(f"{name}[{i}] = {part} must have dimension {parts[0].dim}")
    return parts


def _shape(name: str, value: object, dim: int | None = None) -> Shape:
    if not isinstance(value, Shape):
        raise TypeError(f"{name} = {value!r} must be a shape of granular.bodies")
    if dim is not None and value.dim != dim:
        raise ValueError(f"{name} = {value} must have dimension {dim}")
    return value


@dataclass(frozen=True)
class Joined(Shape):
    """A shape made of several ones."""

    parts: tuple[Shape, ...]

    def __post_init__(self) -> None:
        check_fields(self, _parts, "parts")

    @property
    def dim(self) -> int:
        return self.parts[0].dim

    def samples(self) -> tuple[Any, ...]:
        return _arrays(self.parts)


@dataclass(frozen=True)
class Union(Joined):
    """Several shapes as one; a bucket, for example, is a union of boxes.

    Its signed distance is the least of theirs. This is exact outside; where shapes overlap, the
    depth is underestimated. Shapes that go on as one surface should overlap rather than touch:
    where they only touch, a point just below the surface is nearest to the face between them.

    Parameters
    ----------
    parts : sequence of shapes
        At least one shape, all of one dimension.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    def rows(self) -> Array:
        return np.concatenate([part.rows() for part in self.parts])


@dataclass(frozen=True)
class Intersection(Joined):
    """The common part of several shapes; a wedge, for example, is that of two half-spaces.

    Its signed distance is the greatest of theirs. This is exact inside and beside the faces; beyond
    an edge or corner it is less than the distance, as if faces went on.

    Parameters
    ----------
    parts : sequence of shapes
        At least one shape, all of one dimension.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    def rows(self) -> Array:
        rows = np.concatenate([_joined(part) for part in self.parts])
        return _followed(rows, "intersection", len(self.parts))


@dataclass(frozen=True)
class Difference(Shape):
    """A shape less another one; a floor with an orifice, for example, is a box less a cylinder.

    Its signed distance is the greater of that of `shape` and of the negative one of `without`, as
    in an `Intersection`.

    Parameters
    ----------
    shape : shape
    without : shape
        What is cut out, of the same dimension.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    shape: Shape
    without: Shape

    def __post_init__(self) -> None:
        check_fields(self, _shape, "shape")
        check_fields(self, _shape, "without", dim=self.shape.dim)

    @property
    def dim(self) -> int:
        return self.shape.dim

    def rows(self) -> Array:
        rows = np.concatenate([_joined(self.shape), _inverted(self.without)])
        return _followed(rows, "intersection", 2)

    def samples(self) -> tuple[Any, ...]:
        return _arrays((self.shape, self.without))


@dataclass(frozen=True)
class Altered(Shape):
    """A shape made of one other."""

    shape: Shape

    @property
    def dim(self) -> int:
        return self.shape.dim

    def samples(self) -> tuple[Any, ...]:
        return self.shape.samples()


@dataclass(frozen=True)
class Complement(Altered):
    """All that is outside of a shape: a vessel, with the material inside the shape.

    Parameters
    ----------
    shape : shape

    Raises
    ------
    TypeError
        If `shape` is none.
    """

    def __post_init__(self) -> None:
        check_fields(self, _shape, "shape")

    def rows(self) -> Array:
        return _inverted(self.shape)


@dataclass(frozen=True)
class Offset(Altered):
    """A shape whose surface is moved along its normals.

    Outwards, convex edges become round with the radius `by`, and concave ones stay sharp;
    inwards it is the other way round. Edges made by an operation stay sharp, as its distance is
    that of faces that go on.

    Parameters
    ----------
    shape : shape
    by : float
        Distance between the surfaces [m], not 0; negative inwards.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    _: KW_ONLY
    by: float

    def __post_init__(self) -> None:
        check_fields(self, _shape, "shape")
        check_fields(self, finite, "by")
        if self.by == 0:
            raise ValueError("by = 0.0 must not be 0")

    def rows(self) -> Array:
        if self.by > 0:
            return _followed(_joined(self.shape), "offset", self.by)
        return _followed(_inverted(self.shape), "offset", -self.by, inside=True)


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

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    _: KW_ONLY
    thickness: float
    inward: bool = False

    def __post_init__(self) -> None:
        check_fields(self, _shape, "shape")
        check_fields(self, positive, "thickness")
        check_fields(self, truth, "inward")

    def rows(self) -> Array:
        rows = _inverted(self.shape) if self.inward else _joined(self.shape)
        return _followed(rows, "shell", 0.5 * self.thickness)
