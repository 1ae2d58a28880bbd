"""The material points that fill regions at the start."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from granular.checks import integer, positive
from granular.geometry import MAX_COUNT, Fill, Grid, check_inside, combined

__all__ = ["Points", "count_points", "estimated_points", "seed_points"]


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
