"""What a record holds, finished or not: the one file plus the parts that a running writer left."""

import contextlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol

import h5py
import numpy as np

from granular.record.checkpoint import Checkpoint, read_checkpoint
from granular.record.layout import (
    DTYPES,
    RecordError,
    attribute,
    check_format,
    checked,
    frame_digest,
    hard,
    read_text,
    reading,
    seal,
)
from granular.record.storage import open_hdf5

Columns = dict[str, tuple[h5py.Dataset, int]]


class Source(Protocol):
    """Where frames are stored."""

    path: Path

    def fields(self) -> contextlib.AbstractContextManager[Columns]:
        """Datasets by field name, each with the number of columns of the field (0: none)."""


@dataclass(frozen=True, kw_only=True)
class Frame:
    """One frame: its scalars, and its place: ``n`` rows from ``row`` of ``source``."""

    time: float
    step: int
    dt: float
    mass: float
    n: int
    digest: bytes
    row: int
    source: Source

    def read(self) -> dict[str, np.ndarray]:
        """All fields, verified.

        Raises
        ------
        RecordError
            The stored frame is damaged or does not match its digest.
        """
        fields = {}
        with reading(self.source.path), self.source.fields() as stored:
            for name, (data, columns) in stored.items():
                if self.row < 0 or self.n < 0 or self.row + self.n > data.shape[0]:
                    raise ValueError(f"rows {self.row}+{self.n} of {name} are not in the file")
                rows = data[self.row : self.row + self.n]
                fields[name] = np.ascontiguousarray(rows[:, :columns]) if columns else rows
        if self.digest != frame_digest(self.time, self.step, self.dt, self.mass, fields):
            raise RecordError(
                f"{self.source.path}: the frame of step {self.step} does not match its digest"
            )
        return fields


def _columns(data: h5py.Dataset) -> int:
    columns = int(attribute(data, "columns", "i"))
    wide = data.shape[1] if len(data.shape) == 2 else 0
    if not (columns == wide or (wide == 3 and columns == 2)):
        raise ValueError(f"{data.name} has {wide} columns, its attribute says {columns}")
    return columns


def _member(group: h5py.Group, name: str) -> tuple[h5py.Dataset, int]:
    data = checked(group, name, DTYPES, 1, 2)
    if data.chunks is None or data.chunks[1:] != (1,) * (data.ndim - 1):
        raise ValueError(f"{data.name} is not chunked by columns")
    return data, _columns(data)


class Part:
    """A segment: a small HDF5 file with one frame."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @contextmanager
    def fields(self) -> Iterator[Columns]:
        """See `Source`."""
        with open_hdf5(self.path) as file:
            group = hard(file, "fields", h5py.Group)
            yield {name: _member(group, name) for name in group}

    def frame(self, record: str) -> Frame:
        """The frame in this part, which must belong to ``record``."""
        with open_hdf5(self.path) as file, reading(self.path):
            check_format(self.path, int(attribute(file, "format", "i")))
            frame = Frame(
                time=attribute(file, "time", "f"),
                step=attribute(file, "step", "i"),
                dt=attribute(file, "dt", "f"),
                mass=attribute(file, "mass", "f"),
                n=attribute(file, "n", "i"),
                digest=attribute(file, "digest", "u"),
                row=0,
                source=self,
            )
            if attribute(file, "seal", "u") != part_seal(record, frame):
                raise ValueError("the segment is damaged or of another record")
        return frame


def part_seal(record: str, frame: Frame) -> bytes:
    """Digest of the scalars of a part."""
    scalars = np.array([frame.time, frame.dt, frame.mass])
    return seal(record, scalars, np.array([frame.step, frame.n]), frame.digest)


@dataclass(frozen=True)
class Table:
    """The per-frame columns of a finished file, and the seal over them."""

    time: np.ndarray
    n: np.ndarray
    row: np.ndarray
    step: np.ndarray
    dt: np.ndarray
    mass: np.ndarray
    digest: np.ndarray

    def seal(self, version: int, record: str, texts: tuple[str, str], checkpoint: bytes) -> bytes:
        """Digest of everything in the file that no other digest covers."""
        columns = (self.time, self.n, self.row, self.step, self.dt, self.mass, self.digest)
        return seal(str(version), record, *texts, checkpoint, *columns)


class Main:
    """The finished file, held open."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file = open_hdf5(path)
        try:
            with reading(path):
                self._load()
        except BaseException:
            self.file.close()
            raise

    def _load(self) -> None:
        own = hard(self.file, "granular", h5py.Group)
        version = check_format(self.path, int(attribute(own, "format", "i")))
        self.record = read_text(own, "record")
        self.scene, self.provenance = read_text(own, "scene"), read_text(own, "provenance")
        vtk = hard(self.file, "VTKHDF", h5py.Group)
        steps = hard(vtk, "Steps", h5py.Group)
        table = Table(
            time=checked(steps, "Values", ("<f8",), 1)[:],
            n=checked(vtk, "NumberOfPoints", ("<i8",), 1)[:],
            row=checked(steps, "PointOffsets", ("<i8",), 1)[:],
            step=checked(own, "step", ("<i8",), 1)[:],
            dt=checked(own, "dt", ("<f8",), 1)[:],
            mass=checked(own, "mass", ("<f8",), 1)[:],
            digest=checked(own, "digest", ("|u1",), 2)[:],
        )
        self.has_checkpoint = "checkpoint" in own
        checkpoint = b""
        if self.has_checkpoint:
            checkpoint = attribute(hard(own, "checkpoint", h5py.Group), "digest", "u")
        expected = table.seal(version, self.record, (self.scene, self.provenance), checkpoint)
        if attribute(own, "seal", "u") != expected:
            raise ValueError("the table of contents does not match its digest")
        self.frames = [
            Frame(
                time=float(table.time[i]),
                step=int(table.step[i]),
                dt=float(table.dt[i]),
                mass=float(table.mass[i]),
                n=int(table.n[i]),
                digest=table.digest[i].tobytes(),
                row=int(table.row[i]),
                source=self,
            )
            for i in range(len(table.time))
        ]

    @contextmanager
    def fields(self) -> Iterator[Columns]:
        """See `Source`."""
        yield self._fields

    @cached_property
    def _fields(self) -> Columns:
        vtk = hard(self.file, "VTKHDF", h5py.Group)
        data = hard(vtk, "PointData", h5py.Group)
        return {"x": _member(vtk, "Points")} | {name: _member(data, name) for name in data}

    def checkpoint(self) -> Checkpoint:
        """The checkpoint, verified."""
        with reading(self.path):
            own = hard(self.file, "granular", h5py.Group)
            return read_checkpoint(hard(own, "checkpoint", h5py.Group))


@dataclass
class Contents:
    """Everything a record holds; `close` when done.

    ``main`` is the finished file, if it belongs to the record; ``folder`` the parts, if there
    are any; ``frames`` are in order, a part superseding all frames of ``main`` from its index on.
    """

    path: Path
    record: str
    scene: str
    provenance: str
    frames: list[Frame]
    main: Main | None
    folder: Path | None
    part_checkpoint: Path | None

    @property
    def has_checkpoint(self) -> bool:
        """Whether a restart state is stored."""
        return bool(self.part_checkpoint or (self.main and self.main.has_checkpoint))

    def checkpoint(self) -> Checkpoint:
        """The newest restart state, verified.

        Raises
        ------
        RecordError
            There is none, or it is damaged.
        """
        if self.part_checkpoint:
            path = self.part_checkpoint
            with open_hdf5(path) as file, reading(path):
                check_format(path, int(attribute(file, "format", "i")))
                return read_checkpoint(hard(file, "checkpoint", h5py.Group))
        if self.main and self.main.has_checkpoint:
            return self.main.checkpoint()
        raise RecordError(f"{self.path}: holds no checkpoint")

    def close(self) -> None:
        """Close the finished file."""
        if self.main:
            self.main.file.close()


def parts_folder(path: Path) -> Path:
    """Where the segments of an unfinished record are."""
    return path.with_name(path.name + ".parts")


@dataclass(frozen=True)
class _Head:
    record: str
    scene: str
    provenance: str
    extends: bool
    frames: dict[int, Frame]
    checkpoint: Path | None


def _load_parts(folder: Path) -> _Head | None:
    path = folder / "head.h5"
    if not path.exists():
        return None  # what a kill leaves while a merged folder is removed: nothing of value
    with open_hdf5(path) as file, reading(path):
        check_format(path, int(attribute(file, "format", "i")))
        texts = [read_text(file, name) for name in ("record", "scene", "provenance")]
        extends = int(attribute(file, "extends", "i"))
        if attribute(file, "seal", "u") != seal(*texts, str(extends)):
            raise ValueError("it does not match its digest")
    frames = {}
    for part in sorted(folder.glob("frame-*.h5")):
        with reading(part):
            index = int(part.stem.removeprefix("frame-"))
        frames[index] = Part(part).frame(texts[0])
    checkpoint = folder / "checkpoint.h5"
    return _Head(*texts, bool(extends), frames, checkpoint if checkpoint.exists() else None)


def _combine(path: Path, folder: Path, head: _Head, main: Main | None) -> Contents:
    first = min(head.frames, default=len(main.frames) if main else 0)
    frames = main.frames[:first] if main else []
    expected = list(range(first, first + len(head.frames)))
    if len(frames) < first or sorted(head.frames) != expected:
        if main:
            main.file.close()
        raise RecordError(f"{folder}: a segment is missing before or among {sorted(head.frames)}")
    frames = frames + [head.frames[i] for i in sorted(head.frames)]
    return Contents(
        path, head.record, head.scene, head.provenance, frames, main, folder, head.checkpoint
    )


def load(path: Path) -> Contents:
    """Open a record, finished or not, without writing anything.

    Raises
    ------
    FileNotFoundError
        Neither the file nor segments of it exist.
    RecordError
        Malformed, damaged, foreign or newer.
    """
    for _ in range(2):
        # a writer may be merging just now, its parts vanish: then the file has them
        with contextlib.suppress(FileNotFoundError):
            return _load_once(path)
    return _load_once(path)


def _load_once(path: Path) -> Contents:
    folder = parts_folder(path)
    head = _load_parts(folder) if folder.is_dir() else None
    if head is None:
        return _finished(Main(path))
    if not path.exists():
        return _combine(path, folder, head, None)
    has_content = bool(head.frames or head.checkpoint)
    try:
        main = Main(path)
    except RecordError:
        if head.extends or not has_content:
            raise
        return _combine(path, folder, head, None)  # what is to be overwritten may be anything
    if head.record == main.record:
        return _combine(path, folder, head, main)
    if has_content:
        # a run that is to overwrite the file counts once it has something to show
        main.file.close()
        return _combine(path, folder, head, None)
    return _finished(main)


def _finished(main: Main) -> Contents:
    return Contents(
        main.path, main.record, main.scene, main.provenance, main.frames, main, None, None
    )
