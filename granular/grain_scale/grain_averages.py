"""Continuum fields of grains: averages over the cells of a grid and over frames."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from granular.grain_scale.dump import AXES, DumpFrame, depth_along
from granular.measure.averaging_grid import mean_of, sums_of
from granular.model.grid import Grid
from granular.tools.arrays import Array, BoolArray, IntArray


@dataclass(frozen=True)
class GrainAverages:
    """Fields of grains on the cells of a grid, as means over frames.

    Attributes
    ----------
    axes : tuple of ndarray
        Coordinates of the cell centres along each axis [m].
    packing_fraction : ndarray, shape of the grid
        Volume of the grains over that of the cell; 0 where there are none.
    density : ndarray, shape of the grid
        Mass of the grains over the volume of the cell [kg/m3].
    velocity : ndarray, shape of the grid and (dim,)
        Velocity of the centre of mass of the grains [m/s]; nan where there are none.
    stress : ndarray, shape of the grid and (4,) or (6,)
        Stress [Pa], tension positive: xx, yy, zz, xy in 2D, also yz, xz in 3D. It is due to motion
        relative to the velocity of the cell in each frame and, where contacts are given, to them.
    frames : int
        Number of frames.
    """

    axes: tuple[Array, ...]
    packing_fraction: Array
    density: Array
    velocity: Array
    stress: Array
    frames: int


def average_grains(
    frames: DumpFrame | Iterable[DumpFrame],
    grid: Grid,
    *,
    axes: str = AXES,
    contacts: DumpFrame | Iterable[DumpFrame] | None = None,
    columns: Sequence[str] = (),
) -> GrainAverages:
    """Average the grains of a dump over the cells of a grid, for comparison with a continuum.

    A grain counts for the cell of its centroid, a contact for that of the middle between the two
    centroids: cells should be wider than a few grains. The fields are those that
    `granular.measure.frame_average` has of a run: velocities weighted by mass, stresses by volume.

    Parameters
    ----------
    frames : DumpFrame, or iterable of them such as a Dump
    grid : Grid
        Cells; grains outside of them do not count.
    axes : str
        Axes of the dump that are x, y (and z) of the grid. With two, such as "xz", the average is
        over the whole box along the third.
    contacts : DumpFrame, or iterable of them, optional
        Dump of the pairs in contact at the same steps.
    columns : sequence of 5 str
        Names of its columns: the ids of the grains i and j of a pair, and the three components of
        the force on grain i, in units of the file.

    Raises
    ------
    TypeError, ValueError
        Naming the argument; also if a frame has no grain in the grid, a column is missing, an id
        is that of no grain, or the steps of grains and contacts differ.
    """
    if not isinstance(grid, Grid):
        raise TypeError(f"grid = {grid!r} must be a Grid")
    if len(axes) != grid.dim:
        raise ValueError(f"axes = {axes!r} must name {grid.dim} axes, as the grid has")
    if contacts is not None and len(columns) != 5:
        raise ValueError(f"columns = {columns!r} must be 5 names: ids of i and j, force on i")
    pairs = None if contacts is None else _each("contacts", contacts)
    total: list[Array] = []
    count = 0
    for frame in _each("frames", frames):
        sums = _Sums(frame, grid, axes)
        if pairs is not None:
            other = next(pairs, None)
            if other is None or other.step != frame.step:
                step = "no further frame" if other is None else f"step {other.step}"
                raise ValueError(f"contacts have {step}, frames step {frame.step}")
            sums.add_contacts(other, columns)
        parts = sums.volume, sums.mass, sums.momentum, sums.stress
        total = [a + b for a, b in zip(total, parts, strict=True)] if total else list(parts)
        count += 1
    if not count:
        raise ValueError("frames has 0 frames, at least 1 is needed")
    volume, mass, momentum, stress = total
    shape, cell = tuple(grid.shape), grid.cell**grid.dim
    centres = tuple(
        low + grid.cell * (np.arange(n, dtype=float) + 0.5)
        for low, n in zip(grid.lower, shape, strict=True)
    )
    return GrainAverages(
        axes=centres,
        packing_fraction=(volume / (cell * count)).reshape(shape),
        density=(mass / (cell * count)).reshape(shape),
        velocity=mean_of(momentum, mass).reshape(*shape, grid.dim),
        stress=(stress / (cell * count)).reshape(*shape, -1),
        frames=count,
    )


def _each(name: str, frames: DumpFrame | Iterable[DumpFrame]) -> Iterator[DumpFrame]:
    if not isinstance(frames, Iterable) and not isinstance(frames, DumpFrame):
        raise TypeError(f"{name} = {frames!r} must be a DumpFrame or an iterable of them")
    return iter((frames,) if isinstance(frames, DumpFrame) else frames)


class _Sums:
    """Sums over the cells of one frame, in 2D per metre of depth."""

    def __init__(self, frame: DumpFrame, grid: Grid, axes: str) -> None:
        axis_numbers, self.depth = depth_along(frame, axes)
        self.frame, self.grid = frame, grid
        self.order = (
            axis_numbers if len(axis_numbers) == 3 else [*axis_numbers, 3 - sum(axis_numbers)]
        )
        self.x = frame.x[:, self.order]
        here, self.inside = self._cells(self.x)
        if not self.inside.any():
            raise ValueError(f"frame of step {frame.step} has no grain in the grid")
        mass, v = frame.mass[self.inside], frame.v[:, self.order][self.inside]
        self.volume = self._sum(here, frame.volume[self.inside])
        self.mass = self._sum(here, mass)
        moment = self._sum(here, mass[:, None] * v)
        self.momentum = moment[:, : grid.dim]
        relative = v - mean_of(moment, self.mass)[here]
        self.stress = -self._sum(here, mass[:, None] * _symmetric(relative, relative, grid.dim))

    def add_contacts(self, pairs: DumpFrame, columns: Sequence[str]) -> None:
        """Add ``-f (x_i - x_j)`` of the pairs to the stress, f being the force on i."""
        first, second, *_ = table = pairs.column(*columns).T
        if not len(pairs):
            return
        ids = self.frame.id
        order = np.argsort(ids)
        i, j = (order[self._row_of(ids[order], grains)] for grains in (first, second))
        branch = self.x[i] - self.x[j]
        size = (self.frame.upper - self.frame.lower)[self.order]
        for k, axis in enumerate(self.order):  # the nearest image
            if self.frame.periodic[axis]:
                branch[:, k] -= size[k] * np.round(branch[:, k] / size[k])
        force = table[2:].T[:, self.order] * pairs.force_unit
        middle = self.x[i] - 0.5 * branch
        low = self.frame.lower[self.order]
        for k, axis in enumerate(self.order):
            if self.frame.periodic[axis]:
                middle[:, k] = low[k] + (middle[:, k] - low[k]) % size[k]
        here, inside = self._cells(middle)
        product = _symmetric(force[inside], branch[inside], self.grid.dim)
        self.stress = self.stress - self._sum(here, product)

    def _row_of(self, ids: IntArray, grains: Array) -> IntArray:
        row = np.minimum(np.searchsorted(ids, grains), len(ids) - 1)
        unknown = ids[row] != grains
        if unknown.any():
            raise ValueError(
                f"contacts of step {self.frame.step}: id {grains[unknown][0]:g} is that of no grain"
            )
        return row

    def _cells(self, x: Array) -> tuple[IntArray, BoolArray]:
        """Flat cells of the positions in the grid, and the indices of these positions."""
        grid = self.grid
        place = np.floor((x[:, : grid.dim] - np.array(grid.lower)) / grid.cell).astype(np.int64)
        inside = ((place >= 0) & (place < np.array(grid.shape))).all(axis=1)
        return np.ravel_multi_index(tuple(place[inside].T), tuple(grid.shape)), inside

    def _sum(self, cells: IntArray, values: Array) -> Array:
        return sums_of(cells, values, math.prod(self.grid.shape)) / self.depth


def _symmetric(a: Array, b: Array, dim: int) -> Array:
    """Symmetric parts of the products of vectors: xx, yy, zz, xy, and in 3D yz, xz."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))[: 4 if dim == 2 else 6]
    return np.stack([0.5 * (a[:, p] * b[:, q] + a[:, q] * b[:, p]) for p, q in pairs], axis=1)
