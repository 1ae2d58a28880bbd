"""Shapes by their signed distance, each with its description for the core.

A 2D scene is a section of one that is endless along z: a box is infinite along z there, and a disc
is a cylinder.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from inspect import isabstract
from typing import Any

import numpy as np
import scipy

from granular import _core
from granular.shapes.region import Region
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import finite, vector

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


def padded(value: Sequence[float] | Array) -> tuple[float, ...]:
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


def frame_of(shape: Shape) -> tuple[Array, Array]:
    """Centre (3,) and axes, as columns, of the part of a shape of one part."""
    row = shape.rows()[0]
    return row[2:5], row[5:14].reshape(3, 3)


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
    components = vector(name, value, dim)
    if not math.hypot(*components) > 0:
        raise ValueError(f"{name} = {components} must not be zero")
    return components


TINY = 1e-12
"""Largest cosine that counts as a right angle."""


@dataclass(frozen=True, eq=False)
class Cover:
    """Box with rounded edges that contains a shape.

    The shape lies within `beyond` of the sums of a point of a box and one of a disc about the third
    axis.
    """

    center: Array
    axes: Array
    """As columns."""
    half: Array
    """Half lengths of the box along the axes, may be infinite."""
    radius: float = 0.0
    """Of the disc."""
    beyond: float = 0.0

    @classmethod
    def of(
        cls,
        center: Sequence[float] | Array,
        axes: Array,
        half: Sequence[float],
        radius: float = 0.0,
        beyond: float = 0.0,
    ) -> Cover:
        """Make one about a point of 2 or 3 coordinates; in 2D it is the section at z = 0."""
        edges = np.array(half, dtype=float)
        if len(center) == 2 and math.isinf(edges[2]):
            edges[2] = 0.0
        return cls(np.array(padded(center)), axes, edges, float(radius), float(beyond))

    def turned(self, rotation: Array) -> Cover:
        """Return the same after a rotation about the origin."""
        return Cover(
            rotation @ self.center, rotation @ self.axes, self.half, self.radius, self.beyond
        )

    def along(self, direction: Array) -> float:
        """Largest distance of its points from the origin along a direction, to either side [m]."""
        shares, half = abs(self.axes.T @ direction), self.half.copy()
        shares[shares <= TINY] = 0.0
        half[shares == 0.0] = 0.0  # no product of zero and infinity
        box = float(abs(self.center @ direction) + half @ shares)
        return box + self.radius * math.hypot(*shares[:2]) + self.beyond


@dataclass(frozen=True)
class Measure:
    """A convex function of position whose bound in a shape follows from those in covers.

    Attributes
    ----------
    of : callable
        Bound in a cover.
    growth : float
        Largest change of the function over a metre.
    join : callable
        Greater one of two bounds.
    """

    of: Callable[[Cover], Any]
    growth: float
    join: Callable[[Any, Any], Any] = np.maximum


class Shape(Region):
    """A solid, or the complement of one.

    A new shape has `dim`, `rows` and the methods that have no default. The signed distance
    is that of the core, `gr_part_distance` of csrc/body.
    """

    inside: bool = False
    """True if the solid is outside of the surface."""

    @property
    @abstractmethod
    def dim(self) -> int:
        """Dimension, 2 or 3."""

    @abstractmethod
    def rows(self) -> Array:
        """Return the description of the shape for the core, shape (parts, 17)."""

    @property
    def results(self) -> int:
        """Number of parts in `rows` whose union is the shape."""
        return 1

    def samples(self) -> tuple[Any, ...]:
        """Return the arrays of the rows that need one, in their order.

        They are sampled signed distances [m], shape (z, y, x), negative inside, or the vertices [m]
        of a polygon, shape (1, n, 2).
        """
        return ()

    def covers(self) -> list[Cover] | None:
        """Boxes that contain the inside of the surface; None if it is unbounded on all sides."""
        return None

    def narrowest(self, inverted: bool = False) -> float:
        """Diameter [m] of the largest ball in the solid; inf if it is a complement.

        Of several parts it is the least; `inverted`: of the complement of the solid.
        """
        return math.inf if inverted != self.inside else self._breadth()

    def _breadth(self) -> float:
        """Diameter [m] of the largest ball within the surface."""
        return math.inf

    def is_endless(self, along: Array) -> bool:
        """True if the shape is the same everywhere along a direction of 3 components."""
        return False

    def bound(self, measure: Measure) -> tuple[Any, Any]:
        """Bounds of a function in the solid, and in its complement."""
        covers = self.covers()
        solid = math.inf if covers is None else reduce(measure.join, map(measure.of, covers))
        return (math.inf, solid) if self.inside else (solid, math.inf)

    @property
    def bounds(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        ends = self.ends(np.eye(3)[: self.dim])
        return tuple(ends[0].tolist()), tuple(ends[1].tolist())

    def ends(self, directions: Array) -> tuple[Array, Array]:
        """Least and largest coordinates [m] along directions, the rows (n, 3); may be infinite."""

        def ahead(cover: Cover) -> Array:
            centred = Cover(np.zeros(3), cover.axes, cover.half, cover.radius, cover.beyond)
            half = np.array([centred.along(e) for e in directions])
            middle = directions @ cover.center
            return np.concatenate([half - middle, half + middle])

        bound = self.bound(Measure(ahead, 1.0))[0]
        low, high = np.broadcast_to(bound, 2 * len(directions)).reshape(2, -1)
        return -low, high

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Signed distance to the surface, and the outward normal there.

        Parameters
        ----------
        x : ndarray, shape (n, dim)
            Positions [m].

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

    def cut(self, x: Array) -> tuple[Array, Array]:
        return self.distance(x)

    def cuts(self, x: Array, reach: float) -> BoolArray:
        near: BoolArray = abs(self.distance(x)[0]) <= reach
        return near

    def _inside(self, x: Array) -> BoolArray:
        return self.distance(x)[0] < 0


def shape_kinds(base: type[Shape] = Shape) -> list[type[Shape]]:
    """Classes of shapes that can be made."""
    kinds = [] if isabstract(base) else [base]
    return kinds + [kind for below in base.__subclasses__() for kind in shape_kinds(below)]
