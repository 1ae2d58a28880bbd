"""Contents of a record, finished or not: the one file, and the parts that a writer has left."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import h5py
import numpy as np

from granular.record.checkpoint import Checkpoint, read_checkpoint
from granular.record.chunks import Stored
from granular.record.frame import SCALARS, Frame, Table, Texts
from granular.record.layout import (
    RecordError,
    attribute,
    check_format,
    checked,
    hard,
    read_text,
    reading,
)
from granular.record.segment import read_frames, read_head, read_restart
from granular.record.storage import open_hdf5


def _samples(own: h5py.Group) -> dict[str, np.ndarray]:
    """Values that monitors measured, one column per name; none in records of earlier versions."""
    if "samples" not in own:
        return {}
    group = hard(own, "samples", h5py.Group)
    return {name: checked(group, name, ("<f8",), 1)[:] for name in group}


class Points:
    """One set of points of a finished file (a `Source`).

    ``vtk`` is the group that ParaView reads, ``own`` the group with all other data.
    """

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
        return {"x": Stored(self._vtk, "Points")} | {name: Stored(data, name) for name in data}

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
            self.file.close()
            raise

    def _load(self) -> None:
        own = hard(self.file, "granular", h5py.Group)
        version = check_format(self.path, int(attribute(own, "format", "i")))
        self.texts = Texts(*(read_text(own, name) for name in ("record", "scene", "provenance")))
        points = Points(self.path, hard(self.file, "VTKHDF", h5py.Group), own)
        gas = None
        if "gas" in own:
            group = hard(own, "gas", h5py.Group)
            gas = Points(self.path, hard(group, "VTKHDF", h5py.Group), group)
        self.has_checkpoint = "checkpoint" in own
        checkpoint = b""
        if self.has_checkpoint:
            checkpoint = attribute(hard(own, "checkpoint", h5py.Group), "digest", "u")
        expected = points.table.seal(version, self.texts, checkpoint, gas.table if gas else None)
        if attribute(own, "seal", "u") != expected:
            raise ValueError("the table of contents does not match its digest")
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
    the first frame of the segments on. ``restart`` reads the newest restart state.
    """

    path: Path
    texts: Texts
    frames: list[Frame]
    main: Main | None = None
    folder: Path | None = None
    restart: Callable[[], Checkpoint] | None = None

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
        if not self.restart:
            raise RecordError(f"{self.path}: holds no checkpoint")
        return self.restart()

    def close(self) -> None:
        """Close the finished file."""
        if self.main:
            self.main.file.close()


def parts_folder(path: Path) -> Path:
    """Folder of the segments of an unfinished record."""
    return path.with_name(path.name + ".parts")


@dataclass(frozen=True)
class _Parts:
    folder: Path
    texts: Texts
    segments: dict[int, list[Frame]]
    checkpoint: Path | None

    @property
    def has_content(self) -> bool:
        return bool(self.segments or self.checkpoint)


def _load_parts(folder: Path) -> _Parts | None:
    head, checkpoint = folder / "head.part", folder / "checkpoint.part"
    if not head.exists():
        return None  # removal of a merged folder was interrupted: nothing of value is left
    texts = read_head(head)
    segments = {}
    for path in sorted(folder.glob("frames-*.part")):
        with reading(path):
            index = int(path.stem.removeprefix("frames-"))
        segments[index] = read_frames(path, texts.record)
    return _Parts(folder, texts, segments, checkpoint if checkpoint.exists() else None)


def _combine(path: Path, parts: _Parts, main: Main | None) -> Contents:
    first = min(parts.segments, default=None)
    frames = main.frames[:first] if main else []
    for index, segment in sorted(parts.segments.items()):
        if len(frames) != index:
            if main:
                main.file.close()
            raise RecordError(f"{parts.folder}: a segment is missing before frame {index}")
        frames = frames + segment
    restart = main.checkpoint if main and main.has_checkpoint else None
    if parts.checkpoint:
        restart = partial(read_restart, parts.checkpoint)
    return Contents(path, parts.texts, frames, main, parts.folder, restart)


def load(path: Path) -> Contents:
    """Open a record, finished or not, without writing anything.

    Raises
    ------
    FileNotFoundError
        If neither the file nor segments of it exist.
    RecordError
        If the record is malformed, damaged, of another program or of a newer version.
    """
    for _ in range(2):
        # If a writer is merging just now, its parts vanish; the file then contains them.
        with suppress(FileNotFoundError):
            return _load_once(path)
    return _load_once(path)


def _load_once(path: Path) -> Contents:
    folder = parts_folder(path)
    parts = _load_parts(folder) if folder.is_dir() else None
    if parts is None:
        return _finished(Main(path))
    if not path.exists():
        return _combine(path, parts, None)
    try:
        main = Main(path)
    except RecordError:
        if parts.texts.extends or not parts.has_content:
            raise
        return _combine(path, parts, None)  # the file will be overwritten and need not be a record
    if parts.texts.record == main.texts.record:
        return _combine(path, parts, main)
    if parts.has_content:
        # A run that will overwrite the file replaces it once it has stored something.
        main.file.close()
        return _combine(path, parts, None)
    return _finished(main)


def _finished(main: Main) -> Contents:
    restart = main.checkpoint if main.has_checkpoint else None
    return Contents(main.path, main.texts, main.frames, main=main, restart=restart)
