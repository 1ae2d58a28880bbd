"""Regions of 2D or 3D space, for fills."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from granular.tools.arrays import Array, BoolArray
from granular.tools.description import Description

Vector = tuple[float, ...]


class Region(Description, ABC):
    """A region of 2D or 3D space."""

    @property
    @abstractmethod
    def bounds(self) -> tuple[Vector, Vector]:
        """Lower and upper corner of a box that encloses the region [m]."""

    @abstractmethod
    def _inside(self, x: Array) -> BoolArray:
        """Return `contains` for an array that has been checked."""

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return len(self.bounds[0])

    @property
    def _box(self) -> tuple[Vector, Vector]:
        """Corners of the box in which `depth` searches the top."""
        return self.bounds

    def leaves(self) -> list[Region]:
        """Return the regions that operations are made of, or the region itself."""
        return [self]

    def cuts(self, x: Array, reach: float) -> BoolArray:
        """True for positions, shape (n, dim) [m], whose squares the boundary cuts.

        They are all positions that are no farther from it than `reach` [m], and some more. For
        regions without such a boundary, squares count as a whole, by their centres.
        """
        return np.zeros(len(x), dtype=bool)

    def cut(self, x: Array) -> tuple[Array, Array]:
        """Signed distance of positions from the boundary that cuts squares, and its outward
        normals.

        The distance, shape (n,) [m], is negative inside, and infinite without such a boundary. Near
        to the boundary its error is of second order in the distance.
        """
        return np.where(self._inside(x), -np.inf, np.inf), np.zeros_like(x)

    def depth(self, x: Array, up: Array, step: float) -> Array:
        """Distance of positions from the top of the region above them.

        The top is the last point of the region along a ray, even beyond gaps such as those below
        an overhang: below a level surface the pressure is the same at one height.

        Parameters
        ----------
        x : ndarray, shape (n, dim)
            Positions in the region [m].
        up : ndarray, shape (dim,)
            Direction, of length 1.
        step : float
            Distance at which the ray is sampled [m]; less is not resolved, except for the top,
            which is then located by bisection.

        Returns
        -------
        ndarray, shape (n,)
            Distance [m], >= 0.
        """
        # Rays begin where they enter the box around the region, so that those of a column are one.
        lower, upper = np.array(self._box)
        slack = step * 1e-6
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.where(up > 0, (upper - x) / up, np.where(up < 0, (lower - x) / up, np.inf))
        length = np.maximum(ends.min(axis=1), 0.0) + slack
        tops = x + length[:, None] * up
        digits = np.rint(tops / slack)
        _, first, of = np.unique(digits, axis=0, return_index=True, return_inverse=True)
        down = self._first_inside(tops[first], -up, step, float(np.linalg.norm(upper - lower)))
        return np.maximum(length - down[of.reshape(-1)], 0.0)

    def ahead(self, x: Array, along: Array, step: float) -> Array:
        """Distance at which rays from positions outside enter the region [m]; inf if they do not.

        Parameters are those of `depth`.
        """
        low, high = np.array(self._box)
        x, distance = np.asarray(x), np.full(len(x), np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.sort([(low - x) / along, (high - x) / along], axis=0)
        ends[:, :, along == 0] = np.array([-np.inf, np.inf])[:, None, None]
        begin, end = np.maximum(ends[0].max(axis=1), 0.0), ends[1].min(axis=1)
        inside = (x >= low) & (x <= high)
        hits = (begin <= end) & inside[:, along == 0].all(axis=1)
        if hits.any():
            longest = float((end - begin)[hits].max()) + step
            start = np.maximum(begin[hits] - 1e-6 * step, 0.0)
            distance[hits] = start + self._first_inside(
                x[hits] + start[:, None] * along, along, step, longest
            )
        return distance

    def _first_inside(self, x: Array, along: Array, step: float, longest: float) -> Array:
        """Distance at which rays from positions outside enter the region [m]; inf if they do
        not."""
        distance = np.full(len(x), np.inf)
        left = np.arange(len(x))
        for n in range(math.ceil(longest / step) + 1):
            hit = self._inside(x[left] + (n * step) * along)
            distance[left[hit]] = n * step
            left = left[~hit]
            if not len(left):
                break
        outside, inside = np.maximum(distance - step, 0.0), distance.copy()
        some = np.isfinite(distance)
        for _ in range(40):
            middle = 0.5 * (outside[some] + inside[some])
            within = self._inside(x[some] + middle[:, None] * along)
            inside[some] = np.where(within, middle, inside[some])
            outside[some] = np.where(within, outside[some], middle)
        return inside

    def contains(self, x: ArrayLike) -> BoolArray:
        """True for the positions `x`, shape (n, dim) [m], that lie inside; shape (n,).

        Raises
        ------
        ValueError
            If `x` has another shape.
        """
        x = np.asarray(x, dtype=np.float64)
        if x.ndim != 2 or x.shape[1] != self.dim:
            raise ValueError(f"x of shape {x.shape} must have the shape (n, {self.dim})")
        return self._inside(x)
