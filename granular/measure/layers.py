"""Indicators of a sound run: speeds at rest, occupied area, height, pressure."""

import numpy as np

from granular.measure.averaging_grid import cell_sum, require_points
from granular.measure.bulk import FILLED
from granular.measure.fields import cell_average
from granular.model.state import State
from granular.tools.arrays import Array, BoolArray, IntArray
from granular.tools.checks import finite, in_range, integer, non_negative, one_of


def speed_percentile(state: State, *, q: float = 99.0) -> float:
    """Percentile of the speeds of the points [m/s].

    Parameters
    ----------
    q : float
        Percentile, 0 to 100.

    Raises
    ------
    ValueError
        If the state is empty or q is outside 0 to 100.
    """
    require_points(state)
    in_range("q", q, 0.0, 100.0)
    return float(np.percentile(np.linalg.norm(state.v, axis=1), q))


def occupied_area(state: State, *, filled: float = 0.0) -> float:
    """Area (2D, m2) or volume (3D or of rings, m3) of the cells that hold points.

    Parameters
    ----------
    filled : float
        Count only cells with more than this share of the mass that fits at rho_c, >= 0.

    Raises
    ------
    ValueError
        If the state is empty, a point is off the grid, or `filled` is negative.
    """
    non_negative("filled", filled)
    solid, grid = cell_sum(state, state.rest_section), state.scene.grid
    cells = np.argwhere(solid > filled * grid.cell**solid.ndim)
    x = np.array(grid.lower) + (cells + 0.5) * grid.cell
    return float((grid.cell**solid.ndim * np.broadcast_to(grid.rings(x), len(x))).sum())


def layer_height(state: State, *, base: float | None = None) -> float:
    """Height [m] of a layer: twice the elevation of its centre of mass above the floor.

    Parameters
    ----------
    base : float, optional
        Elevation of the layer's floor [m]; by default the floor of the grid.

    Raises
    ------
    ValueError
        If the state is empty.
    """
    require_points(state)
    floor = float(state.scene.grid.lower[-1]) if base is None else finite("base", base)
    return float(2 * (np.average(np.asarray(state.x)[:, -1], weights=state.mass) - floor))


def mean_pressure_error(
    state: State, *, of: str = "normal", depth_cells: int = 1, per_column: bool = False
) -> float:
    """Relative error of the cell-averaged pressure against the weight of the material above.

    The error is ``sqrt(sum V (P - W)**2 / sum V W**2)`` over cells. P is the volume average in the
    cell. W is the weight per area of the mass above plus half the cell's own mass, with the
    component of gravity across the layer at the time of the state. The measure is meant for boxes
    and inclines whose walls carry no shear.

    Parameters
    ----------
    of : {"normal", "pressure"}
        P is the normal stress across the layer, which balances the weight whatever the
        constitutive law, or the pressure. The pressure equals the weight only where the law makes
        the normal stresses equal: in steady shear, but not in a box at rest.
    depth_cells : int
        Leave out cells with fewer than this many filled cells above them.
    per_column : bool
        True to compare with the weight of each single column (the overburden error of a heap),
        False to compare with the mean layer.

    Raises
    ------
    ValueError
        If the state is empty, gravity does not press the layer onto its floor, or no cell is
        deep enough.
    """
    one_of("of", of, ("normal", "pressure"))
    integer("depth_cells", depth_cells, 0)
    weight = _overburden(state, per_column)
    grid = state.scene.grid
    filled = cell_sum(state, state.rest_section) >= FILLED * grid.cell**weight.ndim
    top = _uppermost(filled)
    axis = weight.ndim - 1
    field = -np.asarray(state.stress)[:, axis] if of == "normal" else state.pressure
    mean = cell_average(state, field, weight="volume")
    occupied = tuple(mean.cells.T)
    deep = filled[occupied] & (top[occupied] - mean.cells[:, axis] >= depth_cells)
    if not deep.any():
        raise ValueError(f"no cell has depth_cells = {depth_cells} filled cells above it")
    expected, volume = weight[occupied][deep], mean.weight[deep]
    error = np.sum(volume * (mean.value[deep] - expected) ** 2)
    return float(np.sqrt(error / np.sum(volume * expected**2)))


def _overburden(state: State, per_column: bool) -> Array:
    """Weight per area [Pa] at the middle of every cell's mass, an array of the grid's shape."""
    require_points(state)
    down = -float(np.asarray(state.scene.gravity.at(state.time))[-1])
    if not down > 0:
        raise ValueError(f"gravity across the layer = {-down} m/s2 must be negative")
    mass = cell_sum(state, np.asarray(state.mass / state.rings))
    if not per_column:
        across = tuple(range(mass.ndim - 1))
        mass = np.broadcast_to(mass.mean(axis=across), mass.shape)
    above = np.flip(np.cumsum(np.flip(mass, -1), axis=-1), -1) - mass / 2
    return down * above / state.scene.grid.cell ** (mass.ndim - 1)


def _uppermost(filled: BoolArray) -> IntArray:
    """For each cell, the uppermost one of its run upwards through filled cells."""
    top = np.broadcast_to(np.arange(filled.shape[-1]), filled.shape).copy()
    for j in range(filled.shape[-1] - 2, -1, -1):
        top[..., j] = np.where(filled[..., j + 1], top[..., j + 1], j)
    return top
