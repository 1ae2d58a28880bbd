"""Writing of a record such that completed frames are not lost."""

import json
import os
import uuid
import warnings
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from granular.record import older_checkpoints
from granular.record import provenance as origin
from granular.record.checkpoint import Checkpoint, CheckpointRows
from granular.record.chunks import Field, Packer
from granular.record.frame import BODY, WALL, Frame, Head, Texts, names_of
from granular.record.fresh import Columns, Fresh, New, Streamed, checksums_of
from granular.record.growing import Growing, remove_all
from granular.record.index import Contents, load, parts_folder, unfinished
from granular.record.layout import (
    FIELD_DTYPES,
    MAX_COLUMNS,
    OTHERS,
    RecordError,
    check_type,
    chunk_rows,
    reading,
)
from granular.record.lock import Lock
from granular.record.storage import followed, fsync_folder, identity, permissions
from granular.tools.resources import Resource

if TYPE_CHECKING:
    from granular.model.state import State
    from granular.model.typing import AnyScene


Given = Mapping[str, np.ndarray | Columns]


def _check_fields(fields: Given, needed: Sequence[str]) -> None:
    """Refuse fields that are not those of points, or cannot be stored without loss."""
    for name, array in fields.items():
        if not name.isidentifier() or not name.isascii():
            raise ValueError(f"field name {name!r} must be an ASCII identifier")
        check_type(f"field {name}", array, FIELD_DTYPES)
        wide = array.shape[1:]
        if len(array.shape) not in (1, 2) or (wide and not 1 <= wide[0] <= MAX_COLUMNS):
            raise ValueError(
                f"field {name} has shape {array.shape}, must be (n,) or (n, 1..{MAX_COLUMNS})"
            )
    for name in needed:
        if name not in fields:
            raise ValueError(f"fields = {sorted(fields)} must have {name}")
    x = fields["x"]
    if x.dtype.kind != "f" or len(x.shape) != 2 or x.shape[1] not in (2, 3):
        raise ValueError(f"field x has shape {x.shape}, must be of floats, (n, 2) or (n, 3)")
    for name, array in fields.items():
        if array.shape[0] != x.shape[0]:
            raise ValueError(f"field {name} has {array.shape[0]} rows, x has {x.shape[0]}")


PATCHES = 1024
"""Rows per chunk of patches, of which there are few in the first frames."""


def _spec(fields: Mapping[str, Field]) -> dict[str, tuple[str, int]]:
    """Types and columns of fields."""
    return {name: (field.dtype, field.columns) for name, field in fields.items()}


def _with_digest(frame: Frame) -> Frame:
    """Return a frame that is not stored yet with its digest, for which all columns are made."""
    assert isinstance(frame.source, New)
    others = {name: _with_digest(other) for name, other in frame.others.items()}
    return replace(frame, digest=frame.digest_of(checksums_of(frame.source.given)), others=others)


@dataclass
class _Layout:
    """Layout of all frames of one set of points: types and columns of fields, rows per chunk."""

    spec: dict[str, tuple[str, int]] | None = None
    chunk: int | None = None
    needed: tuple[str, ...] = ("x", "mass")
    packer: Packer = field(default_factory=Packer)

    @classmethod
    def of(cls, frame: Frame | None, name: str = "") -> Self:
        """Return the layout of a stored frame, or one that the first frame will determine.

        Patches have no mass.
        """
        needed = ("x",) if name == "patches" else ("x", "mass")
        if frame is None:  # patches are few at first
            return cls(needed=needed, chunk=PATCHES if name == "patches" else None)
        with frame.source.fields() as stored:
            return cls(_spec(stored), stored["x"].chunk, needed)

    def frame(self, path: Path, state: "State | Streamed", given: Given, single: bool) -> Frame:
        """Return a frame of these fields, which is not stored yet and has no digest.

        ValueError if they are not those of the frames before.
        """
        _check_fields(given, self.needed)
        n = given["x"].shape[0]
        chunk = self.chunk or chunk_rows(n)
        # Positions stay double: those of points in cells far from the origin need it.
        new = {
            name: Fresh(a, chunk, self.packer, name, single and name != "x")
            for name, a in given.items()
        }
        spec = _spec(new)
        if self.spec is not None and spec != self.spec:
            raise ValueError(f"fields = {spec} must be those of frame 0: {self.spec}")
        return Frame(
            time=float(state.time),
            step=int(state.step),
            dt=float(state.dt),
            mass=new["mass"].total() if "mass" in new else 0.0,
            n=n,
            digest=b"",
            row=0,
            source=New(path, new),
        )

    def fix(self, frame: Frame) -> None:
        """Let all further frames be as this one."""
        assert isinstance(frame.source, New)
        self.spec, self.chunk = _spec(frame.source.given), frame.source.given["x"].chunk


class TrajectoryWriter(Resource):
    """Writer of one record: frames are stored one by one, and `close` completes the file.

    Until then the file lies in the folder ``<path>.parts`` with a log of its frames. A frame is
    complete there or does not count. If the process is killed, `open_trajectory` reads the complete
    frames, and `resume` goes on with them. After a loss of power the frames since the last
    checkpoint may be missing; a run that goes on computes them again.

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

    _instead = "one writer has the record; `resume` goes on with it after `close`"

    def __init__(
        self,
        path: str | os.PathLike[str],
        scene: "AnyScene",
        *,
        overwrite: bool = False,
        provenance: Mapping[str, Any] | None = None,
    ) -> None:
        path = followed(path)
        text = json.dumps(origin.collect(provenance), sort_keys=True)
        texts = Texts(uuid.uuid4().hex, scene.to_json(), text)
        with self._opening(path):
            if not overwrite:
                self._refuse_existing()
            self._begin(texts)
            older_checkpoints.delete(path)

    @classmethod
    def resume(
        cls, path: str | os.PathLike[str], *, provenance: Mapping[str, Any] | None = None
    ) -> Self:
        """Continue a record, finished or not; its frames are copied into the new file.

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
        with writer._opening(followed(path)), writer._stored() as contents:
            frames = _sound(contents)
            for message in contents.spoilt:
                warnings.warn(
                    f"{message}, unless the run makes it again", RuntimeWarning, stacklevel=4
                )
            parent = frames[-1].digest.hex() if frames else None
            if contents.has_checkpoint:
                parent = contents.checkpoint().digest.hex()
            before = json.loads(contents.texts.provenance)
            earlier = [*before.pop("earlier", []), before]
            now = origin.collect(provenance, parent=parent) | {"earlier": earlier}
            texts = replace(contents.texts, provenance=json.dumps(now, sort_keys=True))
            writer._begin(texts, contents, frames)
            writer._cursor = 0
        return writer

    @contextmanager
    def _opening(self, path: Path) -> Iterator[None]:
        """Take the lock of a record; if the body fails, release it and remove all files."""
        self.path, self._folder = path, parts_folder(path)
        self._growing: Growing | None = None
        self._filled = False  # released files that are not empty
        self._cursor = 0  # number of the frames that this run has made or recognised
        self.closed = False
        self._lock: Lock | None = self._locked()
        try:
            yield
        except BaseException:
            with suppress(OSError, RecordError):
                if not unfinished(path):
                    remove_all(self._folder)
            self._let_go()
            raise

    def _locked(self) -> Lock:
        mode = permissions(self.path)
        if mode is None:
            return Lock(self._folder)
        # Who may read the file may search the folder, and nobody else.
        return Lock(self._folder, mode | (mode & 0o444) >> 2 | 0o700)

    def _let_go(self) -> None:
        """Release the files and the lock."""
        if self._growing is not None:
            self._growing.discard()
            self._growing = None
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    def _refuse_existing(self) -> None:
        left = unfinished(self.path)
        if left or self.path.exists():
            raise FileExistsError(
                f"{self.path} exists already"
                + (" (unfinished: resume it)" if left else "")
                + "; overwrite=True replaces it"
            )

    @contextmanager
    def _stored(self) -> Iterator[Contents]:
        """Yield the record that is stored at the path."""
        contents = load(self.path)
        try:
            yield contents
        finally:
            contents.close()

    def _begin(
        self, texts: Texts, contents: Contents | None = None, frames: list[Frame] | None = None
    ) -> None:
        """Begin the file anew, with these frames and the stored checkpoint."""
        frames, checkpoint = frames or [], None
        if contents and contents.has_checkpoint:
            checkpoint = contents.checkpoint()
        with reading(self.path):
            self._layout = _Layout.of(frames[-1] if frames else None)
            last = {name: other for frame in frames for name, other in frame.others.items()}
            self._layouts = {name: _Layout.of(last.get(name), name) for name in OTHERS}
        before, head = self._growing, Head(texts, uuid.uuid4().hex, identity(self.path))
        self._growing = Growing(self.path, self._folder, head, frames, checkpoint)
        self._texts, self._replaces, self._frames = texts, head.replaces, self._growing.frames
        if before:
            before.discard()

    def _grown(self) -> Growing:
        """Return the unfinished files; continue the stored ones after `close` has failed."""
        if self.closed:
            raise ValueError(f"{self.path}: the record is closed")
        if self._growing is None:
            self._lock = self._locked()
            try:
                self._take_up()
            except BaseException:
                self._let_go()
                raise
        assert self._growing is not None
        return self._growing

    def _take_up(self) -> None:
        if not self._filled and identity(self.path) == self._replaces and not unfinished(self.path):
            self._begin(self._texts)
            return
        with self._stored() as contents:
            if contents.texts != self._texts:
                raise FileExistsError(
                    f"{self.path} has been written by another run since this one could not close"
                    " it; resume it, or record under another name"
                )
            self._begin(self._texts, contents, contents.frames)

    @property
    def frames(self) -> int:
        """Number of frames recorded (no ``__len__``: an empty writer must not be false)."""
        return len(self._frames)

    def writes(self, path: str | os.PathLike[str]) -> bool:
        """True if this is the path of the record, or a symbolic link to it."""
        return os.path.abspath(followed(path)) == os.path.abspath(self.path)

    def append(
        self,
        state: "State | Streamed",
        *,
        others: Mapping[str, Mapping[str, np.ndarray]] | None = None,
        samples: Mapping[str, float] | None = None,
        bodies: np.ndarray | None = None,
        walls: np.ndarray | None = None,
        single: bool = False,
    ) -> int:
        """Add a frame; it outlives the process when this method returns.

        A frame equal to the recorded one of the same step is not stored again.

        Parameters
        ----------
        state : State or Streamed
        others : mapping of str to mapping, optional
            Fields of other sets of points, by the names of `granular.record.layout.OTHERS`. The
            patches are stored in double precision.
        samples : mapping, optional
            Values of the monitor.
        bodies, walls : ndarray, optional
            States of the rigid bodies and impulses on the walls, shape (count, numbers).
        single : bool
            Store the fields in single precision.

        Returns
        -------
        int
            Index of the frame.

        Raises
        ------
        ValueError
            If the step is not past the last one, or the fields differ from those of frame 0.
        TypeError
            If a field has a type that cannot be stored.
        OSError
            If it could not be written: the record is as before.
        """
        growing = self._grown()
        frame = self._layout.frame(self.path, state, state.fields, single)
        more = {
            name: self._layouts[name].frame(self.path, state, fields, single and name != "patches")
            for name, fields in (others or {}).items()
        }
        frame = replace(frame, others=more)
        values = dict(samples or {})
        for prefix, rows in ((BODY, bodies), (WALL, walls)):
            if rows is not None:
                values |= zip(names_of(prefix, *rows.shape), rows.ravel().tolist(), strict=True)
        frame = replace(frame, samples=values)
        index = bisect_left(self._frames, frame.step, key=lambda old: old.step)
        known = self._frames[index] if index < len(self._frames) else None
        if known and known.step == frame.step:
            frame = _with_digest(frame)
        if known and frame.digest and known.mark == frame.mark:
            self._cursor = max(self._cursor, index + 1)
            return index
        if index < self._cursor:
            last = self._frames[self._cursor - 1].step
            raise ValueError(f"step = {frame.step} must exceed the last recorded step {last}")
        if known:  # from here on the record is another one
            with self._stored() as contents:
                layouts = self._layout, self._layouts
                self._begin(self._texts, contents, contents.frames[:index])
                self._layout, self._layouts = layouts
            growing = self._grown()
        growing.append(frame)
        self._layout.fix(frame)
        for name, other in more.items():
            self._layouts[name].fix(other)
        self._cursor = index + 1
        return index

    def checkpoint(self, checkpoint: Checkpoint | CheckpointRows) -> None:
        """Store a restart state in place of the previous one, and make all frames durable.

        Raises
        ------
        OSError
            As `append`.
        """
        self._grown().keep(checkpoint)

    def keep(self, index: int, checkpoint: Checkpoint | CheckpointRows) -> None:
        """Store the restart state of a frame separately, where no later one replaces it."""
        older_checkpoints.store(self.path, self._frames[index], checkpoint)

    def close(self) -> None:
        """Complete the file and give it its name; a second call does nothing.

        The frames are not copied.

        Raises
        ------
        OSError
            If the file could not be written. The stored data remain, and the lock is released: the
            record may be opened and resumed, or this writer may go on and `close` again, as long as
            no other has written.
        FileExistsError
            If there is a file at the path that was not there at the beginning. Both are kept.
        """
        if self.closed:
            return
        growing = self._grown()
        self._filled = growing.has_content
        try:
            if self._filled:
                self._replace(growing)
            remove_all(self._folder)
            self.closed = True
        finally:
            self._let_go()

    def _replace(self, growing: Growing) -> None:
        growing.finish()
        if identity(self.path) != growing.head.replaces:
            raise FileExistsError(
                f"{self.path} has changed while the frames in {self._folder} were written; move it"
                " elsewhere"
            )
        os.replace(growing.data, self.path)
        fsync_folder(self.path.parent)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._growing is None:
            return
        if kind is None or self._growing.has_content:
            self.close()
        else:
            self._let_go()  # it may go on once the cause is removed


def _sound(contents: Contents) -> list[Frame]:
    """Frames of a record, without those that a loss of power has spoilt after the checkpoint.

    The run makes these again.
    """
    frames = contents.frames
    if contents.main or not contents.has_checkpoint:
        return frames
    last = contents.checkpoint().step
    for i, frame in enumerate(frames):
        if frame.step > last:
            try:
                for part in frame.each():
                    contents.read(part)
            except RecordError:
                return frames[:i]
    return frames
