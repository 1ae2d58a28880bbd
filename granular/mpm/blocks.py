"""Union of the blocks (`Solid`) of a scene: its cells, its faces, and what is within it.

Blocks that touch have no face between them, so that rows of one cell each, a staircase, act like
one piece of rock.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from granular.geometry import LINE_TOLERANCE, Grid
from granular.mpm.walls import Solid

__all__ = ["deep_within", "held_components", "solid_cells"]

FACE_DEPTH = 0.5 + LINE_TOLERANCE
"""Largest depth [cells] at which nodes of a block belong to its face.

The first layer of nodes of quadratic splines lies half a cell inside, and must not stop material
that slides along the face.
"""

Mask = NDArray[np.bool_]


def solid_cells(grid: Grid, walls: Iterable[object]) -> Mask:
    """Mask of the cells within blocks, of the shape of the grid, the first axis first."""
    solid = np.zeros(grid.shape, dtype=bool)
    for wall in walls:
        if isinstance(wall, Solid):
            ends = zip(wall.lower, wall.upper, grid.lower, strict=True)
            solid[
                tuple(
                    slice(round((low - zero) / grid.cell), round((high - zero) / grid.cell))
                    for low, high, zero in ends
                )
            ] = True
    return solid


def deep_within(grid: Grid, solid: Mask, x: NDArray[np.float64]) -> Mask:
    """True for the positions more than a cell within `solid`, shape (n,).

    All cells around such a position are solid; the ends of the grid are no faces. Fast points that
    hit a block end up to half a cell within it, single ones up to a cell: there they are out of
    reach of the nodes outside, and nothing moves them on.

    Parameters
    ----------
    grid : Grid
    solid : ndarray of bool
        Solid cells, see `solid_cells`.
    x : ndarray, shape (n, dim)
        Positions [m]; those beyond the grid count as in its nearest cell.
    """
    for axis, periodic in enumerate(grid.periodic):
        for shift in (-1, 1):
            moved = np.roll(solid, shift, axis)
            if not periodic:  # beyond the end there is nothing to come from
                end = [slice(None)] * grid.dim
                end[axis] = slice(0, 1) if shift > 0 else slice(-1, None)
                moved[tuple(end)] = True
            solid = solid & moved
    last = np.array(grid.shape) - 1
    cells = np.floor((x - np.array(grid.lower)) / grid.cell).clip(0, last).astype(np.int64)
    return solid[tuple(cells.T)]


def held_components(
    grid: Grid, solid: Mask, positions: Sequence[NDArray[np.float64]]
) -> NDArray[np.uint8]:
    """Velocity components that the nodes within free-slip blocks hold, as bits.

    A node holds the components normal to the faces that it lies behind or on, by half a cell at
    most along each axis: one at a flat face, two where faces meet at an edge, be it protruding or
    reentrant. Nodes deeper within hold all components.

    Parameters
    ----------
    grid : Grid
    solid : ndarray of bool
        Solid cells, see `solid_cells`.
    positions : sequence of ndarray
        Positions of the nodes along each axis, in cells from its lower end.

    Returns
    -------
    ndarray of uint8, shape (..., n_y, n_x)
        Meaningful for nodes in or at solid cells only.
    """
    bits = np.zeros([len(x) for x in positions], dtype=np.uint8)
    for axis, x in enumerate(positions):
        for faces, line in zip(
            _faces(solid, axis, grid.periodic[axis]),
            (np.floor(x + LINE_TOLERANCE), np.ceil(x - LINE_TOLERANCE)),
            strict=True,
        ):
            near = faces.take(line.astype(np.int64), axis)
            near &= (abs(line - x) <= FACE_DEPTH).reshape(_along(axis, grid.dim))
            for other in range(grid.dim):
                if other != axis:
                    near = _beside(near, other, positions[other], grid.periodic[other])
            bits |= near.astype(np.uint8) << np.uint8(axis)
    everything = np.uint8((1 << grid.dim) - 1)
    return np.where(bits, bits, everything).transpose()


def _faces(solid: Mask, axis: int, periodic: bool) -> tuple[Mask, Mask]:
    """Lines of `axis` at which the union begins, and those at which it ends, in each row of cells.

    The ends of the grid are no faces.
    """
    n = solid.shape[axis]
    beyond = (n - 1, 0) if periodic else (0, n - 1)
    wide = solid.take([beyond[0], *range(n), beyond[1]], axis)
    before, after = wide.take(range(n + 1), axis), wide.take(range(1, n + 2), axis)
    return after & ~before, before & ~after


def _beside(cells: Mask, axis: int, x: NDArray[np.float64], periodic: bool) -> Mask:
    """True for the nodes at `x` [cells] that are in, or half a cell from, a cell that is true."""
    n = cells.shape[axis]
    first = np.ceil(x - FACE_DEPTH).astype(np.int64) - 1
    last = np.floor(x + FACE_DEPTH).astype(np.int64)
    found = np.zeros(1, dtype=bool)
    for k in range(int((last - first).max()) + 1):
        at = np.minimum(first + k, last)
        found = found | cells.take(at % n if periodic else at.clip(0, n - 1), axis)
    return found


def _along(axis: int, dim: int) -> list[int]:
    """Shape that lays a vector along one of `dim` axes."""
    return [-1 if d == axis else 1 for d in range(dim)]
