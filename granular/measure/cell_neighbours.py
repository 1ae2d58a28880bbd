"""Cells that hold points and those about them, with their neighbours; not the box around them.

Material along a slope, or a few points far away, may have a box of a thousand times as many cells.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular.model.grid import Grid
from granular.tools.arrays import Array, BoolArray, IntArray


class CellNeighbours:
    """Some cells of a grid and all next to them, corners included, within the grid.

    Fields of these cells are arrays of shape (n,); they are 0 in all other cells. A periodic axis
    has ends like another one.

    Parameters
    ----------
    grid : Grid
    cells : ndarray of int, shape (k,)
        Flat indices of the cells, sorted, each once.

    Attributes
    ----------
    flat : ndarray of int, shape (n,)
        Flat indices of all, sorted: column by column, upwards.
    of : ndarray of int, shape (k,)
        Where the given cells are among them.
    """

    def __init__(self, grid: Grid, cells: IntArray) -> None:
        self.shape, self.flat = grid.shape, cells
        strides = [math.prod(grid.shape[axis + 1 :]) for axis in range(grid.dim)]
        for axis, stride in enumerate(strides):
            place = self.places(axis)
            below = self.flat[place > 0] - stride
            above = self.flat[place < grid.shape[axis] - 1] + stride
            self.flat = np.union1d(self.flat, np.concatenate([below, above]))
        self.of: IntArray = np.searchsorted(self.flat, cells)
        self.at_ends: list[tuple[BoolArray, BoolArray]] = []
        """True for the first and for the last cells along each axis."""
        self.adjacent: list[tuple[IntArray, IntArray]] = []
        """Where the cells before and after along each axis are; n for those not there."""
        for axis, stride in enumerate(strides):
            place = self.places(axis)
            first, last = place == 0, place == grid.shape[axis] - 1
            self.at_ends.append((first, last))
            self.adjacent.append((self._find(-stride, first), self._find(stride, last)))

    def most_neighbours(self) -> Array:
        """Number of cells of the grid that are a cell or next to it."""
        return np.asarray(np.prod([3.0 - first - last for first, last in self.at_ends], axis=0))

    def places(self, axis: int) -> IntArray:
        """Indices of the cells along an axis."""
        return np.unravel_index(self.flat, self.shape)[axis]

    def _find(self, step: int, is_end: BoolArray) -> IntArray:
        wanted = self.flat + step
        at = np.searchsorted(self.flat, wanted)
        n = len(self.flat)
        there = ~is_end & (at < n) & (self.flat[np.minimum(at, n - 1)] == wanted)
        return np.where(there, at, n)

    def field(self, values: Array) -> Array:
        """Make a field of values of the given cells, shape (k, ...)."""
        whole = np.zeros((len(self.flat), *values.shape[1:]))
        whole[self.of] = values
        return whole

    def side(self, field: NDArray[Any], axis: int, after: int) -> NDArray[Any]:
        """Values of the cells before (0) or after (1) along an axis."""
        return np.append(field, field.dtype.type(0))[self.adjacent[axis][after]]

    def pooled(self, field: Array) -> Array:
        """Sum over each cell and its neighbours, corners included."""
        for axis in range(len(self.shape)):
            field = field + self.side(field, axis, 0) + self.side(field, axis, 1)
        return field

    def smoothed(self, field: Array) -> Array:
        """Mean over each cell and its neighbours, weighted 1, 2, 1 along each axis.

        Beyond the ends of the grid lies the mirror image.
        """
        for axis, ends in enumerate(self.at_ends):
            wide = 2.0 * field
            for after, end in enumerate(ends):
                wide = wide + np.where(end, field, self.side(field, axis, after))
            field = wide / 4.0
        return field

    def below_top(self, filled: BoolArray) -> IntArray:
        """Number of cells above each in its run upwards through filled cells."""
        n = len(filled)
        above = self.adjacent[-1][1]
        continues = filled & np.append(filled, False)[above]
        ends = np.flatnonzero(~continues)  # runs follow each other in the order of the cells
        return ends[np.searchsorted(ends, np.arange(n))] - np.arange(n)
