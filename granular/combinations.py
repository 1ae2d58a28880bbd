"""Regions made of other regions: unions, intersections, differences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granular.checks import check_fields, kinds_of, sequence, tuple_of
from granular.geometry import Region, Vector

__all__ = ["Difference", "Intersection", "Union", "least"]


def _regions(name: str, regions: object) -> tuple[Region, ...]:
    checked = tuple_of(name, sequence(name, regions), (Region,))
    if not checked:
        raise ValueError(f"{name} = () must hold at least one Region")
    if len({region.dim for region in checked}) > 1:
        raise ValueError(f"{name} = {checked} must have one dimension")
    return checked


def _common_box(
    regions: Sequence[Region], low: Callable[..., float], high: Callable[..., float]
) -> tuple[Vector, Vector]:
    """Corners made of the `low` of the lower ends and the `high` of the upper ends of regions."""
    corners = zip(*(region.bounds for region in regions), strict=True)
    lows, highs = (zip(*ends, strict=True) for ends in corners)
    return tuple(map(low, lows)), tuple(map(high, highs))


def least(
    found: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least of several distances, and the normals that go with it."""
    distances, normals = (np.array(part) for part in zip(*found, strict=True))
    of = distances.argmin(axis=0)
    every = np.arange(len(of))
    return distances[of, every], normals[of, every]


@dataclass(frozen=True)
class Union(Region):
    """The points that lie in at least one of `regions`, a sequence of regions of one dimension."""

    regions: tuple[Region, ...]

    def __post_init__(self) -> None:
        check_fields(self, _regions, "regions")

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        return _common_box(self.regions, min, max)

    def cuts(self, x: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
        return np.any([region.cuts(x, reach) for region in self.regions], axis=0)

    def distance(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        found = []
        for region in self.regions:
            away, inwards = region.distance(x)
            # A region without such a boundary is infinitely far, inside or outside.
            open_ = np.isinf(away) & ~region.contains(x)
            found.append((np.where(open_, np.inf, -away), -inwards))
        away, outwards = least(found)
        return -away, -outwards

    def _inside(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.any([region.contains(x) for region in self.regions], axis=0)


@dataclass(frozen=True)
class Intersection(Region):
    """The points that lie in all of `regions`, a sequence of regions whose bounds overlap."""

    regions: tuple[Region, ...]

    def __post_init__(self) -> None:
        check_fields(self, _regions, "regions")
        low, high = self.bounds
        if not all(a < b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"regions = {self.regions} must overlap")

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        return _common_box(self.regions, max, min)

    def cuts(self, x: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
        return np.any([region.cuts(x, reach) for region in self.regions], axis=0)

    def distance(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return least([region.distance(x) for region in self.regions])

    def _inside(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.all([region.contains(x) for region in self.regions], axis=0)


@dataclass(frozen=True)
class Difference(Region):
    """The points of `region` that lie outside of `without`, another region of its dimension."""

    region: Region
    without: Region

    def __post_init__(self) -> None:
        kinds_of(self, region=Region, without=Region)
        dim = self.region.dim
        if self.without.dim != dim:
            raise ValueError(f"without = {self.without} must have {dim} dimensions, as region has")

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        return self.region.bounds

    def cuts(self, x: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
        return self.region.cuts(x, reach) | self.without.cuts(x, reach)

    def distance(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        away, inwards = self.without.distance(x)
        away = np.where(np.isinf(away), np.inf, -away)
        return least([self.region.distance(x), (away, -inwards)])

    def _inside(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        return self.region.contains(x) & ~self.without.contains(x)
