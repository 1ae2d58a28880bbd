"""Time of the parts of `sim.run` with a record: the kernels, frames, checkpoints and the end.

The column collapse of figure 2 (aspect 2, E 1e7, a frame each 1/60 s), which is the README's first
command, is run to its record; with `--points` in cells of another size. Each part is charged with
its time, without the time of the parts it calls: by the wall clock, which counts waiting for the
disk, and for other jobs, too; and by the processor time of the process, which counts every thread
and is the one to compare on a busy machine.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import wraps
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

import granular as gr
from granular.mpm.simulation import Simulation as MpmSimulation
from granular.record import TrajectoryWriter

KERNELS, FRAMES, CHECKPOINTS, CLOSE = "kernels", "frames", "checkpoints", "close"
PARTS = (
    (gr.Simulation, "_advance", KERNELS),
    (MpmSimulation, "_streamed", FRAMES),
    (gr.Simulation, "_snapshot", FRAMES),
    (TrajectoryWriter, "append", FRAMES),
    (gr.Simulation, "checkpoint", CHECKPOINTS),
    (TrajectoryWriter, "checkpoint", CHECKPOINTS),
    (TrajectoryWriter, "close", CLOSE),
    (os, "fsync", "waiting for the disk"),
)


class Account:
    """Wall and processor time [s] by part, each without the parts called from it."""

    def __init__(self) -> None:
        self.spent: dict[str, np.ndarray] = defaultdict(lambda: np.zeros(2))
        self._within = [np.zeros(2)]

    def of(self, function: Callable, part: str) -> Callable:
        """Wrap a function so that its time is charged to a part."""

        @wraps(function)
        def timed(*args: Any, **kwargs: Any) -> Any:
            begin = now()
            self._within.append(np.zeros(2))
            try:
                return function(*args, **kwargs)
            finally:
                whole = now() - begin
                self.spent[part] += whole - self._within.pop()
                self._within[-1] += whole

        return timed

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Charge all PARTS while this lasts."""
        with ExitStack() as watched:
            for owner, name, part in PARTS:
                timed = self.of(getattr(owner, name), part)
                watched.enter_context(mock.patch.object(owner, name, timed))
            yield


def now() -> np.ndarray:
    return np.array([time.perf_counter(), time.process_time()])


def table(account: Account, frames: int, steps: int) -> str:
    """Milliseconds of each part, the share of the kernels, and the time of a frame in steps."""
    total = sum(account.spent.values())
    lines = [f"{'ms in all':26s}{'wall':>9s}{'processor':>11s}"]
    for part, spent in (*account.spent.items(), ("sum", total)):
        lines.append(f"{part:26s}{1e3 * spent[0]:9.2f}{1e3 * spent[1]:11.2f}")
    share = account.spent[KERNELS] / total
    lines.append(f"{'share of the kernels':26s}{share[0]:9.1%}{share[1]:11.1%}")
    frame = account.spent[FRAMES] / frames / (account.spent[KERNELS] / steps)
    return "\n".join([*lines, f"{'a frame in steps':26s}{frame[0]:9.2f}{frame[1]:11.2f}"])


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="coarse and short, to see it runs")
    parser.add_argument("--points", type=float, help="default: as in the figure, 8192")
    parser.add_argument("--threads", type=int, help="default: as in a simulation")
    parser.add_argument("--until", type=float, help="time to stop at [s]")
    parser.add_argument("--every", type=float, help="time between frames [s]")
    parser.add_argument("--precision", choices=("double", "single"), help="of the frames")
    parser.add_argument("--folder", type=Path, help="where the record is written for a while")
    arguments = parser.parse_args(argv)
    size = {"cell": 0.05, "duration": 0.1} if arguments.quick else {}
    grains = gr.materials.glass_beads.replace(E=1e7)
    scene = gr.scenes.column_collapse(aspect=2.0, material=grains, **size)
    if arguments.points:
        cell = scene.grid.cell * (scene.n_points / arguments.points) ** 0.5
        scene = gr.scenes.column_collapse(aspect=2.0, material=grains, cell=cell)
    sim = gr.Simulation(scene, threads=arguments.threads)
    account = Account()
    options = {"every": arguments.every, "precision": arguments.precision}
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder, account.watching():
        path = Path(folder) / "collapse.h5"
        account.of(sim.run, "all else")(arguments.until, save=path, **options)
        megabytes = path.stat().st_size / 1e6
        with gr.open(path) as record:
            frames = len(record)
    print(f"{sim.n_points} points, {sim.steps} steps, {sim.threads} threads, {sim.isa}, ", end="")
    print(f"{frames} frames, {megabytes:.0f} MB")
    print(table(account, frames, sim.steps))
