"""Surfaces by their heights, and layers on them.

Functions and bodies are sampled when a surface is made, so that it can be written into a record.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from granular.model.grid import MAX_COUNT, combined, steps_between
from granular.shapes.operations import least
from granular.shapes.region import Region
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import array, check_fields, finite, positive, set_fields, vector
from granular.tools.description import Description
from granular.tools.serializable import ComparedByContent

Vector = tuple[float, ...]

MOST_ROUNDS = 2000
"""Number of steps by the distance from a body after which a search for its surface from above
fails."""

FARTHEST = 1e9
"""Distance from the position of a body within which its surface is searched, over its size."""


@runtime_checkable
class Surface(Protocol):
    """Something with a height."""

    def height(self, x: ArrayLike) -> Array:
        """Height [m] at horizontal positions, shape (n, dim - 1) [m]; shape (n,)."""


@runtime_checkable
class HasDistance(Protocol):
    """Something with a signed distance, such as a `granular.Body`."""

    @property
    def position(self) -> tuple[float, ...]:
        """A position from which its surface is searched [m]."""

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Signed distance [m], shape (n,), and outward normal, shape (n, dim)."""


Source = float | Callable[..., ArrayLike] | Surface | HasDistance


def _level(name: str, value: object, dim: int | None = None) -> Vector:
    """Return a horizontal position as a tuple of 1 or 2 floats; in 2D a number is allowed."""
    if isinstance(value, (int, float, np.number)):
        value = (value,)
    count = len(value) if isinstance(value, (Sequence, np.ndarray)) else 0
    if count not in ((1, 2) if dim is None else (dim,)):
        wanted = "1 or 2 numbers" if dim is None else f"{dim} numbers"
        raise ValueError(f"{name} = {value!r} must be {wanted}")
    return vector(name, value, count)


@dataclass(frozen=True, eq=False, repr=False)
class Heights(ComparedByContent, Description):
    """A surface by its heights on a regular grid, linear (bilinear) in between.

    Beyond the grid it continues at the height of its edge.

    Parameters
    ----------
    z : array_like, shape (n_x,) in 2D, (n_x, n_y) in 3D
        Heights [m], at least 2 along each axis.
    lower : tuple of float, length dim - 1
        Position of the first height [m].
    spacing : float
        Distance between heights along each axis [m], > 0.
    {raises}.
    """

    z: Array
    lower: Vector
    spacing: float

    def __post_init__(self) -> None:
        check_fields(self, _level, "lower")
        check_fields(self, positive, "spacing")
        check_fields(self, array, "z", shape=(None,) * len(self.lower))
        if min(self.z.shape) < 2:
            raise ValueError(f"z of shape {self.z.shape} must have at least 2 heights each way")

    def between(self, lower: Vector, upper: Vector) -> Array:
        """Heights between two positions and next to them, which bound the surface there."""
        ends = zip(lower, upper, self.lower, self.z.shape, strict=True)
        part = tuple(
            slice(
                min(max(math.floor((low - first) / self.spacing), 0), n - 1),
                min(max(math.ceil((high - first) / self.spacing), 0), n - 1) + 1,
            )
            for low, high, first, n in ends
        )
        heights: Array = self.z[part]
        return heights

    @classmethod
    def of(cls, source: Source, lower: Any, upper: Any, spacing: float) -> Self:
        """Sample a surface.

        Parameters
        ----------
        source : float, callable, body, or object with a method ``height(x)``
            A callable takes the arrays x (and y) and returns heights [m]. Of a body it is the
            uppermost surface above its position, or below if the position is in the open.
        lower, upper : float or tuple of float, length dim - 1
            Ends between which it is sampled [m].
        spacing : float
            Distance between samples [m].

        Raises
        ------
        ValueError
            Also if a body has no surface above or below a position.
        """
        low = _level("lower", lower)
        high = _level("upper", upper, len(low))
        step = positive("spacing", spacing)
        if not all(a < b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"upper = {high} must exceed lower = {low}")
        counts = [max(steps_between(a, b, step), 1) + 1 for a, b in zip(low, high, strict=True)]
        if math.prod(counts) > MAX_COUNT:
            raise ValueError(f"spacing = {step} must make at most {MAX_COUNT} heights")
        x = combined([a + step * np.arange(n) for a, n in zip(low, counts, strict=True)])
        z = np.array(np.broadcast_to(_heights_of(source, x), len(x)), dtype=float)
        return cls(z.reshape(counts, order="F"), low, step)

    @property
    def steepest(self) -> float:
        """Bound of the slope of the surface: the tangent of its angle with the horizontal."""
        slopes = [np.abs(np.diff(self.z, axis=axis)).max() for axis in range(self.z.ndim)]
        return math.hypot(*slopes) / self.spacing

    def slope(self, x: ArrayLike) -> Array:
        """Slopes of the surface at horizontal positions, shape (n, dim - 1)."""
        small = 1e-3 * self.spacing
        x = np.asarray(x, dtype=float)
        slopes = [
            (self.height(x + small * e) - self.height(x - small * e)) / (2 * small)
            for e in np.eye(len(self.lower))
        ]
        return np.stack(slopes, axis=1)

    def height(self, x: ArrayLike) -> Array:
        """Heights [m] at horizontal positions, shape (n, dim - 1) [m]; shape (n,)."""
        place = (np.asarray(x, dtype=float) - self.lower) / self.spacing
        last = np.array(self.z.shape) - 1
        place = np.clip(place, 0.0, last)
        first = np.minimum(place.astype(np.int64), last - 1)
        share = place - first
        if len(last) == 1:
            (i,), (s,) = first.T, share.T
            return (1 - s) * self.z[i] + s * self.z[i + 1]
        (i, j), (s, t) = first.T, share.T
        low = (1 - s) * self.z[i, j] + s * self.z[i + 1, j]
        high = (1 - s) * self.z[i, j + 1] + s * self.z[i + 1, j + 1]
        return (1 - t) * low + t * high


def _heights_of(source: Source, x: Array) -> ArrayLike:
    if isinstance(source, Surface):
        return source.height(x)
    if isinstance(source, HasDistance):
        return _uppermost(source, x)
    if callable(source):
        return source(*x.T)
    return finite("source", source)


def _uppermost(body: HasDistance, x: Array) -> Array:
    """Height of the uppermost surface of a body above or below its position, at x (n, d - 1).

    The search goes down, by the distance from the surface, which no step can cross: from the
    position where that is in the open, else from above the body, or, if it is endless, from where
    growing steps up come into the open.
    """
    start = body.position[-1]
    z = np.full(len(x), start)
    reach = float(np.max(body.extents())) if hasattr(body, "extents") else np.inf
    size = reach if reach < np.inf else max(np.ptp(x, axis=0).max(initial=0.0), abs(start)) or 1.0

    def above() -> Array:
        return body.distance(np.column_stack([x, z]))[0]

    rise = 1.01 * size if reach < np.inf else 1e-3 * size
    while (solid := above() <= 0).any():
        z[solid] += rise
        rise *= 2
        if rise > FARTHEST * size:
            raise ValueError(
                f"the body must have a surface above {tuple(x[solid.argmax()].tolist())}"
            )
    for _ in range(MOST_ROUNDS):
        phi = above()
        z -= phi
        if phi.max() < 1e-10 * size + 4 * np.spacing(np.abs(z).max()):
            return z
        if z.min() < start - FARTHEST * size:
            raise ValueError(f"the body must have a surface below {tuple(x[z.argmin()].tolist())}")
    raise ValueError(f"the surface of the body is too steep at {tuple(x[phi.argmax()].tolist())}")


@dataclass(frozen=True, eq=False, repr=False)
class Layer(ComparedByContent, Region):
    """The region above a surface up to a thickness, measured vertically.

    Parameters
    ----------
    on : float, Heights, callable, body, or object with a method ``height(x)``
        Surface at the bottom [m]; see `Heights.of`.
    thickness : float, Heights, callable or array_like
        Thickness [m], >= 0. An array holds the values from `lower` on, at distances `spacing`.
    lower, upper : float or tuple of float, length dim - 1
        Horizontal ends [m].
    spacing : float, optional
        Distance at which functions and bodies are sampled [m]: at most that of the seeding lattice
        is recommended.
    {raises}.
    """

    on: float | Heights
    thickness: float | Heights
    lower: Vector
    upper: Vector
    _: KW_ONLY
    spacing: float | None = None

    def __post_init__(self) -> None:
        check_fields(self, _level, "lower")
        check_fields(self, _level, "upper", dim=len(self.lower))
        check_fields(self, positive, "spacing", optional=True)
        for axis, (low, high) in enumerate(zip(self.lower, self.upper, strict=True)):
            if not high > low:
                raise ValueError(f"upper[{axis}] = {high} must exceed lower[{axis}] = {low}")
        set_fields(self, on=self._sampled("on"), thickness=self._sampled("thickness"))
        thickness = self.thickness
        least = thickness.z.min() if isinstance(thickness, Heights) else thickness
        most = thickness.z.max() if isinstance(thickness, Heights) else thickness
        if not least >= 0 or not most > 0:
            raise ValueError(f"thickness must be >= 0 and somewhere > 0, is {least} to {most}")

    def _sampled(self, name: str) -> float | Heights:
        value = getattr(self, name)
        if isinstance(value, (int, float, np.number)) and not isinstance(value, bool):
            return finite(name, value)
        if isinstance(value, Heights):
            if len(value.lower) != len(self.lower):
                raise ValueError(f"{name} must have heights along {len(self.lower)} axes")
            return value
        if self.spacing is None:
            raise ValueError(f"spacing = None must be a number where {name} is to be sampled")
        if isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, str):
            return Heights(np.asarray(value), self.lower, self.spacing)
        if not (callable(value) or isinstance(value, (Surface, HasDistance))):
            raise TypeError(f"{name} = {value!r} must be a number, an array, a function or a body")
        return Heights.of(value, self.lower, self.upper, self.spacing)

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        on, thickness = self.on, self.thickness
        bottom, extra = (
            part.between(self.lower, self.upper) if isinstance(part, Heights) else np.array(part)
            for part in (on, thickness)
        )
        alike = (
            not isinstance(on, Heights)
            or not isinstance(thickness, Heights)
            or (on.lower, on.spacing, on.z.shape)
            == (thickness.lower, thickness.spacing, thickness.z.shape)
        )
        top = (bottom + extra).max() if alike else bottom.max() + extra.max()
        return (*self.lower, float(bottom.min())), (*self.upper, float(top))

    def cuts(self, x: Array, reach: float) -> BoolArray:
        low, high = self._ends(x)
        parts = [part for part in (self.on, self.thickness) if isinstance(part, Heights)]
        margin = reach * math.hypot(1.0, sum(part.steepest for part in parts))
        z, level = x[:, -1], x[:, :-1]
        bottom, top = np.abs(z - low) <= margin, np.abs(z - high) <= margin
        gaps = np.minimum(np.abs(level - self.lower), np.abs(level - self.upper))
        sides = (gaps <= reach).any(axis=1) & (z >= low - margin) & (z <= high + margin)
        near: BoolArray = bottom | top | sides
        return near

    def cut(self, x: Array) -> tuple[Array, Array]:
        level = x[:, :-1]
        surfaces = []
        slope = np.zeros_like(level)
        for sign, z, part in zip((1, -1), self._ends(x), (self.on, self.thickness), strict=True):
            if isinstance(part, Heights):
                slope = slope + part.slope(level)
            upwards = np.column_stack([-slope, np.ones(len(x))])
            size = np.linalg.norm(upwards, axis=1)
            surfaces.append((sign * (x[:, -1] - z) / size, sign * upwards / size[:, None]))
        for axis, ends in enumerate(zip(self.lower, self.upper, strict=True)):
            for sign, end in zip((1, -1), ends, strict=True):
                inwards = np.zeros_like(x)
                inwards[:, axis] = sign
                surfaces.append((sign * (x[:, axis] - end), inwards))
        depth, inwards = least(surfaces)
        return -depth, -inwards

    def _ends(self, x: Array) -> tuple[Array, Array]:
        level = x[:, :-1]
        low, extra = (
            part.height(level) if isinstance(part, Heights) else np.full(len(x), part)
            for part in (self.on, self.thickness)
        )
        return low, low + extra

    def _inside(self, x: Array) -> BoolArray:
        low, high = self._ends(x)
        level = np.all((x[:, :-1] >= self.lower) & (x[:, :-1] < self.upper), axis=1)
        inside: BoolArray = level & (x[:, -1] >= low) & (x[:, -1] < high)
        return inside

    def depth(self, x: Array, up: Array, step: float) -> Array:
        if up[-1] < 1.0:
            return super().depth(x, up, step)
        below: Array = np.maximum(self._ends(x)[1] - x[:, -1], 0.0)
        return below
