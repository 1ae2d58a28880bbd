"""The arch over the opening of a jammed silo."""

from dataclasses import dataclass

import numpy as np
import scipy

from granular.measure.averaging_grid import only_material, require_points
from granular.measure.opening import Opening, each_state, opening_of
from granular.measure.result import Result
from granular.model.state import State, States
from granular.tools.arrays import Array

_LEVEL = 0.25
"""Difference of height, in point spacings, within which points count as equally low."""


@dataclass(frozen=True)
class Arch(Result, x="m", y="m", spread="m", crown="m"):
    """The lower boundary of the dense material over the opening, from one side to the other.

    Attributes
    ----------
    x : ndarray, shape (k,)
        Distance from the middle of the opening [m], ascending.
    y : ndarray, shape (k,)
        Height above the bottom [m].
    spread : ndarray, shape (k,)
        Standard deviation of y over the frames [m].
    crown : float
        The largest y [m].
    relative_crown : float
        `crown` divided by the width of the opening.
    frames : int
        Number of frames averaged over.
    """

    x: Array
    y: Array
    spread: Array
    crown: float
    relative_crown: float
    frames: int


def arch_outline(states: States, *, opening: Opening | None = None) -> Arch:
    """The outline of the arch over the opening of a jammed silo.

    The plane is divided into squares two point spacings wide; the spacing is the median of
    ``sqrt(m/rho_c)`` over the points, and an edge of the squares runs through the middle of the
    opening. Squares that hold a dense point above the bottom are joined across their edges. The
    largest connected body bears the load; the rest falls. In each column of squares whose middle
    is over the opening, the outline passes half a spacing below the lowest point of that body. Its
    x is the mean over the points that are as low, to within a quarter of a spacing. Both x and y
    are averaged over frames.

    Half a silo gives half an outline. Dunatunga & Kamrin, Modelling silo clogging, show such
    arches in figures 4b, 5 and 9, without coordinates.

    Parameters
    ----------
    states : State or iterable of State

    Raises
    ------
    TypeError, ValueError
        If there are no states, the scene is not a 2D silo or has several materials, a state has no
        dense point above the bottom, or a column over the opening has none, so that there is no
        arch.
    """
    rows = []
    for state in each_state(states):
        require_points(state)
        rows.append(_outline(state, opening_of(state, opening)))
        width = opening_of(state, opening).width
    counts = {len(row) for row in rows}
    if len(counts) != 1:
        raise ValueError(f"states have arches of {sorted(counts)} columns, all must have as many")
    x, y = np.moveaxis(np.array(rows), 2, 0)
    mean, crown = y.mean(axis=0), float(y.mean(axis=0).max())
    return Arch(x.mean(axis=0), mean, y.std(axis=0), crown, crown / width, len(rows))


def _outline(state: State, where: Opening) -> Array:
    """The outline of one state, one row (x, y) for each column of squares."""
    mass = np.asarray(state.mass, dtype=float)
    spacing = np.sqrt(mass / only_material(state).rho_c)
    side = 2 * float(np.median(spacing))
    places = where.places(state)
    keep = np.asarray(state.dense, dtype=bool) & (places[:, 1] > 0)
    if not keep.any():
        raise ValueError(f"state at time = {state.time} has no dense point above the bottom")
    places, spacing = places[keep], spacing[keep]
    square = np.floor(places / side).astype(np.int64)
    body = _largest_body(square)
    places, spacing, column = places[body], spacing[body], square[body, 0]
    reach = int(np.floor(where.width / 2 / side + 0.5))
    rows = []
    for i in _modelled(state, where, side, reach):
        here = np.flatnonzero(column == i)
        if not len(here):
            raise ValueError(
                f"state at time = {state.time} has no dense material over the opening between "
                f"x = {i * side:.6g} and {(i + 1) * side:.6g} m from its middle: it has no arch"
            )
        under = places[here, 1] - spacing[here] / 2
        level = np.flatnonzero(under <= under.min() + _LEVEL * spacing[here])
        rows.append((places[here[level], 0].mean(), under.min()))
    return np.array(rows)


def _modelled(state: State, where: Opening, side: float, reach: int) -> range:
    """Columns of squares whose middles are over the opening and within the grid."""
    grid = state.scene.grid
    left = (grid.lower[0] - where.axis) / side
    right = left + grid.shape[0] * grid.cell / side
    first, last = np.round((left, right)).astype(int)
    columns = range(max(-reach, first), min(reach, last))
    if not len(columns):
        raise ValueError(
            f"opening.axis = {where.axis}, opening.width = {where.width} leave no column of "
            f"{side:.6g} m over the opening"
        )
    return columns


def _largest_body(square: np.ndarray) -> np.ndarray:
    """Mask of the points in the largest body of occupied squares that are joined across edges."""
    index = square - square.min(axis=0)
    occupied = np.zeros(index.max(axis=0) + 1, dtype=bool)
    occupied[tuple(index.T)] = True
    label, _ = scipy.ndimage.label(occupied)
    sizes = np.bincount(label.ravel())
    sizes[0] = 0
    return label[tuple(index.T)] == int(np.argmax(sizes))
