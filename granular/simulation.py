"""A running simulation: step, run, record, stop, resume."""

from __future__ import annotations

import os
import signal
import threading
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from granular import _core, stability
from granular import bodies as rigid
from granular import engine as core
from granular.checks import integer, positive
from granular.monitor import Health, Monitor, health
from granular.notebook import table
from granular.scene import Scene
from granular.state import State
from granular.trajectory import Checkpoint, TrajectoryWriter, open_trajectory

__all__ = ["Hook", "Simulation", "SimulationError"]

SimulationError = _core.SimulationError

Hook = Callable[["Simulation"], Any]

CHUNK_SECONDS = 0.05
"""Wall time between two returns from the core: signals, progress and hooks wait no longer."""
MAX_CHUNK = 1 << 20
EVERY = 1 / 60
"""Time between frames [s], unless another is asked for: a film in real time."""
CARRIED = frozenset({"affine", "density_gradient", "shift_velocity", "g_gain", "side"})
"""Fields that a scheme carries from step to step: in every checkpoint, but not in the frames, which
they would swell by two thirds and where no measure asks for them."""
SMALL = 4000
"""Points up to which one thread is the default: a guess at where the barriers eat the gain."""


class Simulation:
    """Steps the material points of a scene.

    Parameters
    ----------
    scene : Scene
    threads : int, optional
        Threads of the core; by default all processors of the machine for large scenes and one for
        small ones. The result does not depend on it, to the last bit.
    isa : str, optional
        Instruction set of the kernels, "baseline", "avx2" or "avx512"; by default the environment
        variable GRANULAR_ISA, else the best of the machine.

    Raises
    ------
    ValueError
        If the time step is beyond its limit or the scene cannot be built.

    Warns
    -----
    StabilityWarning
        For what is known to go wrong without a word, see `granular.stability.doubts`.
    """

    def __init__(self, scene: Scene, *, threads: int | None = None, isa: str | None = None) -> None:
        stability.warn(scene)
        points = core.initial_points(scene)
        self._start(scene, float(points["mass"].mean()), threads, isa)
        self._buffers = core.initial_buffers(self._engine, points)
        self._bind(len(points["mass"]))

    def _start(self, scene: Scene, mean_mass: float, threads: int | None, isa: str | None) -> None:
        self.scene = scene
        self._mean_mass = mean_mass
        self._engine = core.build(scene, mean_mass, core.default_isa() if isa is None else isa)
        if threads is not None:
            threads = integer("threads", threads, 1, _core.MAX_THREADS)
        self._threads = threads
        self._chunk = 1
        self.record: Path | None = None
        self._every = EVERY
        self._monitor = Monitor()

    def _bind(self, n_points: int) -> None:
        self._engine.bind(self._buffers, n_points, True)
        self._grow(self._engine.regroup())

    def _grow(self, needed: int) -> bool:
        """Give the core larger buffers if it asks for them."""
        grown = needed > 0
        while needed:
            larger = core.allocate(self._engine, needed)
            for name, array in self._buffers.items():
                larger[name][..., : array.shape[-1]] = array
            self._engine.bind(larger, 0, False)
            self._buffers = larger
            needed = self._engine.regroup()
        return grown

    @property
    def threads(self) -> int:
        """Threads that the core uses."""
        if self._threads is not None:
            return self._threads
        if self.n_points <= SMALL:
            return 1
        own = getattr(os, "sched_getaffinity", None)  # Linux: what this process may use
        return min(len(own(0)) if own else os.cpu_count() or 1, _core.MAX_THREADS)

    @property
    def time(self) -> float:
        """Time [s]."""
        return self._engine.scalars()["time"]

    @property
    def steps(self) -> int:
        """Steps made."""
        return self._engine.scalars()["step"]

    @property
    def dt(self) -> float:
        """Time step of the last step, or of the first [s]."""
        return self._engine.scalars()["dt"] or self._engine.stable_dt()

    @property
    def n_points(self) -> int:
        """Points that are still in the domain."""
        return self._engine.scalars()["n_points"]

    @property
    def cell_counts(self) -> NDArray[np.int64]:
        """Points in each cell that the kernels work on: cells with points and their neighbours."""
        return self._engine.cells()[1]

    @property
    def isa(self) -> str:
        """Instruction set of the kernels."""
        return self._engine.isa

    @property
    def fluidity(self) -> _core.Fluidity | None:
        """How the fluidity is diffused: method, substeps, the limit of a substep [s], and the
        iterations and the cells kept from being negative since this object was made. None for a
        local law."""
        return self._engine.fluidity()

    @property
    def bodies(self) -> tuple[rigid.BodyState, ...]:
        """Where the bodies of the scene are and what they have felt, in their order."""
        return tuple(rigid.state_of(row, self.scene.dim) for row in self._engine.bodies())

    @property
    def buffers(self) -> dict[str, NDArray]:
        """What the core works on, without copying: {field: (component, capacity)} and "id".

        Rows are grouped by cell; places with a negative id are spare. They may be larger arrays
        after points have spread. What is written into them counts from the next step on, if this
        property has been asked for since the last one.
        """
        self._engine.refresh()
        return dict(self._buffers)

    @property
    def state(self) -> State:
        """A snapshot, ordered by id."""
        return self._snapshot()

    def _snapshot(self, without: frozenset[str] = frozenset()) -> State:
        ids = self._buffers["id"]
        living = np.flatnonzero(ids >= 0)
        ordered = np.full(ids.max(initial=-1) + 1, -1)
        ordered[ids[living]] = living  # by id, with gaps where points have left
        places = ordered[ordered >= 0]
        fields = {"id": ids[places]}
        for name, rows, _, _ in self._engine.fields():
            if name in without:
                continue
            values = np.empty((len(places), rows))
            for column, row in zip(values.T, self._buffers[name], strict=True):
                column[:] = row.take(places)
            fields[name] = values if rows > 1 else values[:, 0]
        fields["x"] = self._wrapped(fields["x"])
        scalars = self._engine.scalars()
        return State(
            scene=self.scene,
            time=scalars["time"],
            step=scalars["step"],
            dt=scalars["dt"],
            fields=fields,
        )

    def _wrapped(self, x: NDArray) -> NDArray:
        """Positions with those of periodic axes in the domain (ugimp groups by shifted cells)."""
        grid = self.scene.grid
        for d in np.flatnonzero(grid.periodic):
            length = grid.shape[d] * grid.cell
            x[x[:, d] < grid.lower[d], d] += length
        return x

    # ---- stepping ----

    def step(self, n: int = 1) -> None:
        """Make `n` steps."""
        target = self.steps + integer("n", n, 1)
        while self.steps < target:
            self._advance(target - self.steps, np.inf)

    def _advance(self, max_steps: int, until: float) -> None:
        self._grow(self._engine.advance(max_steps, until, self.threads))

    def _chunks(self, until: float) -> Iterator[None]:
        """Advance to `until` in calls of about CHUNK_SECONDS; the cuts do not touch the result."""
        while self.time < until:
            begin, first = clock.perf_counter(), self.steps
            self._advance(self._chunk, until)
            seconds = max(clock.perf_counter() - begin, 1e-6) / max(self.steps - first, 1)
            self._chunk = int(min(max(CHUNK_SECONDS / seconds, 1), MAX_CHUNK, 4 * self._chunk + 1))
            yield

    def run(
        self,
        until: float | None = None,
        *,
        save: str | os.PathLike | None = None,
        every: float | None = None,
        overwrite: bool = False,
        progress: bool = False,
        hooks: tuple[Hook, ...] = (),
        monitor: bool = True,
    ) -> Self:
        """Run to a time, recording frames on the way.

        Where all points have left, the clock and the frames go on without them.

        Parameters
        ----------
        until : float, optional
            Time to stop at [s]: the first step at or past it; the scene's duration by default.
        save : path, optional
            HDF5 record to write. A simulation that was resumed goes on in its own record.
        every : float, optional
            Time between frames [s]; a frame is the first step at or past its time. By default as
            in the run before, which a record tells too, and 1/60 in the first.
        overwrite : bool
            Whether an existing record may be replaced.
        progress : bool
            Show a progress bar.
        hooks : sequence of callables
            Called with the simulation at each frame; what they raise ends the run.
        monitor : bool
            Look at frames for signs of failure, for `health` and the record; the looks are so far
            apart that they take less than a fiftieth of the run.

        Raises
        ------
        FileExistsError
            If the record exists and `overwrite` is not set.
        OSError
            If the record cannot be written; what was there before is intact.
        SimulationError
            If a point is not finite or ran away. `point` and `step` name it; the record holds the
            last good frame and checkpoint.
        RuntimeError
            With several threads in a process that was forked after a run with threads.
        KeyboardInterrupt
            On Ctrl-C; the simulation and the record stay valid and can go on.
        """
        until = self.scene.duration if until is None else positive("until", until)
        self._every = every = positive("every", self._every if every is None else every)
        with self._writer(save, overwrite) as writer, self._bar(progress, until) as bar:
            with _interruptible() as interrupted:
                if self.steps == 0:
                    self._frame(writer, hooks, monitor)
                while self.time < until and not interrupted:
                    frame = min((np.floor(self.time / every + 1e-9) + 1) * every, until)
                    for _ in self._chunks(frame):
                        bar.update(min(self.time, until) - bar.n)
                        if writer:
                            writer.store(may_wait=True)
                        if interrupted and self.time < frame:  # a frame that is due is kept
                            break
                    else:
                        self._frame(writer, hooks, monitor)
                if interrupted and writer:
                    writer.checkpoint(self.checkpoint())
            if interrupted:  # here, so that the record is left as it is and not merged
                raise KeyboardInterrupt
        return self

    def _frame(
        self, writer: TrajectoryWriter | None, hooks: tuple[Hook, ...], monitor: bool
    ) -> None:
        due = monitor and self._monitor.due(self.steps, self.n_points)
        if writer or due:
            state = self._snapshot(CARRIED)
            looks = self._monitor.look(state) if due else {}
        if writer:
            writer.append(
                state,
                self.checkpoint(),
                looks=looks,
                bodies=self._engine.bodies(),
                may_wait=True,
            )
        for hook in hooks:
            hook(self)

    def health(self) -> Health:
        """What the looks at the run so far, and one at the present state, say of it.

        Returns
        -------
        Health
            Value, limit and verdict of each sign; see `granular.monitor`.
        """
        last = self._monitor.peek(self.state) if self.steps else None
        return health(self.scene, self._monitor.columns(last))

    @contextmanager
    def _writer(
        self, save: str | os.PathLike | None, overwrite: bool
    ) -> Iterator[TrajectoryWriter | None]:
        if save is None and self.record is None:
            yield None
            return
        resumed = self.record is not None and save is None
        path = self.record if resumed else Path(save)
        provenance = {"threads": self.threads, "isa": self.isa, "every": self._every}
        with (
            TrajectoryWriter.resume(path, provenance=provenance)
            if resumed
            else TrajectoryWriter(path, self.scene, overwrite=overwrite, provenance=provenance)
        ) as writer:
            self.record = path
            try:
                yield writer
            except SimulationError as error:
                error.add_note(f"the last good checkpoint is in {path}")
                raise

    def _bar(self, progress: bool, until: float) -> Any:
        if not progress:
            return nullcontext(_Silent())
        form = "{l_bar}{bar}| {n:.3f}/{total:.3f} s [{elapsed}<{remaining}]"
        return tqdm(total=until, initial=self.time, desc=self.scene.name, bar_format=form)

    # ---- restart ----

    def checkpoint(self) -> Checkpoint:
        """All that a bitwise restart needs: the points in the order of cells, and the clock."""
        offset, count = self._engine.cells()
        before = np.cumsum(count) - count
        places = np.arange(count.sum()) + np.repeat(offset - before, count)
        scalars = self._engine.scalars()
        return Checkpoint(
            time=scalars["time"],
            step=scalars["step"],
            dt=scalars["dt"],
            scalars=scalars | {"mean_mass": self._mean_mass},
            arrays={name: array.take(places, axis=-1) for name, array in self._buffers.items()}
            | self._body_arrays(),
        )

    @classmethod
    def from_checkpoint(
        cls,
        scene: Scene,
        checkpoint: Checkpoint,
        *,
        threads: int | None = None,
        isa: str | None = None,
    ) -> Self:
        """A simulation that goes on from a checkpoint as if it had never stopped.

        Raises
        ------
        ValueError
            If the checkpoint does not belong to such a scene.
        """
        self = cls.__new__(cls)
        scalars = dict(checkpoint.scalars)
        if "mean_mass" not in scalars:
            raise ValueError("the checkpoint has no mean_mass: it is not one of a simulation")
        self._start(scene, float(scalars.pop("mean_mass")), threads, isa)
        n = len(checkpoint.arrays.get("id", ()))
        self._buffers = core.allocate(self._engine, 3 * n + 64)
        for name, array in self._buffers.items():
            stored = checkpoint.arrays.get(name)
            if stored is None or stored.shape != (*array.shape[:-1], n):
                raise ValueError(f"the checkpoint does not hold {name} of {n} points")
            array[..., :n] = stored
        if scene.bodies:  # before the points: those about thin bodies are grouped by side
            self._restore_bodies(checkpoint)
        self._bind(n)
        self._engine.restore(scalars)
        return self

    def _restore_bodies(self, checkpoint: Checkpoint) -> None:
        stored = checkpoint.arrays.get("bodies")
        if stored is None:
            raise ValueError("the checkpoint does not hold the bodies of the scene")
        self._engine.restore_bodies(stored)
        if "split" in checkpoint.arrays:
            self._engine.restore_split(checkpoint.arrays["split"])

    def _body_arrays(self) -> dict[str, NDArray]:
        if not self.scene.bodies:
            return {}
        return {"bodies": self._engine.bodies(), "split": self._engine.split()}

    @classmethod
    def resume(
        cls, path: str | os.PathLike, *, threads: int | None = None, isa: str | None = None
    ) -> Self:
        """Go on from the checkpoint of a record, and with that record: bitwise as if never stopped.

        Raises
        ------
        RecordError
            If the file is damaged or holds no checkpoint.
        """
        with open_trajectory(path) as record:
            self = cls.from_checkpoint(record.scene, record.checkpoint(), threads=threads, isa=isa)
            self._every = record.provenance.get("every", EVERY)
            past = record.series["step"] <= self.steps
            self._monitor.recall({name: v[past] for name, v in record.looks.items()})
        self.record = Path(path)
        return self

    def __repr__(self) -> str:
        return (
            f"Simulation({self.scene.name}, t = {self.time:.6g} s, step {self.steps}, "
            f"{self.n_points} points)"
        )

    def _repr_html_(self) -> str:
        rows = {
            "time [s]": self.time,
            "step": self.steps,
            "dt [s]": self.dt,
            "points": self.n_points,
            "threads": self.threads,
            "kernels": self.isa,
        }
        return table(f"Simulation of {self.scene.name}", rows)


class _Silent:
    """A progress bar that shows nothing."""

    n = 0.0

    def update(self, amount: float) -> None:
        self.n += amount


class _Flag(list):
    """Empty, hence false, until a signal has come."""


@contextmanager
def _interruptible() -> Iterator[_Flag]:
    """Turn Ctrl-C into a flag that is looked at between calls of the core; restores the handler."""
    flag = _Flag()
    if threading.current_thread() is not threading.main_thread():
        yield flag
        return
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # somebody else's business
        yield flag
        return
    signal.signal(signal.SIGINT, lambda number, _: flag.append(number))
    try:
        yield flag
    finally:
        signal.signal(signal.SIGINT, before)
