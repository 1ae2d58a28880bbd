"""Simulations that go on from a record."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granular import _core, materials
from granular.record import open_trajectory
from granular.record.layout import reading
from granular.record.settings import check_alike, settings_of, usable_isa
from granular.run.monitor import unwatched
from granular.tools.checks import truth

if TYPE_CHECKING:
    from granular.model.typing import AnyScene
    from granular.run.machine import Machine


def resumed(
    cls: Any,
    path: str | os.PathLike,
    scene: AnyScene | None,
    frame: int | None,
    machine: Machine,
    trust_code: bool,
    ranks: Any,
) -> Any:
    """Make the simulation of `granular.Simulation.resume`; `cls` is its class."""
    _core.build_info(machine.kernels)  # refuses one it does not know
    truth("trust_code", trust_code)
    with open_trajectory(path) as record:
        if trust_code:
            materials.trust_code(record.scene)
        if scene is not None:
            check_alike(record.scene, scene)
        method, checkpoint = cls._of(record.scene), record.checkpoint(frame)
        with reading(record.path, "the run cannot be resumed"):
            every, recorded, stored, precision = settings_of(record.path, record.provenance)
            if machine.isa is None and machine.device is None:
                machine = replace(machine, isa=usable_isa(recorded, record.path, method._same_bits))
            if scene is not None and scene != record.scene:
                checkpoint = method._adapted(record.scene, scene, unwatched(checkpoint))
            given = scene or record.scene, checkpoint, machine
            if ranks is None:
                sim = method._restored(*given)
            else:
                sim = method._shared()._restored_by(ranks, *given)
    sim._every, sim._stored, sim._precision = every, stored, precision
    sim._session.path = None if scene is not None else Path(path)
    return sim
