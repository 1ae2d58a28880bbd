"""Checkpoints of a run besides the newest one, in a folder next to its record.

The folder ``<path>.checkpoints`` holds a segment for each, named by the step and the beginning of
the digest of its frame: ``<step>-<digest>.part``. They may be deleted at any time.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from granular.record.checkpoint import Checkpoint, CheckpointRows
from granular.record.frame import Frame
from granular.record.restart import read_restart, write_restart


def folder_of(path: Path) -> Path:
    """Folder of the older checkpoints of a record."""
    return path.with_name(f"{path.name}.checkpoints")


def _file(path: Path, step: int, mark: bytes) -> Path:
    return folder_of(path) / f"{step:012d}-{mark[:8].hex()}.part"


def store(path: Path, frame: Frame, checkpoint: Checkpoint | CheckpointRows) -> None:
    """Store the checkpoint of a frame of a record, completely or not at all."""
    folder_of(path).mkdir(exist_ok=True)
    write_restart(_file(path, frame.step, frame.mark), checkpoint)


def frames_with(path: Path, frames: Iterable[Frame]) -> list[int]:
    """Indices of the frames of which a checkpoint is stored."""
    return [i for i, frame in enumerate(frames) if _file(path, frame.step, frame.mark).exists()]


def read(path: Path, frame: Frame) -> Checkpoint:
    """Read and verify the checkpoint of a frame.

    Raises
    ------
    FileNotFoundError
        If none is stored.
    RecordError
        If it is damaged.
    """
    return read_restart(_file(path, frame.step, frame.mark))


def delete(path: Path) -> None:
    """Delete the older checkpoints of a record, and their folder if it is then empty."""
    folder = folder_of(path)
    if not folder.is_dir():
        return
    for file in folder.glob("*.part"):
        file.unlink()
    if not any(folder.iterdir()):
        folder.rmdir()
