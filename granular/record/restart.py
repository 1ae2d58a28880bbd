"""Files with one restart state: a sealed header, the arrays one after the other, and a digest."""

import math
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path

import numpy as np

from granular.record.checkpoint import Checkpoint, CheckpointRows, digest_of, number
from granular.record.layout import (
    DIGEST_SIZE,
    DTYPES,
    FORMAT,
    check_format,
    checksums,
    count_of_rows,
    reading,
)
from granular.record.sealed import END, START, sealed, unsealed, whole
from granular.record.storage import replacing, write_all

CLOCK = struct.Struct("<dqd")  # time, step, dt as bytes, because JSON would lose the sign of a nan


def write_restart(path: Path, checkpoint: Checkpoint | CheckpointRows) -> None:
    """Store a restart state, durably, completely or not at all."""
    clock = CLOCK.pack(checkpoint.time, checkpoint.step, checkpoint.dt)
    scalars = {name: number(value) for name, value in checkpoint.scalars.items()}
    arrays = checkpoint.arrays
    header = {
        "format": FORMAT,
        "size": sum(8 * math.prod(array.shape) for array in arrays.values()),
        "clock": clock.hex(),
        "scalars": {name: (a.dtype.str, a.tobytes().hex()) for name, a in scalars.items()},
        "arrays": {name: (a.dtype.str, a.shape) for name, a in arrays.items()},
    }
    with replacing(path, path.with_suffix(".tmp")) as fd:

        def put(_: int, row: np.ndarray) -> None:
            write_all(fd, row.view(np.uint8).data)

        write_all(fd, sealed(header))
        sums = {name: checksums(array, put) for name, array in arrays.items()}
        write_all(fd, digest_of(checkpoint, sums))


@dataclass(frozen=True)
class _Stored:
    """An array in a file."""

    file: BufferedReader
    place: int
    dtype: np.dtype
    shape: tuple[int, ...]

    def row(self, k: int) -> np.ndarray:
        n = math.prod(self.shape) // count_of_rows(self.shape)
        row = np.empty(n, dtype=self.dtype)
        self.file.seek(self.place + 8 * n * k)
        if self.file.readinto(row.view(np.uint8).data) != 8 * n:
            raise ValueError("an array is not whole")
        return row


@contextmanager
def opened_restart(path: Path) -> Iterator[tuple[CheckpointRows, bytes]]:
    """Open a state stored by `write_restart`; yield it, and the digest that it should have.

    RecordError if it is damaged, but for what only the digest shows.
    """
    with reading(path), open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        start = file.read(START.size)
        length = START.unpack(start)[1]
        if not 0 <= length <= size:
            raise ValueError("not a restart state")
        header, place = unsealed(memoryview(start + file.read(length + len(END))))
        check_format(path, header["format"])
        end = place + whole(header["size"])
        if size != end + DIGEST_SIZE:
            raise ValueError(f"it has {size} bytes, not those that its header says")
        time, step, dt = CLOCK.unpack(bytes.fromhex(header["clock"]))
        scalars = {
            name: np.frombuffer(bytes.fromhex(raw), dtype=_known(dtype)).reshape(()).item()
            for name, (dtype, raw) in header["scalars"].items()
        }
        arrays = {}
        for name, (dtype, shape) in header["arrays"].items():
            arrays[name] = _Stored(
                file, place, np.dtype(_known(dtype)), tuple(whole(n) for n in shape)
            )
            place += 8 * math.prod(shape)
            if place > end:
                raise ValueError(f"array {name} has shape {shape}, more than the file can hold")
        file.seek(end)
        digest = file.read(DIGEST_SIZE)
        yield CheckpointRows(time=time, step=step, dt=dt, scalars=scalars, arrays=arrays), digest


def read_restart(path: Path) -> Checkpoint:
    """Read and verify the state stored by `write_restart`; RecordError if it is damaged."""
    with opened_restart(path) as (rows, digest), reading(path):
        checkpoint = rows.whole()
        check_digest(checkpoint.digest, digest)
    return checkpoint


def check_digest(found: bytes, stored: bytes) -> None:
    """Refuse a checkpoint with another digest than the stored one."""
    if found != stored:
        raise ValueError("the checkpoint does not match its digest")


def _known(dtype: str) -> str:
    if dtype not in DTYPES:
        raise ValueError(f"type {dtype!r} must be one of {DTYPES}")
    return dtype
