"""Bytes for the nodes or cells of a grid, stored once for all that are alike.

Walls and blocks hold products of ranges of indices. The ranges cut each axis into intervals, the
classes, so that one byte for each combination of classes suffices. A box with four walls
has 3 classes along each axis, however many cells it has.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granular.tools.arrays import IndexArray

Ranges = tuple[IndexArray, ...]
"""Ascending indices along each axis, x first; they mean all combinations."""


class GridMap(NamedTuple):
    """Bytes for the nodes or cells of a grid; the core takes them in this form.

    Attributes
    ----------
    classes : tuple of ndarray of int32
        Class of each index along each axis, x first.
    values : ndarray, shape (..., classes along y, along x)
        Byte for each combination of classes; True or False in maps that the core does not have.
    """

    classes: tuple[NDArray[np.int32], ...]
    values: NDArray[Any]

    @classmethod
    def zeros(
        cls,
        shape: Sequence[int],
        ranges: Iterable[Ranges],
        cuts: Sequence[IndexArray] | None = None,
    ) -> Self:
        """Zeros for a grid of this shape, with classes for which each of the ranges is whole.

        The `cuts` along each axis are further indices at which a class begins.
        """
        used = list(ranges)
        classes = tuple(
            _classes(n, [held[axis] for held in used], () if cuts is None else cuts[axis])
            for axis, n in enumerate(shape)
        )
        counts = tuple(int(along[-1]) + 1 for along in classes)
        return cls(classes, np.zeros(counts[::-1], dtype=np.uint8))

    def of(self, ranges: Ranges) -> tuple[IndexArray, ...]:
        """Index of the combinations of classes in `values` that make up the ranges."""
        classes = (
            np.unique(numbers[held]) for numbers, held in zip(self.classes, ranges, strict=True)
        )
        return np.ix_(*tuple(classes)[::-1])

    def firsts(self) -> tuple[IndexArray, ...]:
        """Index of the first member of each class along each axis."""
        return tuple(np.flatnonzero(np.diff(numbers, prepend=-1)) for numbers in self.classes)

    def dense(self, part: Sequence[slice] | None = None) -> NDArray[Any]:
        """Array with a value for every node or cell, shape (..., n_y, n_x).

        With `part`, one for those in a range along each axis only.
        """
        classes = self.classes
        if part is not None:
            classes = tuple(numbers[along] for numbers, along in zip(classes, part, strict=True))
        return np.ascontiguousarray(self.values[np.ix_(*classes[::-1])])

    def at(self, indices: Sequence[IndexArray]) -> NDArray[Any]:
        """Values at positions given by their indices along x, y (and z)."""
        classes = (numbers[along] for numbers, along in zip(self.classes, indices, strict=True))
        return self.values[tuple(classes)[::-1]]


def _classes(n: int, ranges: Iterable[IndexArray], cuts: ArrayLike) -> NDArray[np.int32]:
    """Number the intervals into which ends of ranges, and cuts, divide an axis of n indices."""
    begins = np.zeros(n + 1, dtype=bool)
    begins[0] = True
    begins[np.asarray(cuts, dtype=np.intp)] = True
    for held in ranges:
        if len(held):
            gaps = np.flatnonzero(np.diff(held) > 1)
            begins[held[np.concatenate([[0], gaps + 1])]] = True
            begins[held[np.concatenate([gaps, [-1]])] + 1] = True
    return (np.cumsum(begins[:n]) - 1).astype(np.int32)
