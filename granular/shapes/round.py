"""Round shapes: spheres, cylinders, capsules, tori, cones and hoppers."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass

import numpy as np

from granular.shapes.sections import chain_cover, chain_rows, inradius
from granular.shapes.shape import TINY, Cover, Shape, axes_about, direction, padded, row_of
from granular.tools.arrays import Array
from granular.tools.checks import (
    check_fields,
    non_negative,
    positive,
    sequence,
    set_fields,
    truth,
    vector,
)


@dataclass(frozen=True)
class Sphere(Shape):
    """A ball; in 2D a disc.

    Parameters
    ----------
    radius : float
        Radius [m], > 0.
    center : tuple of float, length dim
        Centre [m]; its length, 2 or 3, is the dimension.
    {raises}.
    """

    radius: float
    _: KW_ONLY
    center: tuple[float, ...]

    def __post_init__(self) -> None:
        check_fields(self, positive, "radius")
        check_fields(self, vector, "center")

    @property
    def dim(self) -> int:
        return len(self.center)

    def rows(self) -> Array:
        if self.dim == 2:
            return row_of("cylinder", False, self.center, None, (self.radius, math.inf, 0.0))[None]
        return row_of("capsule", False, self.center, None, (self.radius, 0.0, 0.0))[None]

    def covers(self) -> list[Cover]:
        return [Cover.of(self.center, np.eye(3), (0.0, 0.0, 0.0), beyond=self.radius)]

    def _breadth(self) -> float:
        return 2 * self.radius


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder; in 2D a disc.

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
    {raises}.
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
        size = (self.radius, self.length / 2, 0.0)
        return row_of("cylinder", self.inside, self.center, self._axes(), size)[None]

    def _axes(self) -> Array:
        return np.eye(3) if self.axis is None else axes_about(self.axis)

    def covers(self) -> list[Cover]:
        half = (0.0, 0.0, self.length / 2)
        return [Cover.of(self.center, self._axes(), half, radius=self.radius)]

    def _breadth(self) -> float:
        return min(2 * self.radius, self.length)

    def is_endless(self, along: Array) -> bool:
        return math.isinf(self.length) and bool(abs(self._axes()[:, 2] @ along) > 1 - TINY)


@dataclass(frozen=True)
class Capsule(Shape):
    """A rod with round ends: the points within a radius of a straight line.

    Parameters
    ----------
    radius : float
        Radius [m], > 0.
    length : float
        Length of the line [m], > 0: the rod is longer by twice the radius.
    center : tuple of float, length dim
        Middle of the line [m].
    axis : tuple of float, length dim
        Direction of the line, of any length.
    {raises}.
    """

    radius: float
    length: float
    _: KW_ONLY
    center: tuple[float, ...]
    axis: tuple[float, ...]

    def __post_init__(self) -> None:
        check_fields(self, positive, "radius", "length")
        check_fields(self, vector, "center")
        set_fields(self, axis=direction("axis", self.axis, self.dim))

    @property
    def dim(self) -> int:
        return len(self.center)

    def rows(self) -> Array:
        size = (self.radius, 0.5 * self.length, 0.0)
        return row_of("capsule", False, self.center, axes_about(self.axis), size)[None]

    def covers(self) -> list[Cover]:
        half = (0.0, 0.0, 0.5 * self.length)
        return [Cover.of(self.center, axes_about(self.axis), half, beyond=self.radius)]

    def _breadth(self) -> float:
        return 2 * self.radius


@dataclass(frozen=True)
class Torus(Shape):
    """A ring in 3D: the points within a radius of a circle.

    Parameters
    ----------
    radius : float
        Radius of the circle [m], > `tube`.
    tube : float
        Radius of the tube about it [m], > 0.
    center : tuple of 3 floats
        Centre [m].
    axis : tuple of 3 floats
        Direction of the axis of the circle, of any length.
    {raises}.
    """

    radius: float
    tube: float
    _: KW_ONLY
    center: tuple[float, float, float]
    axis: tuple[float, float, float]

    def __post_init__(self) -> None:
        check_fields(self, positive, "radius", "tube")
        if not self.tube < self.radius:
            raise ValueError(f"tube = {self.tube} must be < radius = {self.radius}")
        check_fields(self, vector, "center", dim=3)
        set_fields(self, axis=direction("axis", self.axis, 3))

    @property
    def dim(self) -> int:
        return 3

    def rows(self) -> Array:
        size = (self.radius, self.tube, 0.0)
        return row_of("torus", False, self.center, axes_about(self.axis), size)[None]

    def covers(self) -> list[Cover]:
        axes, none = axes_about(self.axis), (0.0, 0.0, 0.0)
        return [Cover.of(self.center, axes, none, radius=self.radius, beyond=self.tube)]

    def _breadth(self) -> float:
        return 2 * self.tube


@dataclass(frozen=True)
class Frustum(Shape):
    """A cone, a truncated cone or a hopper.

    In 2D it is the section through the axis: a trapezium, or the two straight walls of a hopper.
    ``Frustum((0.02, 0.1), 0.15, center=(0, 0, 0), axis=(0, 0, 1), thickness=0.01)`` is a hopper
    with an orifice of 4 cm.

    Parameters
    ----------
    radii : tuple of 2 floats
        Radii [m] at the two ends, first at that from which `axis` points to the other, >= 0 and not
        both 0. With a `thickness` they are those of the inner surface.
    length : float
        Length along the axis [m], > 0.
    center : tuple of float, length dim
        Middle of the axis [m].
    axis : tuple of float, length dim
        Direction of the axis, of any length.
    thickness : float, optional
        If given, the solid is a wall of this thickness [m], > 0, outside of the conical surface,
        open at both ends; its rims are square to the wall. Must be None if `inside` is true.
    inside : bool
        If True, the material is inside, as in a drum: the solid is all that lies outside of the
        surface, which has two ends.
    {raises}.
    """

    radii: tuple[float, float]
    length: float
    _: KW_ONLY
    center: tuple[float, ...]
    axis: tuple[float, ...]
    thickness: float | None = None
    inside: bool = False

    def __post_init__(self) -> None:
        radii = sequence("radii", self.radii)
        if len(radii) != 2:
            raise ValueError(f"radii = {radii} must be two numbers")
        radii = tuple(non_negative(f"radii[{i}]", radius) for i, radius in enumerate(radii))
        if not max(radii) > 0:
            raise ValueError(f"radii = {radii} must not both be 0")
        check_fields(self, positive, "length")
        check_fields(self, positive, "thickness", optional=True)
        check_fields(self, truth, "inside")
        if self.inside and self.thickness is not None:
            raise ValueError(f"thickness = {self.thickness} must be None where inside is True")
        check_fields(self, vector, "center")
        set_fields(self, radii=radii, axis=direction("axis", self.axis, self.dim))

    @property
    def dim(self) -> int:
        return len(self.center)

    @property
    def walls(self) -> tuple[tuple[Array, Array, tuple[float, float, float]], ...]:
        """Positions, axes and half edges of the boxes of a hopper in 2D; else none."""
        if self.thickness is None or self.dim == 3:
            return ()
        side, (inner, outer) = math.hypot(self.length, self.radii[1] - self.radii[0]), self.radii
        slope = np.array([outer - inner, self.length]) / side
        middle = 0.5 * (inner + outer) * np.array([1.0, 0.0])
        middle += 0.5 * (self.thickness or 0.0) * np.array([slope[1], -slope[0]])
        boxes = []
        for sign in (1, -1):
            across, along = axes_about(self.axis)[:, [0, 2]].T * [[sign], [1]]
            first = slope[0] * across + slope[1] * along
            axes = np.column_stack([first, [-first[1], first[0], 0.0], [0.0, 0.0, 1.0]])
            place = np.array(padded(self.center)) + middle[0] * across + middle[1] * along
            size = (0.5 * side, 0.5 * (self.thickness or 0.0), math.inf)
            boxes.append((place, axes, size))
        return tuple(boxes)

    def _row(self) -> tuple[Array, Array]:
        half, (first, second) = 0.5 * self.length, self.radii
        if self.thickness is not None:
            out = np.array([self.length, first - second])
            out *= self.thickness / np.hypot(*out)
            inner = np.array([[first, -half], [second, half]])
            profile = np.array([inner[0], inner[0] + out, inner[1] + out, inner[1]])
        else:
            corners = [(0.0, -half), (first, -half), (second, half), (0.0, half)]
            profile = np.array(list(dict.fromkeys(corners)))  # the tip of a cone once
        axes = axes_about(self.axis)
        return chain_rows("revolved", profile, self.center, axes, inside=self.inside)

    @property
    def results(self) -> int:
        return len(self.walls) or 1

    def rows(self) -> Array:
        if walls := self.walls:
            return np.array(
                [row_of("box", False, tuple(at), axes, size) for at, axes, size in walls]
            )
        return self._row()[0]

    def samples(self) -> tuple[Array, ...]:
        return () if self.walls else (self._row()[1],)

    def covers(self) -> list[Cover]:
        if walls := self.walls:
            return [Cover.of(at[:2], axes, size) for at, axes, size in walls]
        return [chain_cover("revolved", *self._row(), self.dim)]

    def _breadth(self) -> float:
        if walls := self.walls:
            return min(2 * min(size[:2]) for *_, size in walls)
        return 2 * inradius("revolved", self._row()[1])
