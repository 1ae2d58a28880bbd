"""The base of walls and blocks: what all that looks at a boundary of a scene asks of it."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from granular.model.grid import Grid
from granular.tools.arrays import Array, BoolArray
from granular.tools.description import Description

Span = tuple[float, float]


class Boundary(Description, ABC):
    """A wall or block of a scene of either method.

    Attributes
    ----------
    axis : int or None
        Axis normal to a wall; None for a block.
    velocity : tuple of float, length dim, or None
        Its velocity [m/s].
    """

    axis: int | None
    velocity: tuple[float, ...] | None

    @abstractmethod
    def extent(self, grid: Grid, axis: int) -> Span:
        """Lower and upper end along an axis [m]."""

    @property
    @abstractmethod
    def gone_from(self) -> float:
        """Time from which it is not there any more, or elsewhere [s]; inf for never."""

    @abstractmethod
    def in_words(self) -> str:
        """Its entry in the legend of a picture."""

    @property
    def is_flat(self) -> bool:
        """True for a surface, False for what has a volume."""
        return False

    @property
    def is_block(self) -> bool:
        """True for a block, which acts as one with those that it touches."""
        return self.axis is None

    @property
    def slips(self) -> bool:
        """True if it holds the velocity normal to it alone."""
        return False

    @property
    def rubs(self) -> bool:
        """True if it holds the velocity normal to it, with friction along it."""
        return False

    def corners(self, grid: Grid) -> tuple[Array, Array]:
        """Lower and upper corner [m], shape (dim,)."""
        low, high = np.array([self.extent(grid, axis) for axis in range(grid.dim)]).T
        return low, high

    def encloses(self, grid: Grid, x: Array) -> BoolArray:
        """True for places of shape (n, dim) strictly within it: none for a surface."""
        low, high = self.corners(grid)
        return np.asarray(((x > low) & (x < high)).all(axis=1))
