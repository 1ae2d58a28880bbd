"""Regions from masks, and points given one by one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from granular.model.grid import MAX_COUNT, combined, steps_between
from granular.shapes.region import Region
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import array, check_fields, positive, set_fields, vector
from granular.tools.serializable import ComparedByContent

Vector = tuple[float, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Mask(ComparedByContent, Region):
    """The squares (cubes) of a regular grid that are marked.

    Parameters
    ----------
    inside : array_like of bool, shape (n_x, n_y) or (n_x, n_y, n_z)
        True for the squares of the region; at least one.
    lower : tuple of float, length dim
        Lower corner of the first square [m].
    spacing : float
        Edge of a square [m], > 0.
    {raises}.
    """

    inside: BoolArray
    lower: Vector
    spacing: float

    def __post_init__(self) -> None:
        check_fields(self, vector, "lower")
        check_fields(self, positive, "spacing")
        check_fields(self, array, "inside", shape=(None,) * len(self.lower), dtype=bool)
        if not self.inside.any():
            raise ValueError(f"inside of shape {self.inside.shape} must be True somewhere")

    @classmethod
    def of(
        cls, function: Callable[[Array], ArrayLike], lower: Any, upper: Any, spacing: float
    ) -> Self:
        """Sample a function of positions, shape (n, dim) [m], that is True inside, shape (n,).

        A function cannot be written into a record, its samples can; so can those of the `contains`
        of a user-defined region. With the spacing of the seeding lattice, from the corner of a cell
        on, they are exact at its sites.
        """
        low = vector("lower", lower)
        high = vector("upper", upper, len(low))
        step = positive("spacing", spacing)
        counts = [steps_between(a, b, step) for a, b in zip(low, high, strict=True)]
        if min(counts) < 1:
            raise ValueError(f"upper = {high} must exceed lower = {low}")
        if math.prod(counts) > MAX_COUNT:
            raise ValueError(f"spacing = {step} must make at most {MAX_COUNT} squares")
        x = combined([a + step * (np.arange(n) + 0.5) for a, n in zip(low, counts, strict=True)])
        inside = np.asarray(function(x), dtype=bool)
        if inside.shape != (len(x),):
            raise ValueError(f"function returned the shape {inside.shape}, must be ({len(x)},)")
        return cls(inside.reshape(counts, order="F"), low, step)

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        marked = np.nonzero(self.inside)
        ends = [
            (low + int(at.min()) * self.spacing, low + (int(at.max()) + 1) * self.spacing)
            for low, at in zip(self.lower, marked, strict=True)
        ]
        lower, upper = zip(*ends, strict=True)
        return lower, upper

    def _inside(self, x: Array) -> BoolArray:
        place = np.floor((x - self.lower) / self.spacing)
        among = np.all((place >= 0) & (place < self.inside.shape), axis=1)
        inside = np.zeros(len(x), dtype=bool)
        inside[among] = self.inside[tuple(place[among].astype(np.int64).T)]
        return inside


@dataclass(frozen=True, eq=False, repr=False)
class Cloud(ComparedByContent, Region):
    """Points given one by one; as a region, the squares (cubes) of their volumes about them.

    A `Fill` of a cloud has just these points. Its `points_per_cell` is then only their approximate
    density.

    Parameters
    ----------
    x : array_like, shape (n, dim)
        Positions [m].
    volume : float or array_like, shape (n,)
        Volumes [m^dim], > 0. The mass of a point is its volume times its density.
    velocity : array_like, shape (n, dim), optional
        Velocities [m/s]; only used in a `Fill` without a `velocity`.
    density : array_like, shape (n,), optional
        Densities [kg/m3], > 0; only used in a `Fill` without a `density`. Must be None
        in a lithostatic fill.
    {raises}.
    """

    x: Array
    volume: Array
    velocity: Array | None = None
    density: Array | None = None

    def __post_init__(self) -> None:
        x = array("x", self.x, (None, None))
        if not len(x) or x.shape[1] not in (2, 3):
            raise ValueError(f"x of shape {x.shape} must be (n, 2) or (n, 3) with n >= 1")
        if np.ndim(self.volume) == 0:
            set_fields(self, volume=np.full(len(x), positive("volume", self.volume)))
        set_fields(self, x=x)
        check_fields(self, array, "volume", shape=(len(x),))
        check_fields(self, array, "density", shape=(len(x),), optional=True)
        check_fields(self, array, "velocity", shape=x.shape, optional=True)
        for name in ("volume", "density"):
            values = getattr(self, name)
            if values is not None and not (values > 0).all():
                raise ValueError(f"{name}: the least is {values.min()}, must be > 0")

    @property
    def _half(self) -> Array:
        """Half the edges of the squares of the points [m], shape (n,)."""
        half: Array = 0.5 * self.volume ** (1.0 / self.x.shape[1])
        return half

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        return tuple(self.x.min(axis=0).tolist()), tuple(self.x.max(axis=0).tolist())

    @property
    def _box(self) -> tuple[Vector, Vector]:
        half = self._half[:, None]
        lower, upper = (self.x - half).min(axis=0), (self.x + half).max(axis=0)
        return tuple(lower.tolist()), tuple(upper.tolist())

    def _inside(self, x: Array) -> BoolArray:
        half = self._half
        # The nearest by the largest component; of squares of one size, it is the one around.
        gap, nearest = scipy.spatial.cKDTree(self.x).query(
            x, p=np.inf, distance_upper_bound=half.max()
        )
        inside = np.isfinite(gap)
        inside[inside] = gap[inside] < half[nearest[inside]]
        return inside
