"""Bytes for the nodes or cells of a grid, stored once for all that are alike.

Walls and blocks hold products of ranges of indices. The ranges cut each axis into intervals, the
classes, so that a byte for each combination of classes is all that is needed. A box with four walls
has 3 classes along each axis, however many cells it has.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

__all__ = ["GridMap", "Ranges"]

Ranges = tuple[NDArray[np.intp], ...]
"""Ascending indices along each axis, x first; they mean all combinations."""


class GridMap(NamedTuple):
    """Bytes for the nodes or cells of a grid; the core takes them in this form.

    Attributes
    ----------
    classes : tuple of ndarray of int32
        Class of each index along each axis, x first.
    values : ndarray of uint8, shape (..., classes along y, along x)
        Byte for each combination of classes.
    """

    classes: tuple[NDArray[np.int32], ...]
    values: NDArray[np.uint8]

    @classmethod
    def zeros(cls, shape: Sequence[int], ranges: Iterable[Ranges]) -> Self:
        """Zeros for a grid of this shape, with classes for which each of the ranges is whole."""
        used = list(ranges)
        classes = tuple(_classes(n, [held[axis] for held in used]) for axis, n in enumerate(shape))
        counts = tuple(int(along[-1]) + 1 for along in classes)
        return cls(classes, np.zeros(counts[::-1], dtype=np.uint8))

    def of(self, ranges: Ranges) -> tuple[NDArray[np.intp], ...]:
        """Index of the combinations of classes in `values` that make up the ranges."""
        found = (np.unique(own[held]) for own, held in zip(self.classes, ranges, strict=True))
        return np.ix_(*tuple(found)[::-1])

    def dense(self) -> NDArray[np.uint8]:
        """Array with a byte for every node or cell, shape (..., n_y, n_x)."""
        return np.ascontiguousarray(self.values[np.ix_(*self.classes[::-1])])

    def at(self, indices: Sequence[NDArray[np.intp]]) -> NDArray[np.uint8]:
        """Bytes at places that are given by their indices along x, y (and z)."""
        classes = (own[along] for own, along in zip(self.classes, indices, strict=True))
        return self.values[tuple(classes)[::-1]]


def _classes(n: int, ranges: Iterable[NDArray[np.intp]]) -> NDArray[np.int32]:
    """Number the intervals into which the ends of ranges of indices cut an axis of n places."""
    begins = np.zeros(n + 1, dtype=bool)
    begins[0] = True
    for held in ranges:
        if len(held):
            gaps = np.flatnonzero(np.diff(held) > 1)
            begins[held[np.concatenate([[0], gaps + 1])]] = True
            begins[held[np.concatenate([gaps, [-1]])] + 1] = True
    return (np.cumsum(begins[:n]) - 1).astype(np.int32)
