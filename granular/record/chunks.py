"""Packing of columns into HDF5 chunks: compressed where that pays, raw where it does not.

Mantissas of a flowing state are noise: deflate spends 18 ms on a frame of 8192 points to save
a tenth of them. Masses, ids, the z of the plane and fields at rest, however, shrink to nothing.
So every column is a chunk of its own and says through its filter mask which of the two it is;
HDF5 readers undo it without being told.
"""

import zlib

import h5py
import numpy as np

LEVEL = 1
SAMPLE = 256
WORTHWHILE = 0.6
RAW = 0b11
"""Filter mask of a chunk to which neither shuffle nor deflate was applied."""


def _shuffled(column: np.ndarray) -> bytes:
    """Bytes of a column as HDF5's shuffle filter orders them: all first bytes, all second, ..."""
    return column.view(np.uint8).reshape(-1, column.itemsize).T.tobytes()


def pack(column: np.ndarray) -> tuple[int, bytes]:
    """Filter mask and bytes of a contiguous column, compressed if a sample of it shrinks."""
    sample = np.ascontiguousarray(column[:: max(1, len(column) // SAMPLE)][:SAMPLE])
    if len(zlib.compress(_shuffled(sample), LEVEL)) < WORTHWHILE * sample.nbytes:
        packed = zlib.compress(_shuffled(column), LEVEL)
        if len(packed) < column.nbytes:
            return 0, packed
    return RAW, column.tobytes()


def create(
    group: h5py.Group, name: str, shape: tuple[int, ...], dtype: str, chunk: int
) -> h5py.Dataset:
    """Empty dataset of shape (rows,) or (rows, columns) with one chunk a column."""
    return group.create_dataset(
        name,
        shape=shape,
        maxshape=(None, *shape[1:]),
        chunks=(chunk, 1)[: len(shape)],
        dtype=dtype,
        compression="gzip",
        compression_opts=LEVEL,
        shuffle=True,
    )


def corners(n: int, chunk: int, shape: tuple[int, ...]) -> list[tuple[int, ...]]:
    """First row and column of each chunk of a frame of ``n`` rows, relative to its first row."""
    rows = range(0, n, chunk)
    if len(shape) == 1:
        return [(row,) for row in rows]
    return [(row, column) for row in rows for column in range(shape[1])]


def write(data: h5py.Dataset, array: np.ndarray) -> None:
    """Write an array of the dataset's number of rows; missing columns (z in the plane) are 0."""
    n, chunk = len(array), data.chunks[0]
    for corner in corners(n, chunk, data.shape):
        row, *rest = corner
        column = np.zeros(chunk, dtype=array.dtype)
        if not rest or rest[0] < array.shape[1]:
            part = array[(slice(row, row + chunk), *rest)]
            column[: len(part)] = part
        mask, raw = pack(column)
        data.id.write_direct_chunk(corner, raw, mask)


def copy(source: h5py.Dataset, first: int, target: h5py.Dataset, row: int, n: int) -> None:
    """Copy ``n`` rows from ``first`` to ``row``, both on chunk boundaries, without unpacking."""
    for shift, *rest in corners(n, source.chunks[0], source.shape):
        mask, raw = source.id.read_direct_chunk((first + shift, *rest))
        target.id.write_direct_chunk((row + shift, *rest), raw, mask)
