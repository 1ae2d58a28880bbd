"""Positions allowed for the points of a fill, for all modules that place them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from granular.model.grid import Grid
from granular.shapes.region import Region
from granular.tools.arrays import Array, BoolArray

Distance = Callable[[Array], tuple[Array, Array]]
"""Signed distances of positions from the nearest surface, negative in the solid, and its
normals."""


def nowhere(x: Array) -> tuple[Array, Array]:
    """Return the infinite distance without any body."""
    return np.full(len(x), np.inf), np.zeros_like(x)


def last_place(grid: Grid) -> Array:
    """Last position within a grid [m]: its upper end does not belong to any cell."""
    last: Array = np.nextafter(grid.upper, grid.lower)
    return last


@dataclass(frozen=True)
class OpenSpace:
    """The positions that are open to the points of a fill.

    Attributes
    ----------
    grid : Grid
    region : Region or None
        Region of the fill; None for points given one by one, which have no other bounds.
    distance : Distance
        Distances from the bodies.
    others : sequence of Region
        Regions of the other fills.
    """

    grid: Grid
    region: Region | None
    distance: Distance = nowhere
    others: Sequence[Region] = ()

    def contains(self, x: Array) -> BoolArray:
        """True for the positions, shape (n, dim) [m], that belong to the fill, apart from
        bodies."""
        inside: BoolArray = np.all((x >= self.grid.lower) & (x < self.grid.upper), axis=1)
        if self.region is not None:
            inside[inside] = self.region.contains(x[inside])
        for other in self.others:
            inside[inside] = ~other.contains(x[inside])
        return inside

    def is_open(self, x: Array) -> BoolArray:
        """True for the positions that belong to the fill and are in no body."""
        is_inside = self.contains(x)
        is_inside[is_inside] = self.distance(x[is_inside])[0] >= 0
        return is_inside
