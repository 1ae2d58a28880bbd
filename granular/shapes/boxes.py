"""Boxes and half-spaces."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import Any

import numpy as np

from granular.shapes.region import Region
from granular.shapes.shape import (
    TINY,
    Cover,
    Shape,
    axes_about,
    direction,
    rotation_of,
    row_of,
    turned,
)
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import check_fields, positive, set_fields, vector


@dataclass(frozen=True)
class Box(Shape):
    """A box: by two corners, or by its size.

    ``Box((0.0, 0.0), (0.4, 0.2))`` is the same as ``Box(size=(0.4, 0.2), center=(0.2, 0.1))``. As a
    region of a fill a box that is not turned holds the squares of the seeding lattice whose centres
    are in it, its upper faces not included: such boxes usually end on lines of the grid.

    Parameters
    ----------
    lower, upper : tuple of float, length dim, optional
        Corners [m]; their length, 2 or 3, is the dimension. Of a box given by its size they are
        those of the box about it with faces normal to the axes.
    size : tuple of float, length dim, optional
        Lengths of the edges [m], > 0, may be infinite; instead of the corners.
    center : tuple of float, length dim, optional
        Centre [m] of a box given by its size; the origin by default.
    rotation_deg : float or tuple of 3 floats
        Rotation of a box given by its size about its centre: an angle in 2D, a rotation vector in
        3D [degrees].
    {raises}.
    """

    lower: tuple[float, ...] = None  # type: ignore[assignment]  # a corner once made
    upper: tuple[float, ...] = None  # type: ignore[assignment]  # likewise
    _: KW_ONLY
    size: tuple[float, ...] = None  # type: ignore[assignment]  # lengths once made
    center: tuple[float, ...] = None  # type: ignore[assignment]  # a place once made
    rotation_deg: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        by_size = self.size is not None
        if by_size == (self.lower is not None) or by_size == (self.upper is not None):
            raise TypeError(
                f"lower = {self.lower}, upper = {self.upper} and size = {self.size}: a box takes "
                "two corners, or a size"
            )
        set_fields(self, _by_size=by_size)
        (self._check_size if by_size else self._check_corners)()

    def _check_size(self) -> None:
        size = vector("size", self.size, check=partial(positive, allow_inf=True))
        center = (0.0,) * len(size) if self.center is None else self.center
        set_fields(self, size=size, center=vector("center", center, len(size)))
        check_fields(self, rotation_of, "rotation_deg", dim=len(size))
        lower, upper = super().bounds
        set_fields(self, lower=lower, upper=upper)

    def _check_corners(self) -> None:
        if self.center is not None or self.rotation_deg != 0.0:
            raise ValueError(
                f"center = {self.center} and rotation_deg = {self.rotation_deg} must not be given "
                "for a box by its corners: give size and center"
            )
        lower = vector("lower", self.lower)
        upper = vector("upper", self.upper, len(lower))
        for axis, (low, high) in enumerate(zip(lower, upper, strict=True)):
            if not high > low:
                raise ValueError(f"upper[{axis}] = {high} must exceed lower[{axis}] = {low}")
        ends = list(zip(lower, upper, strict=True))
        size = tuple(high - low for low, high in ends)
        center = tuple(0.5 * (low + high) for low, high in ends)
        set_fields(self, lower=lower, upper=upper, size=size, center=center)

    def arguments(self) -> dict[str, Any]:
        """Arguments that make an equal box: corners, or size, centre and rotation, as given."""
        by_size = self.__dict__["_by_size"]
        names = ("size", "center", "rotation_deg") if by_size else ("lower", "upper")
        return {name: getattr(self, name) for name in names}

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self.arguments().items())
        return f"Box({given})"

    @property
    def dim(self) -> int:
        return len(self.size)

    def _axes(self) -> Array:
        return turned(self.rotation_deg).as_matrix()

    def _half(self) -> tuple[float, ...]:
        return tuple(([edge / 2 for edge in self.size] + [math.inf])[:3])

    def rows(self) -> Array:
        return row_of("box", False, self.center, self._axes(), self._half())[None]

    def covers(self) -> list[Cover]:
        return [Cover.of(self.center, self._axes(), self._half())]

    def _breadth(self) -> float:
        return min(self.size)

    def is_endless(self, along: Array) -> bool:
        shares = abs(self._axes().T @ along)
        ends = zip(shares, self._half(), strict=True)
        return any(share > 1 - TINY and half == math.inf for share, half in ends)

    @property
    def is_turned(self) -> bool:
        """True if its faces are not normal to the axes."""
        return bool(np.any(self.rotation_deg))

    @property
    def bounds(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return self.lower, self.upper

    def cut(self, x: Array) -> tuple[Array, Array]:
        return super().cut(x) if self.is_turned else Region.cut(self, x)

    def cuts(self, x: Array, reach: float) -> BoolArray:
        return super().cuts(x, reach) if self.is_turned else Region.cuts(self, x, reach)

    def _inside(self, x: Array) -> BoolArray:
        if self.is_turned:
            return super()._inside(x)
        inside: BoolArray = np.all((x >= self.lower) & (x < self.upper), axis=1)
        return inside

    def depth(self, x: Array, up: Array, step: float) -> Array:
        if self.is_turned:
            return super().depth(x, up, step)
        ends = [
            ((self.upper if along > 0 else self.lower)[axis] - x[:, axis]) / along
            for axis, along in enumerate(up.tolist())
            if along
        ]
        least: Array = np.min(ends, axis=0)
        return least


@dataclass(frozen=True)
class HalfSpace(Shape):
    """The half-space behind a plane.

    Parameters
    ----------
    normal : tuple of float, length dim
        Normal of the plane, out of the solid, of any length.
    through : tuple of float, length dim, optional
        A point of the plane [m]; the origin by default.
    {raises}.
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

    def is_endless(self, along: Array) -> bool:
        return bool(abs(axes_about(self.normal)[:, 2] @ along) < TINY)
