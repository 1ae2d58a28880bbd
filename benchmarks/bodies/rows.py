"""Rows of the table, and what all of their cases have in common."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

import granular as gr
from granular.mpm.body_distances import distance_from_bodies
from granular.tools.arrays import Array

Numbers = dict[str, float]

G, RHO, CELL = 9.81, 1500.0, 0.01
TURNS, OFFSETS = (0.0, 17.0, 40.0), (0.0, 0.25, 0.5)


PLACES = [(turned, offset) for turned in TURNS for offset in OFFSETS]
"""Angles of a body against the grid, and its distance from a node in cells."""
Cases = dict[str, Callable[[], Numbers]]


@dataclass(frozen=True)
class Line:
    """A line of the table; `met` is None without a criterion."""

    quantity: str
    criterion: str
    measured: str
    met: bool | None


@dataclass(frozen=True)
class Row:
    """Cases, by name, and the lines of the table that are made of their numbers."""

    title: str
    cases: Callable[[bool], Cases]
    lines: Callable[[dict[str, Numbers]], list[Line]]


def within(quantity: str, values: Iterable[float], limit: float, unit: str = "%") -> Line:
    """Line that asks the largest size of some numbers to be at most a limit, as a percentage."""
    largest = max(abs(value) for value in values)
    factor = 100.0 if unit == "%" else 1.0
    text = (
        f"{factor * largest:.1g} {unit}"
        if largest < 0.1 * limit
        else f"{factor * largest:.2g} {unit}"
    )
    return Line(quantity, f"{factor * limit:g} {unit}", text, largest <= limit)


def spread(quantity: str, values: Iterable[float], expected: float, limit: float) -> Line:
    """Line of numbers that should be near a value, with the least and the largest of them."""
    numbers = list(values)
    off = max(abs(value / expected - 1.0) for value in numbers)
    text = f"{min(numbers):.3f} to {max(numbers):.3f}"
    return Line(quantity, f"{expected:g} within {100 * limit:g} %", text, off <= limit)


class Run:
    """A simulation on one thread, with the deepest point in its bodies and the forces on them.

    In a scene without bodies the forces are those on its walls.

    Attributes
    ----------
    deepest : float
        Largest depth of a point in a body at any frame, in cells.
    times : list of float
        Times of the frames [s].
    impulses : list of ndarray, shape (bodies or walls, dim)
        Impulses on the bodies until these times [N s].
    """

    def __init__(self, scene: gr.Scene) -> None:
        self.sim = gr.Simulation(scene, threads=1, wall_forces=not scene.bodies)
        self.deepest = -math.inf
        self.times: list[float] = []
        self.impulses: list[Array] = []
        self._frame(self.sim)

    def _frame(self, sim: Any) -> None:
        phi, _ = distance_from_bodies(sim.scene.grid, sim.scene.bodies, sim.bodies)(sim.state.x)
        self.deepest = max(self.deepest, float(-phi.min()) / sim.scene.grid.cell)
        if not self.times or sim.time > self.times[-1]:
            self.times.append(sim.time)
            touched = sim.bodies or sim.walls
            self.impulses.append(np.array([each.impulse for each in touched]))

    def to(self, until: float, every: float | None = None, *hooks: Callable[[Any], None]) -> None:
        """Run to a time, with frames at the distance `every`, by default a tenth of the time."""
        every = (until - self.sim.time) / 10 if every is None else every
        self.sim.run(until=until, every=every, monitor=False, hooks=(self._frame, *hooks))

    def force(self, since: float) -> Array:
        """Mean force on each body or wall from a time to the last frame [N], shape (k, dim)."""
        first = int(np.searchsorted(self.times, since - 1e-9))
        span = self.times[-1] - self.times[first]
        return (self.impulses[-1] - self.impulses[first]) / span

    def forces(self, since: float) -> Array:
        """Force on each between any two frames [N], shape (frames - 1, k, dim)."""
        first = int(np.searchsorted(self.times, since - 1e-9))
        spans = np.diff(self.times[first:])
        return np.diff(self.impulses[first:], axis=0) / spans[:, None, None]


def axes(turned_deg: float, dim: int = 2) -> tuple[Array, Array]:
    """Directions along and out of a plane that is turned against the grid."""
    c, s = math.cos(math.radians(turned_deg)), math.sin(math.radians(turned_deg))
    middle = (0.0,) * (dim - 2)
    return np.array([c, *middle, s]), np.array([-s, *middle, c])


def rows_of_points(length: float, height: float, spacing: float) -> tuple[Array, Array]:
    """Distances along and above a plane of points in rows along it."""
    a, b = (spacing * (np.arange(round(size / spacing)) + 0.5) for size in (length, height))
    along, above = (c.ravel() for c in np.meshgrid(a, b))
    return along, above


def around(corners: Array, cell: float, margin: int = 4, **options: Any) -> gr.Grid:
    """Grid with nodes at multiples of a cell about some points, shape (k, dim)."""
    low = np.floor(corners.min(axis=0) / cell).astype(int) - margin
    high = np.ceil(corners.max(axis=0) / cell).astype(int) + margin
    return gr.Grid(tuple(cell * low), cell, tuple((high - low).tolist()), **options)


def plane(normal: Array, through: Array, **options: Any) -> gr.Body:
    """Body that fills all behind a plane."""
    return gr.Body(gr.HalfSpace(tuple(normal)), tuple(through), **options)


def name_of(turned_deg: float, offset: float) -> str:
    return f"{turned_deg:g} deg, {offset:g}"
