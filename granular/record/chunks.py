"""Packing of columns into HDF5 chunks: compressed where that pays, raw where it does not.

Mantissas of a flowing state are noise: deflate spends 18 ms on a frame of 8192 points to save
a tenth of their size. Masses, ids, the z coordinate in 2D and fields at rest, however, shrink to
almost nothing. Every column is therefore a separate chunk, whose filter mask shows whether it is
compressed. HDF5 readers decompress it automatically.
"""

import zlib
from collections.abc import Mapping, Sequence
from typing import Protocol

import h5py
import numpy as np

from granular.record.layout import (
    FIELD_DTYPES,
    MAX_CHUNK_ROWS,
    MAX_COLUMNS,
    attribute,
    checked,
    rows_of,
)
from granular.record.storage import Sink

LEVEL = 1
SAMPLE = 64
WORTHWHILE = 0.3
"""Size of a packed sample, in that of the sample, up to which a column is compressed.

To compress a column takes as long as to store four that are not.
"""
VECTORS = ("Points", "v")
"""Datasets stored with three columns, as ParaView requires."""
NO_SHUFFLE, NO_DEFLATE = 0b01, 0b10
"""Bits of the filter mask of a chunk to which a filter was not applied."""
RAW = NO_SHUFFLE | NO_DEFLATE
"""Filter mask of a chunk to which neither shuffle nor deflate was applied."""


Raw = bytes | memoryview


def size_of(dtype: str, rows: int) -> int:
    """Size of a column before it is packed [bytes]."""
    return np.dtype(dtype).itemsize * rows


def most_of(dtype: str, rows: int) -> int:
    """Largest size of a packed column [bytes]; HDF5 also stores results of deflate that are
    slightly larger."""
    size = size_of(dtype, rows)
    return size + size // 1000 + 13


def _shuffled(column: np.ndarray) -> bytes:
    """Bytes of a column in the order of HDF5's shuffle filter: all first bytes, all second, ..."""
    return column.view(np.uint8).reshape(-1, column.itemsize).T.tobytes()


def _raw(column: np.ndarray) -> tuple[int, Raw]:
    return RAW, column.view(np.uint8).data


def pack(column: np.ndarray) -> tuple[int, Raw]:
    """Return filter mask and bytes of a contiguous column, compressed if a sample of it shrinks.

    Data that are not compressed are not copied.
    """
    sample = np.ascontiguousarray(column[:: max(1, len(column) // SAMPLE)][:SAMPLE])
    if len(zlib.compress(_shuffled(sample), LEVEL)) < WORTHWHILE * sample.nbytes:
        packed = zlib.compress(_shuffled(column), LEVEL)
        if len(packed) < column.nbytes:
            return 0, packed
    return _raw(column)


class Packer:
    """Pack the columns of successive frames, without needless work.

    A column that has not changed is not compressed again. A column that could not be compressed is
    tried again only after some frames, because to compress even a sample costs as much as to write
    a quarter of the column.
    """

    PATIENCE = 8
    """Number of frames for which an incompressible column is not tried again."""

    def __init__(self) -> None:
        self._shrunk: dict[tuple, tuple[np.ndarray, tuple[int, Raw]]] = {}
        self._noise: dict[tuple, int] = {}  # number of frames left until the next trial
        self._space = np.empty((2, 0))

    def space(self, n: int) -> np.ndarray:
        """Return memory for two columns of ``n`` numbers of 8 bytes, the same for all frames."""
        if self._space.shape[1] < n:
            self._space = np.empty((2, n))
        return self._space[:, :n]

    def pack(self, place: tuple, column: np.ndarray) -> tuple[int, Raw]:
        """Pack the column at a position in a frame, as `pack` does."""
        last, packed = self._shrunk.get(place, (None, (RAW, b"")))
        if last is not None and np.array_equal(last, column.view(last.dtype)):
            return packed
        left = self._noise.get(place, 0)
        packed = _raw(column) if left else pack(column)
        if packed[0] == RAW:
            self._noise[place] = left - 1 if left else self.PATIENCE
        else:
            # As integers, by which -0.0 is not 0.0, and nan equals itself.
            self._shrunk[place] = column.view(f"i{column.itemsize}").copy(), packed
        return packed


def unpack(mask: int, raw: Raw, dtype: str, chunk: int) -> np.ndarray:
    """Restore a column of ``chunk`` rows from the result of `pack`; ValueError if it cannot be."""
    size = size_of(dtype, chunk)
    if not mask & NO_DEFLATE:
        stream = zlib.decompressobj()
        try:
            raw = stream.decompress(raw, size + 1)  # no more of what is longer than allowed
        except zlib.error as error:
            raise ValueError(f"a column cannot be unpacked: {error}") from error
    if len(raw) != size:
        raise ValueError(f"a column has {len(raw)} bytes, not {size}")
    if mask & NO_SHUFFLE:
        return np.frombuffer(raw, dtype=dtype)
    planes = np.frombuffer(raw, dtype=np.uint8).reshape(np.dtype(dtype).itemsize, -1)
    return planes.T.copy().view(dtype)[:, 0]


def check_chunks(columns: int, chunk: int, n: int, count: int) -> None:
    """Refuse a number of chunks that does not fit a field of ``n`` rows with a ValueError."""
    if not 0 <= columns <= MAX_COLUMNS or not 1 <= chunk <= MAX_CHUNK_ROWS:
        raise ValueError(f"{columns} columns in chunks of {chunk} rows are not allowed")
    if n < 0 or count * chunk != rows_of(n, chunk) * max(columns, 1):
        raise ValueError(f"{count} chunks of {chunk} rows cannot be {n} rows")


class Field(Protocol):
    """A field of a frame."""

    @property
    def dtype(self) -> str:
        """Type of the numbers."""

    @property
    def columns(self) -> int:
        """Number of columns, 0 for an array of shape (n,)."""

    @property
    def chunk(self) -> int:
        """Rows per chunk."""

    def raw(self, corner: tuple[int, ...]) -> tuple[int, Raw]:
        """Return filter mask and bytes of the chunk that begins at (row,) or (row, column)."""

    def read(self, row: int, n: int) -> np.ndarray:
        """Return ``n`` unpacked rows from ``row``."""


class Packed:
    """A field of one frame in memory, packed chunk by chunk as it is stored in a file."""

    def __init__(
        self, dtype: str, columns: int, chunk: int, n: int, chunks: Sequence[tuple[int, Raw]]
    ) -> None:
        check_chunks(columns, chunk, n, len(chunks))
        self.dtype, self.columns, self.chunk = dtype, columns, chunk
        self._chunks = dict(zip(corners(n, chunk, columns), chunks, strict=True))

    def raw(self, corner: tuple[int, ...]) -> tuple[int, Raw]:
        """Return filter mask and bytes of a chunk, as `Field.raw`."""
        return self._chunks[corner]

    def read(self, row: int, n: int) -> np.ndarray:
        """Return ``n`` unpacked rows from ``row``."""
        whole = np.empty((max(self.columns, 1), rows_of(n, self.chunk)), dtype=self.dtype)
        for corner, (mask, raw) in self._chunks.items():
            first, column = (*corner, 0)[:2]
            whole[column, first : first + self.chunk] = unpack(mask, raw, self.dtype, self.chunk)
        rows = whole[:, row : row + n].T
        return rows if self.columns else rows[:, 0]


class Stored:
    """A field of all frames in a file."""

    def __init__(self, group: h5py.Group, name: str) -> None:
        self.data = data = checked(group, name, FIELD_DTYPES, 1, 2, packed=True)
        if data.chunks is None or data.chunks[1:] != (1,) * (data.ndim - 1):
            raise ValueError(f"{data.name} is not chunked by columns")
        self.dtype, self.chunk = data.dtype.str, data.chunks[0]
        self.columns = int(attribute(data, "columns", "i"))
        wide = data.shape[1] if data.ndim == 2 else 0
        if not (self.columns == wide or (wide == 3 and self.columns == 2)):
            raise ValueError(f"{data.name} has {wide} columns, its attribute says {self.columns}")
        check_chunks(self.columns, self.chunk, 0, 0)
        self._filtered = data.id.get_create_plist().get_nfilters() > 0

    def raw(self, corner: tuple[int, ...]) -> tuple[int, Raw]:
        """Return filter mask and bytes of a chunk, as `Field.raw`.

        ValueError if it is larger than a chunk can be.
        """
        size = size_of(
            self.dtype, self.chunk
        )  # HDF5 also stores results of deflate that are larger, by 0.1 % and 12 bytes
        buffer = np.empty(size + size // 1000 + 13, dtype=np.uint8)
        try:
            mask, raw = self.data.id.read_direct_chunk(corner, out=buffer)
        except ValueError as error:  # HDF5 has no other one for a buffer that is too small
            raise ValueError(f"{self.data.name}: the chunk at {corner}: {error}") from error
        return mask if self._filtered else RAW, bytes(raw)

    def read(self, row: int, n: int) -> np.ndarray:
        """Return ``n`` unpacked rows from ``row``, the first one of a chunk.

        HDF5 would unpack a chunk to whatever its stream holds, so that a small file could exhaust
        the memory; here a chunk holds as many rows as it is said to hold, or is refused.
        """
        if row < 0 or n < 0 or row + n > self.data.shape[0] or row % self.chunk:
            raise ValueError(f"rows {row}+{n} of {self.data.name} are not in the file")
        rows = np.empty((self.columns, n) if self.columns else n, dtype=self.dtype).T
        for shift, *rest in corners(n, self.chunk, self.columns):
            mask, raw = self.raw((row + shift, *rest))
            column = rows[:, rest[0]] if rest else rows
            part = column[shift : shift + self.chunk]
            part[:] = unpack(mask, raw, self.dtype, self.chunk)[: len(part)]
        return rows


def layout(fields: Mapping[str, Field]) -> dict[str, tuple[str, int, int]]:
    """Type, number of columns and rows per chunk of each field, equal in all frames of a record."""
    return {name: (field.dtype, field.columns, field.chunk) for name, field in fields.items()}


def create(group: h5py.Group, name: str, rows: int, like: Field) -> h5py.Dataset:
    """Create an empty dataset with one chunk per column.

    Columns that are never written (z in 2D) read as 0.
    """
    columns = 3 if name in VECTORS and like.columns == 2 else like.columns
    data = group.create_dataset(
        name,
        shape=(rows, columns) if columns else (rows,),
        maxshape=(None, columns) if columns else (None,),
        chunks=(like.chunk, 1) if columns else (like.chunk,),
        dtype=like.dtype,
        compression="gzip",
        compression_opts=LEVEL,
        shuffle=True,
    )
    data.attrs["columns"] = like.columns
    return data


def corners(n: int, chunk: int, columns: int) -> list[tuple[int, ...]]:
    """First row (and column, if the field has columns) of each chunk, column by column."""
    rows = range(0, n, chunk)
    if not columns:
        return [(row,) for row in rows]
    return [(row, column) for column in range(columns) for row in rows]


def copy(
    source: Field, first: int, target: h5py.Dataset, row: int, n: int, sink: Sink
) -> list[tuple[int, int, int]]:
    """Copy ``n`` rows from ``first`` to ``row``, both on chunk boundaries, without unpacking.

    ``sink`` is that of the file of the target.

    Returns
    -------
    list
        Filter mask, position in the file and size [bytes] of each chunk.
    """
    placed = []
    for shift, *rest in corners(n, source.chunk, source.columns):
        mask, raw = source.raw((first + shift, *rest))
        target.id.write_direct_chunk((row + shift, *rest), raw, mask)
        placed.append((mask, sink.place, len(raw)))
    return placed
