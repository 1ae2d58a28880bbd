"""Shapes of rigid bodies, each with its description for the core.

In 2D a box is infinite along z and a cylinder is a disc.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from granular import _core
from granular.checks import (
    check_fields,
    finite,
    positive,
    set_fields,
    truth,
    tuple_of,
    vector,
)

__all__ = ["Box", "Cylinder", "HalfSpace", "Shape", "Union"]

Array = NDArray[np.float64]

MOST_SHAPES = 256
BOX, CYLINDER, HALF_SPACE, SAMPLED, HEIGHT_MAP = (
    _core.enumerations()["part"][name]
    for name in ("box", "cylinder", "half_space", "sampled", "height_map")
)


def rotation_of(name: str, value: object, dim: int) -> float | tuple[float, ...]:
    """Check a rotation [degrees]: an angle in 2D, a rotation vector in 3D; 0 is none in both."""
    is_angle = dim == 2 or (isinstance(value, (int, float)) and value == 0)
    return finite(name, value) if is_angle else vector(name, value, 3)


def turned(rotation: float | tuple[float, ...]) -> Rotation:
    """Make a rotation from an angle or a rotation vector [degrees]; 0.0 is no rotation in 3D."""
    return Rotation.from_rotvec(
        (0.0, 0.0, rotation) if isinstance(rotation, float) else rotation, degrees=True
    )


def padded(value: Sequence[float]) -> tuple[float, ...]:
    """Return 3 components; a vector of 2 gets z = 0."""
    return (*value, 0.0)[:3]


def row_of(
    kind: int, inside: bool, center: Sequence[float], matrix: Array, size: Iterable
) -> Array:
    """Return the 17 numbers that describe a part for the core."""
    return np.array([kind, inside, *padded(center), *matrix.ravel(), *size], dtype=float)


def _axes_about(normal: Sequence[float]) -> Array:
    """Rotation matrix whose third column is along `normal`."""
    third = np.array(padded(normal)) / np.linalg.norm(normal)
    first = np.cross(np.eye(3)[np.argmin(np.abs(third))], third)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(third, first), third])


def _direction(name: str, value: object, dim: int | None = None) -> tuple[float, ...]:
    direction = vector(name, value, dim)
    if not math.hypot(*direction) > 0:
        raise ValueError(f"{name} = {direction} must not be zero")
    return direction


class Shape(ABC):
    """A shape of a rigid body."""

    @property
    @abstractmethod
    def dim(self) -> int:
        """Dimension, 2 or 3."""

    @abstractmethod
    def rows(self) -> Array:
        """Return the description of the shape for the core, shape (parts, 17)."""

    def samples(self) -> tuple[tuple[NDArray, ...], ...]:
        """Return the tables of parts that have no formula, for the core."""
        return ()


@dataclass(frozen=True)
class Box(Shape):
    """A box, in coordinates of its body.

    Parameters
    ----------
    size : tuple of float, length dim
        Lengths of the edges [m], > 0, may be infinite.
    center : tuple of float, length dim, optional
        Centre [m]; the position of the body by default.
    rotation_deg : float or tuple of 3 floats
        Rotation about the centre: an angle in 2D, a rotation vector in 3D [degrees].

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    size: tuple[float, ...]
    _: KW_ONLY
    center: tuple[float, ...] = None  # type: ignore[assignment]  # a place once made
    rotation_deg: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        size = vector("size", self.size, check=partial(positive, allow_inf=True))
        center = (0.0,) * len(size) if self.center is None else self.center
        set_fields(self, size=size, center=vector("center", center, len(size)))
        check_fields(self, rotation_of, "rotation_deg", dim=len(size))

    @property
    def dim(self) -> int:
        return len(self.size)

    def rows(self) -> Array:
        half = [edge / 2 for edge in self.size] + [math.inf]
        matrix = turned(self.rotation_deg).as_matrix()
        return row_of(BOX, False, self.center, matrix, half[:3])[None]


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder, in coordinates of its body; in 2D a disc.

    Parameters
    ----------
    radius : float
        Radius [m], > 0.
    length : float
        Length along the axis [m], > 0 or infinite; must be infinite in 2D.
    center : tuple of float, length dim
        Centre [m].
    axis : tuple of 3 floats, optional
        Direction of the axis, of any length; None in 2D.
    inside : bool
        If True, the material is inside, as in a drum: the solid is all that lies outside of the
        surface.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    radius: float
    _: KW_ONLY
    center: tuple[float, ...]
    axis: tuple[float, ...] | None = None
    length: float = math.inf
    inside: bool = False

    def __post_init__(self) -> None:
        center = vector("center", self.center)
        length = positive("length", self.length, allow_inf=True)
        axis = self.axis
        if len(center) == 2 and (axis is not None or math.isfinite(length)):
            raise ValueError(f"axis = {axis} and length = {length} must be None and inf in 2D")
        if len(center) == 3:
            axis = _direction("axis", axis, 3)
        set_fields(self, center=center, axis=axis, length=length)
        check_fields(self, positive, "radius")
        check_fields(self, truth, "inside")

    @property
    def dim(self) -> int:
        return len(self.center)

    def rows(self) -> Array:
        matrix = np.eye(3) if self.axis is None else _axes_about(self.axis)
        size = (self.radius, self.length / 2, 0.0)
        return row_of(CYLINDER, self.inside, self.center, matrix, size)[None]


@dataclass(frozen=True)
class HalfSpace(Shape):
    """All that lies behind a plane, in coordinates of its body.

    Parameters
    ----------
    normal : tuple of float, length dim
        Normal of the plane, out of the solid, of any length.
    through : tuple of float, length dim, optional
        A point of the plane [m]; the position of the body by default.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    normal: tuple[float, ...]
    through: tuple[float, ...] = None  # type: ignore[assignment]  # a place once made

    def __post_init__(self) -> None:
        normal = _direction("normal", self.normal)
        through = (0.0,) * len(normal) if self.through is None else self.through
        set_fields(self, normal=normal, through=vector("through", through, len(normal)))

    @property
    def dim(self) -> int:
        return len(self.normal)

    def rows(self) -> Array:
        matrix = _axes_about(self.normal)
        return row_of(HALF_SPACE, False, self.through, matrix, (0.0, 0.0, 0.0))[None]


@dataclass(frozen=True)
class Union(Shape):
    """Several shapes as one; a bucket, for example, is a union of boxes.

    Its signed distance is the least of theirs. This is exact outside; where shapes overlap, the
    depth is underestimated.

    Parameters
    ----------
    parts : sequence of shapes
        At least one shape, all of one dimension; no unions.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    parts: tuple[Shape, ...]

    def __post_init__(self) -> None:
        parts = tuple_of("parts", self.parts, (Shape,))
        if not 1 <= len(parts) <= MOST_SHAPES:
            raise ValueError(f"parts: {len(parts)} shapes must be from 1 to {MOST_SHAPES}")
        for i, part in enumerate(parts):
            if isinstance(part, Union):
                raise TypeError(f"parts[{i}] = {part} must not be a Union")
            if part.dim != parts[0].dim:
                raise ValueError(f"parts[{i}] = {part} must have dimension {parts[0].dim}")
        set_fields(self, parts=parts)

    @property
    def dim(self) -> int:
        return self.parts[0].dim

    def rows(self) -> Array:
        return np.concatenate([part.rows() for part in self.parts])

    def samples(self) -> tuple[tuple[NDArray, ...], ...]:
        return tuple(tables for part in self.parts for tables in part.samples())
