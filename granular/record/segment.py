"""Segments, the files of a running writer until it closes: each is complete or does not exist.

A segment consists of

    MAGIC, length of the header (8 bytes), digest of the header (32 bytes), header (JSON), data

The header contains the format, the record and the kind of data. The kinds are the texts in the
header of the record (``head.part``, no data), some frames (``frames-<index of the first>.part``,
with columns packed as in the finished file), and the restart state (``checkpoint.part``). Once the
finished file holds all of them, the head is renamed to ``merged.part`` and goes last. The files
are not HDF5, which takes 15 ms for such a file whatever its content; only `load` has to read them.
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
from granular.record.chunks import RAW, Packed, check_chunks
from granular.record.frame import Frame, Head, Texts
from granular.record.layout import DTYPES, MAX_DEFLATE, check_format, format_of, reading, seal
from granular.record.storage import replacing, write_all

MAGIC = b"granular"
START = struct.Struct("<8sq32s")
CLOCK = struct.Struct("<dqd")  # time, step, dt as bytes, because JSON would lose the sign of a nan
SCALARS = struct.Struct("<dqddq")  # and mass, n


def known(dtype: str) -> str:
    """Return the type of a field; ValueError if a record cannot hold it."""
    if dtype not in DTYPES:
        raise ValueError(f"type {dtype!r} must be one of {DTYPES}")
    return dtype


@dataclass(frozen=True)
class Memory:
    """Fields in memory of a frame that waits to be stored (a `Source`)."""

    path: Path
    packed: Mapping[str, Packed]
    offset: int = 0

    @property
    def nbytes(self) -> int:
        """Size of the fields [bytes]."""
        return sum(field.nbytes for field in self.packed.values())

    @contextmanager
    def fields(self) -> Iterator[Mapping[str, Packed]]:
        """Return the fields by name, as `Source.fields`."""
        yield self.packed


@dataclass(frozen=True)
class Stretch:
    """Fields of a frame in a segment (a `Source`), from byte ``offset`` on in the given layout."""

    path: Path
    offset: int
    n: int
    layout: Mapping[str, Any]

    @property
    def size(self) -> int:
        """Size of all fields [bytes]."""
        return sum(size for *_, chunks in self.layout.values() for _, size in chunks)

    @contextmanager
    def fields(self) -> Iterator[Mapping[str, Packed]]:
        """Return the fields by name, as `Source.fields`."""
        packed = {}
        with reading(self.path), open(self.path, "rb") as file:
            file.seek(self.offset)
            for name, (dtype, columns, chunk, chunks) in self.layout.items():
                raw = [(mask, file.read(size)) for mask, size in chunks]
                packed[name] = Packed(dtype, columns, chunk, self.n, raw)
        yield packed


def _whole(value: object) -> int:
    """Return a number of a header that counts something; ValueError if it is none."""
    if type(value) is not int or value < 0:
        raise ValueError(f"{value!r} is not a whole number")
    return value


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
    """Return the verified header and the offset of the data; `reading` has to handle errors."""
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
    if size != offset + _whole(header["size"]):
        raise ValueError(f"it has {size - offset} bytes of data, its header says {header['size']}")
    return header, offset


def write_head(fd: int, head: Head) -> None:
    """Store the head of an unfinished record."""
    texts, before = head.texts, {"continues": head.continues.hex(), "replaces": head.replaces}
    _write(fd, texts.record, {"scene": texts.scene, "provenance": texts.provenance, **before})


def read_head(path: Path) -> Head:
    """Read what `write_head` stored; RecordError if it is damaged."""
    with reading(path):
        header, _ = _read(path)
        texts = Texts(header["record"], header["scene"], header["provenance"])
        replaces = header["replaces"]
        if replaces is not None:
            size, modified = map(_whole, replaces)
            replaces = size, modified
        return Head(texts, bytes.fromhex(header["continues"]), replaces)


def write_frames(path: Path, record: str, frames: Sequence[Frame]) -> None:
    """Store frames that wait in memory."""
    data: list[bytes] = []
    heads = [_pack_frame(frame, data) for frame in frames]
    gas = any(frame.gas for frame in frames)
    with replacing(path, path.with_suffix(".tmp")) as fd:
        _write(fd, record, {"frames": heads}, data, gas)


def _pack_frame(frame: Frame, data: list[bytes]) -> tuple[Any, ...]:
    """Return the header entry of a frame, that of its gas last; append its fields to `data`."""
    layout = {}
    with frame.source.fields() as fields:
        for name, field in fields.items():
            assert isinstance(field, Packed)  # as all that waits in memory
            chunks = [field.raw(corner) for corner in field.corners]
            sizes = [(mask, len(raw)) for mask, raw in chunks]
            layout[name] = field.dtype, field.columns, field.chunk, sizes
            data += [raw for _, raw in chunks]
    scalars = SCALARS.pack(frame.time, frame.step, frame.dt, frame.mass, frame.n)
    samples = {name: value.hex() for name, value in frame.samples.items()}
    head = (scalars.hex(), frame.digest.hex(), layout, samples)
    return (*head, _pack_frame(frame.gas, data)) if frame.gas else head


def read_frames(path: Path, record: str) -> list[Frame]:
    """Read the frames of a segment; RecordError if it is damaged or of another record."""
    frames = []
    with reading(path):
        header, offset = _read(path)
        if header["record"] != record:
            raise ValueError("the segment is of another record")
        end = offset + header["size"]
        for head in header["frames"]:
            frame, offset = _unpack_frame(path, offset, *head)
            frames.append(frame)
        if offset != end:
            raise ValueError("its frames are not as long as its data")
    return frames


def _check_layout(layout: Mapping[str, Any], n: int) -> None:
    """Refuse fields that cannot be those of a frame of ``n`` points, before they are read."""
    for dtype, columns, chunk, chunks in layout.values():
        known(dtype)
        check_chunks(_whole(columns), _whole(chunk), n, len(chunks))
        for mask, size in chunks:
            if mask not in (0, RAW) or 8 * chunk > MAX_DEFLATE * _whole(size):
                raise ValueError(f"a chunk of {chunk} rows cannot be {size} bytes")
    if not {"x", "mass"} <= set(layout):
        raise ValueError(f"fields {sorted(layout)} must have x and mass")


def _unpack_frame(
    path: Path,
    offset: int,
    scalars: str,
    digest: str,
    layout: Mapping[str, Any],
    samples: Mapping[str, str],
    *gas: Sequence[Any],
) -> tuple[Frame, int]:
    """Return the frame whose data begin at `offset`, from its header entry, and their end."""
    time, step, dt, mass, n = SCALARS.unpack(bytes.fromhex(scalars))
    _check_layout(layout, n)
    source = Stretch(path, offset, n, layout)
    offset += source.size
    below = None
    if gas:
        (head,) = gas
        scalars_of, digest_of, layout_of, samples_of = head  # a gas has no gas itself
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
    """Read and verify the state stored by `write_restart`; RecordError if it is damaged."""
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
                size = 8 * math.prod(map(_whole, shape))
                if size > header["size"]:
                    raise ValueError(f"array {name} has shape {shape}, more than the file can hold")
                arrays[name] = _array(dtype, shape, file.read(size))
        checkpoint = Checkpoint(time=time, step=step, dt=dt, scalars=scalars, arrays=arrays)
        if checkpoint.digest != bytes.fromhex(header["digest"]):
            raise ValueError("the checkpoint does not match its digest")
    return checkpoint


def _array(dtype: str, shape: Sequence[int], raw: bytes) -> np.ndarray:
    return np.frombuffer(raw, dtype=known(dtype)).reshape(shape).copy()
