"""Simulations that go on from a record."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from granular import _core
from granular.buffers import default_isa
from granular.checks import integer
from granular.mpm.scene import Scene as MpmScene
from granular.record import Checkpoint, open_trajectory
from granular.record.layout import reading
from granular.record.settings import check_alike, settings_of, usable_isa

if TYPE_CHECKING:
    from granular.simulation import Simulation
    from granular.typing import AnyScene

__all__ = ["resumed"]


def resumed(
    cls: Any,
    path: str | os.PathLike,
    *,
    scene: AnyScene | None,
    frame: int | None,
    threads: int | None,
    isa: str | None,
) -> Simulation:
    """Make the simulation of `granular.Simulation.resume`; `cls` is its class."""
    if threads is not None:
        integer("threads", threads, 1, _core.MAX_THREADS)
    _core.build_info(default_isa() if isa is None else isa)  # refuses one it does not know
    with open_trajectory(path) as record:
        if scene is not None:
            check_alike(record.scene, scene)
        method, checkpoint = cls._of(record.scene), record.checkpoint(frame)
        with reading(record.path, "the run cannot be resumed"):
            every, recorded, stored, precision = settings_of(record.path, record.provenance)
            if isa is None:
                isa = usable_isa(recorded, record.path)
            if scene is not None and scene != record.scene:
                checkpoint = _under(record.scene, scene, checkpoint)
            sim: Simulation = method._restored(scene or record.scene, checkpoint, threads, isa)
            if scene is None:
                past = record.series["step"] <= sim.steps
                samples = {name: column[past] for name, column in record.samples.items()}
                sim._monitor.recall(samples, record.series["step"][past])
    sim._every, sim._stored, sim._precision = every, stored, precision
    sim._session.path = None if scene is not None else Path(path)
    return sim


def _under(before: AnyScene, scene: AnyScene, checkpoint: Checkpoint) -> Checkpoint:
    """Return a checkpoint with which a run goes on under a changed scene.

    Material that rested may move, the time step of the scene before may be too long, and densities
    follow from the pressures with the bulk moduli of the changed scene.
    """
    arrays = {name: array for name, array in checkpoint.arrays.items() if name != "calm"}
    scalars = dict(checkpoint.scalars)
    if isinstance(scene, MpmScene):
        scalars["dt"] = 0.0  # a new one in the first step
        old, new = (np.array([material.K for material in s.materials]) for s in (before, scene))
        kept = [material.elasticity == "hencky" for material in scene.materials]
        number = arrays["material"].astype(np.intp).ravel() if len(new) > 1 else 0
        share = np.where(kept, 1.0, old / new)[number]
        stressed = np.any(arrays["stress"], axis=0)
        log_density = arrays["log_density"]
        arrays["log_density"] = np.where(stressed, share, 1.0) * log_density
    return replace(checkpoint, arrays=arrays, scalars=scalars)
