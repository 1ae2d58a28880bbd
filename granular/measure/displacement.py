"""Displacement of the points between two states of a run."""

from __future__ import annotations

import numpy as np

from granular.model.state import State
from granular.tools.arrays import Array


def displacement(state: State, start: State) -> Array:
    """Displacement of the points of a state since another state of the same run [m].

    Give its length to `granular.plot.frame` as a color, to see what has moved.

    Parameters
    ----------
    state, start : State
        States of one run, at any two times.

    Returns
    -------
    ndarray, shape (n, dim)
        In the order of the points of `state`; nan for points that `start` does not have. Along a
        periodic axis it is the shortest one.

    Raises
    ------
    ValueError
        If the grids of their scenes differ.
    """
    grid = state.scene.grid
    if start.scene.grid != grid:
        raise ValueError("start must be a state of the same run: its grid is another one")
    row = np.minimum(np.searchsorted(start.id, state.id), max(len(start.id) - 1, 0))
    moved = np.full(state.x.shape, np.nan)
    if not len(start.id):
        return moved
    known = start.id[row] == state.id
    moved[known] = (np.asarray(state.x, dtype=float) - start.x[row])[known]
    for axis in np.flatnonzero(grid.periodic):
        length = grid.shape[axis] * grid.cell
        moved[:, axis] -= length * np.rint(moved[:, axis] / length)
    return moved
