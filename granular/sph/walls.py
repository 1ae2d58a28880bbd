"""Flat walls, made of layers of particles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass

import numpy as np
from numpy.typing import NDArray

from granular.model.boundary import Boundary, Span
from granular.model.grid import AXES, LINE_TOLERANCE, Grid, combined
from granular.tools.arrays import Array
from granular.tools.checks import (
    check_fields,
    finite,
    integer,
    non_negative,
    one_of,
    positive,
    spans,
    truth,
    vector,
)

MAX_LAYERS = 100


@dataclass(frozen=True)
class ParticleWall(Boundary):
    """Layers of fixed particles behind a plane.

    Parameters
    ----------
    axis : int
        Axis normal to the wall, from 0 on; not a periodic one.
    at : float
        Coordinate of its surface along `axis` [m], on a line of the grid.
    side : {1, -1}
        Side of the surface on which the material is: 1 above, -1 below.
    layers : int
        Number of layers of particles behind the surface, 1 to 100. They must be at least as thick
        as the reach of the kernel, because particles at the wall would otherwise lack neighbours;
        the thesis takes 5.
    span : tuple of (low, high), or None
        Extent along each *other* axis in their order [m], on grid lines, which may lie beyond the
        ends of the grid. None for the whole grid and, along axes that are not periodic, the
        thickness of the layers beyond it, so that walls meet at corners. Of several particles at
        the same position only the one of the first wall remains.
    velocity : tuple of float, length dim, or None
        Velocity of the wall [m/s]; None for rest. A gate that lifts moves along its own plane.
    moves_from : float
        Time from which the wall has this velocity [s], >= 0.
    until : float
        Time at which the wall is removed [s], > 0; infinite by default.
    permeable : bool
        If true, a gas passes through the wall without resistance; the material never does.
    {raises}.
    """

    axis: int
    at: float
    side: int
    _: KW_ONLY
    layers: int = 5
    span: tuple[Span, ...] | None = None
    velocity: tuple[float, ...] | None = None
    moves_from: float = 0.0
    until: float = math.inf
    permeable: bool = False

    def __post_init__(self) -> None:
        check_fields(self, integer, "axis", low=0, high=2)
        check_fields(self, finite, "at")
        check_fields(self, one_of, "side", allowed=(1, -1))
        check_fields(self, integer, "layers", low=1, high=MAX_LAYERS)
        check_fields(self, non_negative, "moves_from")
        check_fields(self, positive, "until", allow_inf=True)
        check_fields(self, truth, "permeable")
        check_fields(self, spans, "span", optional=True)
        check_fields(self, vector, "velocity", optional=True)

    def check(self, name: str, grid: Grid, reach: float) -> None:
        """Raise if the wall does not fit the grid, or is thinner than the kernel's reach [m]."""
        if self.axis >= grid.dim:
            raise ValueError(f"{name}.axis = {self.axis} must be below {grid.dim}")
        if grid.periodic[self.axis]:
            raise ValueError(f"{name}.axis = {self.axis} must not be a periodic one")
        grid.line(f"{name}.at", self.axis, self.at)
        need = math.ceil(reach / grid.cell - LINE_TOLERANCE)
        if self.layers < need:
            raise ValueError(
                f"{name}.layers = {self.layers} must be at least {need}, the reach of the kernel"
            )
        if self.span is not None and len(self.span) != grid.dim - 1:
            raise ValueError(f"{name}.span = {self.span} must have {grid.dim - 1} pairs")
        if self.velocity is not None and len(self.velocity) != grid.dim:
            raise ValueError(f"{name}.velocity = {self.velocity} must have {grid.dim} entries")
        for axis, (first, last) in enumerate(self.lines(name, grid)):
            if grid.periodic[axis] and (first < 0 or last > grid.shape[axis]):
                raise ValueError(f"{name}.span must stay within the period of {AXES[axis]}")

    def lines(self, name: str, grid: Grid) -> list[tuple[int, int]]:
        """First and past-the-last site along each axis, in spacings from the grid's lower end."""
        sites = []
        others = iter(self.span or ())
        for axis in range(grid.dim):
            if axis == self.axis:
                line = grid.line(f"{name}.at", axis, self.at)
                sites.append(
                    (line - self.layers, line) if self.side > 0 else (line, line + self.layers)
                )
            elif self.span is None:
                more = 0 if grid.periodic[axis] else self.layers
                sites.append((-more, grid.shape[axis] + more))
            else:
                low, high = next(others)
                sites.append((_site(name, grid, axis, low), _site(name, grid, axis, high)))
        return sites

    def sites(self, name: str, grid: Grid) -> list[tuple[int, int]]:
        """Sites among `lines` that are near the grid at some time; the others get no particle.

        That is within three times the thickness of the layers, which is not below the reach of the
        kernel: the density of the particles within its reach is a sum over sums over their own
        neighbours.
        """
        margin, near = 3 * self.layers, []
        for axis, (first, last) in enumerate(self.lines(name, grid)):
            speed = 0.0 if self.velocity is None else self.velocity[axis]
            way = abs(speed) * max(self.until - self.moves_from, 0.0) if speed else 0.0
            come = math.ceil(way / grid.cell) if way < math.inf else last - first
            low, high = -margin, grid.shape[axis] + margin
            low, high = (low - come, high) if speed > 0 else (low, high + come)
            near.append((max(first, low), max(min(last, high), max(first, low))))
        return near

    def extent(self, grid: Grid, axis: int) -> Span:
        first, last = self.lines("wall", grid)[axis]
        return grid.lower[axis] + first * grid.cell, grid.lower[axis] + last * grid.cell

    @property
    def gone_from(self) -> float:
        return min(self.moves_from if any(self.velocity or ()) else math.inf, self.until)

    def in_words(self) -> str:
        text = "wall of particles" + (", moves" if any(self.velocity or ()) else "")
        return text if self.until == math.inf else f"{text}, until {self.until:g} s"

    def box(self, name: str, grid: Grid) -> tuple[list[float], list[float]]:
        """Lower and upper ends of the wall at the start [m], infinite along a whole period."""
        low, high = [], []
        for axis, (first, last) in enumerate(self.lines(name, grid)):
            endless = grid.periodic[axis] and last - first == grid.shape[axis]
            low.append(-math.inf if endless else grid.lower[axis] + first * grid.cell)
            high.append(math.inf if endless else grid.lower[axis] + last * grid.cell)
        return low, high


def _site(name: str, grid: Grid, axis: int, at: float) -> int:
    """Whole number of spacings from the lower end of the grid to `at`."""
    place = (at - grid.lower[axis]) / grid.cell
    if not abs(place) < 1e6 or abs(place - round(place)) > grid.slack:
        raise ValueError(
            f"{name}.span: {at} must be whole spacings {grid.cell} from {grid.lower[axis]}"
        )
    return round(place)


def wall_points(grid: Grid, walls: Sequence[ParticleWall]) -> dict[str, Array]:
    """Wall particles: x, v and normal (n, dim), depth below the surface [m], porosity for a gas,
    number of the wall.

    Of several particles at the same position only the one of the first wall remains.
    """
    dim = grid.dim
    names = ("site", "v", "normal", "depth", "porosity", "wall")
    parts: dict[str, list[NDArray]] = {name: [] for name in names}
    for i, wall in enumerate(walls):
        axes = [np.arange(*ends) for ends in wall.sites(f"walls[{i}]", grid)]
        sites = combined(axes)
        normal = np.zeros(dim)
        normal[wall.axis] = wall.side
        behind = (
            grid.line(f"walls[{i}].at", wall.axis, wall.at) - sites[:, wall.axis] - 0.5
        ) * wall.side
        parts["site"].append(sites)
        velocity = wall.velocity if wall.velocity and not wall.moves_from else (0.0,) * dim
        parts["v"].append(np.broadcast_to(velocity, sites.shape))
        parts["normal"].append(np.broadcast_to(normal, sites.shape))
        parts["depth"].append(behind * grid.cell)
        parts["porosity"].append(np.full(len(sites), float(wall.permeable)))
        parts["wall"].append(np.full(len(sites), float(i)))
    if not walls:
        empty = np.zeros((0, dim))
        return {"x": empty, "v": empty, "normal": empty} | {name: np.zeros(0) for name in names[3:]}
    whole = {name: np.concatenate(part) for name, part in parts.items()}
    _, first = np.unique(whole["site"], axis=0, return_index=True)
    first.sort()
    whole = {name: part[first] for name, part in whole.items()}
    return {"x": np.array(grid.lower) + (whole.pop("site") + 0.5) * grid.cell} | whole


def wall_rows(grid: Grid, walls: Sequence[ParticleWall]) -> Array:
    """Rows of the walls for the core: ends of the box, velocity, times, axis (n, 12)."""
    rows = np.zeros((len(walls), 12))
    for i, (row, wall) in enumerate(zip(rows, walls, strict=True)):
        low, high = wall.box(f"walls[{i}]", grid)
        row[: grid.dim], row[3 : 3 + grid.dim] = low, high
        row[6 : 6 + grid.dim] = wall.velocity or 0.0
        row[9:] = wall.moves_from, wall.until, wall.axis
    return rows
