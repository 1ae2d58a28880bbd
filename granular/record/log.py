"""The log of an unfinished record: its head, and an entry for each frame.

An entry has the scalars of a frame and the positions of its columns in the file of the record. It
is written after them, so that a frame with an entry is complete. An incomplete entry at the end of
the log, which a killed writer may leave, does not count. If the last entry has its full length but
other content, a loss of power or damage has spoilt it: the frame is missing, and the log is
reported as damaged.
"""

import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from granular.record.chunks import RAW, Field, Packed, check_chunks, most_of, size_of
from granular.record.frame import Frame, Head, Texts
from granular.record.layout import (
    FIELD_DTYPES,
    FORMAT,
    MAX_DEFLATE,
    OTHERS,
    check_format,
    reading,
)
from granular.record.sealed import MAGIC, is_beginning, is_whole, sealed, unsealed, whole

SPOILT = "damaged, or was not written whole before a loss of power: the frame is missing"
SCALARS = struct.Struct("<dqddq")  # time, step, dt, mass, n; JSON would lose the sign of a nan


@dataclass(frozen=True)
class Stretch:
    """Fields of one frame, in chunks of a file (a `Source`).

    ``layout`` has dtype, columns, rows per chunk and, for each chunk, filter mask, position and
    size.
    """

    path: Path
    n: int
    layout: Mapping[str, tuple[str, int, int, Sequence[tuple[int, int, int]]]]

    @contextmanager
    def fields(self) -> Iterator[Mapping[str, Field]]:
        """Return the fields by name, as `Source.fields`."""
        packed = {}
        with reading(self.path), open(self.path, "rb") as file:
            ends = [
                (at + size, size) for *_, chunks in self.layout.values() for _, at, size in chunks
            ]
            end, total = max((end for end, _ in ends), default=0), sum(size for _, size in ends)
            if max(end, total) > os.fstat(file.fileno()).st_size:
                raise ValueError(
                    f"a frame of {total} bytes up to {end} is more than the file holds"
                )
            for name, (dtype, columns, chunk, chunks) in self.layout.items():
                raw = []
                for mask, place, size in chunks:
                    file.seek(place)
                    raw.append((mask, file.read(size)))
                packed[name] = Packed(dtype, columns, chunk, self.n, raw)
        yield packed


def head_entry(head: Head) -> bytes:
    """Return the bytes with which a log begins."""
    texts = head.texts
    return sealed(
        {
            "format": FORMAT,
            "record": texts.record,
            "scene": texts.scene,
            "provenance": texts.provenance,
            "name": head.name,
            "replaces": head.replaces,
        }
    )


def _head(path: Path, header: Mapping[str, Any]) -> Head:
    check_format(path, header["format"])
    texts = Texts(header["record"], header["scene"], header["provenance"])
    name, replaces = header["name"], header["replaces"]
    if not isinstance(name, str) or not name.isalnum():
        raise ValueError(f"name {name!r} is not one of files")
    if replaces is not None:
        size, modified = map(whole, replaces)
        replaces = size, modified
    return Head(texts, name, replaces)


def frame_entry(frame: Frame) -> bytes:
    """Return the bytes of the entry of a frame whose source is a `Stretch`."""
    others = {name: _packed(other) for name, other in frame.others.items()}
    return sealed({"frame": _packed(frame), "others": others})


def _packed(frame: Frame) -> dict[str, Any]:
    assert isinstance(frame.source, Stretch)
    return {
        "scalars": SCALARS.pack(frame.time, frame.step, frame.dt, frame.mass, frame.n).hex(),
        "digest": frame.digest.hex(),
        "samples": {name: value.hex() for name, value in frame.samples.items()},
        "layout": frame.source.layout,
    }


def _unpacked(
    path: Path, entry: Mapping[str, Any], others: Mapping[str, Frame], needed: set[str]
) -> Frame:
    time, step, dt, mass, n = SCALARS.unpack(bytes.fromhex(entry["scalars"]))
    layout = {name: tuple(field) for name, field in entry["layout"].items()}
    _check_layout(layout, n, needed)
    return Frame(
        time=time,
        step=step,
        dt=dt,
        mass=mass,
        n=n,
        digest=bytes.fromhex(entry["digest"]),
        row=0,
        source=Stretch(path, n, layout),
        samples={name: float.fromhex(value) for name, value in entry["samples"].items()},
        others=others,
    )


def _check_layout(layout: Mapping[str, Any], n: int, needed: set[str]) -> None:
    """Refuse fields that cannot be those of a frame of ``n`` points, before they are read."""
    for dtype, columns, chunk, chunks in layout.values():
        if dtype not in FIELD_DTYPES:
            raise ValueError(f"type {dtype!r} must be one of {FIELD_DTYPES}")
        check_chunks(whole(columns), whole(chunk), n, len(chunks))
        least, most = size_of(dtype, chunk) / MAX_DEFLATE, most_of(dtype, chunk)
        for mask, place, size in chunks:
            whole(place)
            if mask not in (0, RAW) or not least <= whole(size) <= most:
                raise ValueError(f"a chunk of {chunk} rows cannot be {size} bytes")
    if not needed <= set(layout):
        raise ValueError(f"fields {sorted(layout)} must have {' and '.join(sorted(needed))}")


def read_log(path: Path, data: str) -> tuple[Head, list[Frame], list[str]]:
    """Read a log.

    Returns
    -------
    head, frames, damage
        The frames are in a file with the suffix `data` next to the log. The damage is that of the
        last entry: a message, if it is spoilt.

    Raises
    ------
    RecordError
        If it is damaged elsewhere.
    """
    frames, damage = [], list[str]()
    with reading(path):
        raw = memoryview(path.read_bytes())
        header, at = unsealed(raw)
        head = _head(path, header)
        source = path.with_name(head.name + data)
        while is_whole(raw[at:]):
            try:
                header, size = unsealed(raw[at:])
            except ValueError:  # it is spoilt
                break
            at += size
            others = {name: header["others"][name] for name in sorted(header["others"])}
            if not set(others) <= set(OTHERS):
                raise ValueError(f"sets of points {sorted(others)} must be of {OTHERS}")
            below = {name: _unpacked(source, entry, {}, {"x"}) for name, entry in others.items()}
            frames.append(_unpacked(source, header["frame"], below, {"x", "mass"}))
        if MAGIC in bytes(raw[at + 1 :]):
            raise ValueError(f"entry {len(frames)} is damaged")
        if at < len(raw) and not is_beginning(raw[at:]):
            damage.append(f"{path}: its last entry, of frame {len(frames)}, is {SPOILT}")
    return head, frames, damage
