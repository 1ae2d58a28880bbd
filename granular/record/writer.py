"""Writing a record so that what was completed stays."""

import json
import math
import os
import shutil
import time
import uuid
from bisect import bisect_left
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import h5py
import numpy as np

from granular.record import chunks
from granular.record import provenance as origin
from granular.record.checkpoint import Checkpoint, write_checkpoint
from granular.record.index import Contents, Frame, Part, load, part_seal, parts_folder
from granular.record.layout import (
    DTYPES,
    FORMAT,
    as_attribute,
    chunk_rows,
    frame_digest,
    seal,
    write_text,
)
from granular.record.merge import clear_parts, merge, remove_parts
from granular.record.storage import atomic_write, fsync_folder, image, replacing, write_all

try:
    import fcntl
except ImportError:  # Windows has no advisory locks
    fcntl = None

CHECKPOINT_SECONDS = 1.0
"""Wall time that a kill may cost: closer checkpoints wait for the next one, see `checkpoint`."""

VECTORS = ("x", "v")
"""Fields stored with three columns, for ParaView."""


class StateLike(Protocol):
    """What a frame is made from: a `State`."""

    time: float
    step: int
    dt: float
    fields: Mapping[str, np.ndarray]


class SceneLike(Protocol):
    """What a record is headed with: a `Scene`."""

    def to_json(self) -> str:
        """The scene as JSON."""


def _lock(head: Path) -> int | None:
    """Descriptor that holds the lock of a folder of parts; a kill releases it."""
    if fcntl is None:
        return None
    fd = os.open(head, os.O_RDONLY)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(fd)
        raise BlockingIOError(f"{head.parent}: the record is being written by a live run") from None
    return fd


def _unlock(fd: int | None) -> None:
    if fd is not None:
        os.close(fd)


def _head(record: str, scene: str, provenance: str, extends: bool) -> bytes:
    def fill(file: h5py.File) -> None:
        file.attrs["format"] = FORMAT
        file.attrs["extends"] = int(extends)
        write_text(file, "record", record)
        write_text(file, "scene", scene)
        write_text(file, "provenance", provenance)
        file.attrs["seal"] = as_attribute(seal(record, scene, provenance, str(int(extends))))

    return image(fill)


def _check_fields(state: StateLike) -> dict[str, np.ndarray]:
    """Fields of a state as contiguous arrays that can be stored without loss."""
    fields: dict[str, np.ndarray] = {}
    for name, array in state.fields.items():
        if not name.isidentifier() or not name.isascii():
            raise ValueError(f"field name {name!r} must be an ASCII identifier")
        if not isinstance(array, np.ndarray) or array.dtype.str not in DTYPES:
            kind = getattr(array, "dtype", type(array).__name__)
            raise TypeError(f"field {name} has type {kind}, must be float64 or int64")
        if array.ndim not in (1, 2) or (array.ndim == 2 and not 1 <= array.shape[1] <= 64):
            raise ValueError(f"field {name} has shape {array.shape}, must be (n,) or (n, 1..64)")
        fields[name] = np.ascontiguousarray(array)
    for name in ("x", "mass"):
        if name not in fields:
            raise ValueError(f"fields = {sorted(fields)} must have {name}")
    x = fields["x"]
    if x.dtype != np.float64 or x.ndim != 2 or x.shape[1] not in (2, 3):
        raise ValueError(f"field x has shape {x.shape}, must be float64 (n, 2) or (n, 3)")
    for name, array in fields.items():
        if len(array) != len(x):
            raise ValueError(f"field {name} has {len(array)} rows, x has {len(x)}")
    return fields


def _part(record: str, frame: Frame, fields: Mapping[str, np.ndarray], chunk: int) -> bytes:
    """Image of a segment with one frame."""

    def fill(file: h5py.File) -> None:
        file.attrs["format"] = FORMAT
        for name in ("time", "step", "dt", "mass", "n"):
            file.attrs[name] = getattr(frame, name)
        file.attrs["digest"] = as_attribute(frame.digest)
        file.attrs["seal"] = as_attribute(part_seal(record, frame))
        group = file.create_group("fields")
        for name, array in fields.items():
            columns = array.shape[1] if array.ndim == 2 else 0
            wide = 3 if name in VECTORS and columns == 2 else columns
            shape = (frame.n, wide) if columns else (frame.n,)
            data = chunks.create(group, name, shape, array.dtype.str, chunk)
            chunks.write(data, array)
            data.attrs["columns"] = columns

    return image(fill)


class TrajectoryWriter:
    """Writes one record: every frame at once durable, one file in the end.

    Frames are first written as segments, each whole or not at all, in the folder
    ``<path>.parts``; `close` merges them into the one file. A run that is killed leaves the
    segments, which `open_trajectory` reads and `resume` or the next `close` merges.

    Parameters
    ----------
    path
        The file, usually ``*.h5``.
    scene
        The scene of the run.
    overwrite
        Whether an existing record may be replaced. A finished file stays until `close`.
    provenance
        Entries for the provenance besides the collected ones (``threads`` for one).

    Raises
    ------
    FileExistsError
        There is a record at ``path`` and ``overwrite`` is false.
    BlockingIOError
        Another run is writing this record.
    OSError
        The folder cannot be written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        scene: SceneLike,
        *,
        overwrite: bool = False,
        provenance: Mapping[str, Any] | None = None,
    ) -> None:
        path = Path(path)
        folder = parts_folder(path)
        if path.is_dir():
            raise IsADirectoryError(f"{path} is a folder")
        for existing in (path, folder / "head.h5"):
            if existing.exists() and not overwrite:
                raise FileExistsError(
                    f"{path} exists already"
                    + (" (unfinished: resume it)" if existing != path else "")
                    + "; overwrite=True replaces it"
                )
        text = origin.to_json(origin.collect(provenance))
        self._begin(path, uuid.uuid4().hex, scene.to_json(), text, extends=False)
        self._recorded: list[Frame] = []
        self._cursor = 0
        self._spec: dict[str, tuple[str, tuple[int, ...]]] | None = None
        self._chunk: int | None = None

    @classmethod
    def resume(
        cls, path: str | os.PathLike[str], *, provenance: Mapping[str, Any] | None = None
    ) -> Self:
        """Continue a record, finished or not; parts found are merged first.

        A resumed run makes the frames after its checkpoint again: those equal to recorded ones
        are recognised, at the first different one the rest of the old record is superseded.

        Raises
        ------
        FileNotFoundError, BlockingIOError, OSError
            No such record; another run is writing it; it cannot be written.
        RecordError
            It is damaged.
        """
        path = Path(path)
        head = parts_folder(path) / "head.h5"
        if head.exists():
            lock = _lock(head)
            try:
                merge(path)
            finally:
                _unlock(lock)
        contents = load(path)
        try:
            writer = cls.__new__(cls)
            writer._continue(contents, provenance)
        finally:
            contents.close()
        return writer

    def _continue(self, contents: Contents, extra: Mapping[str, Any] | None) -> None:
        self._recorded = list(contents.frames)
        self._cursor = 0
        self._spec = self._chunk = None
        parent = None
        if contents.frames:
            last = contents.frames[-1]
            parent = last.digest.hex()
            with last.source.fields() as stored:
                self._chunk = stored["x"][0].chunks[0]
                self._spec = {
                    name: (data.dtype.str, (columns,) if columns else ())
                    for name, (data, columns) in stored.items()
                }
        if contents.has_checkpoint:
            parent = contents.checkpoint().digest.hex()
        before = json.loads(contents.provenance)
        earlier = [*before.pop("earlier", []), before]
        text = origin.to_json(origin.collect(extra, parent=parent) | {"earlier": earlier})
        self._begin(contents.path, contents.record, contents.scene, text, extends=True)

    def _begin(self, path: Path, record: str, scene: str, text: str, *, extends: bool) -> None:
        """Head a folder of parts; what an older one held goes once the new head is written."""
        self.path, self._folder, self._record = path, parts_folder(path), record
        self._waiting: Checkpoint | None = None
        self._stored = -math.inf  # time.monotonic() of the last checkpoint on the disk
        head = self._folder / "head.h5"
        data = _head(record, scene, text, extends)
        old = _lock(head) if head.exists() else None
        fresh = not self._folder.exists()
        self._lock: int | None = None
        try:
            if fresh:
                self._folder.mkdir()
            with replacing(head, self._folder / "head.tmp") as fd:
                write_all(fd, data)
                os.fsync(fd)
                clear_parts(self._folder)
            self._lock = _lock(head)
            fsync_folder(path.parent)
        except FileExistsError:  # of mkdir: another run begins at this very moment
            raise
        except BaseException:
            _unlock(self._lock)
            if fresh:
                shutil.rmtree(self._folder, ignore_errors=True)
            raise
        finally:
            _unlock(old)
        self.closed = False

    @property
    def frames(self) -> int:
        """Number of frames recorded (no ``__len__``: an empty writer must not be false)."""
        return len(self._recorded)

    def append(self, state: StateLike) -> None:
        """Add a frame; it is on the disk when this returns.

        A frame equal to the recorded one of the same step is taken for it.

        Raises
        ------
        ValueError
            The step is not past the last one, or the fields differ from those of frame 0.
        TypeError
            A field is neither float64 nor int64.
        OSError
            It could not be written; all earlier frames are as before.
        """
        self._check_open()
        fields = _check_fields(state)
        spec = {name: (a.dtype.str, a.shape[1:]) for name, a in fields.items()}
        if self._spec is not None and spec != self._spec:
            raise ValueError(f"fields = {spec} must be those of frame 0: {self._spec}")
        frame = self._frame(state, fields)
        index = bisect_left(self._recorded, frame.step, key=lambda old: old.step)
        at = self._recorded[index] if index < len(self._recorded) else None
        if at is not None and at.digest == frame.digest:
            self._cursor = max(self._cursor, index + 1)
            return
        if index < self._cursor:
            last = self._recorded[self._cursor - 1].step
            raise ValueError(f"step = {frame.step} must exceed the last recorded step {last}")
        chunk = self._chunk or chunk_rows(frame.n)
        path = self._folder / f"frame-{index:08d}.h5"
        atomic_write(path, _part(self._record, frame, fields, chunk))
        self._recorded[index:] = [frame]
        self._spec, self._chunk, self._cursor = spec, chunk, index + 1

    def _frame(self, state: StateLike, fields: Mapping[str, np.ndarray]) -> Frame:
        scalars = {
            "time": float(state.time),
            "step": int(state.step),
            "dt": float(state.dt),
            "mass": float(np.sum(fields["mass"])),
        }
        return Frame(
            **scalars,
            n=len(fields["x"]),
            digest=frame_digest(*scalars.values(), fields),
            row=0,
            source=Part(self._folder),
        )

    def checkpoint(self, checkpoint: Checkpoint, *, may_wait: bool = False) -> None:
        """Store the restart state in place of the previous one.

        Where it `may_wait`, it is kept in memory while the last one on the disk is younger than
        `CHECKPOINT_SECONDS`, and goes to the disk at the latest when the writer is closed or
        left: frames may come faster than it pays to be able to start at each of them.

        Raises
        ------
        OSError
            It could not be written; the previous one is as before.
        """
        self._check_open()
        self._waiting = checkpoint
        if not may_wait or time.monotonic() - self._stored >= CHECKPOINT_SECONDS:
            self._store()

    def _store(self) -> None:
        """Bring the checkpoint that waits to the disk."""
        checkpoint = self._waiting
        if checkpoint is None:
            return

        def fill(file: h5py.File) -> None:
            file.attrs["format"] = FORMAT
            write_checkpoint(file.create_group("checkpoint"), checkpoint)

        atomic_write(self._folder / "checkpoint.h5", image(fill))
        self._waiting, self._stored = None, time.monotonic()

    def _check_open(self) -> None:
        if self.closed:
            raise ValueError(f"{self.path}: the record is closed")

    def close(self) -> None:
        """Merge everything into the one file; a second call does nothing.

        Raises
        ------
        OSError
            The file could not be written: it is as before, the parts remain, and `close` may be
            called again (or the record be opened and resumed as it is).
        """
        if self.closed:
            return
        self._store()
        if self._recorded or (self._folder / "checkpoint.h5").exists():
            merge(self.path)
        else:
            remove_parts(self._folder)
        self.closed = True
        _unlock(self._lock)

    def leave(self) -> None:
        """Stop writing without merging: the parts are a valid record, to be read and resumed.

        Takes no longer for a long record than for a short one, where `close` copies all of it.
        """
        if not self.closed:
            self._store()
            self.closed = True
            _unlock(self._lock)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is not None and issubclass(kind, KeyboardInterrupt):
            self.leave()  # whoever presses Ctrl-C is not to wait
        else:
            self.close()
