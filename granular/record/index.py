"""Contents of a record, finished or not: the one file, and the parts that a writer has left."""

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from granular.record.checkpoint import Checkpoint, read_checkpoint
from granular.record.chunks import Stored
from granular.record.frame import SCALARS, Frame, Head, Table, Texts
from granular.record.layout import (
    RecordError,
    attribute,
    check_format,
    checked,
    hard,
    has,
    read_text,
    reading,
)
from granular.record.segment import read_frames, read_head, read_restart
from granular.record.storage import followed, identity, open_hdf5


def _samples(own: h5py.Group) -> dict[str, np.ndarray]:
    """Values that monitors measured, one column per name; none in records of earlier versions."""
    if not has(own, "samples"):
        return {}
    group = hard(own, "samples", h5py.Group)
    return {name: checked(group, name, ("<f8",), 1)[:] for name in group}


class Points:
    """One set of points of a finished file (a `Source`).

    ``vtk`` is the group that ParaView reads, ``own`` the group with all other data.
    """

    offset = 0

    def __init__(self, path: Path, vtk: h5py.Group, own: h5py.Group) -> None:
        self.path, self._vtk = path, vtk
        steps = hard(vtk, "Steps", h5py.Group)
        self.table = Table(
            time=checked(steps, "Values", ("<f8",), 1)[:],
            n=checked(vtk, "NumberOfPoints", ("<i8",), 1)[:],
            row=checked(steps, "PointOffsets", ("<i8",), 1)[:],
            step=checked(own, "step", ("<i8",), 1)[:],
            dt=checked(own, "dt", ("<f8",), 1)[:],
            mass=checked(own, "mass", ("<f8",), 1)[:],
            digest=checked(own, "digest", ("|u1",), 2)[:],
            samples=_samples(own),
        )

    @contextmanager
    def fields(self) -> Iterator[Mapping[str, Stored]]:
        """Return the fields by name, as `Source.fields`."""
        yield self._fields

    @cached_property
    def _fields(self) -> Mapping[str, Stored]:
        data = hard(self._vtk, "PointData", h5py.Group)
        fields = {"x": Stored(self._vtk, "Points")} | {name: Stored(data, name) for name in data}
        stored = sum(field.data.id.get_storage_size() for field in fields.values())
        if stored > data.file.id.get_filesize():  # fields that share their chunks
            raise ValueError(f"{data.name}: its fields take {stored} bytes, more than the file")
        return fields

    def frames(self, gas: Mapping[int, Frame]) -> list[Frame]:
        """Return all frames, each with the gas of its step if there is one."""
        table, scalars = self.table, (*SCALARS, "row")
        return [
            Frame(
                **{name: getattr(table, name)[i].item() for name in scalars},
                digest=table.digest[i].tobytes(),
                source=self,
                samples=table.sample(i),
                gas=gas.get(int(table.step[i])),
            )
            for i in range(len(table.time))
        ]


class Main:
    """The finished file, held open, so that it stays readable if it is renamed or replaced."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file = open_hdf5(path)
        try:
            with reading(path):
                self._load()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    def _load(self) -> None:
        own = hard(self.file, "granular", h5py.Group)
        version = check_format(self.path, int(attribute(own, "format", "i")))
        texts = Texts(*(read_text(own, name) for name in ("record", "scene", "provenance")))
        points = Points(self.path, hard(self.file, "VTKHDF", h5py.Group), own)
        gas = None
        if has(own, "gas"):
            group = hard(own, "gas", h5py.Group)
            gas = Points(self.path, hard(group, "VTKHDF", h5py.Group), group)
        self.has_checkpoint = has(own, "checkpoint")
        checkpoint = b""
        if self.has_checkpoint:
            checkpoint = attribute(hard(own, "checkpoint", h5py.Group), "digest", "u")
        expected = points.table.seal(version, texts, checkpoint, gas.table if gas else None)
        if attribute(own, "seal", "u") != expected:
            raise ValueError("the table of contents does not match its digest")
        self.head = Head(texts, continues=expected)
        below = {frame.step: frame for frame in gas.frames({})} if gas else {}
        self.frames = points.frames(below)

    def checkpoint(self) -> Checkpoint:
        """Read and verify the checkpoint."""
        with reading(self.path):
            own = hard(self.file, "granular", h5py.Group)
            return read_checkpoint(hard(own, "checkpoint", h5py.Group))


@dataclass
class Contents:
    """All contents of a record; call `close` when done.

    ``main`` is the finished file, if it belongs to the record, and ``folder`` the folder of parts,
    if there is one. ``frames`` are in order of time; segments replace all frames of ``main`` from
    the first frame of the segments on. ``restart`` reads the newest restart state. If a writer
    merges the parts later, `read` and `checkpoint` find what they ask for where it is then.
    """

    path: Path
    head: Head
    frames: list[Frame]
    main: Main | None = None
    folder: Path | None = None
    restart: Callable[[], Checkpoint] | None = None
    _now: "Contents | None" = None

    @property
    def texts(self) -> Texts:
        """The texts in the header of the record."""
        return self.head.texts

    @property
    def finished(self) -> bool:
        """True if the record was one closed file when it was last looked at."""
        return (self._now or self).folder is None

    @property
    def has_checkpoint(self) -> bool:
        """True if a restart state is stored."""
        return self.restart is not None

    def checkpoint(self) -> Checkpoint:
        """Read and verify the newest restart state.

        Raises
        ------
        RecordError
            If there is none, or it is damaged.
        """

        def restart() -> Checkpoint:
            found = (self._now or self).restart
            if not found:
                raise RecordError(f"{self.path}: holds no checkpoint")
            return found()

        return self._insist(restart)

    def read(self, frame: Frame) -> dict[str, np.ndarray]:
        """Read and verify all fields of a frame, of the grains or of the gas.

        Raises
        ------
        RecordError
            If it is damaged, or no longer part of the record.
        """
        return self._insist(lambda: self._placed(frame).read())

    def close(self) -> None:
        """Close the finished file."""
        for main in (self.main, self._now.main if self._now else None):
            if main:
                main.close()

    def _insist(self, read: Callable[[], Any]) -> Any:
        """Read something, and again if a writer has changed the record meanwhile."""
        for _ in range(ATTEMPTS):
            try:
                return read()
            except (FileNotFoundError, RecordError):
                if not self._renew():
                    raise
        return read()

    def _placed(self, frame: Frame) -> Frame:
        """Return a frame with its present place."""
        if self._now is None:
            return frame
        for now in self._now.each():
            if now.digest == frame.digest:
                return now
        raise RecordError(f"{self.path}: the frame of step {frame.step} is there no longer")

    def each(self) -> Iterator[Frame]:
        """Return all frames, those of the gas too."""
        for frame in self.frames:
            yield frame
            if frame.gas:
                yield frame.gas

    def _renew(self) -> bool:
        """Load the record again; False if it is as it was."""
        known = self._now or self
        if known.folder is None:  # all is in the file that is held open
            return False
        newer = load(self.path)
        if newer.folder == known.folder and newer._places() == known._places():
            newer.close()
            return False
        if self._now:
            self._now.close()
        self._now = newer
        return True

    def _places(self) -> list[tuple]:
        return [(f.digest, f.row, f.source.path, f.source.offset) for f in self.each()]


def parts_folder(path: Path) -> Path:
    """Folder of the segments of an unfinished record."""
    return path.with_name(path.name + ".parts")


HEAD, CHECKPOINT = "head.part", "checkpoint.part"
MERGED = "merged.part"
"""Name of the head from the moment on at which the finished file holds all parts."""
ATTEMPTS = 10
"""Number of times that a record is looked at again while a writer changes it."""


def frame_parts(folder: Path) -> list[Path]:
    """Segments of frames in a folder, in order of time."""
    return sorted(folder.glob("frames-*.part"))


def holds_parts(folder: Path) -> bool:
    """True if a folder holds frames or a restart state that no finished file holds."""
    if (folder / MERGED).exists() and not (folder / HEAD).exists():
        return False  # the removal of the parts was interrupted
    return (folder / CHECKPOINT).exists() or bool(frame_parts(folder))


@dataclass(frozen=True)
class _Parts:
    folder: Path
    head: Head
    segments: dict[int, list[Frame]]
    checkpoint: Path | None

    @property
    def has_content(self) -> bool:
        return bool(self.segments or self.checkpoint)


def _load_parts(folder: Path) -> _Parts | None:
    if not (folder / HEAD).exists():
        if holds_parts(folder):
            raise RecordError(f"{folder / HEAD} is missing, without which the parts are of no use")
        return None
    head = read_head(folder / HEAD)
    segments = {}
    for path in frame_parts(folder):
        with reading(path):
            index = int(path.stem.removeprefix("frames-"))
        segments[index] = read_frames(path, head.texts.record)
    checkpoint = folder / CHECKPOINT
    return _Parts(folder, head, segments, checkpoint if checkpoint.exists() else None)


def _combine(path: Path, parts: _Parts, main: Main | None) -> Contents:
    first = min(parts.segments, default=None)
    if main is None and parts.head.continues and first != 0:
        raise RecordError(f"{path} is missing, which the parts in {parts.folder} continue")
    frames = main.frames[:first] if main else []
    for index, segment in sorted(parts.segments.items()):
        if len(frames) != index:
            if main:
                main.close()
            raise RecordError(f"{parts.folder}: a segment is missing before frame {index}")
        frames = frames + segment
    restart = main.checkpoint if main and main.has_checkpoint else None
    if parts.checkpoint:
        restart = partial(read_restart, parts.checkpoint)
    return Contents(path, parts.head, frames, main, parts.folder, restart)


def load(path: Path) -> Contents:
    """Open a record, finished or not, without writing anything.

    Raises
    ------
    FileNotFoundError
        If neither the file nor segments of it exist.
    FileExistsError
        If there are both a file and segments that do not belong to it.
    RecordError
        If the record is malformed, damaged, of another program or of a newer version.
    """
    path = followed(path)
    for attempt in range(ATTEMPTS):
        before = _stamp(path)
        try:
            return _load_once(path)
        except (FileNotFoundError, FileExistsError, RecordError):
            # If a writer begins or ends just now, parts vanish while they are read.
            if attempt and _stamp(path) == before:
                raise
    return _load_once(path)


def _stamp(path: Path) -> list[tuple[int, int] | None]:
    """Return what changes whenever a writer makes, replaces or removes a file of a record."""
    folder = parts_folder(path)
    stamp: list[tuple[int, int] | None] = []
    for watched in (path, folder, folder / HEAD):
        try:
            found = os.stat(watched)
            stamp.append((found.st_ino, found.st_mtime_ns))
        except OSError:
            stamp.append(None)
    return stamp


def _load_once(path: Path) -> Contents:
    folder = parts_folder(path)
    parts = _load_parts(folder) if folder.is_dir() else None
    if parts is None:
        return _finished(Main(path))
    head, now = parts.head, identity(path)
    if now is None:
        return _combine(path, parts, None)
    if not head.continues and not parts.has_content:  # nothing is stored yet in place of the file
        return _finished(Main(path))
    if now == head.replaces:
        return _combine(path, parts, None)
    try:
        main = Main(path)
    except RecordError as error:
        if head.continues:
            raise
        raise _foreign(path, f"is {error}") from error
    if main.head.texts == head.texts or main.head.continues == head.continues:
        return _combine(path, parts, main)
    main.close()
    raise _foreign(path, "is of another run, or has changed since")


def _foreign(path: Path, what: str) -> FileExistsError:
    return FileExistsError(
        f"{path} is not the file that was there when the unfinished run in {parts_folder(path)}"
        f" began: it {what}; move one of the two elsewhere"
    )


def _finished(main: Main) -> Contents:
    restart = main.checkpoint if main.has_checkpoint else None
    return Contents(main.path, main.head, main.frames, main=main, restart=restart)
