"""Signs that a run is sound: stress-free points in the bulk, speeds at rest, room, pressure."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular.checks import finite, in_range, integer, non_negative, one_of
from granular.measure.fields import cell_average
from granular.measure.lattice import Array, cell_mass, cells_of, require_points

FILLED = 0.5
"""A cell counts as filled from this share of the mass it holds at rho_c."""


def _surface_cells(state: Any) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Which cells are filled, and for each the uppermost cell of its gapless run upwards."""
    grid = state.scene.grid
    dim = len(grid.shape)
    filled = cell_mass(state) >= FILLED * state.scene.material.rho_c * grid.cell**dim
    top = np.broadcast_to(np.arange(grid.shape[-1]), grid.shape).copy()
    for j in range(grid.shape[-1] - 2, -1, -1):
        top[..., j] = np.where(filled[..., j + 1], top[..., j + 1], j)
    return filled, top


def disconnected_fraction(state: Any, *, depth_cells: int = 2) -> float:
    """Share, by mass, of the bulk whose points are free of stress (p = 0).

    The bulk: the points more than `depth_cells` cells below the surface of their column. The
    surface is the upper edge of the run of filled cells that leads up from the point's own cell
    without a gap; filled means at least half the mass that fits at rho_c, so that neither sprays
    above a heap nor free fall below an orifice count as bulk.

    Parameters
    ----------
    state : State
    depth_cells : int
        Cells below the surface that are not bulk; stress-free points belong there.

    Returns
    -------
    float
        0 in a sound dense flow.

    Raises
    ------
    ValueError
        If the state is empty, a point is off the grid, or no point lies in the bulk.
    """
    integer("depth_cells", depth_cells, 0)
    grid = state.scene.grid
    filled, top = _surface_cells(state)
    own = tuple(cells_of(state).T)
    up = (np.asarray(state.x, dtype=float)[:, -1] - grid.lower[-1]) / grid.cell
    bulk = filled[own] & (top[own] + 1 - up > depth_cells)
    if not bulk.any():
        raise ValueError(f"no point lies more than depth_cells = {depth_cells} below the surface")
    mass = np.asarray(state.mass, dtype=float)[bulk]
    free = np.asarray(state.p)[bulk] <= 0
    return float(mass[free].sum() / mass.sum())


def speed_percentile(state: Any, *, q: float = 99.0) -> float:
    """Percentile of the speeds of the points [m/s].

    Parameters
    ----------
    state : State
    q : float
        Percentile, 0 to 100.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the state is empty or q is outside 0 to 100.
    """
    require_points(state)
    in_range("q", q, 0.0, 100.0)
    return float(np.percentile(np.linalg.norm(state.v, axis=1), q))


def occupied_area(state: Any, *, filled: float = 0.0) -> float:
    """Area (plane, m2) or volume (3D, m3) of the cells that hold points.

    Parameters
    ----------
    state : State
    filled : float
        Count only cells with more than this share of the mass that fits at rho_c.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the state is empty, a point is off the grid, or `filled` is negative.
    """
    non_negative("filled", filled)
    mass = cell_mass(state)
    room = state.scene.grid.cell**mass.ndim
    return float(np.count_nonzero(mass > filled * state.scene.material.rho_c * room) * room)


def layer_height(state: Any, *, base: float | None = None) -> float:
    """Height [m] of a layer, twice the elevation of its centre of mass.

    Parameters
    ----------
    state : State
    base : float, optional
        The layer's floor [m]; by default that of the grid.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the state is empty.
    """
    require_points(state)
    floor = float(state.scene.grid.lower[-1]) if base is None else finite("base", base)
    return float(2 * (np.average(np.asarray(state.x)[:, -1], weights=state.mass) - floor))


def mean_pressure_error(
    state: Any, *, of: str = "normal", depth_cells: int = 1, per_column: bool = False
) -> float:
    """Relative error of the cell-averaged pressure against the weight of what lies above.

    ``sqrt(sum V (P - W)**2 / sum V W**2)`` over cells: P is volume-averaged in the cell, W the
    weight per area of the mass above plus half the cell's own, for the gravity at the state's
    time across the layer. For boxes and inclines, whose walls carry no shear.

    Parameters
    ----------
    state : State
    of : {"normal", "pressure"}
        P is the normal stress across the layer, which balances the weight whatever the law, or
        the pressure, which equals it only where the law makes the normal stresses equal: in
        steady shear, not in a box at rest.
    depth_cells : int
        Leave out cells with fewer than this many filled cells above them.
    per_column : bool
        Take the weight of each column by itself (heaps: an overburden error), not of the
        mean layer.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the state is empty, gravity does not press the layer onto its floor, or no cell is
        deep enough.
    """
    one_of("of", of, ("normal", "pressure"))
    integer("depth_cells", depth_cells, 0)
    weight = _overburden(state, per_column)
    filled, top = _surface_cells(state)
    axis = weight.ndim - 1
    field = -np.asarray(state.stress)[:, axis] if of == "normal" else state.p
    mean = cell_average(state, field, weight="volume")
    own = tuple(mean.cells.T)
    deep = filled[own] & (top[own] - mean.cells[:, axis] >= depth_cells)
    if not deep.any():
        raise ValueError(f"no cell has depth_cells = {depth_cells} filled cells above it")
    expected, volume = weight[own][deep], mean.weight[deep]
    error = np.sum(volume * (mean.value[deep] - expected) ** 2)
    return float(np.sqrt(error / np.sum(volume * expected**2)))


def _overburden(state: Any, per_column: bool) -> Array:
    """Weight per area [Pa] at the middle of every cell's mass, an array of the grid's shape."""
    require_points(state)
    down = -float(np.asarray(state.scene.gravity.at(state.time))[-1])
    if not down > 0:
        raise ValueError(f"gravity across the layer = {-down} m/s2 must be negative")
    mass = cell_mass(state)
    if not per_column:
        across = tuple(range(mass.ndim - 1))
        mass = np.broadcast_to(mass.mean(axis=across), mass.shape)
    above = np.flip(np.cumsum(np.flip(mass, -1), axis=-1), -1) - mass / 2
    return down * above / state.scene.grid.cell ** (mass.ndim - 1)
