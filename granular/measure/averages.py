"""Averages over frames on the grid, and results of them: centre-line pressure, contours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import contourpy
import numpy as np
from numpy.typing import ArrayLike

from granular.measure.averaging_grid import (
    cells_of,
    mean_of,
    node_shape,
    point_weights,
    stencil,
    sums_of,
    values,
)
from granular.measure.opening import Opening, each_state, opening_of
from granular.measure.profiles import Profile
from granular.measure.result import Result, Table, mesh_columns, mesh_units
from granular.model.state import State, States
from granular.tools.arrays import Array
from granular.tools.checks import integer, one_of

Field = str | Callable[[State], ArrayLike]
"""Name of a point field, or a function of a state that returns one value or row per point."""


@dataclass(frozen=True)
class GridField(Result):
    """A field on all cells or nodes of the grid, averaged over frames.

    Attributes
    ----------
    axes : tuple of ndarray
        Coordinates of the cell centres, or of the nodes, along each axis [m].
    value : ndarray, one entry (or row of components) per cell or node
        nan where no frame has material.
    weight : ndarray, one entry per cell or node
        Mass [kg] or volume [m3] averaged over, as a mean over the frames.
    frames : int
        Number of frames averaged over.
    """

    axes: tuple[Array, ...]
    value: Array
    weight: Array
    frames: int

    def _table(self) -> Table:
        columns = mesh_columns(self.axes, value=self.value, weight=self.weight)
        return Table(columns, {"frames": self.frames}, mesh_units(self.axes))


@dataclass(frozen=True)
class Contour(Result):
    """The lines along which a field has one given value.

    Attributes
    ----------
    level : float
        The value of the field.
    lines : tuple of ndarray, each of shape (k, 2)
        Coordinates x, y along each piece [m]; empty if the field does not reach the level.
    """

    level: float
    lines: tuple[Array, ...]

    def _table(self) -> Table:
        lengths = [len(line) for line in self.lines]
        x, y = np.concatenate([np.empty((0, 2)), *self.lines]).T
        columns = {"line": np.repeat(np.arange(len(lengths)), lengths), "x": x, "y": y}
        return Table(columns, {"level": self.level}, {"x": "m", "y": "m"})


def frame_average(
    states: States, field: Field, *, weight: str = "mass", points: str = "all", at: str = "cells"
) -> GridField:
    """A point field averaged over frames and over cells, or about nodes.

    A cell holds ``sum w_p f_p / sum w_p`` over all points inside it in any of the frames; a node
    holds ``sum S_ip w_p f_p / sum S_ip w_p`` with multilinear shape functions S. A frame in which
    a cell is empty does not count in that cell. For example, the fluidity is averaged over dense
    points (Dunatunga & Kamrin, Modelling silo clogging, figure 8, which shows 0 where this
    function returns nan), and the stress by volume. Frames at intervals commensurate with a
    periodic motion, such as that of a shaker, sample only few of its phases: use some 50 frames per
    period.

    Parameters
    ----------
    states : State or iterable of State
        All on the same grid.
    field : str or callable
        Name of a point field, or a function of a state that returns one value or row per point.
    weight : {"mass", "volume"}
        Volume is the weight of stresses, mass that of velocities.
    points : {"all", "dense"}
        Average over all points, or over those under pressure.
    at : {"cells", "nodes"}
        Average over the cells, or about the nodes.

    Raises
    ------
    TypeError, ValueError
        If an option is not one of those named, there are no states, a state has no points or
        points off the grid, the grids differ, the field does not have one value per point, or
        `points` is "dense" and no point is dense.
    """
    one_of("points", points, ("all", "dense"))
    one_of("at", at, ("cells", "nodes"))
    frames, moment, total = 0, np.zeros(()), np.zeros(())
    for state in each_state(states):
        grid, frames = state.scene.grid, frames + 1
        f = values(state, field(state) if callable(field) else field)
        w = point_weights(state, weight)
        if points == "dense":
            # A point that is not dense may hold nan, and nan times a weight of 0 would stay nan.
            dense = np.asarray(state.dense, dtype=bool)
            w, f = np.where(dense, w, 0.0), np.where(dense if f.ndim == 1 else dense[:, None], f, 0)
        spread = _cell_sums(state) if at == "cells" else stencil(state).to_nodes
        total = total + spread(w)
        moment = moment + spread((f.T * w).T)
    if not np.any(total > 0):
        raise ValueError(f"points = {points!r}: no such point in any of the {frames} frames")
    shape = tuple(grid.shape) if at == "cells" else node_shape(grid)
    mean = mean_of(moment, total)
    first = 0.5 if at == "cells" else 0.0
    axes = tuple(
        low + grid.cell * (np.arange(count, dtype=float) + first)
        for low, count in zip(grid.lower, shape, strict=True)
    )
    weights = total.reshape(shape) / frames
    return GridField(axes, mean.reshape(shape + mean.shape[1:]), weights, frames)


def _cell_sums(state: State) -> Callable[[Array], Array]:
    shape = tuple(state.scene.grid.shape)
    flat = np.ravel_multi_index(tuple(cells_of(state).T), shape)
    return lambda field: sums_of(flat, field, int(np.prod(shape)))


def centre_line_pressure(
    states: States, *, columns: int = 1, opening: Opening | None = None
) -> Profile:
    """Pressure above the middle of a silo's opening by height, averaged over frames.

    In each row of cells this is the volume-weighted mean over all points in the columns of cells
    next to the axis. Stress-free points count as 0 (Dunatunga & Kamrin, Modelling silo clogging,
    figure 5b).

    Parameters
    ----------
    states : State or iterable of State
    columns : int
        Number of columns of cells on each modelled side of the axis. If the axis cuts cells in
        half, the columns whose centres are less than this many cells away.

    Returns
    -------
    Profile
        Heights above the bottom [m], pressures [Pa] (nan in rows without points), centroids of
        the points in each row [m], volumes [m3].

    Raises
    ------
    TypeError, ValueError
        As `frame_average`; also if there is no column of cells there.
    """
    integer("columns", columns, 1)
    states = list(each_state(states))
    where = opening_of(states[0], opening)

    def both(state: State) -> Array:
        return np.stack([state.pressure, where.places(state)[:, 1]], axis=1)

    field = frame_average(states, both, weight="volume")
    cell = states[0].scene.grid.cell
    x, y = field.axes[0] - where.axis, field.axes[1] - where.floor
    near, above = np.abs(x) < (columns - 1e-6) * cell, y > 0
    if not near.any():
        raise ValueError(f"opening.axis = {where.axis} has no column of cells next to it")
    w = field.weight[near][:, above]
    moment = np.nansum(field.value[near][:, above] * w[..., None], axis=0)
    total = w.sum(axis=0)
    mean = mean_of(moment, total)
    return Profile(y[above], mean[:, 0], mean[:, 1], total)


def contours(field: GridField, levels: ArrayLike) -> tuple[Contour, ...]:
    """Lines of equal value of a 2D field, interpolated linearly between its cells or nodes.

    Parameters
    ----------
    field : GridField
        In 2D, with one value per cell or node.
    levels : array_like, shape (k,)
        Values of the field, ascending.

    Returns
    -------
    tuple of k Contours
        No line enters where the field is nan.

    Raises
    ------
    ValueError
        If the field is not a 2D one with one value per cell or node, or the levels are not finite
        and ascending.
    """
    if field.value.ndim != 2 or len(field.axes) != 2:
        raise ValueError(
            f"field has values of shape {field.value.shape}, "
            "must be 2D, with one value per cell or node"
        )
    at = np.atleast_1d(np.asarray(levels, dtype=float))
    if at.ndim != 1 or not len(at) or not np.all(np.isfinite(at)) or not np.all(np.diff(at) > 0):
        raise ValueError(f"levels = {levels!r} must be finite, ascending, and at least one")
    lines = contourpy.contour_generator(
        *field.axes, np.ma.masked_invalid(field.value.T), line_type=contourpy.LineType.Separate
    )
    return tuple(
        Contour(float(level), tuple(cast(list[Array], lines.lines(level)))) for level in at
    )


def speed_contours(states: States, levels: ArrayLike) -> tuple[Contour, ...]:
    """Lines of equal speed: the magnitude of the nodal velocity averaged over frames.

    Dunatunga & Kamrin, Modelling silo clogging, figure 6, draw them at 0.05, 0.10 ... 0.35 m/s.

    Parameters
    ----------
    states : State or iterable of State
    levels : array_like, shape (k,)
        Speeds [m/s], ascending.

    Returns
    -------
    tuple of k Contours

    Raises
    ------
    TypeError, ValueError
        As `frame_average` and `contours`.
    """
    v = frame_average(states, "v", at="nodes")
    speed = np.linalg.norm(v.value, axis=-1)
    return contours(GridField(v.axes, speed, v.weight, v.frames), levels)
