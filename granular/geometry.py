"""The grid, simple regions, and fills of material points; combinations: `combinations`."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

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
from granular.materials import Material

__all__ = [
    "AXES",
    "Box",
    "Cylinder",
    "Disc",
    "Fill",
    "Grid",
    "Region",
]

AXES = "xyz"
LINE_TOLERANCE = 1e-9
"""Largest distance, in cells, at which a coordinate still counts as on a grid line, near the
origin; see `Grid.slack`."""
ROUNDINGS = 64
"""Roundings of a coordinate that add up in places made of sums and products of a few numbers."""
COARSEST = 0.01
"""Largest `Grid.slack`: what is nearer to a line than this would have no cell of its own."""
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
        Edge of a cell dx [m], > 0.
    shape : tuple of int, length dim
        Cells along each axis, >= 1.
    periodic : tuple of bool, length dim, optional
        Axes along which the domain is periodic; none by default.
    open_sides : collection of str, optional
        Sides ("x-", "y+", ...) through which points leave for good; none by default, and none along
        a periodic axis.

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
        if not self.slack <= COARSEST:
            raise ValueError(
                f"cell = {self.cell} must be larger, or the grid nearer to the origin: coordinates "
                f"from {self.lower} to {self.upper} are rounded by up to {self.slack:.2g} cells, "
                f"must be <= {COARSEST}"
            )
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

    @property
    def rounding(self) -> float:
        """Rounding of the coordinates of the grid [cells]."""
        return max(rounding(self.cell, *self.lower, *self.upper), rounding(1.0, *self.shape))

    @property
    def slack(self) -> float:
        """Largest distance [cells] at which a coordinate counts as on a grid line."""
        return max(LINE_TOLERANCE, ROUNDINGS * self.rounding)

    def line(self, name: str, axis: int, at: float) -> int:
        """Index of the grid line at coordinate `at` [m] of `axis`; `name` is for the message.

        Raises
        ------
        ValueError
            If there is none within the `slack`.
        """
        place = (at - self.lower[axis]) / self.cell
        line = round(place)
        if abs(place - line) > self.slack or not 0 <= line <= self.shape[axis]:
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

    @property
    def _box(self) -> tuple[Vector, Vector]:
        """Corners of the box in which `depth` looks for the top."""
        return self.bounds

    def cuts(self, x: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
        """True for places, shape (n, dim) [m], whose squares the boundary is to cut.

        For a region whose points follow its boundary these are all that are no farther from it
        than `reach` [m], and some more. Of others squares count as a whole, by their centres.
        """
        return np.zeros(len(x), dtype=bool)

    def distance(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Distance of places from the boundary that is to cut squares, and its inward normals.

        The distance, shape (n,) [m], is positive inside and infinite without such a boundary. Near
        to the boundary its error is of second order in the distance.
        """
        return np.full(len(x), np.inf), np.zeros_like(x)

    def depth(
        self, x: NDArray[np.float64], up: NDArray[np.float64], step: float
    ) -> NDArray[np.float64]:
        """Distance of places from the top of the region above them.

        The top is the last place of the region along a ray, even beyond gaps such as those below
        an overhang: below a level surface the pressure is the same at one height.

        Parameters
        ----------
        x : ndarray, shape (n, dim)
            Places in the region [m].
        up : ndarray, shape (dim,)
            Direction, of length 1.
        step : float
            Distance at which the ray is looked at [m]; less is not resolved, but for the top, which
            is then found by bisection.

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

    def ahead(
        self, x: NDArray[np.float64], along: NDArray[np.float64], step: float
    ) -> NDArray[np.float64]:
        """Distance at which rays from places outside enter the region [m]; inf if they do not.

        Parameters are those of `depth`.
        """
        low, high = np.array(self._box)
        x, found = np.asarray(x), np.full(len(x), np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.sort([(low - x) / along, (high - x) / along], axis=0)
        ends[:, :, along == 0] = np.array([-np.inf, np.inf])[:, None, None]
        begin, end = np.maximum(ends[0].max(axis=1), 0.0), ends[1].min(axis=1)
        inside = (x >= low) & (x <= high)
        hits = (begin <= end) & inside[:, along == 0].all(axis=1)
        if hits.any():
            longest = float((end - begin)[hits].max()) + step
            start = np.maximum(begin[hits] - 1e-6 * step, 0.0)
            found[hits] = start + self._first_inside(
                x[hits] + start[:, None] * along, along, step, longest
            )
        return found

    def _first_inside(
        self, x: NDArray[np.float64], along: NDArray[np.float64], step: float, longest: float
    ) -> NDArray[np.float64]:
        """Distance at which rays from places outside enter the region [m]; inf if they do not."""
        found = np.full(len(x), np.inf)
        left = np.arange(len(x))
        for n in range(math.ceil(longest / step) + 1):
            hit = self._inside(x[left] + (n * step) * along)
            found[left[hit]] = n * step
            left = left[~hit]
            if not len(left):
                break
        outside, inside = np.maximum(found - step, 0.0), found.copy()
        some = np.isfinite(found)
        for _ in range(40):
            middle = 0.5 * (outside[some] + inside[some])
            within = self._inside(x[some] + middle[:, None] * along)
            inside[some] = np.where(within, middle, inside[some])
            outside[some] = np.where(within, outside[some], middle)
        return inside

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
    """An axis-aligned box, the upper faces not included.

    Parameters
    ----------
    lower, upper : tuple of float, length dim
        Corners [m]; their length, 2 or 3, is the dimension.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

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

    def depth(
        self, x: NDArray[np.float64], up: NDArray[np.float64], step: float
    ) -> NDArray[np.float64]:
        ends = [
            ((self.upper if along > 0 else self.lower)[axis] - x[:, axis]) / along
            for axis, along in enumerate(up.tolist())
            if along
        ]
        least: NDArray[np.float64] = np.min(ends, axis=0)
        return least


@dataclass(frozen=True)
class Disc(Region):
    """A disc in 2D, a ball in 3D.

    Parameters
    ----------
    center : tuple of float, length dim
        Centre [m]; its length, 2 or 3, is the dimension.
    radius : float
        Radius [m], > 0.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

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
    """An upright cylinder in 3D, along the last axis.

    Parameters
    ----------
    center : tuple of 3 floats
        Centre of its base [m].
    radius, height : float
        Radius and height [m], > 0.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

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


@dataclass(frozen=True)
class Fill:
    """Material that fills a region at the start, as points on a regular seeding lattice.

    Points keep out of the bodies of a scene: where a body cuts the square (cube) of a site, the
    point is at the centroid of the open part and has the volume of that part, so that the first row
    follows the surface. Parts of less than a tenth go to a neighbour. Where the centroid is within
    a body, outside of the region or in another fill, as in a wedge, the point is in the nearest
    piece of the part instead.

    Parameters
    ----------
    region : Region
        Region to fill: every site of the seeding lattice that lies inside gets a point. The
        boundary of a `Polygon` or `Layer` cuts squares as bodies do. A `Cloud` holds the points
        itself.
    points_per_cell : int
        Points in a full cell: q^2 in 2D, q^3 in 3D, with an integer q.
    density : float or None
        Initial density [kg/m3]; None for the material's `rho_c`. Grains have the pressure that
        goes with it, K ln(rho/rho_c) if that is positive; cohesive ones that are looser have come
        apart, and cohere once they touch. Must be None in a lithostatic fill.
    velocity : tuple of float, length dim, or None
        Initial velocity [m/s]; None for rest.
    jitter : float
        Amplitude of a random displacement, 0 to 1: it is uniform within +- jitter/2 point spacings
        along each axis. A point that would leave the region, or come nearer to a body beside it,
        stays where it is.
    stagger : bool
        If True, each column of points along the last axis is raised or lowered by its own part of
        half a point spacing. For material that a body carries across the grid: the points of a row
        then cross a line of nodes one after the other and not all at once. A `Cloud` stays as it
        is.
    lithostatic : bool
        If True, the material bears its weight from the start: each point has the vertical stress of
        the depth below the top of the region above it, against gravity, and the density that goes
        with the mean of its stresses. This is an equilibrium where the top is level, and below a
        slope of one angle. The weight of other lithostatic fills above it is added. If False,
        grains have the pressure of their density, and an elastic material is stress-free; with
        Hencky's law it too has the pressure of its density.
    K0 : float or None
        Ratio of the horizontal to the vertical stress of a lithostatic fill, > 0, within yield of
        its material. None for that of material that has settled by its weight alone,
        `Material.K0`: nu/(1 - nu), or more if that yields. It is 1 - sin(phi) in many sands (Jaky
        1944); compaction makes it larger, up to the passive limit. Must be None in a fill that is
        not lithostatic.
    material : Material or None
        Material of this fill; None for that of the scene. Several materials share one velocity
        field, so that they stick to each other where they meet.

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
    stagger: bool = False
    lithostatic: bool = False
    K0: float | None = None
    material: Material | None = None

    def __post_init__(self) -> None:
        kinds_of(self, region=Region)
        if self.material is not None:
            kinds_of(self, material=Material)
        count = integer("points_per_cell", self.points_per_cell, 1, 10**6)
        if self.points_per_axis**self.region.dim != count:
            kind = "square" if self.region.dim == 2 else "cube"
            raise ValueError(f"points_per_cell = {count} must be the {kind} of an integer")
        set_fields(self, points_per_cell=count)
        check_fields(self, in_range, "jitter", low=0.0, high=1.0)
        check_fields(self, truth, "stagger")
        check_fields(self, positive, "density", optional=True)
        if truth("lithostatic", self.lithostatic) and self.density is not None:
            raise ValueError(f"density = {self.density} must be None in a lithostatic fill")
        check_fields(self, positive, "K0", optional=True)
        if self.K0 is not None and not self.lithostatic:
            raise ValueError(f"K0 = {self.K0} must be None in a fill that is not lithostatic")
        check_fields(self, vector, "velocity", dim=self.region.dim, optional=True)

    @property
    def points_per_axis(self) -> int:
        """Points along an edge of a cell."""
        return round(self.points_per_cell ** (1.0 / self.region.dim))


def check_inside(name: str, grid: Grid, region: Region) -> None:
    """Refuse a region whose dimension is not that of the grid, or that extends beyond the grid."""
    if region.dim != grid.dim:
        raise ValueError(f"{name} has dimension {region.dim}, must have {grid.dim} as the grid")
    slack = grid.slack * grid.cell
    for axis, (low, high) in enumerate(zip(*region.bounds, strict=True)):
        if low < grid.lower[axis] - slack or high > grid.upper[axis] + slack:
            raise ValueError(
                f"{name} reaches from {low} to {high} along {AXES[axis]}, must stay in the grid"
                f" from {grid.lower[axis]} to {grid.upper[axis]}"
            )


def rounding(step: float, *coordinates: float) -> float:
    """Rounding of coordinates [m], over a step [m]."""
    return float(np.finfo(float).eps) * (max(map(abs, coordinates)) / step)


def steps_between(low: float, high: float, step: float) -> int:
    """Number of steps [m] from one coordinate to another, the last of which may reach beyond it."""
    slack = max(LINE_TOLERANCE, ROUNDINGS * rounding(step, low, high))
    return math.ceil((high - low) / step - slack)


def combined(axes: Sequence[NDArray]) -> NDArray:
    """All combinations of coordinates along axes, shape (n, dim), the first axis fastest."""
    mesh = np.meshgrid(*axes[::-1], indexing="ij")
    return np.stack([coordinate.ravel() for coordinate in mesh[::-1]], axis=1)
