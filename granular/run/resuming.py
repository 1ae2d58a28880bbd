"""Simulations that go on from a record."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granular import _core, materials
from granular.record import open_trajectory
from granular.record.layout import reading
from granular.record.settings import check_alike, settings_of, usable_isa
from granular.run.monitor import unwatched
from granular.tools.buffers import default_isa
from granular.tools.checks import integer, truth

if TYPE_CHECKING:
    from granular.model.typing import AnyScene


def resumed(
    cls: Any,
    path: str | os.PathLike,
    scene: AnyScene | None,
    frame: int | None,
    threads: int | None,
    isa: str | None,
    trust_code: bool,
    ranks: Any,
) -> Any:
    """Make the simulation of `granular.Simulation.resume`; `cls` is its class."""
    if threads is not None:
        integer("threads", threads, 1, _core.MAX_THREADS)
    _core.build_info(default_isa() if isa is None else isa)  # refuses one it does not know
    truth("trust_code", trust_code)
    with open_trajectory(path) as record:
        if trust_code:
            materials.trust_code(record.scene)
        if scene is not None:
            check_alike(record.scene, scene)
        method, checkpoint = cls._of(record.scene), record.checkpoint(frame)
        with reading(record.path, "the run cannot be resumed"):
            every, recorded, stored, precision = settings_of(record.path, record.provenance)
            if isa is None:
                isa = usable_isa(recorded, record.path)
            if scene is not None and scene != record.scene:
                checkpoint = method._adapted(record.scene, scene, unwatched(checkpoint))
            given = scene or record.scene, checkpoint, threads, isa
            if ranks is None:
                sim = method._restored(*given)
            else:
                sim = method._shared()._restored_by(ranks, *given)
    sim._every, sim._stored, sim._precision = every, stored, precision
    sim._session.path = None if scene is not None else Path(path)
    return sim
