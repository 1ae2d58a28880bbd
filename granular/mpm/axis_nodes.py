"""Nodes along one axis of the grid: C0 lines of the shape functions, and positions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from granular import _core
from granular.model.grid import Grid
from granular.mpm.walls import WallOrBlock
from granular.tools.arrays import Array
from granular.tools.checks import integer, one_of

CORE_BASES = _core.enumerations()["basis"]


def c0_lines(scene_grid: Grid, walls: Sequence[WallOrBlock], axis: int) -> tuple[int, ...]:
    """Grid lines of `axis` on which walls stand or end inside the grid, ascending.

    Shape functions are only C0 on these lines (quadratic splines have a repeated knot), so that an
    inner wall or the edge of an opening is sharp. The lines are that of every wall normal to `axis`
    and the ends of the spans of the other walls, if they lie strictly inside the grid. Of blocks
    (`Solid`) only a face that crosses the whole domain has one, as the top of a floor: a staircase
    would make a C0 line of every grid line.

    Parameters
    ----------
    walls : sequence of Wall and Solid

    Raises
    ------
    ValueError
        If a wall does not lie on grid lines.
    """
    integer("axis", axis, 0, scene_grid.dim - 1)
    lines = set()
    for i, wall in enumerate(walls):
        if wall.is_block and not _crosses(wall, scene_grid, axis):
            continue
        ends = wall.extent(scene_grid, axis)
        lines |= {scene_grid.line(f"walls[{i}] {wall}", axis, end) for end in ends}
    return tuple(sorted(line for line in lines if 0 < line < scene_grid.shape[axis]))


def _crosses(block: WallOrBlock, grid: Grid, axis: int) -> bool:
    """True if the faces of a block normal to `axis` cross the domain, which is not periodic."""
    others = [other for other in range(grid.dim) if other != axis]
    ends = [
        [grid.line(f"walls = {block}", other, end) for end in block.extent(grid, other)]
        for other in others
    ]
    return not grid.periodic[axis] and all(
        low == 0 and high == grid.shape[other]
        for other, (low, high) in zip(others, ends, strict=True)
    )


def check_c0_lines(basis: str, n_cells: int, periodic: bool, c0_lines: Sequence[int]) -> list[int]:
    """Check the C0 lines of an axis and return them; see `node_positions`."""
    one_of("basis", basis, CORE_BASES)
    n = integer("n_cells", n_cells, 1)
    lines = [integer("c0_lines", line, 1, n - 1) for line in c0_lines]
    if lines != sorted(set(lines)):
        raise ValueError(f"c0_lines = {tuple(c0_lines)} must ascend")
    if basis == "quadratic" and periodic and lines:
        raise ValueError(
            f"c0_lines = {tuple(lines)} must be empty on a periodic axis of quadratic splines:"
            " no wall may end along it"
        )
    return lines


def node_positions(basis: str, n_cells: int, periodic: bool, c0_lines: Sequence[int] = ()) -> Array:
    """Positions of the nodes along one axis, in cells from its lower end.

    Linear shape functions ("linear", "ugimp") have a node on each grid line. Quadratic B-splines
    have the knots 0, 0, 0, 1, 2, ..., n, n, n, with those on C0 lines doubled; node i stands at its
    Greville abscissa (t[i+1] + t[i+2])/2, so that nodal values of a linear field reproduce that
    field. On a periodic axis the knots are uniform and the nodes stand in the middle of the cells.

    Parameters
    ----------
    basis : {"linear", "ugimp", "quadratic"}
    c0_lines : sequence of int
        Ascending lines with 0 < line < n_cells.

    Returns
    -------
    ndarray, shape (n_nodes,)

    Raises
    ------
    ValueError
        For C0 lines out of order or range, or on a periodic axis of quadratic splines.
    """
    lines = check_c0_lines(basis, n_cells, periodic, c0_lines)
    lines_of_core = np.array(lines, np.int32)
    return _core.node_positions(CORE_BASES[basis], int(n_cells), periodic, lines_of_core)
