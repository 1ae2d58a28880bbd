"""Fields of the points as the core has them, in the order of the points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from granular.tools.arrays import IntArray
from granular.tools.buffers import stored_type

SUMMED = 1 << 17
"""Points that are summed at once for a sample of a run, for the sake of memory."""


class PointField:
    """A field of the points in the order of their ids; see `granular.record.fresh.Columns`."""

    def __init__(self, rows: NDArray, slots: IntArray) -> None:
        self._rows, self._slots = np.atleast_2d(rows), slots
        self.dtype = stored_type(rows.dtype)
        wide = (len(rows),) if rows.ndim == 2 and len(rows) > 1 else ()
        self.shape = (len(slots), *wide)
        self.wrap: dict[
            int, tuple[float, float]
        ] = {}  # columns with lower end and length of a period

    def _take(self, k: int, column: NDArray) -> None:
        """Put a column, as the core has it, into an array."""
        if self._rows.dtype == self.dtype:
            self._rows[k].take(self._slots, out=column, mode="clip")  # "raise" would buffer it
        else:
            column[:] = self._rows[k].take(self._slots)

    def column(self, k: int, out: NDArray) -> NDArray:
        """Put a column into an array of numbers of 8 bytes."""
        column = out.view(self.dtype)
        self._take(k, column)
        if k in self.wrap:
            lower, length = self.wrap[k]
            column[column < lower] += length
        return column

    def whole(self) -> NDArray:
        """Return the field as an array of its shape, of which each column is contiguous."""
        n, *wide = self.shape
        columns = np.empty((*(wide or [1]), n), dtype=self.dtype)
        for k, out in enumerate(columns):
            self.column(k, out)
        return columns[0] if len(self.shape) == 1 else columns.T


class PointRows:
    """A field of the points in the order of slots, as checkpoints have it, made row by row."""

    def __init__(self, rows: NDArray, slots: IntArray) -> None:
        self._rows, self._slots = rows, slots
        self.dtype = stored_type(rows.dtype)
        self.shape = (*rows.shape[:-1], len(slots))

    def row(self, k: int) -> NDArray:
        """Return a row; see `granular.record.layout.Rows`."""
        row = np.atleast_2d(self._rows)[k].take(self._slots)
        return row.astype(self.dtype, copy=False)


def whole_groups(counts: NDArray[np.integer], most: int) -> Iterator[slice]:
    """Divide items of groups that follow each other into parts of whole groups, of at most so many
    items unless a group has more; without items there is one part.
    """
    ends, begin = np.cumsum(counts), 0
    total = int(ends[-1]) if len(ends) else 0
    while True:
        fits = int(np.searchsorted(ends, begin + most, "right"))
        further = int(np.searchsorted(ends, begin, "right"))  # the next group with items
        end = int(ends[max(fits - 1, further)]) if begin < total else total
        yield slice(begin, end)
        begin = end
        if begin >= total:
            return
