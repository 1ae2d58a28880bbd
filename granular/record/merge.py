"""Merge of all frames of a record into one HDF5 file, chunk by chunk, without unpacking them."""

import os
from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np

from granular.record import chunks
from granular.record.checkpoint import Checkpoint, write_checkpoint
from granular.record.frame import SCALARS, Frame, Table, Texts, samples_of
from granular.record.index import CHECKPOINT, HEAD, MERGED, frame_parts, load, parts_folder
from granular.record.layout import (
    DIGEST_SIZE,
    LIBVER,
    TOPOLOGIES,
    RecordError,
    as_attribute,
    format_of,
    reading,
    rows_of,
    write_text,
)
from granular.record.storage import Sink, fsync_folder, identity, replacing


def begin_poly_data(vtk: h5py.Group) -> None:
    """Mark a group as VTKHDF PolyData."""
    vtk.attrs["Version"] = np.array((2, 0), dtype="<i8")
    vtk.attrs.create("Type", np.bytes_("PolyData"), dtype=h5py.string_dtype("ascii", 8))


def _write_vertices(vtk: h5py.Group, counts: np.ndarray) -> None:
    """Write one vertex cell per point; all frames share one table 0, 1, ... of the largest one."""
    most = int(counts.max(initial=0))
    for name, here, size in (("Vertices", counts, most), ("Lines", np.zeros_like(counts), 0)):
        group = vtk.create_group(name)
        group["NumberOfCells"] = here
        group["NumberOfConnectivityIds"] = group["NumberOfCells"]
        group["Connectivity"] = np.arange(size, dtype="<i8")
        group["Offsets"] = np.arange(size + 1, dtype="<i8")
    for name in TOPOLOGIES[2:]:
        vtk[name] = vtk["Lines"]  # equally empty: a second name of the same group


def write_steps(vtk: h5py.Group, times: np.ndarray, first_points: np.ndarray) -> h5py.Group:
    """Write the steps of PolyData: their times, and the first point of each; return the group."""
    steps = vtk.create_group("Steps")
    count = len(times)
    steps.attrs["NSteps"] = count
    steps["Values"] = times
    steps["PartOffsets"] = np.arange(count, dtype="<i8")
    steps["NumberOfParts"] = np.ones(count, dtype="<i8")
    steps["PointOffsets"] = first_points
    steps["CellOffsets"] = np.zeros((count, len(TOPOLOGIES)), dtype="<i8")
    steps["ConnectivityIdOffsets"] = steps["CellOffsets"]
    return steps


def _write_points(vtk: h5py.Group, own: h5py.Group, frames: Sequence[Frame]) -> Table:
    """Write the frames of one set of points: the data that ParaView reads, and all other data."""
    begin_poly_data(vtk)
    table, fields = _write_frames(vtk, frames)
    vtk["NumberOfPoints"] = table.n
    _write_vertices(vtk, table.n)
    steps = write_steps(vtk, table.time, table.row)
    offsets = steps.create_group("PointDataOffsets")
    for name in fields:
        if name != "x":
            offsets[name] = steps["PointOffsets"]  # a second name of the same data
    for name in ("step", "dt", "mass", "digest"):
        own[name] = getattr(table, name)
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


def _write_frames(vtk: h5py.Group, frames: Sequence[Frame]) -> tuple[Table, list[str]]:
    """Write the fields of all frames, opening one frame at a time."""
    inside = vtk.create_group("PointData")
    if not frames:
        vtk.create_dataset("Points", shape=(0, 3), maxshape=(None, 3), dtype="<f8")
        return _table(frames, 1), []
    with frames[0].source.fields() as first:
        layout = chunks.layout(first)
        chunk = first["x"].chunk
        table = _table(frames, chunk)
        rows = sum(rows_of(frame.n, chunk) for frame in frames)
        targets = {
            name: chunks.create(*((vtk, "Points") if name == "x" else (inside, name)), rows, field)
            for name, field in first.items()
        }
    for frame, row in zip(frames, table.row, strict=True):
        with reading(frame.source.path), frame.source.fields() as fields:
            if chunks.layout(fields) != layout:
                raise RecordError(f"{frame.source.path}: fields differ from those of frame 0")
            for name, field in fields.items():
                chunks.copy(field, frame.row, targets[name], int(row), frame.n)
    return table, list(layout)


def write_record(
    file: h5py.File,
    texts: Texts,
    frames: Sequence[Frame],
    checkpoint: Checkpoint | None,
) -> None:
    """Write a whole record into an empty HDF5 file."""
    vtk, own = file.create_group("VTKHDF"), file.create_group("granular")
    table = _write_points(vtk, own, frames)
    gas = [frame.gas for frame in frames if frame.gas]
    gas_table = None
    if gas:
        group = own.create_group("gas")
        gas_table = _write_points(group.create_group("VTKHDF"), group, gas)
    for name in ("record", "scene", "provenance"):
        write_text(own, name, getattr(texts, name))
    samples = own.create_group("samples")
    for name, column in table.samples.items():
        samples[name] = column
    if checkpoint:
        write_checkpoint(own.create_group("checkpoint"), checkpoint)
    version, digest = format_of(bool(gas)), checkpoint.digest if checkpoint else b""
    own.attrs["format"] = version
    own.attrs["seal"] = as_attribute(table.seal(version, texts, digest, gas_table))


def clear_parts(folder: Path) -> None:
    """Remove all parts, except for the head.

    The last segment is removed first, so that an interruption leaves a valid, shorter record.
    """
    parts = [*reversed(frame_parts(folder)), folder / CHECKPOINT, *folder.glob("*.tmp")]
    parts = [part for part in parts if part.name != "head.tmp" and part.exists()]
    for part in parts:
        part.unlink()
    if (folder / MERGED).exists():
        fsync_folder(folder)  # the mark goes after all that it marks
        (folder / MERGED).unlink()


def remove_parts(folder: Path) -> None:
    """Remove the parts and the head of a record that the finished file holds.

    The head is renamed first: what an interruption leaves is then known to be of no use.
    """
    if (folder / HEAD).exists():
        os.replace(folder / HEAD, folder / MERGED)
        fsync_folder(folder)
    clear_parts(folder)
    fsync_folder(folder)


def merge(path: Path) -> None:
    """Merge the parts of a record into its one file; empty parts are only removed.

    The caller holds the `Lock` of the record.

    Raises
    ------
    FileExistsError
        If there is a file at the path that the record must not replace; both are as before.
    OSError
        If the file could not be written; the file and the parts are then as before.
    RecordError
        If something stored is damaged.
    """
    before = identity(path)
    contents = load(path)
    folder = parts_folder(path)
    try:
        if contents.folder and (contents.frames or contents.has_checkpoint):
            checkpoint = contents.checkpoint() if contents.has_checkpoint else None
            temporary = folder / "merged.tmp"
            with replacing(path, temporary) as fd:
                sink = Sink(fd)
                try:
                    with h5py.File(sink, "w", libver=LIBVER) as file:
                        write_record(file, contents.texts, contents.frames, checkpoint)
                except Exception:
                    sink.check()  # the first error is the cause
                    raise
                sink.check()
                if identity(path) != before:
                    raise FileExistsError(
                        f"{path} has changed while the frames in {folder} were merged; move it"
                        " elsewhere"
                    )
    finally:
        contents.close()
    if folder.is_dir():
        remove_parts(folder)
