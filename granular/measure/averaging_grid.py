"""Position of the points on the scene's grid: their cells, their nodes, their weights.

The code is plain NumPy. It uses multilinear shape functions whatever basis the run itself used,
because a measurement must not depend on the scheme.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granular.model.grid import Grid
from granular.model.state import State
from granular.tools.arrays import Array, BoolArray, IntArray
from granular.tools.checks import one_of

_EDGE = 1e-6
"""Distance [cells] a point may lie beyond the grid; it allows for rounding at a wall only."""


def require_points(state: State) -> None:
    """Refuse a state without points.

    Raises
    ------
    ValueError
        If the state is empty.
    """
    if len(state.mass) == 0:
        raise ValueError(f"state at time = {state.time} has 0 points, at least 1 is needed")


def only_material(state: State) -> Any:
    """Return the material of a state.

    Raises
    ------
    ValueError
        If the scene has several: the measure is defined for one.
    """
    materials = state.scene.materials
    if len(materials) > 1:
        names = ", ".join(type(material).__name__ for material in materials)
        raise ValueError(f"the scene has {len(materials)} materials, {names}, must have one here")
    return materials[0]


def values(state: State, field: str | ArrayLike) -> Array:
    """A point field as floats, by name or as an array.

    Parameters
    ----------
    field : str or array_like, shape (n,) or (n, k)
        The name of an attribute of the state, or one value (or row) per point.

    Returns
    -------
    ndarray, shape (n,) or (n, k)

    Raises
    ------
    ValueError
        If there is no such field, or it does not have one value per point.
    """
    require_points(state)
    if isinstance(field, str):
        if not hasattr(state, field):
            raise ValueError(f"field = {field!r} is not a field of the state")
        field = getattr(state, field)
    array = np.asarray(field, dtype=float)
    if array.ndim not in (1, 2) or len(array) != len(state.mass):
        raise ValueError(
            f"field has shape {array.shape}, it must hold one value or row "
            f"for each of the {len(state.mass)} points"
        )
    return array


def point_weights(state: State, weight: str) -> Array:
    """Weight of each point in an average: mass [kg], or the scheme's quadrature volume [m3].

    Raises
    ------
    TypeError, ValueError
        If `weight` is neither "mass" nor "volume".
    """
    one_of("weight", weight, ("mass", "volume"))
    return np.asarray(state.mass if weight == "mass" else state.quadrature_volume, dtype=float)


def _positions(state: State) -> Array:
    """Positions in cells from the lower corner, shape (n, dim), folded into periodic axes."""
    require_points(state)
    grid = state.scene.grid
    cells = (np.asarray(state.x, dtype=float) - np.asarray(grid.lower)) / grid.cell
    for axis, (count, periodic) in enumerate(zip(grid.shape, grid.periodic, strict=True)):
        along = cells[:, axis]
        if periodic:
            cells[:, axis] = along % count
        elif not (along.min() >= -_EDGE and along.max() <= count + _EDGE):
            raise ValueError(
                f"state.x lies outside the grid along axis {axis}: cells {along.min():.6g} "
                f"to {along.max():.6g}, allowed 0 to {count}"
            )
    return cells


def cells_of(state: State) -> IntArray:
    """The cell of every point, shape (n, dim); a point on the upper edge is in the last cell.

    Raises
    ------
    ValueError
        If the state is empty or a point lies outside the grid.
    """
    last = np.asarray(state.scene.grid.shape) - 1
    return np.clip(np.floor(_positions(state)).astype(np.int64), 0, last)


def sums_of(place: NDArray[np.integer], weights: ArrayLike, count: int = 0) -> Array:
    """Sums of the weights by index, for indices from 0 to the last one or to `count` - 1.

    Weights of shape (n, k) are summed column by column.
    """
    weights = np.asarray(weights)
    if weights.ndim == 2:
        return np.stack([sums_of(place, column, count) for column in weights.T], axis=1)
    return np.bincount(place, weights=weights, minlength=count).astype(float, copy=False)


def mean_of(moment: Array, total: Array) -> Array:
    """Moments divided by the total weights of their rows; nan where the weight is not positive."""
    total = total.reshape(total.shape + (1,) * (moment.ndim - total.ndim))
    return np.divide(moment, total, out=np.full_like(moment, np.nan), where=total > 0)


def cell_sum(state: State, values: ArrayLike) -> Array:
    """Sum of a point field over every cell, an array of the grid's shape."""
    shape = tuple(state.scene.grid.shape)
    flat = np.ravel_multi_index(tuple(cells_of(state).T), shape)
    return sums_of(flat, values, int(np.prod(shape))).reshape(shape)


def cell_mass(state: State) -> Array:
    """Mass [kg] in every cell, an array of the grid's shape."""
    return cell_sum(state, state.mass)


def node_shape(grid: Grid) -> tuple[int, ...]:
    """Number of nodes along each axis; along a periodic axis the last node is the first one."""
    pairs = zip(grid.shape, grid.periodic, strict=True)
    return tuple(count + (0 if periodic else 1) for count, periodic in pairs)


@dataclass(frozen=True)
class Stencil:
    """Multilinear weights of all points on the nodes of their cells.

    Attributes
    ----------
    nodes : ndarray of int, shape (2**dim, n)
        Flat node indices.
    weights : ndarray, shape (2**dim, n)
        Shape functions S_ip; each column sums to one.
    shape : tuple of int
        Number of nodes along each axis.
    """

    nodes: IntArray
    weights: Array
    shape: tuple[int, ...]

    def to_nodes(self, field: Array) -> Array:
        """``sum_p S_ip f_p`` at all nodes in a flat array, shape (nodes,) or (nodes, k)."""
        size = int(np.prod(self.shape))
        total = np.zeros((size, *field.shape[1:]))
        for nodes, weights in zip(self.nodes, self.weights, strict=True):
            total += sums_of(nodes, (weights * field.T).T, size)
        return total

    def to_points(self, nodal: Array) -> Array:
        """``sum_i S_ip f_i`` at all points, from flat nodal values."""
        weights = self.weights[..., None] if nodal.ndim == 2 else self.weights
        return (weights * nodal[self.nodes]).sum(axis=0)


def stencil(state: State) -> Stencil:
    """The multilinear shape functions of the points on the scene's grid.

    Raises
    ------
    ValueError
        If the state is empty or a point lies outside the grid.
    """
    cell = cells_of(state)
    inside = np.clip(_positions(state) - cell, 0.0, 1.0)
    shape = node_shape(state.scene.grid)
    nodes, weights = [], []
    for corner in product((0, 1), repeat=cell.shape[1]):
        nodes.append(np.ravel_multi_index(tuple(((cell + corner) % shape).T), shape))
        weights.append(np.where(corner, inside, 1.0 - inside).prod(axis=1))
    return Stencil(np.array(nodes), np.array(weights), shape)


def filled_neighbours(filled: BoolArray, grid: Grid) -> IntArray:
    """Number of filled cells around each node, an array of the shape of the nodes."""
    count = np.zeros(node_shape(grid), dtype=np.int64)
    where = np.nonzero(filled)
    for corner in product((0, 1), repeat=filled.ndim):
        index = tuple(
            (along + step) % size
            for along, step, size in zip(where, corner, count.shape, strict=True)
        )
        np.add.at(count, index, 1)
    return count
