"""Volume and moments of shapes by quadrature of their signed distance, with a bound of the error.

A shape is cut by parallel lines, in a direction askew to those in which people build, so that
hardly a wall is along them. On each line the pieces inside are found by steps as long as the signed
distance allows: no wall is passed over, however thin it is. In each square of a grid there is a
line at a random place, which no shape can be in step with. At each level the squares are half as
wide. What the lines are clear of tells which squares are empty for certain; these are left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["Moments", "directions", "moments"]

Array = NDArray[np.float64]
Distance = Callable[[Array], Array]
"""Signed distance, or a bound of it of the right sign, of places (n, 3)."""

FIRST = {2: 256, 3: 24}
"""Lines across the longest side at the first level, by the dimension."""
MOST_LINES = 40_000
"""Lines from which no level follows, which has two or four times as many."""
STEP = 5e-5
"""Least step along a line, over the longest side: thinner walls may be missed."""
SIDES = {2: 16, 3: 4}
"""Groups of lines along each axis across them, by the dimension: 16 in all.

The errors of a group are hardly related to those of others. The mean of all groups errs by a
quarter of their deviation if they are independent, and by an eighth if the error falls as the
number of lines to the power 3/4, as that of jumps does.
"""
DEVIATIONS = 3.0
"""Standard deviations of the mean of independent groups in the bound of the error."""


@dataclass(frozen=True)
class Moments:
    """Integrals over a solid.

    Attributes
    ----------
    volume : float
        Volume [m3; in 2D area, m2].
    center : ndarray, shape (dim,)
        Centroid [m].
    second : ndarray, shape (dim, dim)
        Integrals of the products of distances from the centroid [m5; in 2D m4].
    error : float
        Bound of the largest relative error, of the volume, of the moments of inertia over the
        largest of them, and of the centroid over the radius of gyration.
    """

    volume: float
    center: Array
    second: Array
    error: float


def directions(dim: int) -> Array:
    """Return directions in 3D as rows (dim, 3): across the lines, and last along them."""
    if dim == 2:
        return np.array([[0.838, -0.5456, 0.0], [0.5456, 0.838, 0.0]]) / math.hypot(0.838, 0.5456)
    turn = scipy.spatial.transform.Rotation.from_rotvec([0.6931, -0.9159, 0.5772])
    return np.asarray(turn.as_matrix())


def moments(distance: Distance, low: Array, high: Array, tolerance: float) -> Moments | None:
    """Return the moments of what is inside, or None if no line meets it.

    Parameters
    ----------
    distance : callable
    low, high : ndarray, shape (dim,)
        Bounds of the solid along `directions` [m].
    tolerance : float
        Relative error at which the lines are enough, if they are not too many before.
    """
    dim, middle, longest = len(low), 0.5 * (low + high), float((high - low).max())
    turn, half = directions(dim), 0.5 * (high - low) + STEP * longest
    lines = _Lines(distance, turn, middle, float(half[-1]), STEP * longest)
    width = longest / FIRST[dim]
    counts = np.ceil(2 * half[:-1] / width).astype(int)
    nodes = np.stack([part.ravel() for part in np.indices(counts.tolist())], axis=1)
    before, random = None, np.random.default_rng(0)
    while True:
        away = random.uniform(-0.5, 0.5, nodes.shape)
        at = width * (nodes + away + 0.5 - 0.5 * counts)
        line = lines.along(at)
        groups = _by_group(nodes, width ** (dim - 1) * _products(at, line))
        total = groups.sum(axis=0)
        error = _error(groups, before)
        if error <= tolerance or len(at) > MOST_LINES:
            break
        # no corner of a square is farther from its line than this
        farthest = width * np.linalg.norm(abs(away) + 0.5, axis=1)
        full = (line[:, 0] > 0) | (line[:, 3] <= farthest)
        ends = np.stack([part.ravel() for part in np.indices((2,) * (dim - 1))], axis=1)
        nodes = (2 * nodes[full][:, None] + ends).reshape(-1, dim - 1)
        width, counts, before = 0.5 * width, 2 * counts, total
        if not len(nodes):
            break
    if not total[0, 0] > 0:
        return None
    volume, center, turn = float(total[0, 0]), total[0, 1:] / total[0, 0], turn[:, :dim]
    second = turn.T @ (total[1:, 1:] - volume * np.outer(center, center)) @ turn
    return Moments(volume, turn.T @ (middle + center), second, error)


def _by_group(nodes: NDArray[np.intp], products: Array) -> Array:
    """Sums of products over lines of the same place in blocks of the grid (16, ...)."""
    across = nodes.shape[1]
    side = SIDES[across + 1]
    group = np.ravel_multi_index(tuple((nodes % side).T), (side,) * across)
    groups = np.zeros((side**across, *products.shape[1:]))
    np.add.at(groups, group, products)
    return groups


def _error(groups: Array, before: Array | None) -> float:
    """Bound of the relative error of the sum of groups, and of the change since a level before."""
    total, count = groups.sum(axis=0), len(groups)
    if not total[0, 0] > 0:
        return math.inf
    apart = _relative(total, count * groups - total)
    bound = DEVIATIONS * np.sqrt((apart**2).sum(axis=0) / (count - 1) / count)
    change = 0.0 if before is None else abs(_relative(total, (total - before)[None])).max()
    return float(max(bound.max(), 0.5 * change))


def _relative(total: Array, changes: Array) -> Array:
    """Changes of integrals (n, dim + 1, dim + 1), relative to what they change.

    They are those of the volume, of the centroid over the radius of gyration, and of the moments of
    inertia over the largest.
    """
    dim, volume = len(total) - 1, total[0, 0]
    shift = np.eye(dim + 1)
    shift[1:, 0] = -total[0, 1:] / volume
    moved = shift @ changes @ shift.T  # about the centroid
    second = (shift @ total @ shift.T)[1:, 1:]
    trace, traces = float(np.trace(second)), np.trace(moved[:, 1:, 1:], axis1=1, axis2=2)
    if dim == 2:
        inertia, largest = traces[:, None], trace
    else:
        inertia = (traces[:, None, None] * np.eye(dim) - moved[:, 1:, 1:]).reshape(-1, dim * dim)
        largest = trace - float(np.linalg.eigvalsh(second)[0])
    centers = moved[:, 0, 1:] / math.sqrt(volume * trace)
    return np.concatenate([moved[:, :1, 0] / volume, centers, inertia / largest], axis=1)


@dataclass(frozen=True)
class _Lines:
    """Parallel lines through a shape."""

    distance: Distance
    turn: Array
    origin: Array
    half: float
    step: float

    def along(self, at: Array) -> Array:
        """Integrals of 1, s and s2 over the pieces inside, and distances of what is nearest (n, 4).

        s is the distance along a line from the middle.
        """
        lines = np.zeros((len(at), 4))
        lines[:, 3] = np.inf
        live, s = np.arange(len(at)), np.full(len(at), -self.half)
        depth, entry = self._depth(at, s), s.copy()
        while len(live):
            lines[live, 3] = np.minimum(lines[live, 3], abs(depth))
            ahead = np.minimum(s + np.maximum(abs(depth), self.step), self.half)
            there = self._depth(at[live], ahead)
            crosses = (depth < 0) != (there < 0)
            crossing = ahead.copy()
            share = depth[crosses] / (depth[crosses] - there[crosses])
            crossing[crosses] = s[crosses] + share * (ahead - s)[crosses]
            ends = (depth < 0) & (crosses | (ahead >= self.half))
            a, b = entry[ends], crossing[ends]
            pieces = np.stack([b - a, (b**2 - a**2) / 2, (b**3 - a**3) / 3], axis=1)
            lines[live[ends], :3] += pieces
            begins = crosses & (there < 0)
            entry[begins] = crossing[begins]
            on = ahead < self.half
            live, s, depth, entry = live[on], ahead[on], there[on], entry[on]
        return lines

    def _depth(self, at: Array, s: Array) -> Array:
        own = np.concatenate([at, s[:, None]], axis=1) + self.origin
        return self.distance(np.ascontiguousarray(own @ self.turn))


def _products(at: Array, line: Array) -> Array:
    """Integrals of the products of (1, x) along lines."""
    sums = np.empty((len(at), at.shape[1] + 2, at.shape[1] + 2))
    one = np.concatenate([np.ones((len(at), 1)), at], axis=1)
    sums[:, :-1, :-1] = one[:, :, None] * one[:, None, :] * line[:, 0, None, None]
    sums[:, :-1, -1] = sums[:, -1, :-1] = one * line[:, 1, None]
    sums[:, -1, -1] = line[:, 2]
    return sums
