"""Point fields on the grid: nodal smoothing, the nodal density, averages by cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from granular.measure.averaging_grid import (
    cell_mass,
    cell_sum,
    cells_of,
    filled_neighbours,
    mean_of,
    only_material,
    point_weights,
    stencil,
    sums_of,
    values,
)
from granular.measure.result import Result
from granular.model.state import State
from granular.tools.arrays import Array, BoolArray, IntArray
from granular.tools.checks import in_range, non_negative, one_of


def smooth(state: State, field: str | ArrayLike) -> Array:
    """A point field mapped to the nodes and projected back onto the points.

    ``f_i = sum_p S_ip m_p f_p / sum_p S_ip m_p``, then ``f_p = sum_i S_ip f_i``, with multilinear
    shape functions S (Dunatunga & Kamrin 2015, eqs. 4.1-4.3). This is meant for plots of stress and
    pressure; rates and other measures of deformation are best plotted without it.

    Parameters
    ----------
    field : str or array_like, shape (n,) or (n, k)
        Name of a field of the state, or one value or row per point.

    Returns
    -------
    ndarray
        An array of the shape of the field.

    Raises
    ------
    ValueError
        If the state is empty, a point is off the grid, or the field does not have one value per
        point.
    """
    field = values(state, field)
    return stencil(state).to_points(nodal(state, field))


def nodal(state: State, field: str | ArrayLike) -> Array:
    """Mass-weighted nodal values of a point field (Dunatunga & Kamrin 2015, eqs. 4.1-4.2).

    Parameters
    ----------
    field : str or array_like, shape (n,) or (n, k)

    Returns
    -------
    ndarray, shape (nodes,) or (nodes, k)
        Nodes in C order of the axes; 0 where a node has no mass.

    Raises
    ------
    ValueError
        If the state is empty, a point is off the grid, or the field does not have one value per
        point.
    """
    field = values(state, field)
    shapes = stencil(state)
    mass = shapes.to_nodes(np.asarray(state.mass, dtype=float))
    weighted = shapes.to_nodes((field.T * state.mass).T)
    mass = mass[:, None] if field.ndim == 2 else mass
    return np.divide(weighted, mass, out=np.zeros_like(weighted), where=mass > 0)


def nodal_density(state: State, *, at: str = "points") -> Array:
    """Density of the volume that the points really occupy, from nodal masses and volumes.

    It is the nodal mass divided by the nodal volume. The nodal volume is the filled fraction of the
    cells around the node times the volume of the node's Voronoi cell: a whole cell inside the grid,
    half a cell on an edge, a quarter in a corner (Wieckowski 2004; Dunatunga & Kamrin 2015,
    section 4.3). That product is (filled cells around the node) * cell**dim / 2**dim everywhere.

    Parameters
    ----------
    at : {"points", "nodes"}
        Project the density back onto the points, or return the nodal values.

    Returns
    -------
    ndarray, shape (n,) or (nodes,)
        Density [kg/m3]; nodes are in C order of the axes, with 0 at empty ones.

    Raises
    ------
    ValueError
        If the state is empty, a point is off the grid, or `at` is neither of the two.
    """
    one_of("at", at, ("points", "nodes"))
    grid = state.scene.grid
    dim = len(grid.shape)
    shapes = stencil(state)
    mass = shapes.to_nodes(np.asarray(state.mass / state.rings, dtype=float))
    filled = filled_neighbours(cell_mass(state) > 0, grid).ravel()
    volume = filled * (grid.cell / 2) ** dim
    density = np.divide(mass, volume, out=np.zeros_like(mass), where=filled > 0)
    return shapes.to_points(density) if at == "points" else density


def phase(state: State, *, tolerance: float = 1e-9) -> BoolArray:
    """Mask of the points that are dense (True) or disconnected (False) by the nodal density.

    A point is dense if `nodal_density` there is at least rho_c (Dunatunga & Kamrin 2015, figure
    7). This depends on the positions of the points only; ``state.dense`` depends on their pressure.

    Parameters
    ----------
    tolerance : float
        Relative shortfall that still counts as dense; the default allows for rounding only.

    Returns
    -------
    ndarray of bool, shape (n,)

    Raises
    ------
    TypeError, ValueError
        If the state is empty, a point is off the grid, the tolerance is negative, or the scene has
        several materials.
    """
    non_negative("tolerance", tolerance)
    return nodal_density(state) >= only_material(state).rho_c * (1 - tolerance)


@dataclass(frozen=True)
class CellField(Result, centres="m"):
    """A field on the occupied cells.

    Attributes
    ----------
    cells : ndarray of int, shape (k, dim)
        Indices of the occupied cells, in C order.
    centres : ndarray, shape (k, dim)
        Centres of these cells [m].
    value : ndarray, shape (k,) or (k, components)
        Values of the field in these cells.
    weight : ndarray, shape (k,)
        Mass [kg] or volume [m3] averaged over.
    """

    cells: IntArray
    centres: Array
    value: Array
    weight: Array


def cell_average(state: State, field: str | ArrayLike, *, weight: str = "mass") -> CellField:
    """A point field averaged over each occupied cell.

    The average is ``sum w_p f_p / sum w_p`` over the points of the cell, where w is the mass or the
    quadrature volume of the scheme (`State.quadrature_volume`).

    Parameters
    ----------
    field : str or array_like, shape (n,) or (n, k)
    weight : {"mass", "volume"}
        Volume is the weight of stresses, mass that of velocities.

    Raises
    ------
    ValueError
        If the state is empty, a point is off the grid, or the field does not have one value per
        point.
    """
    field = values(state, field)
    w = point_weights(state, weight)
    cells, row = np.unique(cells_of(state), axis=0, return_inverse=True)
    total = sums_of(row, w)
    mean = mean_of(sums_of(row, (field.T * w).T), total)
    return CellField(cells, _centres(state, cells), mean, total)


def cell_density(state: State) -> CellField:
    """Mass over volume of each occupied cell [kg/m3]: the density on the grid.

    Returns
    -------
    CellField
        Weighted by mass. Cells cut by a free surface are only partly filled.

    Raises
    ------
    ValueError
        If the state is empty or a point is off the grid.
    """
    mass = cell_mass(state)
    cells = np.argwhere(mass > 0)
    weight = mass[mass > 0]
    section = cell_sum(state, np.asarray(state.mass / state.rings))[mass > 0]
    return CellField(
        cells, _centres(state, cells), section / state.scene.grid.cell**mass.ndim, weight
    )


def cell_density_percentile(state: State, *, q: float = 99.0) -> float:
    """Percentile over the occupied cells of `cell_density` divided by rho_c.

    It is 1 for an undisturbed packing, and well above 1 where points have collapsed into one
    another.

    Parameters
    ----------
    q : float
        Percentile, 0 to 100.

    Raises
    ------
    TypeError, ValueError
        If the state is empty, a point is off the grid, q is outside 0 to 100, or the scene has
        several materials.
    """
    in_range("q", q, 0.0, 100.0)
    return float(np.percentile(cell_density(state).value, q) / only_material(state).rho_c)


def _centres(state: State, cells: IntArray) -> Array:
    grid = state.scene.grid
    return np.asarray(grid.lower) + (cells + 0.5) * grid.cell
