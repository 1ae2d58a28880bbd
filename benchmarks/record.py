"""Time of the parts of `sim.run` in the README's first command: the kernels and all the rest.

    python benchmarks/record.py [--quick] [--threads N] [--until SECONDS] [--folder FOLDER]

The column collapse of figure 2 (aspect 2, E 1e7, a frame each 1/60 s) is run to its record. Each
part is charged with its own time, without that of the parts it calls: by the wall clock, which
counts waiting for the disk, and for other jobs, too; and by the processor time of the process,
which counts every thread and is the one to compare on a busy machine.
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
from granular.record import TrajectoryWriter

PARTS = (
    (gr.Simulation, "_advance", "kernels"),
    (gr.Simulation, "_snapshot", "copy of the state"),
    (gr.Simulation, "checkpoint", "copy for the checkpoint"),
    (TrajectoryWriter, "append", "digest and packing"),
    (TrajectoryWriter, "store", "segments and checkpoints"),
    (TrajectoryWriter, "close", "merge"),
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


def table(account: Account, frames: int) -> str:
    """Milliseconds a frame of each part, and what share of them the kernels have."""
    total = sum(account.spent.values())
    lines = [f"{'ms per frame':26s}{'wall':>9s}{'processor':>11s}"]
    for part, spent in (*account.spent.items(), ("sum", total)):
        lines.append(f"{part:26s}{1e3 * spent[0] / frames:9.2f}{1e3 * spent[1] / frames:11.2f}")
    share = account.spent["kernels"] / total
    return "\n".join([*lines, f"share of the kernels      {share[0]:9.1%}{share[1]:11.1%}"])


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="coarse and short, to see it runs")
    parser.add_argument("--threads", type=int, help="default: that of a simulation")
    parser.add_argument("--until", type=float, help="time to stop at [s]")
    parser.add_argument("--folder", type=Path, help="where the record is written for a while")
    arguments = parser.parse_args(argv)
    size = {"cell": 0.05, "duration": 0.1} if arguments.quick else {}
    grains = gr.materials.glass_beads.replace(E=1e7)
    scene = gr.scenes.column_collapse(aspect=2.0, material=grains, **size)
    sim = gr.Simulation(scene, threads=arguments.threads)
    account = Account()
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder, account.watching():
        path = Path(folder) / "collapse.h5"
        account.of(sim.run, "all else")(arguments.until, save=path)
        megabytes = path.stat().st_size / 1e6
        with gr.open(path) as record:
            frames = len(record)
    print(f"{sim.n_points} points, {sim.steps} steps, {sim.threads} threads, {sim.isa}, ", end="")
    print(f"{frames} frames, {megabytes:.0f} MB")
    print(table(account, frames))


if __name__ == "__main__":
    main()
