"""Frames, samples and checkpoints of a simulation while it advances."""

from __future__ import annotations

import math
import os
import time as clock
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from granular.measure.derived import with_derived
from granular.record.settings import (
    fields_to_store,
    frames_to_a_checkpoint,
    precision_to_store,
)
from granular.run.interrupts import DeferredSignals, ending_as_ctrl_c
from granular.run.monitor import known
from granular.run.running import CHECKPOINT_MINUTES, Chunks, Run, Saver, check_interval, next_frame
from granular.tools.checks import positive

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from granular.model.state import State
    from granular.model.typing import AnyScene
    from granular.record.fresh import Streamed
    from granular.record.session import Session
    from granular.record.writer import TrajectoryWriter
    from granular.run.turns import Turns

Hook = Callable[[Any], Any]
"""Called with the simulation at each frame."""


class Recordable(Run, Protocol):
    """A simulation, as far as its record knows it."""

    scene: AnyScene
    _chunks: Chunks
    _session: Session
    _turns: Turns
    _due: int | None
    _ended_by: Hook | None
    _every: float
    _keeps: int
    _precision: str
    _stored: tuple[str, ...]

    @property
    def dt(self) -> float: ...
    @property
    def isa(self) -> str: ...
    @property
    def threads(self) -> int: ...
    @property
    def record(self) -> Any: ...
    @property
    def state(self) -> State: ...
    def _body_rows(self) -> NDArray | None: ...
    def _wall_rows(self) -> NDArray | None: ...
    def _patches(self) -> dict[str, NDArray] | None: ...
    def _snapshot(self, recorded: bool = False) -> State: ...
    def _streamed(self) -> State | Streamed: ...
    def _values(self) -> dict[str, float]: ...


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """The options of a record: the arguments of `Simulation.run` of the same names."""

    save: str | os.PathLike | None = None
    every: float | None = None
    fields: Collection[str] | None = None
    precision: str | None = None
    checkpoint_minutes: float = CHECKPOINT_MINUTES
    checkpoints: int | Literal["all"] | None = None
    overwrite: bool = False
    monitor: bool = True
    gas: bool = True

    @contextmanager
    def opened(
        self, sim: Recordable, end: float, hooks: tuple[Hook, ...] = ()
    ) -> Iterator[Recorder]:
        """Open the record of a simulation, and yield what advances it.

        A checkpoint is stored at the beginning, and at the end however it comes. `end` is the
        latest time of the run [s] as far as it is known; the hooks are called if a frame is due.
        """
        minutes = positive("checkpoint_minutes", self.checkpoint_minutes, allow_inf=True)
        recorded = sim._session.writer(
            self.save, sim.scene, overwrite=self.overwrite, provenance=self._set(sim, end)
        )
        with (
            ending_as_ctrl_c(),
            DeferredSignals() as signals,
            recorded as writer,
            Saver(sim, writer, 60 * minutes) as saver,
        ):
            recorder = Recorder(sim, writer, saver, self)
            recorder.begin(hooks, signals)
            signals.deliver()
            with signals.released():
                yield recorder

    def _set(self, sim: Recordable, end: float) -> dict[str, Any]:
        """Set the attributes of the simulation that its next record has, too, and return them."""
        sim._keeps = frames_to_a_checkpoint(self.checkpoints)
        every = sim._every if self.every is None else self.every
        sim._every = check_interval(every, sim.dt, max(end, sim.time))
        goes_on = self.save is None and sim.record is not None
        sim._stored = fields_to_store(
            self.fields, sim._stored, goes_on=goes_on, state=lambda: sim.state
        )
        sim._precision = precision_to_store(self.precision, sim._precision, goes_on=goes_on)
        return {
            "threads": sim.threads,
            "isa": sim.isa,
            "every": sim._every,
            "fields": sim._stored,
            "precision": sim._precision,
        }


class Recorder:
    """Advances a simulation whose record is open, and appends to it."""

    def __init__(
        self,
        sim: Recordable,
        writer: TrajectoryWriter | None,
        saver: Saver,
        options: Recorded,
    ) -> None:
        self._sim, self._writer, self._saver, self._options = sim, writer, saver, options

    def begin(self, hooks: tuple[Hook, ...], signals: DeferredSignals) -> None:
        """Store the first frame, or one that an earlier run could not store, and a checkpoint."""
        if self._options.monitor:
            self._sim._sample_if_due()
        if self._sim.steps in (0, self._sim._due):
            self._frame(hooks, signals)
        self._saver.save()

    def advance(
        self,
        until: float,
        steps: int,
        hooks: tuple[Hook, ...] = (),
        show: Callable[[float], object] = lambda _: None,
        seconds: float = math.inf,
    ) -> None:
        """Advance to a time [s], which is a frame if it is reached, to a number of steps, or for
        some seconds.

        A hook that returns True ends it, and is `_ended_by` of the simulation. `show` is called
        with the time now and then.
        """
        sim, saver, end = self._sim, self._saver, clock.monotonic() + seconds
        sim._ended_by = None
        with DeferredSignals() as signals:
            while sim.time < until and sim.steps < steps and clock.monotonic() < end:
                signals.deliver()
                frame = min(next_frame(sim.time, sim._every), until)
                for _ in sim._chunks.to_time(sim, frame, self._options.monitor, steps):
                    show(min(sim.time, until))
                    if sim.time < frame:  # the frame comes before a checkpoint or an end
                        saver.save_if_due()
                        signals.deliver()
                        if clock.monotonic() >= end:
                            break
                if sim.time >= frame:
                    sim._ended_by = self._frame(hooks, signals)
                    saver.save_if_due()
                    if sim._ended_by is not None:
                        break

    def _frame(self, hooks: tuple[Hook, ...], signals: DeferredSignals) -> Hook | None:
        """Append a frame, and call the hooks. Returned: the first of them that ends the run."""
        sim, options, writer = self._sim, self._options, self._writer
        sim._due = sim.steps
        if writer:
            frame = self._stored_frame()
            index = writer.append(
                frame,
                others=self._others(frame),
                samples=known(sim._values()) if options.monitor else None,
                bodies=sim._body_rows(),
                walls=sim._wall_rows(),
                single=sim._precision == "single",
            )
            if sim._keeps and index % sim._keeps == 0:
                writer.keep(index, sim._checkpoint_rows())
        sim._due = None
        with signals.released():
            answers = [sim._turns.call(hook, sim) for hook in hooks]
        for hook, answer in zip(hooks, answers, strict=True):
            if isinstance(answer, bool | np.bool_) and answer:
                return hook
        return None

    def _others(self, frame: State | Streamed) -> dict[str, dict[str, NDArray]]:
        """Fields of the other sets of points: of the gas, or of patches of walls and bodies."""
        gas = getattr(frame, "gas", None)
        others = {"gas": dict(gas.fields)} if self._options.gas and gas is not None else {}
        patches = self._sim._patches()
        return others | ({"patches": patches} if patches is not None else {})

    def _stored_frame(self) -> State | Streamed:
        """Present state as it is stored; derived fields need all of it in memory."""
        if not self._sim._stored:
            return self._sim._streamed()
        state = self._sim._snapshot(recorded=True)
        state.fields.update(with_derived(state, self._sim._stored))
        return state
