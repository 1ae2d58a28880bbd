"""The seeding lattice about a region."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np

from granular.model.fill import Fill
from granular.model.grid import MAX_COUNT, Grid
from granular.tools.arrays import Array, IntArray

STAGGER = {2: (1 / 1.618033988749895,), 3: (1 / 1.324717957244746, 1 / 1.324717957244746**2)}
"""Steps between columns of a staggered fill by the dimension, modulo 1: columns near each other
have heights far apart. They are powers of the golden ratio, r^2 = r + 1, and of r^3 = r + 1."""

AT_ONCE = 1 << 17
"""Squares whose points are made at once: what is needed for a time takes some 500 bytes each."""


class SeedingLattice:
    """Squares (cubes) of the seeding lattice about the region of a fill, the first axis fastest.

    These include the ends of staggered columns, whose squares are partly in the grid.

    Attributes
    ----------
    spacing : float
        Edge of the squares [m].
    dim, n : int
        Dimension, and number of the squares.
    """

    def __init__(self, grid: Grid, fill: Fill) -> None:
        self.spacing, self.dim = grid.cell / fill.points_per_axis, grid.dim
        self._origin, self._stagger = grid.lower, fill.stagger
        first, shape = [], []
        for axis, (low, high) in enumerate(zip(*fill.region.bounds, strict=True)):
            origin, sites = grid.lower[axis], grid.shape[axis] * fill.points_per_axis
            beyond = int(fill.stagger and axis == grid.dim - 1)
            first.append(max(math.floor((low - origin) / self.spacing) - 1, -beyond))
            last = min(math.ceil((high - origin) / self.spacing) + 1, sites + beyond)
            shape.append(max(last - first[axis], 0))
        self._first, self._shape, self.n = first, tuple(shape), math.prod(shape)
        if self.n > MAX_COUNT:
            raise ValueError(f"a fill of {fill.region} must have at most {MAX_COUNT} points")

    def in_parts(self) -> Iterator[IntArray]:
        """Return the numbers of the squares, of a part after the other."""
        for begin in range(0, self.n, AT_ONCE):
            yield np.arange(begin, min(begin + AT_ONCE, self.n))

    def _places(self, squares: IntArray) -> list[IntArray]:
        """Numbers of columns, rows, ... of squares along each axis, from 0."""
        return [*np.unravel_index(squares, self._shape[::-1])][::-1]

    def at(self, squares: IntArray) -> Array:
        """Return the sites of squares, shape (k, dim) [m]."""
        places = self._places(squares)
        x = np.empty((len(squares), self.dim))
        for axis, place in enumerate(places):
            place += self._first[axis]
            x[:, axis] = self._origin[axis] + (place + 0.5) * self.spacing
        if self._stagger:
            steps = STAGGER[self.dim]
            raised = sum(place * step for step, place in zip(steps, places[:-1], strict=True))
            x[:, -1] += ((raised + 0.5 * steps[0]) % 1.0 - 0.5) * self.spacing
        return x

    def around(self, squares: IntArray, reach: int) -> IntArray:
        """Return the squares within a number of squares along each axis, sorted, each once."""
        places = self._places(np.unique(squares))
        near = []
        for step in product(range(-reach, reach + 1), repeat=self.dim):
            moved = [place + k for place, k in zip(places, step, strict=True)]
            bounds = zip(moved, self._shape, strict=True)
            inside = np.all([(place >= 0) & (place < n) for place, n in bounds], axis=0)
            there = [place[inside] for place in moved[::-1]]
            near.append(np.unique(np.ravel_multi_index(there, self._shape[::-1])))
        return np.unique(np.concatenate(near))
