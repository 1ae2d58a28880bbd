"""The files of an unfinished record as its writer has them: frames are added until it is finished.

They lie in the folder of the record, under a name that no other writer uses:

    log             head and frames of the record, see `granular.record.log`
    <name>.data     the unfinished HDF5 file
    <name>.restart  the newest restart state, see `granular.record.restart`

The columns of a frame are written to their final position in the HDF5 file at once. The metadata of
HDF5 remain in memory until the end, when the file needs only these and its new name. Until then the
log contains the positions of the columns, for readers as well as for a writer that continues after
a killed one.
"""

import os
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np

from granular.record import chunks
from granular.record.checkpoint import Checkpoint, CheckpointRows, write_checkpoint
from granular.record.frame import SCALARS, Frame, Head, Table, samples_of
from granular.record.fresh import New, checksums_of
from granular.record.layout import (
    DIGEST_SIZE,
    FORMAT,
    LIBVER,
    RecordError,
    as_attribute,
    reading,
    rows_of,
    write_text,
)
from granular.record.log import Stretch, frame_entry, head_entry
from granular.record.polydata import begin_poly_data, write_steps, write_vertices
from granular.record.restart import check_digest, opened_restart, write_restart
from granular.record.storage import Sink, create, fsync_folder, permissions, replacing, write_all

LOG, DATA, RESTART = "log", ".data", ".restart"


class _Points:
    """The datasets of one set of points."""

    def __init__(self, vtk: h5py.Group, path: Path, sink: Sink) -> None:
        self._vtk, self._path, self._sink = vtk, path, sink
        self._inside = vtk.create_group("PointData")
        self._layout: dict[str, tuple[str, int, int]] = {}
        self._targets: dict[str, h5py.Dataset] = {}
        self._chunk, self._rows = 1, 0

    def put(self, frame: Frame) -> Frame:
        """Store a frame behind the others; return it with its new position.

        The next one is stored at the same position unless `advance` is called.
        """
        copied = not isinstance(frame.source, New)
        with (
            reading(frame.source.path) if copied else nullcontext(),
            frame.source.fields() as fields,
        ):
            layout = chunks.layout(fields)
            if not self._targets:
                self._layout, self._chunk = layout, fields["x"].chunk
                for name, field in fields.items():
                    place = (self._vtk, "Points") if name == "x" else (self._inside, name)
                    self._targets[name] = chunks.create(*place, 0, field)
            if layout != self._layout:
                raise RecordError(f"{frame.source.path}: fields differ from those of frame 0")
            end = self._rows + rows_of(frame.n, self._chunk)
            placed = {}
            for name, field in fields.items():
                target = self._targets[name]
                if target.shape[0] < end:
                    target.resize(end, axis=0)
                places = chunks.copy(field, frame.row, target, self._rows, frame.n, self._sink)
                placed[name] = (*layout[name], places)
            digest = frame.digest or frame.digest_of(checksums_of(fields))
        self._sink.check()
        source = Stretch(self._path, frame.n, placed)
        return replace(frame, digest=digest, row=0, source=source)

    def advance(self, n: int) -> None:
        """Move on from the position of the last frame, of ``n`` points."""
        self._rows += rows_of(n, self._chunk)

    def finish(self, group: h5py.Group, frames: Sequence[Frame]) -> Table:
        """Write the description of the frames, for ParaView and for the package."""
        begin_poly_data(self._vtk)
        if not self._targets:
            self._vtk.create_dataset("Points", shape=(0, 3), maxshape=(None, 3), dtype="<f8")
        table = _table(frames, self._chunk)
        self._vtk["NumberOfPoints"] = table.n
        write_vertices(self._vtk, table.n)
        steps = write_steps(self._vtk, table.time, table.row)
        offsets = steps.create_group("PointDataOffsets")
        for name in self._inside:
            offsets[name] = steps["PointOffsets"]  # a second name of the same data
        for name in ("step", "dt", "mass", "digest"):
            group[name] = getattr(table, name)
        return table


def _table(frames: Sequence[Frame], chunk: int) -> Table:
    rows = [rows_of(frame.n, chunk) for frame in frames]
    digests = b"".join(frame.digest for frame in frames)
    return Table(
        **{
            name: np.array([getattr(frame, name) for frame in frames], dtype=dtype)
            for name, dtype in SCALARS.items()
        },
        row=np.cumsum([0, *rows], dtype="<i8")[:-1],
        digest=np.frombuffer(digests, dtype=np.uint8).reshape(-1, DIGEST_SIZE),
        samples=samples_of(frames),
    )


def _keep_in_memory(file: h5py.File) -> None:
    """Let HDF5 write nothing but the columns of frames until it closes the file."""
    cache = file.id.get_mdc_config()
    cache.evictions_enabled = False
    cache.incr_mode = cache.flash_incr_mode = cache.decr_mode = 0
    file.id.set_mdc_config(cache)


class Growing:
    """The unfinished record at a path, which replaces an unfinished one there.

    Parameters
    ----------
    path
        Path of the record, not yet of any file that is written here.
    folder
        Folder of its files.
    head
        Its name is one that no files in the folder have.
    frames, checkpoint
        Its initial content; it is copied.

    Raises
    ------
    OSError
        If it could not be written. All files are then as before.
    """

    def __init__(
        self,
        path: Path,
        folder: Path,
        head: Head,
        frames: Sequence[Frame] = (),
        checkpoint: Checkpoint | None = None,
    ) -> None:
        self.head, self.frames = head, list[Frame]()
        self.data, self._log = folder / (head.name + DATA), folder / LOG
        self.restart = folder / (head.name + RESTART)
        mode = permissions(path)
        self._fd, self._log_fd = create(self.data, mode), -1
        self._file: h5py.File | None = None
        try:
            self._sink = Sink(self._fd)
            self._file = h5py.File(self._sink, "w", libver=LIBVER)
            _keep_in_memory(self._file)
            self._group = self._file.create_group("granular")
            self._points = _Points(self._file.create_group("VTKHDF"), self.data, self._sink)
            self._others: dict[str, _Points] = {}
            if checkpoint:
                write_restart(self.restart, checkpoint)
            fsync_folder(path.parent)  # which holds the folder
            with replacing(self._log, self._log.with_suffix(".tmp"), mode) as fd:
                write_all(fd, head_entry(head))
                for frame in frames:
                    placed = self._put(frame)
                    write_all(fd, frame_entry(placed))
                    self._add(placed)
                if frames:
                    os.fsync(self._fd)
                self._log_fd = os.dup(fd)
                self._end = os.lseek(fd, 0, os.SEEK_CUR)
        except BaseException:
            if not self._began():
                self._remove()
            self.discard()
            raise
        remove_others(folder, head.name)

    def _began(self) -> bool:
        """True if the log has been written, though an error followed."""
        with suppress(OSError):
            return os.path.samestat(os.fstat(self._log_fd), os.stat(self._log))
        return False

    def _put(self, frame: Frame) -> Frame:
        placed, others = self._points.put(frame), {}
        for name, other in frame.others.items():
            if name not in self._others:
                vtk = self._group.create_group(f"{name}/VTKHDF")
                self._others[name] = _Points(vtk, self.data, self._sink)
            others[name] = self._others[name].put(other)
        return replace(placed, others=others)

    def _add(self, placed: Frame) -> None:
        self.frames.append(placed)
        self._points.advance(placed.n)
        for name, other in placed.others.items():
            self._others[name].advance(other.n)

    def append(self, frame: Frame) -> None:
        """Add a frame, whose digest may be missing.

        OSError if it could not be written; all files are then as before.
        """
        placed = self._put(frame)
        entry = frame_entry(placed)
        os.ftruncate(self._log_fd, self._end)  # a part of an entry after an error
        os.lseek(self._log_fd, self._end, os.SEEK_SET)
        write_all(self._log_fd, entry)
        self._end += len(entry)
        self._add(placed)

    def keep(self, checkpoint: Checkpoint | CheckpointRows) -> None:
        """Store a restart state, after all frames have become durable."""
        os.fsync(self._fd)
        os.fsync(self._log_fd)
        write_restart(self.restart, checkpoint)

    @property
    def has_content(self) -> bool:
        """True if there are frames or a restart state."""
        return bool(self.frames) or self.restart.exists()

    def finish(self) -> None:
        """Complete the file and make it durable; OSError if it could not be, it is then of no use.

        The frames are where they were, as the log tells.
        """
        assert self._file is not None
        texts, group, frames = self.head.texts, self._group, self.frames
        table = self._points.finish(group, frames)
        others = {
            name: points.finish(group[name], [f.others[name] for f in frames if name in f.others])
            for name, points in self._others.items()
        }
        for name in ("record", "scene", "provenance"):
            write_text(group, name, getattr(texts, name))
        samples = group.create_group("samples")
        for name, column in table.samples.items():
            samples[name] = column
        digest = b""
        if self.restart.exists():
            with opened_restart(self.restart) as (checkpoint, stored):
                digest = write_checkpoint(group.create_group("checkpoint"), checkpoint)
                check_digest(digest, stored)
        group.attrs["format"] = FORMAT
        group.attrs["seal"] = as_attribute(table.seal(texts, digest, others))
        self._file.close()
        self._file = None
        self._sink.check()
        os.fsync(self._fd)

    def __del__(self) -> None:
        with suppress(AttributeError):  # of what could not be begun
            self.discard()

    def discard(self) -> None:
        """Release the files, which remain unchanged for readers of the log."""
        if self._file is not None:
            self._sink.error = OSError("not finished")  # HDF5 must not write any more
            with suppress(Exception):
                self._file.close()
            self._file = None
        for fd in (self._fd, self._log_fd):
            if fd >= 0:
                with suppress(OSError):
                    os.close(fd)
        self._fd = self._log_fd = -1

    def _remove(self) -> None:
        for path in (self.data, self.restart):
            with suppress(OSError):
                path.unlink(missing_ok=True)


def remove_others(folder: Path, name: str) -> None:
    """Remove the files that other writers have left in a folder."""
    for suffix in (DATA, RESTART, ".tmp"):
        for path in folder.glob("*" + suffix):
            if path.stem != name:
                path.unlink()


def remove_all(folder: Path) -> None:
    """Remove all files of an unfinished record, the log first."""
    (folder / LOG).unlink(missing_ok=True)
    fsync_folder(folder)
    remove_others(folder, "")
