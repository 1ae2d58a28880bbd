"""The record of a simulation, to which its runs append one after the other."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granular.record.writer import TrajectoryWriter
from granular.run.running import spoils_state

if TYPE_CHECKING:
    from granular.model.typing import AnyScene


FOR_PARAVIEW = ".vtkhdf"
"""End of the names of records that ParaView opens directly."""


def bodies_file(path: Path) -> Path:
    """Path of the file with the surfaces of the bodies of a record."""
    return path.with_name(f"{path.stem}_bodies{FOR_PARAVIEW}")


def _shows_bodies(path: Path, scene: AnyScene) -> bool:
    return path.suffix == FOR_PARAVIEW and bool(scene.bodies)


def _write_bodies(path: Path) -> None:
    """Write the surfaces of the bodies of a record, and replace an older file."""
    # Imported here: only scenes with bodies need them.
    from granular.export import write_bodies
    from granular.record.reader import open_trajectory

    with open_trajectory(path) as record:
        if len(record):
            write_bodies(record, bodies_file(path), overwrite=True)


class Session:
    """Path of the record of a simulation, and its writer if that could not be closed.

    Attributes
    ----------
    path : Path or None
        None before the first run that is recorded.
    """

    def __init__(self) -> None:
        self.path: Path | None = None
        self._unclosed: TrajectoryWriter | None = None

    @contextmanager
    def writer(
        self,
        save: str | os.PathLike | None,
        scene: AnyScene,
        *,
        overwrite: bool,
        provenance: Mapping[str, Any],
    ) -> Iterator[TrajectoryWriter | None]:
        """Yield the writer of a run: of a new record if `save` is given, else of the present one.

        It is None without a record. A writer that an earlier run could not close goes on. When a
        record for ParaView is closed, the surfaces of its bodies are also written.
        """
        path = self.path if save is None else Path(save)
        if path is None:
            yield None
            return
        writer = self._opened(path, save is None, scene, overwrite, dict(provenance))
        self.path, self._unclosed = path, writer
        try:
            with writer:
                try:
                    yield writer
                except Exception as error:
                    if spoils_state(error):
                        error.add_note(f"the last good checkpoint is in {path}")
                    raise
        finally:
            if writer.closed:
                self._unclosed = None
                if _shows_bodies(path, scene):
                    _write_bodies(path)

    def _opened(
        self, path: Path, resumed: bool, scene: AnyScene, overwrite: bool, provenance: dict
    ) -> TrajectoryWriter:
        unclosed = self._unclosed
        if unclosed is not None and unclosed.writes(path):
            return unclosed
        if resumed:
            return TrajectoryWriter.resume(path, provenance=provenance)
        if not overwrite and _shows_bodies(path, scene) and bodies_file(path).exists():
            raise FileExistsError(f"{bodies_file(path)} exists already; overwrite=True replaces it")
        return TrajectoryWriter(path, scene, overwrite=overwrite, provenance=provenance)
