"""Round shapes of rigid bodies: spheres, capsules, tori, cones and hoppers."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass

import numpy as np

from granular.checks import (
    check_fields,
    non_negative,
    positive,
    sequence,
    set_fields,
    truth,
    vector,
)
from granular.shapes.sections import chain_rows
from granular.shapes.shape import Array, Shape, axes_about, direction, padded, row_of

__all__ = ["Capsule", "Frustum", "Sphere", "Torus"]


@dataclass(frozen=True)
class Sphere(Shape):
    """A ball in 3D, in coordinates of its body; a disc in 2D is a `Cylinder`.

    Parameters
    ----------
    radius : float
        Radius [m], > 0.
    center : tuple of 3 floats
        Centre [m].

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    radius: float
    _: KW_ONLY
    center: tuple[float, float, float]

    def __post_init__(self) -> None:
        check_fields(self, positive, "radius")
        check_fields(self, vector, "center", dim=3)

    @property
    def dim(self) -> int:
        return 3

    def rows(self) -> Array:
        return row_of("capsule", False, self.center, None, (self.radius, 0.0, 0.0))[None]


@dataclass(frozen=True)
class Capsule(Shape):
    """A rod with round ends, in coordinates of its body: all within a radius of a straight line.

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

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
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


@dataclass(frozen=True)
class Torus(Shape):
    """A ring in 3D, in coordinates of its body: all within a radius of a circle.

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

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
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


@dataclass(frozen=True)
class Frustum(Shape):
    """A cone, a truncated cone or a hopper, in coordinates of its body.

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

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
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

    def _walls(self) -> Array:
        """The two walls of a hopper in 2D: boxes, which may be thin."""
        side, (inner, outer) = math.hypot(self.length, self.radii[1] - self.radii[0]), self.radii
        slope = np.array([outer - inner, self.length]) / side
        middle = 0.5 * (inner + outer) * np.array([1.0, 0.0])
        middle += 0.5 * (self.thickness or 0.0) * np.array([slope[1], -slope[0]])
        rows = []
        for sign in (1, -1):
            across, along = axes_about(self.axis)[:, [0, 2]].T * [[sign], [1]]
            first = slope[0] * across + slope[1] * along
            axes = np.column_stack([first, [-first[1], first[0], 0.0], [0.0, 0.0, 1.0]])
            place = np.array(padded(self.center)) + middle[0] * across + middle[1] * along
            size = (0.5 * side, 0.5 * (self.thickness or 0.0), math.inf)
            rows.append(row_of("box", False, tuple(place), axes, size))
        return np.array(rows)

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

    def rows(self) -> Array:
        if self.thickness is not None and self.dim == 2:
            return self._walls()
        return self._row()[0]

    def samples(self) -> tuple[Array, ...]:
        if self.thickness is not None and self.dim == 2:
            return ()
        return (self._row()[1],)
