"""Walls, blocks, absorbing layers and gravity: what acts on the material from outside."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass

import numpy as np

from granular.checks import finite, integer, non_negative, one_of, positive, vector
from granular.geometry import AXES, LINE_TOLERANCE, Grid

__all__ = ["Solid", "SpongeLayer", "Wall"]

Span = tuple[float, float]


def _spans(value: object) -> tuple[Span, ...]:
    if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)):
        raise TypeError(f"span = {value!r} must be pairs (low, high), one for each other axis")
    if len(value) not in (1, 2):
        raise ValueError(f"span = {value!r} must be pairs (low, high), one for each other axis")
    spans = []
    for i, pair in enumerate(value):
        low, high = vector(f"span[{i}]", pair, 2)
        if not high > low:
            raise ValueError(f"span[{i}] = {(low, high)} must have its low end first")
        spans.append((low, high))
    return tuple(spans)


@dataclass(frozen=True)
class Wall:
    """A flat wall on a grid line, at the end of the grid or within it.

    Parameters
    ----------
    axis : int
        Axis normal to the wall.
    at : float
        Coordinate along `axis` [m]; must be that of a grid line.
    kind : {"no_slip", "free_slip", "coulomb"}
        "no_slip" holds all velocity components, "free_slip" only the normal one (a symmetry
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
    kind: str = "no_slip"
    friction: float = 0.0
    span: tuple[Span, ...] | None = None
    opens_at: float = math.inf

    def __post_init__(self) -> None:
        kind = one_of("kind", self.kind, ("no_slip", "free_slip", "coulomb"))
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

    With quadratic splines a block is soft by up to half a cell, because only walls make c0_lines:
    put a `Wall` on a face that has to be sharp.

    Parameters
    ----------
    lower, upper : tuple of float, length dim
        Corners [m], on grid lines.
    kind : {"no_slip", "free_slip"}
        "free_slip" faces hold the velocity normal to them; where two of them meet, both
        components are held. Ends of the grid are no faces.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    _: KW_ONLY
    kind: str = "no_slip"

    def __post_init__(self) -> None:
        lower = vector("lower", self.lower)
        upper = vector("upper", self.upper, len(lower))
        for axis, (low, high) in enumerate(zip(lower, upper, strict=True)):
            if not high > low:
                raise ValueError(f"upper[{axis}] = {high} must exceed lower[{axis}] = {low}")
        one_of("kind", self.kind, ("no_slip", "free_slip"))
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
class SpongeLayer:
    """A layer that swallows elastic waves: points beyond `above` that rise are slowed down.

    Parameters
    ----------
    axis : int
        Along which they rise.
    above : float
        Where the layer begins [m].
    damping : float
        1/s: after a step the upward velocity of its points is exp(-damping dt) of what it would be.
        Infinity stops them at once, as published; but then what is too dense expands no faster
        than g dt, and a bed that has been pressed together stays so for many thousand steps. A
        wave that rises dies out over the length c/damping.
    """

    axis: int
    above: float
    damping: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", integer("axis", self.axis, 0, 2))
        object.__setattr__(self, "above", finite("above", self.above))
        if self.damping != math.inf:
            object.__setattr__(self, "damping", positive("damping", self.damping))

    def check(self, name: str, grid: Grid) -> None:
        """Refuse what does not fit the grid."""
        if self.axis >= grid.dim:
            raise ValueError(f"{name} = {self} must have the grid's dimension {grid.dim}")
        if grid.periodic[self.axis]:
            raise ValueError(f"{name} = {self} must not be normal to the periodic axis")
        low, high = grid.lower[self.axis], grid.upper[self.axis]
        if not low <= self.above < high - LINE_TOLERANCE * grid.cell:
            raise ValueError(f"{name}.above = {self.above} must be in [{low}, {high})")
