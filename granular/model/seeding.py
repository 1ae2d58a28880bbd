"""The material points that fill regions at the start."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, permutations

import numpy as np
from numpy.typing import ArrayLike

from granular.model.fill import Fill, check_inside
from granular.model.grid import Grid, combined
from granular.model.open_parts import LEAST_SHARE, REACH, OpenParts
from granular.model.open_space import Distance, OpenSpace, last_place, nowhere
from granular.model.regions import Cloud, Mask
from granular.model.seeding_lattice import SeedingLattice
from granular.shapes.boxes import Box
from granular.shapes.region import Region
from granular.tools.arrays import Array, BoolArray, IntArray
from granular.tools.checks import integer, positive


@dataclass(frozen=True, eq=False)
class Points:
    """Material points as seeded; arrays are read-only.

    Attributes
    ----------
    x, v : ndarray, shape (n, dim)
        Position [m], velocity [m/s], in the order of the fills; within a fill the first axis of the
        seeding lattice varies fastest.
    volume, density : ndarray, shape (n,)
        Volume of the point [m^dim; m3 in an axisymmetric grid], density [kg/m3]; their product is
        its mass.
    depth : ndarray, shape (n,)
        Depth below the top of a lithostatic fill [m], which determines its pressure; 0 in others.
        It is measured against gravity, up to the top of the region above the point.
    overburden : ndarray, shape (n,)
        Mass per area of the other lithostatic fills above a point of a lithostatic fill [kg/m2].
    slope : ndarray, shape (n, dim)
        Horizontal gradient of that depth and overburden, over the density of the material; 0 below
        a level top.
    fill : ndarray, shape (n,)
        Number of the fill of the point.
    """

    x: Array
    v: Array
    volume: Array
    density: Array
    depth: Array
    overburden: Array
    slope: Array
    fill: IntArray

    def __post_init__(self) -> None:
        for array in vars(self).values():
            array.setflags(write=False)

    def taken(self, index: slice | BoolArray) -> Points:
        """Return some of the points."""
        return Points(*(array[index] for array in vars(self).values()))


def joined(parts: Iterable[Points], dim: int) -> Points:
    """Join points of a dimension, one part after the other."""
    place, number = np.empty((0, dim)), np.empty(0)
    none = (place, place, number, number, number, number, place, np.empty(0, dtype=np.int64))
    columns = zip(none, *(vars(part).values() for part in parts), strict=True)
    return Points(*(np.concatenate(arrays) for arrays in columns))


def _sites(grid: Grid, fill: Fill) -> Iterator[Array]:
    """Sites of the seeding lattice in the region of a fill, in parts of shape (n, dim).

    The sites of a cloud are its points.
    """
    if isinstance(fill.region, Cloud):
        yield fill.region.x
        return
    seeding_lattice = SeedingLattice(grid, fill)
    for squares in seeding_lattice.in_parts():
        x = seeding_lattice.at(squares)
        yield x[fill.region.contains(x)]


DEEPEST = 0.25
"""Largest depth of given points in a body [cells]. The contact moves such points out slowly."""
SAMPLES = 200_000
"""Number of sites up to which `estimated_points` counts all; beyond, the number of samples."""


def estimated_points(
    grid: Grid, fill: Fill, distance: Distance = nowhere, *, even: bool = False
) -> int:
    """Number of points of a fill, without making them: exact for few, else from samples.

    The fraction of the box around a region that is in it is estimated from samples, one at random
    in each of equal parts.
    """
    if isinstance(fill.region, Cloud):
        return len(fill.region.x)
    spacing = grid.cell / fill.points_per_axis
    lower, upper = np.array(fill.region.bounds)
    sites = math.prod((upper - lower) / spacing)
    if sites <= SAMPLES:
        return sum(len(x) for x, _ in _seeded(fill, _space(grid, (fill,), 0, distance), even))
    parts = max(math.floor(SAMPLES ** (1.0 / grid.dim)), 1)
    axes = [
        low + (np.arange(parts) + 0.5) * ((high - low) / parts)
        for low, high in zip(lower, upper, strict=True)
    ]
    x = combined(axes)
    x += np.random.default_rng(0).uniform(-0.5, 0.5, x.shape) * ((upper - lower) / parts)
    open_ = distance(x)[0] > (LEAST_SHARE - 0.5) * spacing
    return round(sites * float((fill.region.contains(x) & open_).mean()))


def most_points(grid: Grid, fill: Fill) -> int:
    """Bound of the number of points of a fill: twice the squares of the seeding lattice around it.
    A thin body may divide a square into two points.
    """
    if isinstance(fill.region, Cloud):
        return len(fill.region.x)
    spacing = grid.cell / fill.points_per_axis
    lower, upper = np.array(fill.region.bounds)
    return 2 * math.prod((np.ceil((upper - lower) / spacing) + 1).astype(np.int64).tolist())


def _space(grid: Grid, fills: Sequence[Fill], index: int, distance: Distance) -> OpenSpace:
    """Where the points of one of several fills may lie; a cloud's also beyond its squares."""
    region = fills[index].region
    others = tuple(fill.region for k, fill in enumerate(fills) if k != index)
    return OpenSpace(grid, None if isinstance(region, Cloud) else region, distance, others)


def _seeded(fill: Fill, space: OpenSpace, even: bool = False) -> Iterable[tuple[Array, Array]]:
    """Positions and volumes of the points of a fill, before any jitter, in parts."""
    region, grid = fill.region, space.grid
    if isinstance(region, Cloud):
        return [(np.clip(region.x, grid.lower, last_place(grid)), region.volume)]
    return OpenParts(SeedingLattice(grid, fill), region, space, even)


def _check(grid: Grid, fills: Sequence[Fill], distance: Distance) -> None:
    """Refuse fills that overlap or leave the grid, and given points deep in bodies."""
    if not fills:
        raise ValueError("fills = () must hold at least one Fill")
    for i, fill in enumerate(fills):
        check_inside(f"fills[{i}]", grid, fill.region)
        if not isinstance(fill.region, Cloud):
            continue
        if fill.lithostatic and fill.region.density is not None:
            raise ValueError(f"fills[{i}].region.density must be None in a lithostatic fill")
        phi, _ = distance(fill.region.x)
        if phi.min() < -DEEPEST * grid.cell:
            place = tuple(fill.region.x[phi.argmin()].tolist())
            raise ValueError(
                f"fills[{i}].region has a point at {place} that is {-phi.min():.3g} m within a "
                f"body, must be at most {DEEPEST * grid.cell:.3g} m, {DEEPEST} cells"
            )
    if len(fills) == 1:
        return
    for i, j in permutations(range(len(fills)), 2):
        squares = _sites(grid, fills[i])
        if i < j:
            squares = chain(squares, _cut_by_both(grid, fills[i], fills[j].region))
        for sites in squares:
            shared = _deep_in(fills[j].region, sites, grid)
            if shared.any():
                place = tuple(sites[shared.argmax()].tolist())
                raise ValueError(
                    f"fills[{i}] and fills[{j}] must not overlap, as they do at {place}"
                )


def _deep_in(region: Region, x: Array, grid: Grid) -> BoolArray:
    """True for positions in a region, by more than the rounding of coordinates."""
    inside = region.contains(x)
    inside[inside] = region.cut(x[inside])[0] < -grid.slack * grid.cell
    return inside


FINE = 4
"""Number of positions along an edge of a square at which two fills that cut it are compared."""


def _cut_by_both(grid: Grid, fill: Fill, other: Region) -> Iterator[Array]:
    """Positions of a fill in the squares that are cut by its boundary and by another one."""
    if isinstance(fill.region, Cloud):
        return
    seeding_lattice = SeedingLattice(grid, fill)
    parts = ((np.arange(FINE) + 0.5) / FINE - 0.5) * seeding_lattice.spacing
    for squares in seeding_lattice.in_parts():
        x = seeding_lattice.at(squares)
        x = x[fill.region.cuts(x, REACH * seeding_lattice.spacing)]
        x = x[other.cuts(x, REACH * seeding_lattice.spacing)]
        places = (x[:, None] + combined([parts] * grid.dim)).reshape(-1, grid.dim)
        yield places[_deep_in(fill.region, places, grid)]


def _jittered(rng: np.random.Generator, fill: Fill, x: Array, space: OpenSpace) -> Array:
    """Displace points at random, but not out of their fill or towards a body nearby."""
    grid = space.grid
    spacing = grid.cell / fill.points_per_axis
    moved = x + rng.uniform(-0.5, 0.5, x.shape) * (fill.jitter * spacing)
    moved = np.clip(moved, grid.lower, last_place(grid))
    fits = space.contains(moved)
    if space.distance is not nowhere:
        least = np.minimum(space.distance(x)[0], 0.5 * spacing)
        fits &= space.distance(moved)[0] >= least
    return np.where(fits[:, None], moved, x)


def _carried(fill: Fill, rho_c: float) -> tuple[ArrayLike, ArrayLike]:
    """Velocities [m/s] and densities [kg/m3] of the points of a fill."""
    v: ArrayLike | None = fill.velocity
    density: ArrayLike | None = fill.density
    if isinstance(fill.region, Cloud):
        v = fill.region.velocity if v is None else v
        density = fill.region.density if density is None else density
    return np.zeros(fill.region.dim) if v is None else v, rho_c if density is None else density


def is_level_box(region: Region) -> bool:
    """True for a box with faces normal to the axes."""
    return isinstance(region, Box) and not region.is_turned


def _loads(
    fills: Sequence[Fill], index: int, x: Array, above: Array, rho_c: Sequence[float], step: float
) -> tuple[Array, Array]:
    """Depth [m] below the top of a fill, and mass per area [kg/m2] of the others above."""
    load = _overburden(fills, index, x, above, rho_c, step)
    return fills[index].region.depth(x, above, step), load


def _slopes(
    fills: Sequence[Fill], index: int, x: Array, above: Array, rho_c: Sequence[float], step: float
) -> Array:
    """Horizontal gradient of the load above positions in a fill, over its density, shape (n, dim).

    The smaller of the differences over a cell on either side, or of the next two on one side at the
    ends of the fill, and 0 where they differ in sign: the edge of a load is a jump, not a slope.
    """
    slopes, region = np.zeros_like(x), fills[index].region
    alone = sum(fill.lithostatic for fill in fills) == 1
    level = is_level_box(region) and np.count_nonzero(above) == 1 and alone
    # Squares of single points have no slope.
    if level or isinstance(region, (Cloud, Mask)):
        return slopes
    reach = 4 * fills[index].points_per_axis * step  # gaps of others are known to a step

    def load(places: Array) -> Array:
        depth, others = _loads(fills, index, places, above, rho_c, step)
        loads = depth + others / rho_c[index]
        return np.where(region.contains(places), loads, np.nan)

    here = load(x)
    for along in _level_axes(above):
        sides = []
        for sign in (1.0, -1.0):
            near = load(x + sign * reach * along)
            change, ends = near - here, np.isnan(near)
            inward = x[ends] - sign * reach * along
            change[ends] = load(inward) - load(inward - sign * reach * along)
            sides.append(sign * change / reach)
        agree = sides[0] * sides[1] > 0  # not at positions outside the fill
        smaller = np.where(np.abs(sides[0]) < np.abs(sides[1]), *sides)
        slopes += np.where(agree, smaller, 0.0)[:, None] * along
    return slopes


def _level_axes(above: Array) -> list[Array]:
    """Directions of length 1 across a direction, and across each other."""
    axes = np.delete(np.eye(len(above)), np.argmax(np.abs(above)), axis=0)
    known, directions = [above], []
    for axis in axes:
        for direction in known:
            axis = axis - (axis @ direction) * direction
        known.append(axis / np.linalg.norm(axis))
        directions.append(known[-1])
    return directions


def _overburden(
    fills: Sequence[Fill], index: int, x: Array, above: Array, rho_c: Sequence[float], step: float
) -> Array:
    """Mass per area [kg/m2] of the other lithostatic fills above positions in a fill. It corrects
    the depth in a fill, which is too large where others lie in its gaps.
    """
    mass = np.zeros(len(x))
    others = [k for k, fill in enumerate(fills) if fill.lithostatic and k != index]
    for i in others:
        ahead = fills[i].region.ahead(x, above, step)
        below = np.isfinite(ahead)
        entered = x[below] + ahead[below, None] * above
        depth = fills[i].region.depth(entered, above, step)
        gaps = _within_others(fills, i, entered, above, depth, step)
        mass[below] += rho_c[i] * (depth - gaps)
    if others:
        depth = fills[index].region.depth(x, above, step)
        mass -= rho_c[index] * _within_others(fills, index, x, above, depth, step)
    return mass


def _within_others(
    fills: Sequence[Fill], index: int, x: Array, above: Array, length: Array, step: float
) -> Array:
    """Length [m] of rays to the top of a fill that is in other lithostatic fills, in its gaps."""
    total = np.zeros(len(x))
    if is_level_box(fills[index].region) or not len(x):  # no gaps
        return total
    others = [fill.region for fill in fills if fill.lithostatic and fill is not fills[index]]
    for k in range(math.ceil(float(length.max()) / step)):
        below = (k + 0.5) * step < length
        places = x[below] + (k + 0.5) * step * above
        total[below] += step * np.any([region.contains(places) for region in others], axis=0)
    return total


class SeededPoints:
    """Points that fill regions, outside of bodies.

    They are made in parts, each time when this is iterated over, so that a scene of any size need
    not be held as a whole: `joined` makes one of them.

    Parameters
    ----------
    fills : sequence of Fill
    seed : int
        Seed of the random jitter, >= 0; the same seed gives the same points.
    densities : sequence of float
        Density [kg/m3] of each fill if its `density` is None.
    distance : callable, optional
        Signed distance from bodies at positions, shape (n,) [m], and normals, shape (n, dim).
        Squares (cubes) of the seeding lattice that bodies cut get a point at the centroid of their
        open part, with the volume of that part.
    up : sequence of float, length dim, optional
        Direction against gravity, of length 1, along which the depth is measured; the last axis by
        default.
    even : bool
        If True, all points have the volume of a whole square of the seeding lattice.

    Raises
    ------
    ValueError
        If fills overlap, extend beyond the grid, or hold no point outside of bodies.
    """

    def __init__(
        self,
        grid: Grid,
        fills: Sequence[Fill],
        seed: int,
        densities: Sequence[float],
        *,
        distance: Distance = nowhere,
        up: Sequence[float] | None = None,
        even: bool = False,
    ) -> None:
        self._grid, self._fills, self._seed = grid, fills, integer("seed", seed, 0)
        self._above = np.eye(grid.dim)[-1] if up is None else np.array(up, dtype=float)
        _check(grid, fills, distance)
        self._rho_c = [positive("density", density) for density in densities]
        self._spaces = [_space(grid, fills, i, distance) for i in range(len(fills))]
        pairs = zip(fills, self._spaces, strict=True)
        self._places = [_seeded(fill, space, even) for fill, space in pairs]
        for i, places in enumerate(self._places):
            if not any(len(x) for x, _ in places):
                raise ValueError(f"fills[{i}] = {fills[i]} must hold at least one material point")

    def __iter__(self) -> Iterator[Points]:
        rng = np.random.default_rng(self._seed)
        for i, fill in enumerate(self._fills):
            for x, volume in self._places[i]:
                if fill.jitter:
                    x = _jittered(rng, fill, x, self._spaces[i])
                if len(x):
                    yield _filled(self._grid, self._fills, i, x, volume, self._above, self._rho_c)


class Joined:
    """Points of several sources, one after the other, each time when this is iterated over."""

    def __init__(self, *sources: Iterable[Points]) -> None:
        self._sources = sources

    def __iter__(self) -> Iterator[Points]:
        return chain.from_iterable(self._sources)


def _filled(
    grid: Grid,
    fills: Sequence[Fill],
    index: int,
    x: Array,
    volume: Array,
    above: Array,
    rho_c: Sequence[float],
) -> Points:
    """Points of a fill at these positions."""
    fill = fills[index]
    if not isinstance(fill.region, Cloud):
        volume = volume * grid.rings(x)
    step = 0.25 * grid.cell / fill.points_per_axis
    depth = load = np.zeros(len(x))
    slope = np.zeros_like(x)
    if fill.lithostatic:
        depth, load = _loads(fills, index, x, above, rho_c, step)
        slope = _slopes(fills, index, x, above, rho_c, step)
    v, density = _carried(fill, rho_c[index])
    v, density = np.broadcast_to(v, x.shape), np.broadcast_to(density, volume.shape)
    return Points(x, v, volume, density, depth, load, slope, np.full(len(x), index))
