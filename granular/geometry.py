"""The grid, regions to fill, and the seeding of material points."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granular.checks import (
    check_fields,
    in_range,
    integer,
    kinds_of,
    positive,
    sequence,
    set_fields,
    truth,
    vector,
)

__all__ = [
    "AXES",
    "Box",
    "Cylinder",
    "Difference",
    "Disc",
    "Fill",
    "Grid",
    "Intersection",
    "Points",
    "Region",
    "Union",
    "count_points",
    "seed_points",
]

AXES = "xyz"
LINE_TOLERANCE = 1e-9
"""Largest distance, in cells, at which a coordinate still counts as on a grid line."""
MAX_COUNT = 2**31 - 1
"""Largest number of cells or points; the core counts them with 32 bits."""

Vector = tuple[float, ...]


@dataclass(frozen=True)
class Grid:
    """A box of square (cubic) cells. The last axis is up.

    Parameters
    ----------
    lower : tuple of float, length dim
        Lower corner [m]; its length (2 or 3) is the dimension.
    cell : float
        Edge of a cell dx [m].
    shape : tuple of int, length dim
        Cells along each axis.
    periodic : tuple of bool, length dim, optional
        Axes along which the domain is periodic; none by default.
    open_sides : collection of str, optional
        Sides ("x-", "y+", ...) through which points leave for good.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    lower: Vector
    cell: float
    shape: tuple[int, ...]
    periodic: tuple[bool, ...] = ()
    open_sides: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        lower = vector("lower", self.lower)
        shape = tuple(
            integer(f"shape[{i}]", n, 1, MAX_COUNT)
            for i, n in enumerate(sequence("shape", self.shape))
        )
        periodic = sequence("periodic", self.periodic) or (False,) * len(lower)
        for name, value in (("shape", shape), ("periodic", periodic)):
            if len(value) != len(lower):
                raise ValueError(f"{name} = {value} must have {len(lower)} entries, as lower")
        if not all(isinstance(flag, (bool, np.bool_)) for flag in periodic):
            raise TypeError(f"periodic = {periodic} must hold True or False")
        if math.prod(shape) > MAX_COUNT:
            raise ValueError(f"shape = {shape} must have at most {MAX_COUNT} cells")
        check_fields(self, positive, "cell")
        set_fields(self, lower=lower, shape=shape, periodic=tuple(map(bool, periodic)))
        set_fields(self, open_sides=self._checked_sides())

    def _checked_sides(self) -> frozenset[str]:
        if isinstance(self.open_sides, str):
            raise TypeError(f"open_sides = {self.open_sides!r} must be a set of sides")
        sides = frozenset(self.open_sides)
        allowed = {axis + end for axis in AXES[: self.dim] for end in "-+"}
        for side in sorted(map(str, sides)):
            if side not in allowed:
                raise ValueError(f"open_sides: {side!r} must be one of {sorted(allowed)}")
            if self.periodic[AXES.index(side[0])]:
                raise ValueError(f"open_sides: {side!r} must not end a periodic axis")
        return sides

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return len(self.lower)

    @property
    def upper(self) -> Vector:
        """Upper corner [m]."""
        return tuple(x + n * self.cell for x, n in zip(self.lower, self.shape, strict=True))

    def line(self, name: str, axis: int, at: float) -> int:
        """Index of the grid line at coordinate `at` [m] of `axis`; `name` is for the message.

        Raises
        ------
        ValueError
            If there is none within 1e-9 cells.
        """
        place = (at - self.lower[axis]) / self.cell
        line = round(place)
        if abs(place - line) > LINE_TOLERANCE or not 0 <= line <= self.shape[axis]:
            raise ValueError(
                f"{name} = {at} must lie on a grid line of {AXES[axis]}: from"
                f" {self.lower[axis]} to {self.upper[axis]} in steps of {self.cell}"
            )
        return line


class Region(ABC):
    """A region of 2D or 3D space."""

    @property
    @abstractmethod
    def bounds(self) -> tuple[Vector, Vector]:
        """Lower and upper corner of a box that encloses the region [m]."""

    @abstractmethod
    def _inside(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return `contains` for an array that has been checked."""

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return len(self.bounds[0])

    def contains(self, x: ArrayLike) -> NDArray[np.bool_]:
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


@dataclass(frozen=True)
class Box(Region):
    """An axis-aligned box from `lower` to `upper` [m], the upper faces not included."""

    lower: Vector
    upper: Vector

    def __post_init__(self) -> None:
        lower = vector("lower", self.lower)
        upper = vector("upper", self.upper, len(lower))
        for axis, (low, high) in enumerate(zip(lower, upper, strict=True)):
            if not high > low:
                raise ValueError(f"upper[{axis}] = {high} must exceed lower[{axis}] = {low}")
        set_fields(self, lower=lower, upper=upper)

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        return self.lower, self.upper

    def _inside(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.all((x >= self.lower) & (x < self.upper), axis=1)


@dataclass(frozen=True)
class Disc(Region):
    """A disc in 2D, a ball in 3D, with `center` and `radius` [m]."""

    center: Vector
    radius: float

    def __post_init__(self) -> None:
        check_fields(self, vector, "center")
        check_fields(self, positive, "radius")

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        return (
            tuple(c - self.radius for c in self.center),
            tuple(c + self.radius for c in self.center),
        )

    def _inside(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.sum((x - self.center) ** 2, axis=1) < self.radius**2


@dataclass(frozen=True)
class Cylinder(Region):
    """An upright cylinder with the `center` of its base (3 numbers), `radius` and `height` [m]."""

    center: Vector
    radius: float
    height: float

    def __post_init__(self) -> None:
        check_fields(self, vector, "center", dim=3)
        check_fields(self, positive, "radius", "height")

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        x, y, z = self.center
        r = self.radius
        return (x - r, y - r, z), (x + r, y + r, z + self.height)

    def _inside(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        base = self.center[2]
        flat = np.sum((x[:, :2] - self.center[:2]) ** 2, axis=1) < self.radius**2
        return flat & (x[:, 2] >= base) & (x[:, 2] < base + self.height)


def _regions(name: str, regions: object) -> tuple[Region, ...]:
    checked = sequence(name, regions)
    for region in checked:
        if not isinstance(region, Region):
            raise TypeError(f"regions: {region!r} must be a Region")
    if not checked:
        raise ValueError("regions = () must hold at least one Region")
    if len({region.dim for region in checked}) > 1:
        raise ValueError(f"regions = {checked} must have one dimension")
    return checked


def _common_box(
    regions: Sequence[Region], low: Callable[..., float], high: Callable[..., float]
) -> tuple[Vector, Vector]:
    """Corners made of the `low` of the lower ends and the `high` of the upper ends of regions."""
    corners = zip(*(region.bounds for region in regions), strict=True)
    lows, highs = (zip(*ends, strict=True) for ends in corners)
    return tuple(map(low, lows)), tuple(map(high, highs))


@dataclass(frozen=True)
class Union(Region):
    """The points that lie in at least one of `regions`."""

    regions: tuple[Region, ...]

    def __post_init__(self) -> None:
        check_fields(self, _regions, "regions")

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        return _common_box(self.regions, min, max)

    def _inside(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.any([region.contains(x) for region in self.regions], axis=0)


@dataclass(frozen=True)
class Intersection(Region):
    """The points that lie in all of `regions`."""

    regions: tuple[Region, ...]

    def __post_init__(self) -> None:
        check_fields(self, _regions, "regions")
        low, high = self.bounds
        if not all(a < b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"regions = {self.regions} must overlap")

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        return _common_box(self.regions, max, min)

    def _inside(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.all([region.contains(x) for region in self.regions], axis=0)


@dataclass(frozen=True)
class Difference(Region):
    """The points of `region` that lie outside of `without`."""

    region: Region
    without: Region

    def __post_init__(self) -> None:
        _regions("regions", (self.region, self.without))

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        return self.region.bounds

    def _inside(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        return self.region.contains(x) & ~self.without.contains(x)


@dataclass(frozen=True)
class Fill:
    """Material that fills a region at the start, as points on a regular seeding lattice.

    Parameters
    ----------
    region : Region
        Region to fill: every site of the seeding lattice that lies inside gets a point.
    points_per_cell : int
        Points in a full cell: q^2 in 2D, q^3 in 3D.
    density : float or None
        Initial density [kg/m3]; None for the material's `rho_c`.
    velocity : tuple of float, length dim, or None
        Initial velocity [m/s]; None for rest.
    jitter : float
        Amplitude of a random displacement, 0 to 1: it is uniform within +- jitter/2 point spacings
        along each axis.
    lithostatic : bool
        If True, the material is in equilibrium with gravity from the start: each point has the
        pressure of the material above it, up to the top of the region, and the density that goes
        with this pressure. If False, it is stress-free.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    region: Region
    points_per_cell: int
    density: float | None = None
    velocity: Vector | None = None
    jitter: float = 0.0
    lithostatic: bool = False

    def __post_init__(self) -> None:
        kinds_of(self, region=Region)
        count = integer("points_per_cell", self.points_per_cell, 1, 10**6)
        if self.points_per_axis**self.region.dim != count:
            kind = "square" if self.region.dim == 2 else "cube"
            raise ValueError(f"points_per_cell = {count} must be the {kind} of an integer")
        set_fields(self, points_per_cell=count)
        check_fields(self, in_range, "jitter", low=0.0, high=1.0)
        check_fields(self, positive, "density", optional=True)
        if truth("lithostatic", self.lithostatic) and self.density is not None:
            raise ValueError(f"density = {self.density} must be None in a lithostatic fill")
        check_fields(self, vector, "velocity", dim=self.region.dim, optional=True)

    @property
    def points_per_axis(self) -> int:
        """Points along an edge of a cell."""
        return round(self.points_per_cell ** (1.0 / self.region.dim))


@dataclass(frozen=True, eq=False)
class Points:
    """Material points as seeded; arrays are read-only.

    Attributes
    ----------
    x, v : ndarray, shape (n, dim)
        Position [m], velocity [m/s], in the order of the fills; within a fill the first axis varies
        fastest.
    volume, density : ndarray, shape (n,)
        Volume of the point [m^dim], density [kg/m3]; their product is its mass.
    depth : ndarray, shape (n,)
        Depth below the top of a lithostatic fill [m], which determines its pressure; 0 in others.
    """

    x: NDArray[np.float64]
    v: NDArray[np.float64]
    volume: NDArray[np.float64]
    density: NDArray[np.float64]
    depth: NDArray[np.float64]

    def __post_init__(self) -> None:
        for array in vars(self).values():
            array.setflags(write=False)


def check_inside(name: str, grid: Grid, region: Region) -> None:
    """Refuse a region whose dimension is not that of the grid, or that extends beyond the grid."""
    if region.dim != grid.dim:
        raise ValueError(f"{name} has dimension {region.dim}, must have {grid.dim} as the grid")
    slack = LINE_TOLERANCE * grid.cell
    for axis, (low, high) in enumerate(zip(*region.bounds, strict=True)):
        if low < grid.lower[axis] - slack or high > grid.upper[axis] + slack:
            raise ValueError(
                f"{name} reaches from {low} to {high} along {AXES[axis]}, must stay in the grid"
                f" from {grid.lower[axis]} to {grid.upper[axis]}"
            )


def combined(axes: Sequence[NDArray]) -> NDArray:
    """All combinations of coordinates along axes, shape (n, dim), the first axis fastest."""
    mesh = np.meshgrid(*axes[::-1], indexing="ij")
    return np.stack([coordinate.ravel() for coordinate in mesh[::-1]], axis=1)


def _sites(grid: Grid, fill: Fill) -> NDArray[np.float64]:
    """Sites of the seeding lattice in the region of a fill, shape (n, dim), first axis fastest."""
    spacing = grid.cell / fill.points_per_axis
    axes = []
    for axis, (low, high) in enumerate(zip(*fill.region.bounds, strict=True)):
        origin, sites = grid.lower[axis], grid.shape[axis] * fill.points_per_axis
        first = max(math.floor((low - origin) / spacing) - 1, 0)
        last = min(math.ceil((high - origin) / spacing) + 1, sites)
        axes.append(origin + (np.arange(first, last) + 0.5) * spacing)
    if math.prod(len(sites) for sites in axes) > MAX_COUNT:
        raise ValueError(f"a fill of {fill.region} must have at most {MAX_COUNT} points")
    x = combined(axes)
    return x[fill.region.contains(x)]


SAMPLES = 200_000
"""Number of sites up to which `estimated_points` counts all; beyond, the number of samples."""


def estimated_points(grid: Grid, fill: Fill) -> int:
    """Number of points of a fill, without making them: exact for few, else from samples.

    The share of a region in the box around it is that of samples at the centres of equal parts.
    """
    spacing = grid.cell / fill.points_per_axis
    lower, upper = np.array(fill.region.bounds)
    sites = math.prod((upper - lower) / spacing)
    if sites <= SAMPLES:
        return len(_sites(grid, fill))
    parts = max(math.floor(SAMPLES ** (1.0 / grid.dim)), 1)
    axes = [
        low + (np.arange(parts) + 0.5) * ((high - low) / parts)
        for low, high in zip(lower, upper, strict=True)
    ]
    return round(sites * float(fill.region.contains(combined(axes)).mean()))


def _checked_sites(grid: Grid, fills: Sequence[Fill]) -> list[NDArray[np.float64]]:
    """Sites of each fill; refuse fills that overlap, leave the grid or hold no point."""
    if not fills:
        raise ValueError("fills = () must hold at least one Fill")
    sites = []
    for i, fill in enumerate(fills):
        check_inside(f"fills[{i}]", grid, fill.region)
        sites.append(_sites(grid, fill))
        if not len(sites[-1]):
            raise ValueError(f"fills[{i}] = {fill} must hold at least one material point")
    for i, j in permutations(range(len(fills)), 2):
        shared = fills[j].region.contains(sites[i])
        if shared.any():
            place = tuple(sites[i][shared.argmax()].tolist())
            raise ValueError(f"fills[{i}] and fills[{j}] must not overlap, as they do at {place}")
    return sites


def count_points(grid: Grid, fills: Sequence[Fill]) -> int:
    """Number of material points that `seed_points` makes."""
    return sum(len(sites) for sites in _checked_sites(grid, fills))


def seed_points(grid: Grid, fills: Sequence[Fill], seed: int, rho_c: float) -> Points:
    """Fill regions with material points.

    Parameters
    ----------
    grid : Grid
    fills : sequence of Fill
    seed : int
        Seed of the random jitter, >= 0; the same seed gives the same points.
    rho_c : float
        Density [kg/m3] of the fills whose `density` is None.

    Returns
    -------
    Points

    Raises
    ------
    ValueError
        If fills overlap, extend beyond the grid, or hold no point.
    """
    rng = np.random.default_rng(integer("seed", seed, 0))
    rho_c = positive("rho_c", rho_c)
    parts = []
    # Rounding may put a site onto the upper end of the grid, which does not belong to any cell.
    last = np.nextafter(grid.upper, grid.lower)
    for fill, sites in zip(fills, _checked_sites(grid, fills), strict=True):
        spacing = grid.cell / fill.points_per_axis
        if fill.jitter:
            moved = sites + rng.uniform(-0.5, 0.5, sites.shape) * (fill.jitter * spacing)
            sites = np.clip(moved, grid.lower, last)
        v = np.broadcast_to(fill.velocity or (0.0,) * grid.dim, sites.shape)
        volume = np.full(len(sites), spacing**grid.dim)
        density = np.full(len(sites), rho_c if fill.density is None else fill.density)
        depth = (fill.region.bounds[1][-1] - sites[:, -1]) * fill.lithostatic
        parts.append((sites, v, volume, density, depth))
    return Points(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
