"""Shapes of rigid bodies, each with its description for the core.

A 2D scene is a section of one that is endless along z: a box is infinite along z there, and a disc
is a cylinder.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import partial
from inspect import isabstract
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from granular import _core
from granular.checks import (
    check_fields,
    finite,
    positive,
    set_fields,
    truth,
    vector,
)

__all__ = ["Box", "Cylinder", "HalfSpace", "Shape", "shape_kinds"]

Array = NDArray[np.float64]

MOST_SHAPES = 256
PARTS = _core.enumerations()["part"]
"""Number of each kind of part in the core."""


def rotation_of(name: str, value: object, dim: int) -> float | tuple[float, ...]:
    """Check a rotation [degrees]: an angle in 2D, a rotation vector in 3D; 0 is none in both."""
    is_angle = dim == 2 or (isinstance(value, (int, float)) and value == 0)
    return finite(name, value) if is_angle else vector(name, value, 3)


def turned(rotation: float | tuple[float, ...]) -> scipy.spatial.transform.Rotation:
    """Make a rotation from an angle or a rotation vector [degrees]; 0.0 is no rotation in 3D."""
    return scipy.spatial.transform.Rotation.from_rotvec(
        (0.0, 0.0, rotation) if isinstance(rotation, float) else rotation, degrees=True
    )


def padded(value: Sequence[float]) -> tuple[float, ...]:
    """Return 3 components; a vector of 2 gets z = 0."""
    return (*value, 0.0)[:3]


def row_of(
    kind: str,
    inside: bool = False,
    center: Sequence[float] = (0.0, 0.0, 0.0),
    matrix: Array | None = None,
    size: Iterable[float] = (0.0, 0.0, 0.0),
) -> Array:
    """Return the 17 numbers of a part: kind, inside, centre, rotation matrix, size."""
    turn = np.eye(3) if matrix is None else matrix
    return np.array([PARTS[kind], inside, *padded(center), *turn.ravel(), *size], dtype=float)


def axes_about(normal: Sequence[float]) -> Array:
    """Rotation matrix whose third column is along `normal`; in 2D the second one is along z."""
    third = np.array(padded(normal)) / np.linalg.norm(normal)
    if len(normal) == 2:
        return np.column_stack([[-third[1], third[0], 0.0], [0.0, 0.0, 1.0], third])
    first = np.cross(np.eye(3)[np.argmin(np.abs(third))], third)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(third, first), third])


def direction(name: str, value: object, dim: int | None = None) -> tuple[float, ...]:
    """Check a vector that must not be zero."""
    found = vector(name, value, dim)
    if not math.hypot(*found) > 0:
        raise ValueError(f"{name} = {found} must not be zero")
    return found


class Shape(ABC):
    """A shape of a rigid body."""

    @property
    @abstractmethod
    def dim(self) -> int:
        """Dimension, 2 or 3."""

    @abstractmethod
    def rows(self) -> Array:
        """Return the description of the shape for the core, shape (parts, 17)."""

    def samples(self) -> tuple[Any, ...]:
        """Return the arrays of the rows that need one, in their order.

        They are sampled signed distances [m], shape (z, y, x), negative inside, or the vertices [m]
        of a polygon, shape (1, n, 2).
        """
        return ()

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Signed distance to the surface, and the outward normal there.

        Parameters
        ----------
        x : ndarray, shape (n, dim)
            Positions [m] in coordinates of the body.

        Returns
        -------
        distance : ndarray, shape (n,)
            Distance [m], negative in the solid.
        normal : ndarray, shape (n, dim)

        Raises
        ------
        ValueError
            If positions are not finite or have another dimension.
        """
        x = np.asarray(x, dtype=float)
        if x.ndim != 2 or x.shape[1] != self.dim or not np.isfinite(x).all():
            raise ValueError(f"x of shape {x.shape} must be finite of shape (n, {self.dim})")
        places = np.zeros((len(x), 3))
        places[:, : self.dim] = x
        distance, normal = _core.body_distance(self.rows(), self.samples(), places)
        return distance, np.ascontiguousarray(normal[:, : self.dim])


def shape_kinds(base: type[Shape] = Shape) -> list[type[Shape]]:
    """Classes of shapes that can be made."""
    kinds = [] if isabstract(base) else [base]
    return kinds + [kind for below in base.__subclasses__() for kind in shape_kinds(below)]


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
        return row_of("box", False, self.center, matrix, half[:3])[None]


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
        Direction of the axis, of any length; required in 3D, None in 2D.
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
            axis = direction("axis", axis, 3)
        set_fields(self, center=center, axis=axis, length=length)
        check_fields(self, positive, "radius")
        check_fields(self, truth, "inside")

    @property
    def dim(self) -> int:
        return len(self.center)

    def rows(self) -> Array:
        matrix = np.eye(3) if self.axis is None else axes_about(self.axis)
        size = (self.radius, self.length / 2, 0.0)
        return row_of("cylinder", self.inside, self.center, matrix, size)[None]


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
        normal = direction("normal", self.normal)
        through = (0.0,) * len(normal) if self.through is None else self.through
        set_fields(self, normal=normal, through=vector("through", through, len(normal)))

    @property
    def dim(self) -> int:
        return len(self.normal)

    def rows(self) -> Array:
        matrix = axes_about(self.normal)
        return row_of("half_space", False, self.through, matrix, (0.0, 0.0, 0.0))[None]
