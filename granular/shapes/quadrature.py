"""Volume and moments of shapes by quadrature of their signed distance, with a bound of the error.

Cells that contain the shape are halved, except those that the signed distance proves to be full or
empty, so that no part is missed, however small it is. In the others, which are at the surface,
random points are counted, so that no regular shape can bias the result. For any shape, the share of
the points of a cell that are inside has a variance of 1/4 at most, which bounds the error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from granular.tools.arrays import Array, BoolArray

Sides = NDArray[np.int8]
FIRST = {2: 16, 3: 8}
"""Cells along the longest side at the first level, by the dimension."""
MOST_PLACES = 8
"""Largest number of random points in a cell: beyond it smaller cells are cheaper."""
MOST_PROOF = 20_000
"""Largest number of cells at a level of a proof that a shape is empty."""
DEVIATIONS = 3.0
"""Standard deviations in the bound of the error."""
RELATIVE_GROWTH = 1 + 1e-9
"""Growth of the box about a shape to allow for rounding."""


class HasSides(Protocol):
    """A solid, by tests of points (n, 3)."""

    def sides(self, x: Array, radius: float) -> Sides:
        """Return -1 where a ball of this radius is inside, 1 where it is outside, 0 if unknown."""
        ...

    def inside(self, x: Array) -> BoolArray:
        """True for points inside."""
        ...


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
        Integrals of the products of distances from the centroid [m5; in 2D m4]. In 2D only the
        trace has a meaning.
    error : float
        Bound of the largest relative error, of the volume, of the moments of inertia over the
        largest of them, and of the centroid over the radius of gyration.
    """

    volume: float
    center: Array
    second: Array
    error: float

    def largest(self) -> float:
        """Largest moment of inertia over the density."""
        least = float(np.linalg.eigvalsh(self.second)[0]) if len(self.center) == 3 else 0.0
        return float(np.trace(self.second)) - least

    def gyration(self) -> float:
        """Radius of gyration about the centroid, in all directions together [m]."""
        return math.sqrt(float(np.trace(self.second)) / self.volume)


def joined(parts: list[tuple[float, Moments]]) -> Moments | None:
    """Sum of moments times a sign, of parts that are apart (1) or subtracted (-1)."""
    volume = sum(sign * part.volume for sign, part in parts)
    if not volume > 0:
        return None
    origin = parts[0][1].center  # no digits are lost far off
    center = sum(sign * part.volume * (part.center - origin) for sign, part in parts) / volume
    center = center + origin
    arms = [part.center - center for _, part in parts]
    second = sum(
        sign * (part.second + part.volume * np.outer(arm, arm))
        for (sign, part), arm in zip(parts, arms, strict=True)
    )
    whole = Moments(float(volume), center, np.asarray(second), 0.0)
    if not np.trace(second) > 0:
        return None
    errors = np.zeros(3)
    for (_, part), arm in zip(parts, arms, strict=True):
        far, around = float(np.linalg.norm(arm)), part.gyration()
        about = part.largest() + part.volume * (far**2 + 2 * far * around)
        errors += part.error * np.array([part.volume, part.volume * (far + around), about])
    errors /= [whole.volume, whole.volume * whole.gyration(), whole.largest()]
    return Moments(whole.volume, whole.center, whole.second, float(errors.max()))


def moments(
    solid: HasSides, low: Array, high: Array, tolerance: float, most: int
) -> Moments | None:
    """Return the moments of a solid, or None if it is empty.

    Parameters
    ----------
    low, high : ndarray, shape (dim,)
        Corners of a box that contains the solid [m].
    tolerance : float
        Relative error at which the cells are small enough.
    most : int
        Number of cells to be halved at most; the error may stay larger than the tolerance.
    """
    dim, middle = len(low), 0.5 * (low + high)
    places, width = _first(low, high)
    full = np.zeros((dim + 1, dim + 1))
    while True:
        sides = solid.sides(_padded(places + middle), 0.5 * math.sqrt(dim) * width)
        full += _cells(places[sides < 0], width)
        places = places[sides == 0]
        inside = solid.inside(_padded(places + middle))
        error = _error(full + _cells(places[inside], width), places, width)
        if error <= math.sqrt(MOST_PLACES) * tolerance or len(places) > most:
            break
        places, width = _halved(places, width)
    if not len(places) and not full.any():
        return None
    count = math.ceil(min(1.1 * (error / tolerance) ** 2, MOST_PLACES)) if len(places) else 0
    random = np.random.default_rng(0)
    total = full
    for _ in range(count):
        at = places + width * random.uniform(-0.5, 0.5, places.shape)
        total = total + width**dim / count * _products(at[solid.inside(_padded(at + middle))])
    error = _error(total, places, width) / math.sqrt(max(count, 1))
    if not math.isfinite(error):
        return Moments(0.0, middle, np.zeros((dim, dim)), math.inf)
    volume, center = float(total[0, 0]), total[0, 1:] / total[0, 0]
    second = total[1:, 1:] - volume * np.outer(center, center)
    return Moments(volume, middle + center, second, error)


def is_empty(solid: HasSides, low: Array, high: Array) -> bool:
    """True if a box is certainly outside of the solid; False if it is not, or too near."""
    if not (low < high).all():
        return True
    middle = 0.5 * (low + high)
    places, width = _first(low, high)
    while 0 < len(places) <= MOST_PROOF:
        sides = solid.sides(_padded(places + middle), 0.5 * math.sqrt(len(low)) * width)
        near = places[sides == 0]
        if (sides < 0).any() or solid.inside(_padded(near + middle)).any():
            return False
        places, width = _halved(near, width)
    return not len(places)


def _first(low: Array, high: Array) -> tuple[Array, float]:
    """Cells that cover a box: their middles relative to the middle of the box, and their width."""
    width = float((high - low).max()) * RELATIVE_GROWTH / FIRST[len(low)]
    counts = np.ceil((high - low) / width).astype(int).clip(1)
    nodes = np.stack([part.ravel() for part in np.indices(counts.tolist())], axis=1)
    return width * (nodes + 0.5 - 0.5 * counts), width


def _halved(places: Array, width: float) -> tuple[Array, float]:
    dim = places.shape[1]
    corners = 0.25 * width * np.array(list(product((-1.0, 1.0), repeat=dim)))
    return (places[:, None] + corners).reshape(-1, dim), 0.5 * width


def _padded(places: Array) -> Array:
    padded = np.zeros((len(places), 3))
    padded[:, : places.shape[1]] = places
    return padded


def _products(places: Array) -> Array:
    """Sums of the products of (1, x) at points."""
    one = np.concatenate([np.ones((len(places), 1)), places], axis=1)
    sums: Array = one.T @ one
    return sums


def _cells(places: Array, width: float) -> Array:
    """Integrals of the products of (1, x) over cells."""
    dim = places.shape[1]
    within = np.diag([0.0] + [width**2 / 12] * dim)
    sums: Array = width**dim * (_products(places) + len(places) * within)
    return sums


def _error(total: Array, places: Array, width: float) -> float:
    """Bound of the relative error of a total if one point is counted in each of the cells."""
    if not len(places):
        return 0.0
    dim, volume = len(total) - 1, total[0, 0]
    if not volume > 0:
        return math.inf
    center = total[0, 1:] / volume
    second = total[1:, 1:] - volume * np.outer(center, center)
    whole = Moments(float(volume), center, second, 0.0)
    if not np.trace(second) > 0:
        return math.inf
    arms = abs(places - center) + 0.5 * width
    square = (arms**2).sum(axis=1)
    if dim == 2:
        inertia = square[:, None]
    else:
        inertia = np.concatenate([square[:, None] - arms**2, arms * np.roll(arms, 1, axis=1)], 1)
    scale = [1.0 / volume, 1.0 / (volume * whole.gyration()), 1.0 / whole.largest()]
    weights = (np.ones((len(places), 1)), arms, inertia)
    squares = [s**2 * (w**2).sum(axis=0).max() for s, w in zip(scale, weights, strict=True)]
    return DEVIATIONS * 0.5 * width**dim * math.sqrt(max(squares))
