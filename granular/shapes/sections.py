"""Shapes given by a section: polygons, prisms, surfaces of revolution."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import ClassVar

import numpy as np

from granular import _core
from granular.shapes.shape import (
    TINY,
    Cover,
    Shape,
    axes_about,
    direction,
    padded,
    rotation_of,
    row_of,
    turned,
)
from granular.tools.arrays import Array
from granular.tools.checks import check_fields, one_of, positive, sequence, set_fields, vector

MOST_VERTICES = 1000

Vertices = tuple[tuple[float, ...], ...]


def _chain(name: str, value: Sequence[Sequence[float]], *, closed: bool, radial: bool) -> Vertices:
    """Check the vertices of a polygon or of an open line; a closed one is made anticlockwise."""
    given = sequence(name, value)
    least = 3 if closed else 2
    if not least <= len(given) <= MOST_VERTICES:
        raise ValueError(f"{name}: {len(given)} must be {least} to {MOST_VERTICES} vertices")
    vertices = tuple(vector(f"{name}[{i}]", vertex, 2) for i, vertex in enumerate(given))
    for i, vertex in enumerate(vertices):
        following = vertices[(i + 1) % len(vertices)]
        if vertex == following and (closed or i + 1 < len(vertices)):
            raise ValueError(f"{name}[{i}] = {vertex} must differ from the next vertex")
        if radial and vertex[0] < 0:
            raise ValueError(f"{name}[{i}] = {vertex} must have a distance r >= 0 from the axis")
    x = np.array(vertices)
    if radial and not x[:, 0].any():
        raise ValueError(f"{name} must not all lie on the axis")
    if not closed:
        return vertices
    crossing = _crossing(x)
    if crossing is not None:
        i, j = crossing
        raise ValueError(
            f"{name}: the edges that begin at {name}[{i}] = {vertices[i]} and {name}[{j}] = "
            f"{vertices[j]} must not meet: the polygon must be simple"
        )
    after = np.roll(x, -1, axis=0)
    area = float(x[:, 0] @ after[:, 1] - x[:, 1] @ after[:, 0])
    return vertices if area > 0 else vertices[::-1]


def _crossing(x: Array) -> tuple[int, int] | None:
    """Return two edges of a polygon that meet at another point than the vertex between them."""
    n, a, b = len(x), x, np.roll(x, -1, axis=0)
    edge = b - a

    def sides(places: Array) -> Array:
        arm = places[None] - a[:, None]
        return np.sign(edge[:, None, 0] * arm[..., 1] - edge[:, None, 1] * arm[..., 0])

    apart = sides(a) * sides(b) > 0
    low, high = np.minimum(a, b), np.maximum(a, b)
    separate = ((low[:, None] > high[None]) | (high[:, None] < low[None])).any(axis=2)
    meet = ~(apart | apart.T | separate)
    places = np.arange(n)
    meet[places, places] = False
    # Neighbours always meet: they may not lie on one another.
    after = (places + 1) % n
    cross = edge[:, 0] * edge[after, 1] - edge[:, 1] * edge[after, 0]
    back = (cross == 0) & (np.einsum("nd,nd->n", edge, edge[after]) < 0)
    meet[places, after] = meet[after, places] = back
    pairs = np.argwhere(meet)
    return (int(pairs[0, 0]), int(pairs[0, 1])) if len(pairs) else None


def chain_rows(
    kind: str,
    vertices: Sequence[Sequence[float]] | Array,
    center: Sequence[float],
    axes: Array,
    *,
    half_length: float = 0.0,
    half_thickness: float = 0.0,
    inside: bool = False,
) -> tuple[Array, Array]:
    """Return the row of a chain and its array, moved to the middle of the chain along its axes."""
    x = np.array(vertices)
    middle = 0.5 * (x.min(axis=0) + x.max(axis=0))
    if kind == "revolved":
        middle[0] = 0.0
    across = axes[:, :2] if kind == "polygon" else axes[:, [0, 2]]
    place = np.array(padded(center)) + across @ middle
    row = row_of(kind, inside, tuple(place), axes, (half_length, half_thickness, 0.0))
    return row[None], np.ascontiguousarray((x - middle)[None])


def chain_cover(kind: str, row: Array, array: Array, dim: int) -> Cover:
    """Cover of a chain, from its row and array."""
    first, second = abs(array[0]).max(axis=0)
    center, axes, half_length, beyond = row[0, 2 : 2 + dim], row[0, 5:14], row[0, 14], row[0, 15]
    turn = axes.reshape(3, 3)
    if kind == "revolved":
        return Cover.of(center, turn, (0.0, 0.0, second), radius=first, beyond=beyond)
    return Cover.of(center, turn, (first, second, half_length), beyond=beyond)


def inradius(kind: str, array: Array) -> float:
    """Radius [m] of the largest circle in a polygon or in the section of a solid of revolution.

    It touches the surface: the largest circles that touch it at some points are computed by
    bisection.
    """
    revolved = kind == "revolved"
    row = row_of(kind, size=(0.0 if revolved else math.inf, 0, 0))
    a, b = array[0], np.roll(array[0], -1, axis=0)
    edge = b - a
    if revolved:
        off_axis = (a[:, 0] > 0) | (b[:, 0] > 0)
        a, edge = a[off_axis], edge[off_axis]
    share = (np.arange(count := max(64 // len(a), 1)) + 0.5)[:, None, None] / count
    start = (a + share * edge).reshape(-1, 2)
    inward = np.stack([-edge[:, 1], edge[:, 0]], axis=1) / np.linalg.norm(edge, axis=1)[:, None]
    inward = np.tile(inward, (count, 1))
    low, high = np.zeros(len(start)), np.full(len(start), np.linalg.norm(np.ptp(array[0], axis=0)))
    for _ in range(40):
        radius = 0.5 * (low + high)
        at = np.zeros((len(start), 3))
        at[:, [0, 2] if revolved else [0, 1]] = start + radius[:, None] * inward
        depth = -_core.body_distance(row[None], (array,), at)[0]
        touches = depth > radius * (1 - 1e-9)
        low, high = np.where(touches, radius, low), np.where(touches, high, radius)
    return float(low.max())


class Section(Shape):
    """A shape given by the vertices of a section."""

    kind: ClassVar[str] = "polygon"
    """Kind of its part in the core."""
    thickness: float | None

    @abstractmethod
    def _row(self) -> tuple[Array, Array]:
        """Row for the core, and the vertices."""

    def rows(self) -> Array:
        return self._row()[0]

    def samples(self) -> tuple[Array, ...]:
        return (self._row()[1],)

    def covers(self) -> list[Cover]:
        return [chain_cover(self.kind, *self._row(), self.dim)]

    def _breadth(self) -> float:
        return self.thickness or 2 * inradius(self.kind, self._row()[1])


@dataclass(frozen=True)
class Polygon(Section):
    """A polygon in 2D, or the wall along a line of straight pieces.

    Parameters
    ----------
    vertices : sequence of points, shape (n, 2)
        Vertices [m] relative to `center`, in either sense, 3 to 1000, or 2 to 1000 with a
        `thickness`. The polygon may be concave; its edges must not cross or touch.
    center : tuple of 2 floats
        Position of the origin of the vertices [m].
    rotation_deg : float
        Rotation about the centre [degrees].
    thickness : float, optional
        If given, the vertices are those of an open line, and the solid is a wall of this thickness
        [m] about it, with round ends and outer corners.
    {raises}.
    """

    vertices: Vertices
    _: KW_ONLY
    center: tuple[float, float] = (0.0, 0.0)
    rotation_deg: float = 0.0
    thickness: float | None = None

    def __post_init__(self) -> None:
        check_fields(self, positive, "thickness", optional=True)
        check_fields(self, _chain, "vertices", closed=self.thickness is None, radial=False)
        check_fields(self, vector, "center", dim=2)
        check_fields(self, rotation_of, "rotation_deg", dim=2)

    @property
    def dim(self) -> int:
        return 2

    def is_endless(self, along: Array) -> bool:
        return bool(abs(along[2]) > 1 - TINY)

    def _row(self) -> tuple[Array, Array]:
        return chain_rows(
            "polygon",
            self.vertices,
            self.center,
            turned(self.rotation_deg).as_matrix(),
            half_length=math.inf,
            half_thickness=0.5 * (self.thickness or 0.0),
        )


@dataclass(frozen=True)
class Prism(Section):
    """A polygon extended along an axis in 3D.

    Parameters
    ----------
    vertices : sequence of points, shape (n, 2)
        Vertices [m] of the section relative to `center`: (x, y) if `axis` is z, (x, z) if it is y,
        (y, z) if it is x; otherwise as those of a `Polygon`.
    length : float
        Length along the axis [m], > 0, half of it on each side of the centre; may be infinite.
    axis : {"x", "y", "z"}
        Axis along which the section is extended.
    center : tuple of 3 floats
        Position of the origin of the vertices [m].
    rotation_deg : tuple of 3 floats, or 0
        Rotation about the centre, a rotation vector [degrees]; 0 for none.
    thickness : float, optional
        As for a `Polygon`: the section is a wall of this thickness [m] along an open line.
    {raises}.
    """

    vertices: Vertices
    length: float
    _: KW_ONLY
    axis: str
    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation_deg: float | tuple[float, ...] = 0.0
    thickness: float | None = None

    def __post_init__(self) -> None:
        check_fields(self, positive, "thickness", optional=True)
        check_fields(self, _chain, "vertices", closed=self.thickness is None, radial=False)
        check_fields(self, positive, "length", allow_inf=True)
        check_fields(self, one_of, "axis", allowed=("x", "y", "z"))
        check_fields(self, vector, "center", dim=3)
        check_fields(self, rotation_of, "rotation_deg", dim=3)

    @property
    def dim(self) -> int:
        return 3

    def _breadth(self) -> float:
        return min(super()._breadth(), self.length)

    def is_endless(self, along: Array) -> bool:
        third = self._row()[0][0, 5:14].reshape(3, 3)[:, 2]
        return math.isinf(self.length) and bool(abs(third @ along) > 1 - TINY)

    def _row(self) -> tuple[Array, Array]:
        first, second = (np.eye(3)["xyz".index(letter)] for letter in "xyz" if letter != self.axis)
        section = np.column_stack([first, second, np.cross(first, second)])
        return chain_rows(
            "polygon",
            self.vertices,
            self.center,
            turned(self.rotation_deg).as_matrix() @ section,
            half_length=0.5 * self.length,
            half_thickness=0.5 * (self.thickness or 0.0),
        )


@dataclass(frozen=True)
class Revolve(Section):
    """A solid of revolution: a profile turned about an axis.

    In 2D it is the section through the axis: the profile and its mirror image. A silo with its
    hopper, for example, is ``Revolve([(0.02, 0), (0.1, 0.1), (0.1, 0.4)], center=..., axis=...,
    thickness=0.01)``.

    Parameters
    ----------
    profile : sequence of points, shape (n, 2)
        Vertices (r, z) [m] of the profile, r >= 0 the distance from the axis and z the distance
        along it from `center`. They are those of a polygon, in either sense, with edges that do not
        cross or touch; edges on the axis are not part of the surface.
    center : tuple of float, length dim
        A point of the axis [m].
    axis : tuple of float, length dim
        Direction of the axis, of any length.
    thickness : float, optional
        If given, the profile is an open line, and the solid is a wall of this thickness [m] about
        it, with round ends and outer corners.
    {raises}.
    """

    profile: Vertices
    _: KW_ONLY
    center: tuple[float, ...]
    axis: tuple[float, ...]
    thickness: float | None = None

    def __post_init__(self) -> None:
        check_fields(self, positive, "thickness", optional=True)
        check_fields(self, _chain, "profile", closed=self.thickness is None, radial=True)
        check_fields(self, vector, "center")
        set_fields(self, axis=direction("axis", self.axis, self.dim))

    kind = "revolved"

    @property
    def dim(self) -> int:
        return len(self.center)

    def _row(self) -> tuple[Array, Array]:
        half = 0.5 * (self.thickness or 0.0)
        axes = axes_about(self.axis)
        return chain_rows("revolved", self.profile, self.center, axes, half_thickness=half)
