"""One case of a sweep, in the process that runs it."""

from __future__ import annotations

import copy
import os
import pickle
import signal
import threading
import traceback
from _thread import interrupt_main
from collections.abc import Callable, Collection, Hashable
from dataclasses import dataclass
from multiprocessing import parent_process
from pathlib import Path
from typing import Any

from granular.model.typing import AnyScene
from granular.record import Trajectory, open_trajectory
from granular.run.recorder import Hook
from granular.run.simulation import Simulation
from granular.run.turns import name_of

Measure = Callable[[Trajectory], Any]


@dataclass(frozen=True, kw_only=True)
class Options:
    """Arguments of `Simulation` and of its `run` that all cases have."""

    every: float | None
    hooks: tuple[Hook, ...]
    fields: Collection[str] | None
    precision: str | None
    checkpoint_minutes: float
    watched: tuple[str, ...]


@dataclass(frozen=True)
class Case:
    """A scene of a sweep, its record and what is made of it."""

    key: Hashable
    scene: AnyScene
    path: Path
    options: Options
    measure: Measure | None

    @property
    def stopped(self) -> Path:
        """The file that says that a hook has ended the case."""
        return self.path.with_suffix(".stopped")


@dataclass(frozen=True)
class Failure:
    """Result of a case that failed."""

    error: Exception


def stage_of(case: Case) -> str:
    """Return the stage of the record of a case: "new", "begun" or "done"."""
    try:
        record = open_trajectory(case.path)
    except FileNotFoundError:
        return "new"
    with record:
        if not record.finished and not record.has_checkpoint:
            return "new"  # killed before its first checkpoint
        if record.scene.to_json() != case.scene.to_json():
            raise ValueError(
                f"case {case.key!r}: the record {case.path} is of another scene; "
                "the folder must be of this sweep"
            )
        done = is_whole(record) or (record.finished and case.stopped.exists())
        return "done" if done else "begun"


def is_whole(record: Trajectory) -> bool:
    """True for the finished record of a run to the duration of its scene."""
    return record.finished and len(record) > 0 and record.times[-1] >= record.scene.duration


def run_case(case: Case) -> Any:
    """Run the rest of a case and return its measure, or a `Failure`.

    Errors are returned, not raised: an exception that cannot be unpickled would break the pool for
    all cases.
    """
    try:
        stage = stage_of(case)
        if stage != "done":
            _complete(case, stage == "new")
        if case.measure is None:
            return None
        with open_trajectory(case.path) as record:
            return case.measure(record)
    except Exception as error:
        return Failure(_portable(error, case.key))


def _complete(case: Case, new: bool) -> None:
    """Run a case that is new, or the rest of one that was begun."""
    options = case.options
    watch: dict[str, Any] = dict.fromkeys(options.watched, True)
    hooks = copy.deepcopy(options.hooks)  # an executor may run all cases in one process
    minutes = options.checkpoint_minutes
    sim: Simulation
    if new:
        case.stopped.unlink(missing_ok=True)
        sim = Simulation(case.scene, threads=1, **watch)
        sim.run(
            save=case.path,
            every=options.every,
            fields=options.fields,
            precision=options.precision,
            checkpoint_minutes=minutes,
            overwrite=True,
            hooks=hooks,
        )
    else:
        sim = Simulation.resume(case.path, threads=1)
        sim.run(every=options.every, checkpoint_minutes=minutes, hooks=hooks)
    if sim.ended_by is not None and sim.time < case.scene.duration:
        hook = name_of(sim.ended_by)
        case.stopped.write_text(f"The hook {hook} ended this case at t = {sim.time} s.\n")


def _portable(error: Exception, key: Hashable) -> Exception:
    """Return an error that can be sent to another process, with its traceback as text."""
    error.add_note(f"in case {key!r}:\n{''.join(traceback.format_tb(error.__traceback__))}")
    try:
        return pickle.loads(pickle.dumps(error))
    except Exception:
        plain = RuntimeError(f"{type(error).__name__}: {error}")
        plain.__notes__ = error.__notes__
        return plain


# ---- processes of the own pool ----

_stop: Any = None
"""In a process of the pool: a pipe that is closed when the sweep or its process ends."""


def enlist(stop: Any) -> None:
    """Prepare a process of the pool: Ctrl-C and `stop` take effect only while a case runs."""
    global _stop
    _stop = stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_watch, daemon=True).start()


def _watch() -> None:
    _stop.poll(None)
    interrupt_main()  # like Ctrl-C, after which `Simulation.run` leaves a valid record
    parent = parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)  # otherwise the process would go on without a parent and hold the record open


def run_in_pool(case: Case) -> Any:
    """Run a case as `run_case`; Ctrl-C takes effect meanwhile."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        if _stop.poll(0):
            raise KeyboardInterrupt
        return run_case(case)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
