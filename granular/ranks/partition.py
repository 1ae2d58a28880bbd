"""Which rank has which cells: blocks of cells along a curve that fills space."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from granular.tools.arrays import Array, IntArray

EDGES = {2: (32, 16, 8, 4), 3: (16, 8, 4)}
"""Cells of a block along each axis, by dimension. A larger block has fewer ghost cells about it for
each of its own; a block of 4 cells is the smallest for all schemes."""

RUNS = 0
"""Instead of an edge: blocks are runs of 512 cells in the order of the grid, x first. Nonlocal laws
need them, as the fluidity is summed over such runs."""

BLOCKS = 12
"""Blocks with points that each rank should have at least: so many can be divided evenly."""

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


def hilbert(places: IntArray, bits: int) -> IntArray:
    """Return the positions of blocks on the Hilbert curve.

    Parameters
    ----------
    places : ndarray of int, shape (dim, n)
        Indices along the axes, 0 to 2^bits - 1.
    bits : int
        Order of the curve, at least 1.

    Notes
    -----
    By the exchange and inversion of the lower bits of the axes (Skilling 2004, Programming the
    Hilbert curve, AIP Conf. Proc. 707).
    """
    x = places.astype(np.int64)
    dim = len(x)
    bit = 1 << (bits - 1)
    while bit > 1:
        lower = bit - 1
        for axis in range(dim):
            inverted = (x[axis] & bit) != 0
            swapped = np.where(inverted, 0, (x[0] ^ x[axis]) & lower)
            x[0] = np.where(inverted, x[0] ^ lower, x[0] ^ swapped)
            x[axis] ^= swapped if axis else 0
        bit >>= 1
    for axis in range(1, dim):
        x[axis] ^= x[axis - 1]
    flips = np.zeros_like(x[0])
    bit = 1 << (bits - 1)
    while bit > 1:
        flips = np.where((x[dim - 1] & bit) != 0, flips ^ (bit - 1), flips)
        bit >>= 1
    x ^= flips
    position = np.zeros_like(x[0])
    for level in range(bits - 1, -1, -1):
        for axis in range(dim):
            position = position << 1 | (x[axis] >> level & 1)
    return position


def owners_of_blocks(weights: Array, shape: tuple[int, ...], size: int) -> NDArray[np.int32]:
    """Return the rank of each block: parts of the Hilbert curve of about equal weight.

    Parameters
    ----------
    weights : ndarray, shape (blocks,)
        Weight of each block, as the number of its points, x fastest.
    shape : tuple of int
        Number of blocks along each axis.
    size : int
        Number of ranks.
    """
    dim = max(sum(n > 1 for n in shape), 1)
    axes = [axis for axis, n in enumerate(shape) if n > 1] or [0]
    places = np.array(np.unravel_index(np.arange(len(weights)), shape[::-1])[::-1])[axes]
    bits = max(int(places.max(initial=0)).bit_length(), 1)
    order = np.argsort(hilbert(places.reshape(dim, -1), bits), kind="stable")
    along = weights[order] + 1e-9  # blocks without points are divided, too
    middle = np.cumsum(along) - 0.5 * along
    owners = np.empty(len(weights), dtype=np.int32)
    owners[order] = np.minimum((middle * size / along.sum()).astype(np.int32), size - 1)
    return owners
