"""Which rank has which cells: blocks of cells, divided by planes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from granular.tools.arrays import Array, IntArray

EDGES = {2: (32, 16, 8, 4), 3: (16, 8, 4)}
"""Cells of a block along each axis, by dimension. A block of 4 cells is the smallest for all
schemes."""

RUNS = 0
"""Instead of an edge: blocks are runs of 512 cells in the order of the grid, x first. Nonlocal laws
need them, as the fluidity is summed over such runs."""

BLOCKS = 500
"""Blocks with points that each rank should have at least: parts of so many are even, and meet in
planes. With blocks twice as large a step of half a million points in 3D takes 4 % longer on two
ranks, and 16 % longer with blocks four times as large (measured)."""

UNEVEN = 1.1
"""Largest number of points of a rank over their mean from which on blocks change their owners."""


def edge_of_blocks(counts: dict[int, int], size: int) -> int:
    """Return the largest edge with enough blocks for each rank.

    Parameters
    ----------
    counts : dict
        Number of blocks that hold points, by the edge.
    size : int
        Number of ranks.
    """
    for edge in sorted(counts, reverse=True):
        if counts[edge] >= BLOCKS * size:
            return edge
    return min(counts)


ALONG_X = 1.5
"""Weight of a face between blocks that is normal to the first axis, over that of another one: an
estimate. There ranks share the cells of a row, whose sums are exchanged for each of them."""


def owners_of_blocks(weights: Array, shape: tuple[int, ...], size: int) -> NDArray[np.int32]:
    """Return the rank of each block.

    The blocks are divided by planes into two parts, and these again: by the weights of the parts,
    and normal to the axis along which the fewest blocks with weight meet.

    Parameters
    ----------
    weights : ndarray, shape (blocks,)
        Weight of each block, as the number of its points, x fastest.
    shape : tuple of int
        Number of blocks along each axis.
    size : int
        Number of ranks.

    Notes
    -----
    The recursive bisection of Berger & Bokhari 1987, IEEE Trans. Comput. C-36. Its parts meet in
    fewer faces than those of a curve that fills space.
    """
    owners = np.empty(len(weights), dtype=np.int32)
    places = np.array(np.unravel_index(np.arange(len(weights)), shape[::-1])[::-1])
    parts = [(np.arange(len(weights)), 0, size)]
    while parts:
        blocks, first, ranks = parts.pop()
        if ranks == 1:
            owners[blocks] = first
            continue
        low = ranks // 2
        cuts = [_cut(places, weights, blocks, axis, low / ranks) for axis in range(len(shape))]
        below, above = min(reversed(cuts), key=lambda halves: _faces(weights, shape, *halves))
        parts += [(below, first, low), (above, first + low, ranks - low)]
    return owners


def _cut(
    places: IntArray, weights: Array, blocks: IntArray, axis: int, share: float
) -> tuple[IntArray, IntArray]:
    """Divide blocks in the order along an axis, so that the first half has a share of the weight.

    A plane of blocks may be divided, too.
    """
    order = np.lexsort((*np.delete(places[:, blocks], axis, axis=0), places[axis, blocks]))
    along = weights[blocks[order]] + 1e-9  # blocks without points are divided, too
    middle = np.cumsum(along) - 0.5 * along
    is_below = middle < share * along.sum()
    return blocks[order[is_below]], blocks[order[~is_below]]


def _faces(weights: Array, shape: tuple[int, ...], below: IntArray, above: IntArray) -> float:
    """Weighted number of faces at which blocks with points of two parts meet."""
    side = np.zeros(len(weights))
    side[below], side[above] = 1, -1
    side = (side * (weights > 0)).reshape(shape[::-1])
    faces = 0.0
    for axis in range(len(shape)):
        layers = np.moveaxis(side, -1 - axis, 0)
        meeting = np.count_nonzero(layers[:-1] * layers[1:] < 0)
        faces += (ALONG_X if axis == 0 else 1.0) * meeting
    return faces
