"""Walls, blocks and sponge layers, the fixed boundaries of the material.

A new kind of boundary is a class derived from `WallOrBlock` in `BOUNDARIES`, a new boundary
condition an entry of `RULES`. Other modules use these only.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass, replace
from typing import ClassVar, Self

import numpy as np

from granular.model.boundary import Boundary, Span
from granular.model.grid import AXES, Grid
from granular.shapes import Box
from granular.tools.arrays import Array
from granular.tools.checks import (
    check_fields,
    finite,
    integer,
    non_negative,
    one_of,
    positive,
    set_fields,
    spans,
    vector,
)
from granular.tools.description import Description

ABOVE, BELOW = 1, 2
"""Bits for the sides of a face on which material may be."""

Face = tuple[Array, Array, int, int]
"""Lower and upper corner [m], axis, and sides of a face."""


@dataclass(frozen=True)
class Rule:
    """A boundary condition of walls and blocks.

    Attributes
    ----------
    sticks : bool
        True if all velocity components are held, and the fluidity is 0; else the normal one.
    rubs : bool
        True if there is friction along the surface.
    order : float
        Rank of a wall when an impulse along several is attributed to one; inf if there is none.
    """

    sticks: bool = False
    rubs: bool = False
    order: float = math.inf


RULES = {
    "no_slip": Rule(sticks=True, order=1.0),
    "free_slip": Rule(),
    "coulomb": Rule(rubs=True, order=3.0),
}
"""Rules by the `kind` of walls; blocks have those without friction."""


class WallOrBlock(Boundary):
    """Base of the walls and blocks of the material point method.

    Attributes
    ----------
    quantities : dict
        Quantities of its fields, see `granular.mpm.scaling`.
    """

    quantities: ClassVar[dict[str, str]]
    kind: str
    friction: float
    span: tuple[Span, ...] | None
    opens_at: float
    pressure: float | None

    @property
    def rule(self) -> Rule:
        """Boundary condition of its `kind`."""
        return RULES[self.kind]

    @property
    def slips(self) -> bool:
        return not self.rule.sticks and not self.rule.rubs

    @property
    def rubs(self) -> bool:
        return self.rule.rubs

    @property
    def gone_from(self) -> float:
        return self.opens_at

    @abstractmethod
    def check(self, name: str, grid: Grid) -> None:
        """Raise if it does not fit the dimension, the periodic axes or the lines of the grid."""

    @abstractmethod
    def faces(self, grid: Grid) -> Iterator[Face]:
        """Yield its faces: both sides of a wall, or the faces of a block."""

    @abstractmethod
    def order(self, axis: int) -> tuple[float, float]:
        """Rank when an impulse along an axis is attributed to one of several; least first."""

    @abstractmethod
    def above(self, grid: Grid, at: float, beyond: float) -> Self | None:
        """Part at x > `at`; None if no part is at x > `beyond` [m]."""


def _check_axis(part: Wall | SpongeLayer, name: str, grid: Grid) -> None:
    """Refuse a part whose axis the grid does not have, or along which the grid is periodic."""
    if part.axis >= grid.dim:
        raise ValueError(f"{name} = {part} must have the grid's dimension {grid.dim}")
    if grid.periodic[part.axis]:
        raise ValueError(f"{name} = {part} must not be normal to the periodic axis")


@dataclass(frozen=True)
class Wall(WallOrBlock):
    """A flat wall on a grid line, at the end of the grid or within it.

    Parameters
    ----------
    axis : int
        Axis normal to the wall, from 0 on; not a periodic one.
    at : float
        Coordinate along `axis` [m]; must be on a grid line.
    kind : {"no_slip", "free_slip", "coulomb"}
        "no_slip" holds all velocity components at zero, "free_slip" only the normal one (as does a
        symmetry plane). "coulomb" holds the normal one, with friction along the wall (Dunatunga &
        Kamrin 2015, section 4), while material moves into it: material leaves the wall freely. A
        "coulomb" wall within the grid, which may have material on both sides, holds it both ways.
    friction : float
        Friction coefficient of a "coulomb" wall, >= 0; must be 0 for other kinds. The friction is
        at most `friction` times the normal force on the wall.
    span : tuple of (low, high), or None
        Extent along each *other* axis in their order [m], on grid lines; None for all of it.
    opens_at : float
        Time [s], >= 0, from which on the wall does not exist.
    velocity : tuple of float, length dim, or None
        Velocity of a "no_slip" wall along itself [m/s], constant; None for 0. Where it meets
        another wall or block, components in which the two differ are 0.
    pressure : float or None
        Mean normal stress on the wall [Pa], > 0, that a servo keeps; None for a wall that is fixed.
        The wall must be an end of the grid, without a `span`, and the only one with a pressure. It
        moves outwards by u, but as u is far less than a cell, it stays where it is on the grid, and
        its motion is a uniform change u/H of the volume of all connected material, H the extent of
        the grid along `axis`: d(u/H)/dt = (F/A - P)/(K T), with F the force on the wall, A the
        area of that side of the grid, and T the time in which a compression wave crosses 8 cells.
        `WallState.displacement` is u. The wall waits while material fills less than half of its
        nodes, and after `opens_at`.
    {raises}.
    """

    axis: int
    at: float
    _: KW_ONLY
    kind: str = "no_slip"
    friction: float = 0.0
    span: tuple[Span, ...] | None = None
    opens_at: float = math.inf
    velocity: tuple[float, ...] | None = None
    pressure: float | None = None
    quantities: ClassVar = {
        **{"at": "length", "span": "length", "opens_at": "time"},
        **{"velocity": "velocity", "pressure": "stress"},
    }

    def __post_init__(self) -> None:
        one_of("kind", self.kind, RULES)
        friction = non_negative("friction", self.friction)
        if friction and not self.rule.rubs:
            raise ValueError(f'friction = {friction} must be 0 unless kind is "coulomb"')
        check_fields(self, spans, "span", optional=True)
        check_fields(self, integer, "axis", low=0, high=2 if self.span is None else len(self.span))
        check_fields(self, finite, "at")
        check_fields(self, non_negative, "friction")
        check_fields(self, non_negative, "opens_at", allow_inf=True)
        if self.velocity is not None:
            set_fields(self, velocity=vector("velocity", self.velocity))
            if not self.rule.sticks:
                raise ValueError(
                    f'velocity = {self.velocity} must be None unless kind is "no_slip"'
                )
        if self.pressure is not None:
            check_fields(self, positive, "pressure")
            if self.span is not None:
                raise ValueError(f"span = {self.span} must be None with a pressure")

    @property
    def is_flat(self) -> bool:
        return True

    def extent(self, grid: Grid, axis: int) -> Span:
        if axis == self.axis:
            return self.at, self.at
        if self.span is None:
            return grid.lower[axis], grid.upper[axis]
        return self.span[axis - (axis > self.axis)]

    def in_words(self) -> str:
        text = f"{self.kind.replace('_', '-')} wall"
        if self.rule.rubs:
            text = f"{self.kind.title()} wall, friction {self.friction:g}"
        if any(self.velocity or ()):
            text += f", {math.hypot(*self.velocity or ()):g} m/s"
        if self.pressure is not None:
            text += f", keeps {self.pressure:g} Pa"
        return text if self.opens_at == math.inf else f"{text}, opens at {self.opens_at:g} s"

    def faces(self, grid: Grid) -> Iterator[Face]:
        yield *self.corners(grid), self.axis, ABOVE | BELOW

    def order(self, axis: int) -> tuple[float, float]:
        return (0.0, 0.0) if axis == self.axis else (self.rule.order, -self.friction)

    def above(self, grid: Grid, at: float, beyond: float) -> Self | None:
        low, high = self.extent(grid, 0)
        if high <= beyond:
            return None
        if self.axis == 0 or self.span is None:
            return self
        return replace(self, span=((max(low, at), high), *self.span[1:]))

    def check(self, name: str, grid: Grid) -> None:
        _check_axis(self, name, grid)
        if self.span is not None and len(self.span) != grid.dim - 1:
            raise ValueError(f"{name} = {self} must have the grid's dimension {grid.dim}")
        if self.velocity is not None and len(self.velocity) != grid.dim:
            raise ValueError(f"{name} = {self} must have the grid's dimension {grid.dim}")
        if self.velocity is not None and self.velocity[self.axis]:
            across = f"{name}.velocity[{self.axis}] = {self.velocity[self.axis]}"
            raise ValueError(f"{across} must be 0: a wall moves along itself")
        line = grid.line(f"{name}.at", self.axis, self.at)
        if self.pressure is not None and line not in (0, grid.shape[self.axis]):
            ends = grid.lower[self.axis], grid.upper[self.axis]
            raise ValueError(
                f"{name}.at = {self.at} must be an end of the grid, one of {ends}, with a pressure"
            )
        for axis in range(grid.dim):
            if axis != self.axis:
                for end in self.extent(grid, axis):
                    grid.line(f"{name}.span along {AXES[axis]}", axis, end)


@dataclass(frozen=True)
class Solid(WallOrBlock):
    """An axis-aligned block that material cannot enter; several of them make a staircase.

    Blocks that touch act as one: where they meet there is no face. With quadratic splines only a
    face that crosses the whole domain, as that of a floor, is sharp. Others are blurred by up to
    half a cell: a layer that starts on one first drops by a part of a cell, and bounces for long if
    it is elastic; single points that hit a block fast can end up to a cell within it. Put a `Wall`
    on a face that has to be sharp. The indicator "in_solids" of `Simulation.health` is the share of
    the points deeper than that.

    Parameters
    ----------
    lower, upper : tuple of float, length dim
        Corners [m], on grid lines.
    kind : {"no_slip", "free_slip"}
        "no_slip" holds all velocity components at zero. "free_slip" faces hold the component normal
        to them; where two faces meet at an edge, both components are held. Ends of the grid are not
        faces.
    {raises}.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    _: KW_ONLY
    kind: str = "no_slip"
    axis = span = velocity = pressure = None
    friction, opens_at = 0.0, math.inf
    quantities: ClassVar = {"lower": "length", "upper": "length"}

    def __post_init__(self) -> None:
        box = Box(self.lower, self.upper)
        one_of("kind", self.kind, (kind for kind, rule in RULES.items() if not rule.rubs))
        set_fields(self, lower=box.lower, upper=box.upper)

    def extent(self, grid: Grid, axis: int) -> Span:
        return self.lower[axis], self.upper[axis]

    def in_words(self) -> str:
        return f"block, {self.kind.replace('_', '-')}"

    def faces(self, grid: Grid) -> Iterator[Face]:
        low, high = self.corners(grid)
        for axis, at in enumerate(np.eye(grid.dim, dtype=bool)):
            yield np.where(at, high, low), high, axis, ABOVE
            yield low, np.where(at, low, high), axis, BELOW

    def order(self, axis: int) -> tuple[float, float]:
        return (2.0 if self.rule.sticks else 4.0, 0.0)

    def above(self, grid: Grid, at: float, beyond: float) -> Self | None:
        if self.upper[0] <= beyond:
            return None
        return replace(self, lower=(max(self.lower[0], at), *self.lower[1:]))

    def check(self, name: str, grid: Grid) -> None:
        if len(self.lower) != grid.dim:
            raise ValueError(f"{name} = {self} must have the grid's dimension {grid.dim}")
        for axis in range(grid.dim):
            grid.line(f"{name}.lower[{axis}]", axis, self.lower[axis])
            grid.line(f"{name}.upper[{axis}]", axis, self.upper[axis])


BOUNDARIES: tuple[type[WallOrBlock], ...] = (Wall, Solid)
"""Classes of the walls and blocks of a scene."""


@dataclass(frozen=True, eq=False, kw_only=True)
class WallState:
    """Accumulated impulse of the material on a wall or block, and the motion of a wall.

    Impulses and work refer to the modelled part where planes of symmetry cut the wall.

    Attributes
    ----------
    impulse : ndarray, shape (dim,)
        Impulse of the material on the wall since the start of the run [N s; in 2D per metre of
        depth].
    angular_impulse : ndarray, shape () or (3,)
        Angular impulse since then about the origin of the coordinates [N m s].
    displacement : ndarray, shape ()
        Displacement outwards of a wall that keeps a pressure [m]; else 0.
    work : ndarray, shape ()
        Work of a wall that moves on the material [J; in 2D per metre of depth]; else 0.
    """

    impulse: Array
    angular_impulse: Array
    displacement: Array
    work: Array


def split_impulses(numbers: Array, dim: int) -> dict[str, Array]:
    """Split the numbers of a wall, shape (..., 9), into the attributes of `WallState`."""
    turning = numbers[..., 5] if dim == 2 else numbers[..., 3:6]
    return {
        "impulse": numbers[..., :dim],
        "angular_impulse": turning,
        "displacement": numbers[..., 6],
        "work": numbers[..., 7],
    }


@dataclass(frozen=True)
class SpongeLayer(Description):
    """A sponge layer, which damps elastic waves: it slows points beyond `above` that move upwards.

    Parameters
    ----------
    axis : int
        Axis along which the points move upwards, from 0 on; not a periodic one. A scene has at most
        one layer along an axis.
    above : float
        Coordinate at which the layer begins [m], within the grid.
    damping : float
        Damping rate [1/s], > 0: in each step the upward velocity of the points is multiplied by
        exp(-damping dt), so that a rising wave decays over the length c/damping. The default,
        infinity, stops them at once, as published. Over-compressed material then expands no faster
        than g dt, so that a compressed bed remains compressed for many thousand steps.
    {raises}.
    """

    axis: int
    above: float
    damping: float = math.inf

    def __post_init__(self) -> None:
        check_fields(self, integer, "axis", low=0, high=2)
        check_fields(self, finite, "above")
        check_fields(self, positive, "damping", allow_inf=True)

    def check(self, name: str, grid: Grid) -> None:
        """Raise if it does not fit the grid."""
        _check_axis(self, name, grid)
        low, high = grid.lower[self.axis], grid.upper[self.axis]
        if not low <= self.above < high - grid.slack * grid.cell:
            raise ValueError(f"{name}.above = {self.above} must be in [{low}, {high})")
