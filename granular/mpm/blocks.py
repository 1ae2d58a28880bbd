"""Union of the blocks (`Solid`) of a scene: its cells, its faces, and the points within it.

Blocks that touch have no face between them, so that rows of one cell each, a staircase, act like
one piece of rock. All is computed for classes of cells and nodes that are alike (`GridMap`), so
that the size of the grid does not matter.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from granular.model.boundary import Boundary
from granular.model.grid import LINE_TOLERANCE, Grid
from granular.mpm.grid_map import GridMap, Ranges
from granular.tools.arrays import Array, BoolArray, IndexArray

FACE_DEPTH = 0.5 + LINE_TOLERANCE
"""Largest depth [cells] at which nodes of a block belong to its face.

The first layer of nodes of quadratic splines lies half a cell inside, and must not stop material
that slides along the face.
"""


def solid_cells(grid: Grid, walls: Iterable[Boundary]) -> GridMap:
    """Map of the cells: True for those within blocks."""
    ranges: list[Ranges] = [
        tuple(np.arange(*ends) for ends in _ends(grid, wall)) for wall in walls if wall.is_block
    ]
    zeros = GridMap.zeros(grid.shape, ranges)
    solid = zeros._replace(values=zeros.values.astype(bool))
    for where in ranges:
        solid.values[solid.of(where)] = True
    return solid


def _ends(grid: Grid, block: Boundary) -> list[tuple[int, int]]:
    """Lines at which a block begins and ends along each axis."""
    return [
        (round((low - zero) / grid.cell), round((high - zero) / grid.cell))
        for low, high, zero in zip(*block.corners(grid), grid.lower, strict=True)
    ]


def deep_within(grid: Grid, walls: Iterable[Boundary], x: Array) -> BoolArray:
    """True for the positions more than a cell within the union of the blocks, shape (n,).

    All cells around such a position are solid; the ends of the grid are no faces. Fast points that
    hit a block end up to half a cell within it, single ones up to a cell: there they are out of
    reach of the nodes outside, and no force moves them.

    Parameters
    ----------
    walls : iterable of Wall and Solid
    x : ndarray, shape (n, dim)
        Positions [m]; those beyond the grid count as in its nearest cell.
    """
    solid, last = solid_cells(grid, walls), np.array(grid.shape) - 1
    cells = np.floor((x - np.array(grid.lower)) / grid.cell).clip(0, last).astype(np.intp)
    deep: BoolArray = solid.at(cells.T)
    inside = np.flatnonzero(deep)  # few or none, so that the other cells are looked up for few
    for step in product((-1, 0, 1), repeat=grid.dim):
        neighbours = cells[inside] + step
        places = [
            _on_grid(along, n, periodic)
            for along, n, periodic in zip(neighbours.T, grid.shape, grid.periodic, strict=True)
        ]
        deep[inside] &= solid.at(places)
    return deep


def _on_grid(cells: IndexArray, n: int, periodic: bool) -> IndexArray:
    """Cells along an axis: wrapped where it is periodic, else the nearest ones of the grid."""
    return cells % n if periodic else cells.clip(0, n - 1)


def outlook(x: Array, classes: NDArray[np.int32], periodic: bool) -> IndexArray:
    """The properties of the cells around the nodes along an axis that matter to the nodes.

    Nodes with the same outlook along every axis are held alike, see `held_components`.

    Parameters
    ----------
    x : ndarray
        Positions of the nodes, in cells from the lower end of the axis.
    classes : ndarray of int32
        Classes of the cells along the axis, of the map that `solid_cells` returns.

    Returns
    -------
    ndarray, shape (7 or more, nodes)
        Classes of the cells below and above the grid line at or below the node, and 1 if the node
        is half a cell from that line at most; the same for the line at or above it; classes of the
        cells that the node is in, or half a cell from.
    """

    def class_of(cells: Array) -> NDArray[np.int32]:
        return classes[_on_grid(cells.astype(np.intp), len(classes), periodic)]

    rows: list[NDArray] = []
    for line in (np.floor(x + LINE_TOLERANCE), np.ceil(x - LINE_TOLERANCE)):
        rows += [class_of(line - 1), class_of(line), abs(line - x) <= FACE_DEPTH]
    first, last = np.ceil(x - FACE_DEPTH) - 1, np.floor(x + FACE_DEPTH)
    for k in range(int((last - first).max()) + 1):
        rows.append(class_of(np.minimum(first + k, last)))
    return np.array(rows, dtype=np.intp)


def held_components(solid: GridMap, outlooks: Sequence[IndexArray]) -> NDArray[np.uint8]:
    """Velocity components that the nodes within free-slip blocks hold, as bits.

    A node holds the components normal to the faces that it lies behind or on, by half a cell at
    most along each axis: one at a flat face, two where faces meet at an edge, be it protruding or
    reentrant. Nodes deeper within hold all components. The ends of the grid are no faces.

    Parameters
    ----------
    solid : GridMap
        Solid cells, see `solid_cells`.
    outlooks : sequence of ndarray
        Outlooks of the nodes along each axis, see `outlook`.

    Returns
    -------
    ndarray of uint8, shape (..., n_y, n_x)
        For all combinations of these nodes; meaningful for those in or at solid cells only.
    """
    dim = len(outlooks)
    cells, bits = solid.values.T, np.zeros([rows.shape[1] for rows in outlooks], dtype=np.uint8)
    for axis, rows in enumerate(outlooks):
        along = [-1 if d == axis else 1 for d in range(dim)]
        for end, (below, above, is_near) in enumerate((rows[:3], rows[3:6])):
            low, high = cells.take(below, axis), cells.take(above, axis)
            face = low & ~high if end else high & ~low  # the union ends, or begins, at the line
            near = face & (is_near > 0).reshape(along)
            for other in range(dim):
                if other != axis:
                    near = np.any([near.take(at, other) for at in outlooks[other][6:]], axis=0)
            bits |= near.astype(np.uint8) << np.uint8(axis)
    return np.where(bits, bits, np.uint8((1 << dim) - 1)).transpose()
