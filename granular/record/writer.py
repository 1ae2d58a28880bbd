"""Writing of a record such that completed frames are not lost."""

import json
import math
import os
import threading
import time
import uuid
from bisect import bisect_left
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from granular.record import kept
from granular.record import provenance as origin
from granular.record.checkpoint import Checkpoint
from granular.record.chunks import Packed, Packer
from granular.record.frame import BODY, WALL, Frame, Head, Texts, names_of
from granular.record.index import CHECKPOINT, HEAD, Contents, holds_parts, load, parts_folder
from granular.record.layout import MAX_COLUMNS, check_type, chunk_rows, frame_digest, reading
from granular.record.lock import Lock
from granular.record.merge import clear_parts, merge, remove_parts
from granular.record.segment import Memory, read_head, write_frames, write_head, write_restart
from granular.record.storage import followed, fsync_folder, identity, permissions, replacing

if TYPE_CHECKING:
    from granular.state import State
    from granular.typing import AnyScene

WAITING_SECONDS = 1.0
"""Wall time that may be lost if the run is killed [s].

Frames that follow the last segment sooner than this may wait for more frames.
"""
WAITING_BYTES = 1 << 24
"""Largest amount that may wait in memory [bytes]; it is quickly written if Ctrl-C is pressed."""


def _check_fields(given: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the fields of points as contiguous arrays that can be stored without loss."""
    fields: dict[str, np.ndarray] = {}
    for name, array in given.items():
        if not name.isidentifier() or not name.isascii():
            raise ValueError(f"field name {name!r} must be an ASCII identifier")
        check_type(f"field {name}", array)
        if array.ndim not in (1, 2) or (array.ndim == 2 and not 1 <= array.shape[1] <= MAX_COLUMNS):
            raise ValueError(
                f"field {name} has shape {array.shape}, must be (n,) or (n, 1..{MAX_COLUMNS})"
            )
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


@dataclass
class _Layout:
    """Layout of all frames of one set of points: types and columns of fields, rows per chunk."""

    spec: dict[str, tuple[str, int]] | None = None
    chunk: int | None = None
    packer: Packer = field(default_factory=Packer)

    @classmethod
    def of(cls, frame: Frame | None) -> Self:
        """Return the layout of a stored frame, or one that the first frame will determine."""
        if frame is None:
            return cls()
        with frame.source.fields() as stored:
            spec = {name: (field.dtype, field.columns) for name, field in stored.items()}
            return cls(spec, stored["x"].chunk)

    def check(self, fields: Mapping[str, np.ndarray]) -> dict[str, tuple[str, int]]:
        """Return types and columns of fields; ValueError if other ones were stored before."""
        spec = {name: (a.dtype.str, a.shape[1] if a.ndim == 2 else 0) for name, a in fields.items()}
        if self.spec is not None and spec != self.spec:
            raise ValueError(f"fields = {spec} must be those of frame 0: {self.spec}")
        return spec

    def packed(
        self, path: Path, head: Mapping[str, Any], fields: Mapping[str, np.ndarray], **more: Any
    ) -> Frame:
        """Make a frame that waits in memory."""
        self.chunk = self.chunk or chunk_rows(head["n"])
        packed = {
            name: Packed.of(array, self.chunk, self.packer, name) for name, array in fields.items()
        }
        return Frame(**head, row=0, source=Memory(path, packed), **more)


def _head(state: "State", fields: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Scalars and digest of a frame."""
    scalars: dict[str, Any] = {
        "time": float(state.time),
        "step": int(state.step),
        "dt": float(state.dt),
        "mass": float(np.sum(fields["mass"])),
    }
    digest = frame_digest(**scalars, fields=fields)
    return scalars | {"n": len(fields["x"]), "digest": digest}


class TrajectoryWriter:
    """Writer of one record: frames are soon durable, and finally merged into one file.

    Frames are first written to the folder ``<path>.parts`` as segments of one or more frames, each
    completely or not at all. `close` merges them into the one file. If a run is killed, the
    segments remain: `open_trajectory` reads them, and `resume` or the next `close` merges them.

    Parameters
    ----------
    path
        Path of the file, usually ``*.vtkhdf``, which ParaView opens; a symbolic link is followed.
    scene
        The scene of the run.
    overwrite
        True to replace an existing record. A finished file remains until `close`.
    provenance
        Entries of the provenance in addition to the collected ones (for example ``threads``).

    Raises
    ------
    FileExistsError
        If there is a record at ``path`` and ``overwrite`` is false.
    BlockingIOError
        If another run is writing this record.
    OSError
        If the folder cannot be written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        scene: "AnyScene",
        *,
        overwrite: bool = False,
        provenance: Mapping[str, Any] | None = None,
    ) -> None:
        path = followed(path)
        if path.is_dir():
            raise IsADirectoryError(f"{path} is a folder")
        text = json.dumps(origin.collect(provenance), sort_keys=True)
        texts = Texts(uuid.uuid4().hex, scene.to_json(), text)
        self._open(path)
        with self._beginning():
            unfinished = holds_parts(self._folder)
            if not overwrite and (path.exists() or unfinished):
                raise FileExistsError(
                    f"{path} exists already"
                    + (" (unfinished: resume it)" if unfinished else "")
                    + "; overwrite=True replaces it"
                )
            self._begin(Head(texts, replaces=identity(path)))
            kept.forget(path)

    @classmethod
    def resume(
        cls, path: str | os.PathLike[str], *, provenance: Mapping[str, Any] | None = None
    ) -> Self:
        """Continue a record, finished or not; existing parts are merged first.

        A resumed run computes the frames after its checkpoint again. Frames equal to the recorded
        ones are recognised and not stored again. From the first different frame on, the old record
        is replaced.

        Raises
        ------
        FileNotFoundError
            If there is no such record.
        FileExistsError
            If there is an unfinished record, and at its path a file that does not belong to it.
        BlockingIOError
            If another run is writing it.
        OSError
            If it cannot be written.
        RecordError
            If it is damaged.
        """
        writer = cls.__new__(cls)
        writer._open(followed(path))
        with writer._beginning():
            merge(writer.path)
            writer._continue(provenance)
        return writer

    def _open(self, path: Path) -> None:
        """Take the lock of a record, of which nothing is known or changed yet."""
        self.path, self._folder = path, parts_folder(path)
        self._layout, self._gas_layout = _Layout(), _Layout()
        self._recorded: list[tuple[int, bytes]] = []  # step and mark of each frame
        self._cursor = 0
        self._frames: list[Frame] = []  # waiting frames, the last of those recorded
        self._bytes = 0  # size of the waiting frames
        self._checkpoint: Checkpoint | None = None  # waiting checkpoint
        self._stored = -math.inf  # time.monotonic() of the last write
        self._lock: Lock | None = self._locked()
        self.closed = False

    def _locked(self) -> Lock:
        mode = permissions(self.path)
        if mode is None:
            return Lock(self._folder)
        # Who may read the file may search the folder, and nobody else.
        return Lock(self._folder, mode | (mode & 0o444) >> 2 | 0o700)

    def _release(self) -> None:
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    @contextmanager
    def _beginning(self) -> Iterator[None]:
        """Leave nothing behind, not even the lock, if the body fails."""
        try:
            yield
        except BaseException:
            with suppress(OSError):
                if self._folder.is_dir() and not holds_parts(self._folder):
                    remove_parts(self._folder)
            self._release()
            raise

    def _continue(self, extra: Mapping[str, Any] | None) -> None:
        """Begin as the continuation of a finished file."""
        contents = load(self.path)
        try:
            with reading(self.path):
                self._recall(contents)
            last = contents.frames[-1] if contents.frames else None
            parent = last.digest.hex() if last else None
            if contents.has_checkpoint:
                parent = contents.checkpoint().digest.hex()
        finally:
            contents.close()
        before = json.loads(contents.texts.provenance)
        earlier = [*before.pop("earlier", []), before]
        now = origin.collect(extra, parent=parent) | {"earlier": earlier}
        texts = replace(contents.texts, provenance=json.dumps(now, sort_keys=True))
        self._begin(replace(contents.head, texts=texts))

    def _recall(self, contents: Contents) -> None:
        """Take over the frames and the layout of what is stored."""
        self._recorded = [(frame.step, frame.mark) for frame in contents.frames]
        self._cursor = 0
        self._layout = _Layout.of(contents.frames[-1] if contents.frames else None)
        gases = (frame.gas for frame in reversed(contents.frames) if frame.gas)
        self._gas_layout = _Layout.of(next(gases, None))

    def _begin(self, head: Head) -> None:
        """Write the head of a folder of parts; old contents are removed once it is written."""
        self._head = head
        with replacing(self._folder / HEAD, self._folder / "head.tmp") as fd:
            write_head(fd, head)
            os.fsync(fd)
            clear_parts(self._folder)
        fsync_folder(self.path.parent)

    def _hold(self) -> None:
        """Take the lock again after `close` has failed, if the record is as it was left."""
        if self._lock is not None:
            return
        lock = self._locked()
        try:
            path = self._folder / HEAD
            if path.exists() and read_head(path) != self._head:
                raise FileExistsError(
                    f"{self.path} has been written by another run since this one could not close"
                    " it; resume it, or record under another name"
                )
        except BaseException:
            lock.release()
            raise
        self._lock = lock

    def _begin_again(self) -> None:
        """Go on after a `close` that failed when all was in the file already."""
        contents = load(self.path)
        try:
            if contents.texts != self._head.texts:
                raise FileExistsError(f"{self.path} has been written by another run since")
            self._begin(contents.head)
        finally:
            contents.close()

    @property
    def frames(self) -> int:
        """Number of frames recorded (no ``__len__``: an empty writer must not be false)."""
        return len(self._recorded)

    def writes(self, path: str | os.PathLike[str]) -> bool:
        """True if this is the path of the record, or a symbolic link to it."""
        return os.path.abspath(followed(path)) == os.path.abspath(self.path)

    def append(
        self,
        state: "State",
        checkpoint: Checkpoint | None = None,
        *,
        gas: Mapping[str, np.ndarray] | None = None,
        samples: Mapping[str, float] | None = None,
        bodies: np.ndarray | None = None,
        walls: np.ndarray | None = None,
        keep_each: int = 0,
        may_wait: bool = False,
    ) -> None:
        """Add a frame, and the restart state at its time.

        Both are on the disk when this method returns, unless they `may_wait` (see `store`). `gas`
        are the fields of the gas particles, `samples` the values that monitors measured at the
        frame; `bodies`, shape (count, numbers), is the state of its rigid bodies, and `walls`, also
        (count, numbers), the impulses on its walls. The restart states of frames whose index is a
        multiple of `keep_each` are not replaced by later ones: they are stored at once, in files
        beside the record. A frame equal to the recorded one of the same step is not stored again.

        Raises
        ------
        ValueError
            If the step is not past the last one, or the fields differ from those of frame 0.
        TypeError
            If a field is neither float64 nor int64.
        OSError
            If it could not be written: the disk is as before, and the rest waits for the next
            attempt.
        """
        self._check_open()
        fields = _check_fields(state.fields)
        spec = self._layout.check(fields)
        if gas is not None:
            gas = _check_fields(gas)
            gas_spec = self._gas_layout.check(gas)
        told = dict(samples or {})
        for prefix, rows in ((BODY, bodies), (WALL, walls)):
            if rows is not None:
                told |= zip(names_of(prefix, *rows.shape), rows.ravel().tolist(), strict=True)
        self._add(state, fields, gas, told)
        self._layout.spec = spec
        if gas is not None:
            self._gas_layout.spec = gas_spec
        self._checkpoint = checkpoint or self._checkpoint
        self.store(may_wait=may_wait)
        index = self._cursor - 1
        if keep_each and index % keep_each == 0 and checkpoint is not None:
            _, mark = self._recorded[index]
            kept.keep(self.path, self._head.texts.record, mark, checkpoint)

    def _add(
        self,
        state: "State",
        fields: Mapping[str, np.ndarray],
        gas: Mapping[str, np.ndarray] | None,
        samples: Mapping[str, float],
    ) -> None:
        """Put a frame among those that wait, if it is not recorded already."""
        head, below = _head(state, fields), None if gas is None else _head(state, gas)
        step, mark = head["step"], head["digest"] + (below["digest"] if below else b"")
        index = bisect_left(self._recorded, step, key=lambda old: old[0])
        if self._recorded[index : index + 1] == [(step, mark)]:
            self._cursor = max(self._cursor, index + 1)
            return
        if index < self._cursor:
            last = self._recorded[self._cursor - 1][0]
            raise ValueError(f"step = {step} must exceed the last recorded step {last}")
        inside = (
            None if gas is None or below is None else self._gas_layout.packed(self.path, below, gas)
        )
        frame = self._layout.packed(self.path, head, fields, samples=samples, gas=inside)
        self._frames.append(frame)
        waiting = [part.source for part in (frame, inside) if part]
        self._bytes += sum(part.nbytes for part in waiting if isinstance(part, Memory))
        self._recorded[index:] = [(step, mark)]
        self._cursor = index + 1

    def checkpoint(self, checkpoint: Checkpoint) -> None:
        """Store the frames that wait, then a restart state in place of the previous one.

        Raises
        ------
        OSError
            As `append`.
        """
        self._check_open()
        self._checkpoint = checkpoint
        self.store()

    def store(self, *, may_wait: bool = False) -> None:
        """Write the frames and the restart state that wait to the disk.

        If they `may_wait`, they are written only if `WAITING_SECONDS` have passed since the last
        write or `WAITING_BYTES` have accumulated. Many frames then form one segment, and only the
        last of their restart states is stored.

        Raises
        ------
        OSError
            As `append`.
        """
        due = time.monotonic() - self._stored >= WAITING_SECONDS
        if may_wait and not due and self._bytes < WAITING_BYTES:
            return
        if not self._frames and not self._checkpoint:
            return
        self._hold()
        if not (self._folder / HEAD).exists():
            self._begin_again()
        if self._frames:
            first = len(self._recorded) - len(self._frames)
            path = self._folder / f"frames-{first:08d}.part"
            write_frames(path, self._head.texts.record, self._frames)
            self._frames, self._bytes = [], 0
            self._stored = time.monotonic()
        if self._checkpoint:
            path = self._folder / CHECKPOINT
            write_restart(path, self._head.texts.record, self._checkpoint)
            self._checkpoint, self._stored = None, time.monotonic()

    @contextmanager
    def storing(self) -> Iterator[None]:
        """Store what waits as soon as it is due, while the body of the caller is busy elsewhere.

        The body must not use the writer. An error is not raised here: what could not be stored
        waits for the next attempt, which raises it.
        """
        if not self._frames and not self._checkpoint:
            yield
            return
        timer = threading.Timer(self._stored + WAITING_SECONDS - time.monotonic(), self._try_store)
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()
            timer.join()  # a segment that is being written

    def _try_store(self) -> None:
        with suppress(Exception):
            self.store()

    def _check_open(self) -> None:
        if self.closed:
            raise ValueError(f"{self.path}: the record is closed")

    def close(self) -> None:
        """Merge everything into the one file; a second call does nothing.

        Raises
        ------
        OSError
            If the file could not be written. It is then as before, the parts remain, and the lock
            is released: the record may be opened and resumed, or this writer may go on and `close`
            again, as long as no other has written.
        FileExistsError
            If there is a file at the path that was not there at the beginning. Both are kept.
        """
        if self.closed:
            return
        with self._leaving():
            self.store()
            if self._recorded or (self._folder / CHECKPOINT).exists():
                merge(self.path)
            else:
                remove_parts(self._folder)

    def leave(self) -> None:
        """Stop writing without merging; the parts are a valid record that can be read and resumed.

        This takes no longer for a long record than for a short one, whereas `close` copies all
        frames. If it fails, `leave` or `close` may be called again.
        """
        if not self.closed:
            with self._leaving():
                self.store()

    @contextmanager
    def _leaving(self) -> Iterator[None]:
        """Release the lock, and close the record if the body succeeds."""
        self._hold()
        try:
            yield
            self.closed = True
        finally:
            self._release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None and issubclass(kind, KeyboardInterrupt):
            self.leave()  # Ctrl-C must not wait for the merge
        else:
            self.close()
