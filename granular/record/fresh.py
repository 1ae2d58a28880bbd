"""Fields of a frame that is not stored yet: made, checked and packed column by column.

No copy of the whole state is made: a column is gathered, its checksum taken, and it is stored
before the next but one is made. The next one is made in a thread meanwhile.
"""

import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from granular.record.chunks import Field, Packer, Raw
from granular.record.layout import described

AHEAD = 50_000
"""Number of points from which on the next column is made in a thread."""


class Columns(Protocol):
    """A field whose columns are made on demand, of shape (n,) or (n, columns)."""

    dtype: np.dtype
    shape: tuple[int, ...]

    def column(self, k: int, out: np.ndarray) -> np.ndarray:
        """Return column `k`, contiguous: in `out`, n numbers of 8 bytes, or elsewhere."""


@dataclass(frozen=True)
class Streamed:
    """The part of a state that a frame stores, with fields that are made column by column."""

    time: float
    step: int
    dt: float
    fields: Mapping[str, Columns]


@dataclass(frozen=True)
class _Whole:
    """Columns of an array."""

    array: np.ndarray

    @property
    def dtype(self) -> np.dtype:
        return self.array.dtype

    @property
    def shape(self) -> tuple[int, ...]:
        return self.array.shape

    def column(self, k: int, out: np.ndarray) -> np.ndarray:
        part = self.array[:, k] if self.array.ndim == 2 else self.array
        return np.ascontiguousarray(part)


class Fresh:
    """A field of a frame that is not stored yet; its chunks are packed on demand."""

    def __init__(
        self, given: np.ndarray | Columns, chunk: int, packer: Packer, name: str, single: bool
    ) -> None:
        source = _Whole(given) if isinstance(given, np.ndarray) else given
        rounded = single and source.dtype.kind == "f"
        self.dtype, self.chunk = "<f4" if rounded else source.dtype.str, chunk
        self.n, *wide = source.shape
        self.columns = wide[0] if wide else 0
        self._source, self._packer, self._name = source, packer, name
        self._sums: dict[int, int] = {}
        self._at, self._column = -1, np.empty(0)
        self.ahead: Iterator[np.ndarray] | None = None  # of the columns, in their order

    def make(self, k: int, out: np.ndarray) -> np.ndarray:
        """Return a column, which is valid until `out` is used again."""
        column = self._source.column(k, out)
        if column.dtype.str != self.dtype:
            with np.errstate(over="ignore"):  # infinity then
                column = column.astype(self.dtype)
        self._sums[k] = zlib.crc32(column.view(np.uint8).data)
        return column

    def total(self) -> float:
        """Sum of the first column as it was given, in double precision."""
        return float(np.sum(self._source.column(0, self.space()[0]), dtype=float))

    def space(self) -> np.ndarray:
        """Return memory for two columns, which all frames use again."""
        return self._packer.space(self.n)

    def checksums(self) -> bytes:
        """Return the `granular.record.layout.checksums` of the field."""
        count, out = max(self.columns, 1), self.space()[0]
        for k in range(count):
            if k not in self._sums:
                self.make(k, out)
        shape = (self.columns, self.n) if self.columns else (self.n,)
        sums = struct.pack(f"<{count}L", *(self._sums[k] for k in range(count)))
        return described(self.dtype, shape, sums)

    def raw(self, corner: tuple[int, ...]) -> tuple[int, Raw]:
        """Return filter mask and bytes of the chunk that begins at (row,) or (row, column)."""
        row, k = (*corner, 0)[:2]
        if k != self._at:
            self._column = self.make(k, self.space()[0]) if self.ahead is None else next(self.ahead)
            self._at = k
        part = self._column[row : row + self.chunk]
        if len(part) < self.chunk:
            whole = np.zeros(self.chunk, dtype=part.dtype)
            whole[: len(part)] = part
            part = whole
        return self._packer.pack((self._name, *corner), part)

    def read(self, row: int, n: int) -> np.ndarray:
        """Return ``n`` rows from ``row``; an unstored field cannot be read."""
        raise NotImplementedError


@dataclass(frozen=True)
class New:
    """Fields of a frame that is not stored yet (a `Source`)."""

    path: Path
    given: Mapping[str, Fresh]

    @contextmanager
    def fields(self) -> Iterator[Mapping[str, Fresh]]:
        """Return the fields by name, of which the columns are to be used in their order."""
        fields = self.given.values()
        if max(field.n for field in fields) < AHEAD:
            yield self.given
            return
        with ThreadPoolExecutor(1) as pool:
            columns = _made_ahead(fields, pool)
            for field in fields:
                field.ahead = columns
            try:
                yield self.given
            finally:
                for field in fields:
                    field.ahead = None


def checksums_of(fields: Mapping[str, Field]) -> dict[str, bytes]:
    """Checksums of fields that are not stored yet, of which no column need be made again."""
    return {name: field.checksums() for name, field in fields.items() if isinstance(field, Fresh)}


def _made_ahead(fields: Iterable[Fresh], pool: ThreadPoolExecutor) -> Iterator[np.ndarray]:
    """Columns of all fields, one after the other; each is made while the one before is used."""
    pending: Future[np.ndarray] | None = None
    turn = 0
    for field in fields:
        for k in range(max(field.columns, 1)):
            following = pool.submit(field.make, k, field.space()[turn])
            turn = 1 - turn
            if pending is not None:
                yield pending.result()
            pending = following
    if pending is not None:
        yield pending.result()
