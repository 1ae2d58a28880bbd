"""What a running writer leaves on the disk until it closes: small files, each whole or not at all.

    MAGIC, length of the header (8 bytes), digest of the header (32 bytes), header (JSON), data

The header tells the format and the record, and what the data are: the texts that head the record
(``head.part``, no data), some frames (``frames-<index of the first>.part``; their columns, packed
as they will be in the finished file), or the restart state (``checkpoint.part``). HDF5 takes 15 ms
for such a file whatever it holds, and here nobody but `load` has to read it.
"""

import json
import math
import os
import struct
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from granular.record.checkpoint import Checkpoint, number
from granular.record.chunks import Packed
from granular.record.frame import Frame, Texts
from granular.record.layout import DTYPES, check_format, format_of, reading, seal
from granular.record.storage import replacing, write_all

MAGIC = b"granular"
START = struct.Struct("<8sq32s")
CLOCK = struct.Struct("<dqd")  # time, step, dt; JSON would lose the sign of a nan
SCALARS = struct.Struct("<dqddq")  # and mass, n


def known(dtype: str) -> str:
    """The type of a field, if it is one that a record holds."""
    if dtype not in DTYPES:
        raise ValueError(f"type {dtype!r} must be one of {DTYPES}")
    return dtype


@dataclass(frozen=True)
class Memory:
    """Fields of a frame that waits to be stored (a `Source`)."""

    path: Path
    packed: Mapping[str, Packed]

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return sum(field.nbytes for field in self.packed.values())

    @contextmanager
    def fields(self) -> Iterator[Mapping[str, Packed]]:
        """As of `Source`."""
        yield self.packed


@dataclass(frozen=True)
class Stretch:
    """Fields of a frame in a segment (a `Source`): from a byte on, as the header tells."""

    path: Path
    offset: int
    n: int
    layout: Mapping[str, Any]

    @property
    def size(self) -> int:
        """Bytes of all fields."""
        return sum(size for *_, chunks in self.layout.values() for _, size in chunks)

    @contextmanager
    def fields(self) -> Iterator[Mapping[str, Packed]]:
        """As of `Source`."""
        packed = {}
        with open(self.path, "rb") as file:
            file.seek(self.offset)
            for name, (dtype, columns, chunk, chunks) in self.layout.items():
                raw = [(mask, file.read(size)) for mask, size in chunks]
                packed[name] = Packed(known(dtype), columns, chunk, self.n, raw)
        yield packed


def _write(
    fd: int,
    record: str,
    header: Mapping[str, Any],
    data: Collection[bytes] = (),
    gas: bool = False,
) -> None:
    start = {"format": format_of(gas), "record": record, "size": sum(map(len, data))}
    text = json.dumps(start | dict(header)).encode("ascii")
    for piece in (START.pack(MAGIC, len(text), seal(text)), text, *data):
        write_all(fd, piece)


def _read(path: Path) -> tuple[dict[str, Any], int]:
    """Header, verified, and where the data begin; errors to be met by `reading`."""
    size = os.stat(path).st_size
    with open(path, "rb") as file:
        magic, length, digest = START.unpack(file.read(START.size))
        if magic != MAGIC or not 0 <= length <= size:
            raise ValueError("not a segment of a record")
        text = file.read(length)
    if seal(text) != digest:
        raise ValueError("its header does not match its digest")
    header = json.loads(text)
    check_format(path, header["format"])
    offset = START.size + length
    if size != offset + header["size"]:
        raise ValueError(f"it has {size - offset} bytes of data, its header says {header['size']}")
    return header, offset


def write_head(fd: int, texts: Texts) -> None:
    """Store what heads a record."""
    _write(fd, texts.record, {"scene": texts.scene, "provenance": texts.provenance})


def read_head(path: Path) -> Texts:
    """As stored by `write_head`; RecordError if it is damaged."""
    with reading(path):
        header, _ = _read(path)
        return Texts(header["record"], header["scene"], header["provenance"])


def write_frames(path: Path, record: str, frames: Sequence[Frame]) -> None:
    """Store frames that wait in memory."""
    data: list[bytes] = []
    heads = [_pack_frame(frame, data) for frame in frames]
    gas = any(frame.gas for frame in frames)
    with replacing(path, path.with_suffix(".tmp")) as fd:
        _write(fd, record, {"frames": heads}, data, gas)


def _pack_frame(frame: Frame, data: list[bytes]) -> tuple[Any, ...]:
    """What the header tells of a frame, that of its gas last; what it holds goes to the data."""
    layout = {}
    with frame.source.fields() as fields:
        for name, field in fields.items():
            chunks = [field.raw(corner) for corner in field.corners]
            sizes = [(mask, len(raw)) for mask, raw in chunks]
            layout[name] = field.dtype, field.columns, field.chunk, sizes
            data += [raw for _, raw in chunks]
    scalars = SCALARS.pack(frame.time, frame.step, frame.dt, frame.mass, frame.n)
    samples = {name: value.hex() for name, value in frame.samples.items()}
    head = (scalars.hex(), frame.digest.hex(), layout, samples)
    return (*head, _pack_frame(frame.gas, data)) if frame.gas else head


def read_frames(path: Path, record: str) -> list[Frame]:
    """Frames of a segment of this record; RecordError if it is damaged or of another one."""
    frames = []
    with reading(path):
        header, offset = _read(path)
        if header["record"] != record:
            raise ValueError("the segment is of another record")
        for head in header["frames"]:
            frame, offset = _unpack_frame(path, offset, *head)
            frames.append(frame)
    return frames


def _unpack_frame(
    path: Path,
    offset: int,
    scalars: str,
    digest: str,
    layout: Mapping[str, Any],
    samples: Mapping[str, str],
    *gas: Sequence[Any],
) -> tuple[Frame, int]:
    """A frame whose data begin at a byte, from what `_pack_frame` told of it; and their end."""
    time, step, dt, mass, n = SCALARS.unpack(bytes.fromhex(scalars))
    source = Stretch(path, offset, n, layout)
    offset += source.size
    below = None
    if gas:
        (head,) = gas
        scalars_of, digest_of, layout_of, samples_of = head  # a gas has none of its own
        below, offset = _unpack_frame(path, offset, scalars_of, digest_of, layout_of, samples_of)
    frame = Frame(
        time=time,
        step=step,
        dt=dt,
        mass=mass,
        n=n,
        digest=bytes.fromhex(digest),
        row=0,
        source=source,
        samples={name: float.fromhex(value) for name, value in samples.items()},
        gas=below,
    )
    return frame, offset


def write_restart(path: Path, record: str, checkpoint: Checkpoint) -> None:
    """Store a restart state."""
    clock = CLOCK.pack(checkpoint.time, checkpoint.step, checkpoint.dt)
    scalars = {name: number(value) for name, value in checkpoint.scalars.items()}
    header = {
        "clock": clock.hex(),
        "scalars": {name: (a.dtype.str, a.tobytes().hex()) for name, a in scalars.items()},
        "arrays": {name: (a.dtype.str, a.shape) for name, a in checkpoint.arrays.items()},
        "digest": checkpoint.digest.hex(),
    }
    data = [array.tobytes() for array in checkpoint.arrays.values()]
    with replacing(path, path.with_suffix(".tmp")) as fd:
        _write(fd, record, header, data)


def read_restart(path: Path) -> Checkpoint:
    """As stored by `write_restart`, verified; RecordError if it is damaged."""
    with reading(path):
        header, offset = _read(path)
        time, step, dt = CLOCK.unpack(bytes.fromhex(header["clock"]))
        scalars = {
            name: _array(dtype, (), bytes.fromhex(raw)).item()
            for name, (dtype, raw) in header["scalars"].items()
        }
        arrays = {}
        with open(path, "rb") as file:
            file.seek(offset)
            for name, (dtype, shape) in header["arrays"].items():
                raw = file.read(8 * math.prod(shape))
                arrays[name] = _array(dtype, shape, raw)
        checkpoint = Checkpoint(time=time, step=step, dt=dt, scalars=scalars, arrays=arrays)
        if checkpoint.digest != bytes.fromhex(header["digest"]):
            raise ValueError("the checkpoint does not match its digest")
    return checkpoint


def _array(dtype: str, shape: Sequence[int], raw: bytes) -> np.ndarray:
    return np.frombuffer(raw, dtype=known(dtype)).reshape(shape).copy()
