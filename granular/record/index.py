"""Contents of a record, finished or not: the one file, or the files of its writer."""

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from granular.record.checkpoint import Checkpoint, read_checkpoint
from granular.record.chunks import Stored
from granular.record.frame import SCALARS, Frame, Table, Texts
from granular.record.growing import DATA, LOG, RESTART
from granular.record.layout import (
    OTHERS,
    RecordError,
    attribute,
    check_format,
    checked,
    hard,
    has,
    read_text,
    reading,
)
from granular.record.log import read_log
from granular.record.restart import read_restart
from granular.record.storage import followed, identity, open_hdf5


def _samples(data: h5py.Group) -> dict[str, np.ndarray]:
    """Values of the monitor, one column per name; other sets of points have none."""
    if not has(data, "samples"):
        return {}
    group = hard(data, "samples", h5py.Group)
    return {name: checked(group, name, ("<f8",), 1)[:] for name in group}


class Points:
    """One set of points of a finished file (a `Source`).

    ``vtk`` is the group that ParaView reads, ``own`` the group with all other data.
    """

    def __init__(self, path: Path, vtk: h5py.Group, group: h5py.Group) -> None:
        self.path, self._vtk = path, vtk
        steps = hard(vtk, "Steps", h5py.Group)
        self.table = Table(
            time=checked(steps, "Values", ("<f8",), 1)[:],
            n=checked(vtk, "NumberOfPoints", ("<i8",), 1)[:],
            row=checked(steps, "PointOffsets", ("<i8",), 1)[:],
            step=checked(group, "step", ("<i8",), 1)[:],
            dt=checked(group, "dt", ("<f8",), 1)[:],
            mass=checked(group, "mass", ("<f8",), 1)[:],
            digest=checked(group, "digest", ("|u1",), 2)[:],
            samples=_samples(group),
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
        n, row, rows = self.table.n, self.table.row, fields["x"].data.shape[0]
        if ((n < 0) | (row < 0) | (n > rows) | (row > rows - n)).any():
            raise ValueError(f"{data.name}: frames of {n} points do not fit its {rows} rows")
        return fields

    def frames(self, others: Mapping[str, Mapping[int, Frame]]) -> list[Frame]:
        """Return all frames, each with those of other sets of points at its step."""
        table, scalars = self.table, (*SCALARS, "row")
        return [
            Frame(
                **{name: getattr(table, name)[i].item() for name in scalars},
                digest=table.digest[i].tobytes(),
                source=self,
                samples=table.sample(i),
                others={name: by_step[step] for name, by_step in others.items() if step in by_step},
            )
            for i, step in enumerate(table.step.tolist())
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
        data = hard(self.file, "granular", h5py.Group)
        check_format(self.path, int(attribute(data, "format", "i")))
        self.texts = Texts(*(read_text(data, name) for name in ("record", "scene", "provenance")))
        points = Points(self.path, hard(self.file, "VTKHDF", h5py.Group), data)
        others = {}
        for name in OTHERS:
            if has(data, name):
                group = hard(data, name, h5py.Group)
                others[name] = Points(self.path, hard(group, "VTKHDF", h5py.Group), group)
        self.has_checkpoint = has(data, "checkpoint")
        checkpoint = b""
        if self.has_checkpoint:
            checkpoint = attribute(hard(data, "checkpoint", h5py.Group), "digest", "u")
        tables = {name: other.table for name, other in others.items()}
        expected = points.table.seal(self.texts, checkpoint, tables)
        if attribute(data, "seal", "u") != expected:
            raise ValueError("the table of contents does not match its digest")
        below = {
            name: {frame.step: frame for frame in other.frames({})}
            for name, other in others.items()
        }
        self.frames = points.frames(below)

    def checkpoint(self) -> Checkpoint:
        """Read and verify the checkpoint."""
        with reading(self.path):
            group = hard(self.file, "granular", h5py.Group)
            return read_checkpoint(hard(group, "checkpoint", h5py.Group))


@dataclass
class Contents:
    """All contents of a record; call `close` when done.

    ``frames`` are in order of time. ``main`` is the finished file; it is None if the record is not
    finished. ``restart`` reads the newest restart state. ``spoilt`` describes what is missing at
    the end of an unfinished record because it is damaged. If a writer changes the record later,
    `read` and `checkpoint` use its new state.
    """

    path: Path
    texts: Texts
    frames: list[Frame]
    main: Main | None = None
    restart: Callable[[], Checkpoint] | None = None
    spoilt: list[str] = field(default_factory=list)
    _now: "Contents | None" = None

    @property
    def finished(self) -> bool:
        """True if the record was one closed file when it was last read."""
        return (self._now or self).main is not None

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
            restart = (self._now or self).restart
            if not restart:
                raise RecordError(f"{self.path}: holds no checkpoint")
            return restart()

        return self._insist(restart)

    def read(self, frame: Frame) -> dict[str, np.ndarray]:
        """Read and verify all fields of a frame, of the material or of another set of points.

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
        """Read by a function, and again if a writer has changed the record meanwhile."""
        for _ in range(ATTEMPTS):
            try:
                return read()
            except (FileNotFoundError, RecordError):
                if not self._renew():
                    raise
        return read()

    def _placed(self, frame: Frame) -> Frame:
        """Return a frame with its present position."""
        if self._now is None:
            return frame
        for now in self._now.each():
            if now.digest == frame.digest:
                return now
        raise RecordError(f"{self.path}: the frame of step {frame.step} is there no longer")

    def each(self) -> Iterator[Frame]:
        """Return all frames, including those of other sets of points."""
        for frame in self.frames:
            yield from frame.each()

    def _renew(self) -> bool:
        """Load the record again; False if it has not changed."""
        known = self._now or self
        if known.main:  # all is in the file that is held open
            return False
        newer = load(self.path)
        if not newer.main and newer._places() == known._places():
            return False
        if self._now:
            self._now.close()
        self._now = newer
        return True

    def _places(self) -> list[tuple]:
        return [(f.digest, f.source.path) for f in self.each()]


ATTEMPTS = 10
"""Number of times that a record is read again while a writer changes it."""


def parts_folder(path: Path) -> Path:
    """Folder of the files of an unfinished record."""
    return path.with_name(path.name + ".parts")


def load(path: Path) -> Contents:
    """Open a record, finished or not, without writing anything.

    Raises
    ------
    FileNotFoundError
        If there is neither the file nor an unfinished record.
    FileExistsError
        If there is an unfinished record, and a file that it must not replace.
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
    """Return a value that changes whenever a writer makes, replaces or removes a file of a
    record."""
    folder = parts_folder(path)
    stamp: list[tuple[int, int] | None] = []
    for watched in (path, folder, folder / LOG):
        try:
            status = os.stat(watched)
            stamp.append((status.st_ino, status.st_mtime_ns))
        except OSError:
            stamp.append(None)
    return stamp


def unfinished(path: Path) -> Contents | None:
    """Return an unfinished record if there is one that is not empty.

    Once its file has been renamed to that of the record, the record is finished.

    Raises
    ------
    RecordError
        If it is damaged.
    FileExistsError
        If there is a file that it must not replace.
    """
    folder = parts_folder(path)
    if not (folder / LOG).exists():
        return None
    head, frames, spoilt = read_log(folder / LOG, DATA)
    data, restart = folder / (head.name + DATA), folder / (head.name + RESTART)
    has_restart, now = restart.exists(), identity(path)
    if not data.exists():
        if now is None:
            raise RecordError(f"{data} is missing, without which the log next to it is useless")
        return None
    if not (frames or has_restart):
        return None
    if now not in (None, head.replaces):
        raise FileExistsError(
            f"{path} is not the file that was there when the unfinished run in {folder} began: it"
            " is of another run, or has changed since; move one of the two elsewhere"
        )
    read = partial(read_restart, restart) if has_restart else None
    return Contents(path, head.texts, frames, restart=read, spoilt=spoilt)


def _load_once(path: Path) -> Contents:
    contents = unfinished(path)
    if contents:
        return contents
    main = Main(path)
    restart = main.checkpoint if main.has_checkpoint else None
    return Contents(path, main.texts, main.frames, main, restart)
