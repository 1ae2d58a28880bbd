"""The record of a simulation, to which its runs append one after the other."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granular import _core
from granular.record.writer import TrajectoryWriter

if TYPE_CHECKING:
    from granular.typing import AnyScene

__all__ = ["Session"]


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

        It is None without a record. A writer that an earlier run could not close goes on.
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
                except _core.SimulationError as error:
                    error.add_note(f"the last good checkpoint is in {path}")
                    raise
        finally:
            if writer.closed:
                self._unclosed = None

    def _opened(
        self, path: Path, resumed: bool, scene: AnyScene, overwrite: bool, provenance: dict
    ) -> TrajectoryWriter:
        unclosed = self._unclosed
        if unclosed is not None and unclosed.writes(path):
            return unclosed
        if resumed:
            return TrajectoryWriter.resume(path, provenance=provenance)
        return TrajectoryWriter(path, scene, overwrite=overwrite, provenance=provenance)
