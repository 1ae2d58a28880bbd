"""Threads, calls of the core, checkpoints, times of frames and progress bar of a run."""

from __future__ import annotations

import os
import time as clock
import warnings
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np

from granular import _core
from granular.tools.checks import positive

if TYPE_CHECKING:
    from granular.record.checkpoint import CheckpointRows
    from granular.record.writer import TrajectoryWriter
    from granular.run.monitor import Monitor


SMALL = 4000
"""Number of points up to which one thread is the default.

An estimate: with fewer points handing out chunks costs more than the threads gain.
"""
CHUNK_SECONDS = 0.05
"""Wall time [s] between two returns from the core.

Signals, progress and hooks wait no longer than this.
"""
MAX_CHUNK = 1 << 20
MOST_STEPS = 2**63 - 1
"""Number of steps that the core can count."""

EVERY = 1 / 60
"""Default time between frames [s]; played at 60 frames per second they show real time."""
CHECKPOINT_MINUTES = 10.0
"""Default wall-clock time between two checkpoints [min]: what a run that is killed has to repeat.

A checkpoint takes about as long as twenty steps.
"""
LEAST_STEP = 1e-3
"""Least time between frames, in time steps.

Each step is a frame anyway if they are closer than steps. The margin is for steps that become
shorter in the run. Much smaller values are mistakes, and their multiples cannot be distinguished.
"""


def default_threads(n_points: int) -> int:
    """Threads for a number of points: one for few, else all processors of this process."""
    if n_points <= SMALL:
        return 1
    affinity = getattr(os, "sched_getaffinity", None)  # Linux
    return min(len(affinity(0)) if affinity else os.cpu_count() or 1, _core.MAX_THREADS)


def warn_of_threads(wanted: int, refused: int) -> None:
    """Warn that the system has refused threads of those that a simulation wanted."""
    warnings.warn(
        f"the system has refused {refused} of threads = {wanted}: the run goes on with "
        f"{wanted - refused}, slower, with the same results. Limits of the user (ulimit -u), of "
        "the memory (ulimit -v) or of the container (pids.max) allow no more",
        RuntimeWarning,
        stacklevel=6,
    )


class Run(Protocol):
    """A simulation, as far as a run knows it."""

    _monitor: Monitor

    @property
    def time(self) -> float: ...
    @property
    def steps(self) -> int: ...
    @property
    def frame_is_stored(self) -> bool: ...
    def _checkpoint_rows(self) -> CheckpointRows: ...
    def _advance(self, max_steps: int, until: float) -> None: ...
    def _sample_if_due(self) -> None: ...


class Chunks:
    """Steps made in calls of the core that take about CHUNK_SECONDS each.

    How they are divided does not affect the result.
    """

    def __init__(self) -> None:
        self._steps = 1  # of the next call

    def advance(self, sim: Run, until: float, target: int = MOST_STEPS) -> Iterator[None]:
        """Advance a simulation to the time `until` [s], or a number of steps; yield after each."""
        while sim.time < until and (first := sim.steps) < target:
            begin = clock.perf_counter()
            sim._advance(min(self._steps, target - first), until)
            seconds = max(clock.perf_counter() - begin, 1e-6) / max(sim.steps - first, 1)
            self._steps = int(min(max(CHUNK_SECONDS / seconds, 1), MAX_CHUNK, 4 * self._steps + 1))
            yield

    def to_time(
        self, sim: Run, until: float, monitored: bool, steps: int = MOST_STEPS
    ) -> Iterator[None]:
        """Advance a simulation to a time [s], or a number of steps, and take the samples of its
        monitor on the way."""
        while sim.time < until and sim.steps < steps:
            target = sim._monitor.next(sim.steps) if monitored else MOST_STEPS
            for _ in self.advance(sim, until, min(target, steps)):
                if monitored:
                    sim._sample_if_due()
                yield


class Soundness:
    """Guard of the steps of a simulation, which records whether an error in one has made the state
    invalid.

    Attributes
    ----------
    failure : str
        Message of that error; empty while the state is valid.
    """

    def __init__(self) -> None:
        self.failure = ""

    def check(self) -> None:
        """Refuse to go on from an invalid state."""
        if self.failure:
            raise _core.SimulationError(
                "the simulation has failed in a step before, and its state is of no use: make a "
                "new one, or resume its record"
            )

    def __enter__(self) -> None:
        self.check()

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if error is not None and spoils_state(error):
            self.failure = str(error) or type(error).__name__


def spoils_state(error: BaseException | None) -> bool:
    """Return whether an error, or its cause, leaves an invalid state."""
    causes = (error, getattr(error, "__cause__", None))
    return any(isinstance(cause, _core.SimulationError) for cause in causes)


class Saver:
    """Stores checkpoints of a run in its record: at intervals, and in the end however it ends.

    None is stored after an error that makes the state invalid, or if a frame that was due could not
    be stored, because a resumed run would not make it.
    """

    def __init__(self, sim: Run, writer: TrajectoryWriter | None, seconds: float) -> None:
        self._sim, self._writer, self._seconds = sim, writer, seconds
        self._last = clock.monotonic()

    def save(self) -> None:
        """Store a checkpoint if the run is recorded."""
        if self._writer:
            self._writer.checkpoint(self._sim._checkpoint_rows())
            self._last = clock.monotonic()

    def save_if_due(self) -> None:
        """Store a checkpoint if the last one was long ago."""
        if clock.monotonic() - self._last >= self._seconds:
            self.save()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: object
    ) -> None:
        if kind is None:
            self.save()
        elif self._sim.frame_is_stored and not spoils_state(error):
            with suppress(OSError):  # the first error is the one to report
                self.save()


def check_interval(every: object, dt: float, end: float) -> float:
    """Return the time between frames [s]; refuse one that floating-point time cannot resolve.

    Parameters
    ----------
    every : float
        Time between frames [s].
    dt, end : float
        Time step and latest time of the run [s].
    """
    every = positive("every", every)
    least = max(dt * LEAST_STEP, 8 * np.spacing(end))
    if every < least:
        raise ValueError(
            f"every = {every:g} must be >= {least:.3g}, {LEAST_STEP:g} of the time step of "
            f"{dt:.3g} s: a frame is a step at least; every = {dt:.3g} has them all"
        )
    return every


def next_frame(time: float, every: float) -> float:
    """First multiple of `every` after a time [s], which may itself be one but for rounding."""
    frame = float((np.floor(time / every + 1e-9) + 1) * every)
    return frame if frame > time else time + every  # rounding of a large quotient
