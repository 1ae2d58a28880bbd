"""The grid, and positions on it."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from granular.tools.checks import check_fields, integer, positive, sequence, set_fields, vector
from granular.tools.description import Description

AXES = "xyz"
LINE_TOLERANCE = 1e-9
"""Largest distance, in cells, at which a coordinate still counts as on a grid line, near the
origin; see `Grid.slack`."""
ROUNDINGS = 64
"""Rounding errors of a coordinate that add up in positions made of sums and products of a few
numbers."""
COARSEST = 0.01
"""Largest `Grid.slack`: points nearer to a line than this could not be assigned to a cell."""
MAX_COUNT = 2**31 - 1
"""Largest number of cells or points; the core counts them with 32 bits."""

Vector = tuple[float, ...]


@dataclass(frozen=True)
class Grid(Description):
    """A box of square (cubic) cells. The last axis is up.

    An axisymmetric grid is a plane of the distance r from an axis and the height z, its axes 0 and
    1. Points are rings about the axis: masses, volumes, forces and energies are those of whole
    rings, and there is no motion around the axis. See :doc:`/explanation/axisymmetry`.

    Parameters
    ----------
    lower : tuple of float, length dim
        Lower corner [m]; its length (2 or 3) is the dimension.
    cell : float
        Edge of a cell dx [m], > 0.
    shape : tuple of int, length dim
        Cells along each axis, >= 1.
    periodic : tuple of bool, length dim, optional
        Axes along which the domain is periodic; none by default.
    open_sides : collection of str, optional
        Sides ("x-", "y+", ...) through which points leave for good; none by default, and none along
        a periodic axis.
    axisymmetric : bool, optional
        Whether the plane is one of radius and height, 2D only. Then ``lower[0]`` must be >= 0 (0
        for a domain that reaches the axis of symmetry), and r is not periodic.
    {raises}.
    """

    lower: Vector
    cell: float
    shape: tuple[int, ...]
    periodic: tuple[bool, ...] = ()
    open_sides: frozenset[str] = frozenset()
    axisymmetric: bool = False

    def __post_init__(self) -> None:
        lower = vector("lower", self.lower)
        shape = tuple(
            integer(f"shape[{i}]", n, 1, MAX_COUNT)
            for i, n in enumerate(sequence("shape", self.shape))
        )
        periodic = sequence("periodic", self.periodic) or (False,) * len(lower)
        for name, value in (("shape", shape), ("periodic", periodic)):
            if len(value) != len(lower):
                raise ValueError(f"{name} = {value} must have {len(lower)} entries, as lower")
        if not all(isinstance(flag, (bool, np.bool_)) for flag in periodic):
            raise TypeError(f"periodic = {periodic} must hold True or False")
        if math.prod(shape) > MAX_COUNT:
            raise ValueError(f"shape = {shape} must have at most {MAX_COUNT} cells")
        check_fields(self, positive, "cell")
        set_fields(self, lower=lower, shape=shape, periodic=tuple(map(bool, periodic)))
        if not self.slack <= COARSEST:
            raise ValueError(
                f"cell = {self.cell} must be larger, or the grid nearer to the origin: coordinates "
                f"from {self.lower} to {self.upper} are rounded by up to {self.slack:.2g} cells, "
                f"must be <= {COARSEST}"
            )
        set_fields(self, open_sides=self._checked_sides())
        self._check_axisymmetry()

    def _check_axisymmetry(self) -> None:
        """Refuse an axisymmetric grid that is not a plane of radius and height."""
        if not isinstance(self.axisymmetric, (bool, np.bool_)):
            raise TypeError(f"axisymmetric = {self.axisymmetric!r} must be True or False")
        set_fields(self, axisymmetric=bool(self.axisymmetric))
        if not self.axisymmetric:
            return
        if self.dim != 2:
            raise ValueError(
                f"axisymmetric = True needs a grid in 2D, of radius and height: lower = "
                f"{self.lower} must have 2 entries"
            )
        if not self.lower[0] >= 0.0:
            raise ValueError(f"lower[0] = {self.lower[0]} is a radius, must be >= 0")
        if self.periodic[0]:
            raise ValueError(f"periodic = {self.periodic} must be False along the radius")
        if self.has_axis and "x-" in self.open_sides:
            raise ValueError("open_sides: 'x-' must not be the axis of symmetry")

    @classmethod
    def covering(
        cls,
        lower: Sequence[float],
        upper: Sequence[float],
        cell: float,
        *,
        periodic: Sequence[bool] = (),
        open_sides: Collection[str] = (),
        axisymmetric: bool = False,
    ) -> Self:
        """Return the smallest grid that begins at one corner and reaches another one.

        Parameters
        ----------
        lower, upper : sequence of float, length dim
            Corners to be covered [m]. The grid ends within a cell beyond `upper`.
        cell, periodic, open_sides, axisymmetric
            As of `Grid`.

        Raises
        ------
        TypeError, ValueError
            If an argument is out of range, or `upper` does not exceed `lower`.

        Examples
        --------
        >>> gr.Grid.covering((0.0, 0.0), (1.0, 0.55), 0.1).shape
        (10, 6)
        """
        low, cell = vector("lower", lower), positive("cell", cell)
        high = vector("upper", upper, len(low))
        for axis, (a, b) in enumerate(zip(low, high, strict=True)):
            if not b > a:
                raise ValueError(f"upper[{axis}] = {b} must exceed lower[{axis}] = {a}")
        shape = tuple(steps_between(a, b, cell) for a, b in zip(low, high, strict=True))
        sides = frozenset(open_sides)
        return cls(low, cell, shape, tuple(periodic), sides, axisymmetric)

    def _checked_sides(self) -> frozenset[str]:
        if isinstance(self.open_sides, str):
            raise TypeError(f"open_sides = {self.open_sides!r} must be a set of sides")
        sides = frozenset(self.open_sides)
        allowed = {axis + end for axis in AXES[: self.dim] for end in "-+"}
        for side in sorted(map(str, sides)):
            if side not in allowed:
                raise ValueError(f"open_sides: {side!r} must be one of {sorted(allowed)}")
            if self.periodic[AXES.index(side[0])]:
                raise ValueError(f"open_sides: {side!r} must not end a periodic axis")
        return sides

    @property
    def has_axis(self) -> bool:
        """True if the axis of symmetry of an axisymmetric grid is its side "x-"."""
        return self.axisymmetric and self.lower[0] == 0.0

    def rings(self, x: NDArray[np.float64]) -> NDArray[np.float64] | float:
        """Circumference [m] of the rings at positions of shape (..., dim); 1 in other grids."""
        return 2.0 * math.pi * x[..., 0] if self.axisymmetric else 1.0

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return len(self.lower)

    @property
    def upper(self) -> Vector:
        """Upper corner [m]."""
        return tuple(x + n * self.cell for x, n in zip(self.lower, self.shape, strict=True))

    @property
    def dim_of_whole(self) -> int:
        """Dimension of the set-up that it stands for: 3 for an axisymmetric plane."""
        return 3 if self.axisymmetric else self.dim

    @property
    def rounding(self) -> float:
        """Rounding of the coordinates of the grid [cells]."""
        return max(rounding(self.cell, *self.lower, *self.upper), rounding(1.0, *self.shape))

    @property
    def slack(self) -> float:
        """Largest distance [cells] at which a coordinate counts as on a grid line."""
        return max(LINE_TOLERANCE, ROUNDINGS * self.rounding)

    def line(self, name: str, axis: int, at: float) -> int:
        """Index of the grid line at coordinate `at` [m] of `axis`; `name` is for the message.

        Raises
        ------
        ValueError
            If there is none within the `slack`.
        """
        place = (at - self.lower[axis]) / self.cell
        line = round(place)
        if abs(place - line) > self.slack or not 0 <= line <= self.shape[axis]:
            raise ValueError(
                f"{name} = {at} must lie on a grid line of {AXES[axis]}: from"
                f" {self.lower[axis]} to {self.upper[axis]} in steps of {self.cell}"
            )
        return line


def rounding(step: float, *coordinates: float) -> float:
    """Rounding of coordinates [m], over a step [m]."""
    return float(np.finfo(float).eps) * (max(map(abs, coordinates)) / step)


def steps_between(low: float, high: float, step: float) -> int:
    """Number of steps [m] from one coordinate to another, the last of which may reach beyond it."""
    slack = max(LINE_TOLERANCE, ROUNDINGS * rounding(step, low, high))
    return math.ceil((high - low) / step - slack)


def combined(axes: Sequence[NDArray]) -> NDArray:
    """All combinations of coordinates along axes, shape (n, dim), the first axis fastest."""
    mesh = np.meshgrid(*axes[::-1], indexing="ij")
    return np.stack([coordinate.ravel() for coordinate in mesh[::-1]], axis=1)
