"""Walls, blocks, absorbing layers and gravity: what acts on the material from outside."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from granular.checks import finite, integer, non_negative, one_of, positive, vector
from granular.geometry import AXES, LINE_TOLERANCE, Grid

__all__ = ["Absorber", "Gravity", "Solid", "Wall"]

Span = tuple[float, float]


def _spans(value: object) -> tuple[Span, ...]:
    if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)):
        raise TypeError(f"span = {value!r} must be pairs (low, high), one for each other axis")
    if len(value) not in (1, 2):
        raise ValueError(f"span = {value!r} must be pairs (low, high), one for each other axis")
    spans = tuple(vector(f"span[{i}]", pair, 2) for i, pair in enumerate(value))
    for i, (low, high) in enumerate(spans):
        if not high > low:
            raise ValueError(f"span[{i}] = {(low, high)} must have its low end first")
    return spans


@dataclass(frozen=True)
class Wall:
    """A flat wall on a grid line, at the end of the grid or within it.

    Parameters
    ----------
    axis : int
        Axis normal to the wall.
    at : float
        Coordinate along `axis` [m]; must be that of a grid line.
    kind : {"rough", "frictionless", "coulomb"}
        "rough" holds all velocity components, "frictionless" only the normal one (a symmetry
        plane is the same), "coulomb" the normal one with friction along the wall
        (Dunatunga & Kamrin 2015, section 4).
    friction : float
        Coefficient of a "coulomb" wall, >= 0.
    span : tuple of (low, high), or None
        Extent along each *other* axis in their order [m], on grid lines; None for all of it.
    opens_at : float
        From this time on [s] the wall is gone.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    axis: int
    at: float
    _: KW_ONLY
    kind: str = "rough"
    friction: float = 0.0
    span: tuple[Span, ...] | None = None
    opens_at: float = math.inf

    def __post_init__(self) -> None:
        kind = one_of("kind", self.kind, ("rough", "frictionless", "coulomb"))
        friction = non_negative("friction", self.friction)
        if friction and kind != "coulomb":
            raise ValueError(f'friction = {friction} must be 0 unless kind is "coulomb"')
        span = None if self.span is None else _spans(self.span)
        checked: dict[str, object] = {
            "axis": integer("axis", self.axis, 0, 2 if span is None else len(span)),
            "at": finite("at", self.at),
            "friction": friction,
            "span": span,
            "opens_at": non_negative("opens_at", self.opens_at, allow_inf=True),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def extent(self, grid: Grid, axis: int) -> Span:
        """From where to where it reaches along another `axis` [m]."""
        if self.span is None:
            return grid.lower[axis], grid.upper[axis]
        return self.span[axis - (axis > self.axis)]

    def check(self, name: str, grid: Grid) -> None:
        """Refuse what does not fit the grid: its dimension, its periodic axes, its lines."""
        if self.axis >= grid.dim or (self.span is not None and len(self.span) != grid.dim - 1):
            raise ValueError(f"{name} = {self} must have the grid's dimension {grid.dim}")
        if grid.periodic[self.axis]:
            raise ValueError(f"{name} = {self} must not be normal to the periodic axis")
        grid.line(f"{name}.at", self.axis, self.at)
        for axis in range(grid.dim):
            if axis != self.axis:
                for end in self.extent(grid, axis):
                    grid.line(f"{name}.span along {AXES[axis]}", axis, end)


@dataclass(frozen=True)
class Solid:
    """An axis-aligned block that material cannot enter; several of them make a staircase.

    With quadratic splines a block is soft by up to half a cell, because only walls make creases:
    put a `Wall` on a face that has to be sharp.

    Parameters
    ----------
    lower, upper : tuple of float, length dim
        Corners [m], on grid lines.
    kind : {"rough", "frictionless"}
        "frictionless" faces hold the velocity normal to them; where two of them meet, both
        components are held. Ends of the grid are no faces.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    _: KW_ONLY
    kind: str = "rough"

    def __post_init__(self) -> None:
        lower = vector("lower", self.lower)
        upper = vector("upper", self.upper, len(lower))
        for axis, (low, high) in enumerate(zip(lower, upper, strict=True)):
            if not high > low:
                raise ValueError(f"upper[{axis}] = {high} must exceed lower[{axis}] = {low}")
        one_of("kind", self.kind, ("rough", "frictionless"))
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)

    def check(self, name: str, grid: Grid) -> None:
        """Refuse what does not fit the grid."""
        if len(self.lower) != grid.dim:
            raise ValueError(f"{name} = {self} must have the grid's dimension {grid.dim}")
        for axis in range(grid.dim):
            grid.line(f"{name}.lower[{axis}]", axis, self.lower[axis])
            grid.line(f"{name}.upper[{axis}]", axis, self.upper[axis])


@dataclass(frozen=True)
class Absorber:
    """A layer that swallows elastic waves: points beyond `above` that rise are slowed down.

    Parameters
    ----------
    axis : int
        Along which they rise.
    above : float
        Where the layer begins [m].
    rate : float
        1/s: after a step the upward velocity of its points is exp(-rate dt) of what it would be.
        Infinity stops them at once, as published; but then what is too dense expands no faster
        than g dt, and a bed that has been pressed together stays so for many thousand steps. A
        wave that rises dies out over the length c/rate.
    """

    axis: int
    above: float
    rate: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", integer("axis", self.axis, 0, 2))
        object.__setattr__(self, "above", finite("above", self.above))
        if self.rate != math.inf:
            object.__setattr__(self, "rate", positive("rate", self.rate))

    def check(self, name: str, grid: Grid) -> None:
        """Refuse what does not fit the grid."""
        if self.axis >= grid.dim:
            raise ValueError(f"{name} = {self} must have the grid's dimension {grid.dim}")
        if grid.periodic[self.axis]:
            raise ValueError(f"{name} = {self} must not be normal to the periodic axis")
        low, high = grid.lower[self.axis], grid.upper[self.axis]
        if not low <= self.above < high - LINE_TOLERANCE * grid.cell:
            raise ValueError(f"{name}.above = {self.above} must be in [{low}, {high})")


@dataclass(frozen=True)
class Gravity:
    """Gravity that is linear between given times, and constant before and after them.

    Parameters
    ----------
    times : tuple of float, length k >= 1
        Seconds, >= 0, ascending.
    vectors : tuple of k tuples of float, length dim
        Acceleration at these times [m/s2].

    The default is the ramp of Dunatunga & Kamrin 2015, section 4: 9.8 m/s2 in 0.1 s.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    times: tuple[float, ...] = (0.0, 0.1)
    vectors: tuple[tuple[float, ...], ...] = ((0.0, 0.0), (0.0, -9.8))

    def __post_init__(self) -> None:
        for name in ("times", "vectors"):
            value = getattr(self, name)
            if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)):
                raise TypeError(f"{name} = {value!r} must be a sequence")
        times = tuple(non_negative(f"times[{i}]", t) for i, t in enumerate(self.times))
        if not times or len(times) != len(self.vectors):
            raise ValueError(f"times = {times} must be as many as vectors, and at least one")
        if any(b <= a for a, b in pairwise(times)):
            raise ValueError(f"times = {times} must ascend")
        vectors = [vector("vectors[0]", self.vectors[0])]
        for i, value in enumerate(self.vectors[1:], start=1):
            vectors.append(vector(f"vectors[{i}]", value, len(vectors[0])))
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "vectors", tuple(vectors))

    @property
    def dim(self) -> int:
        """2 or 3."""
        return len(self.vectors[0])

    def at(self, t: float) -> NDArray[np.float64]:
        """Acceleration at time `t` [s], shape (dim,) [m/s2]."""
        t = finite("t", t)
        return np.array([np.interp(t, self.times, g) for g in zip(*self.vectors, strict=True)])
